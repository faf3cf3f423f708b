"""How several workers share the tests: file by file, those that take longest first, and the page's tests by one, whose server, browser and
reconstructed part they share. And what tests of many folders ask for."""

from __future__ import annotations

import gc
from collections import Counter
from pathlib import Path

import pytest

from imdim.export import step_worker
from imdim.export.step import StepError

TESTS = Path(__file__).parent
PAGE = "tests/app/lab/page/"
# one that began last would keep a single worker busy at the end; by their seconds of the processor, or waited for
LONGEST = (
    "app/lab/page",
    "reconstruction/test_pipeline.py",
    "reconstruction/test_mdl.py",
    "stories/test_first_hour.py",
    "delivery/test_first_run.py",
    "app/test_fit.py",
    "learn/test_distributed.py",
    "export/test_loops.py",
    "reconstruction/test_policy_beam.py",
    "learn/test_train.py",
    "learn/test_reinforce.py",
    "export/test_step.py",
    "hostile/test_repeatable.py",
    "test_wheel.py",
    "test_docs.py",
    "export/test_freecad.py",
    "delivery/test_explanation.py",
    "test_benchmark.py",
    "learn/test_policies.py",
    "reconstruction/test_evolution.py",
    "detection/test_cloud_occupancy.py",
    "detection/test_mesh_noise.py",
    "export/test_outlines.py",
    "target/test_bad_input.py",
    "test_searches.py",
    "app/agent/test_server.py",
    "app/lab/test_jobs.py",
    "hostile/test_fuzz_fits.py",
    "app/lab/test_resume.py",
)


def pytest_collection_modifyitems(config, items):
    """Put what takes longest first, then files of many tests, where these are shared by workers; alone they stay in their order."""
    if not hasattr(config, "workerinput"):
        return
    first = {TESTS / name: k for k, name in enumerate(LONGEST)}
    count = Counter(item.path for item in items)

    def rank(item):
        place = min((first[path] for path in (item.path, item.path.parent) if path in first), default=len(first))
        return place, -count[item.path], item.path

    items.sort(key=rank)


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Finding the tests imports everything, and a sixth of its time went into looking through that for cycles: Python's collector leaves it
    out, then and later."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_xdist_make_scheduler(config, log):
    from xdist.scheduler import LoadScopeScheduling

    class Scheduler(LoadScopeScheduling):
        def _split_scope(self, nodeid):
            """The file of a test, or the folder of the page's."""
            return PAGE if nodeid.startswith(PAGE) else nodeid.partition("::")[0]

    return Scheduler(config, log)


@pytest.fixture
def without_step(monkeypatch):
    """For results whose STEP file a test does not look at: OpenCASCADE takes a second of the processor to load for each."""

    def refuse():
        raise StepError("this test does without")

    monkeypatch.setattr(step_worker, "start_worker", refuse)
