"""The kernels of the speed benchmark answer as their plain references do, and a wrong answer would be seen."""

from __future__ import annotations

import importlib
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.distance import cdist

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts" / "bench"))  # the scripts import each other by name
bench_speed = importlib.import_module("speed")
speed_kernels = importlib.import_module("speed_kernels")
speed_plain = importlib.import_module("speed_plain")
NAMES = ["population", "leaf table", "solver step", "gradients", "chamfer", "cloud generation", "decoding"]


@pytest.fixture(scope="module")
def kernels():
    """The kernels by their names; not made where tests are collected, which each worker does."""
    return {kernel.name: kernel for kernel in speed_kernels.kernels(0.01)}


def test_all_kernels_are_asked(kernels):
    assert list(kernels) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_the_fast_answer_is_the_plain_one(kernels, name):
    kernel = kernels[name]
    assert kernel.differs(kernel.run(kernel.prepare()), kernel.plain()) <= kernel.tolerance
    assert kernel.work.flops > 0


def test_the_plain_chamfer_distance_is_that_of_all_pairs():
    a, b = np.random.default_rng(0).normal(size=(2, 300, 3))
    pairs = cdist(a, b)
    assert speed_plain.chamfer(a, b, rows=77) == pytest.approx(pairs.min(1).mean() + pairs.min(0).mean(), rel=1e-12)


def test_a_wrong_answer_is_seen(kernels, monkeypatch):
    right = kernels["chamfer"]
    wrong = replace(right, run=lambda _: 1.001 * right.plain())
    for kernel, verdict in ((right, True), (wrong, False)):
        monkeypatch.setattr(bench_speed, "kernels", lambda _, kernel=kernel: [kernel])
        (figure,) = bench_speed.measured(1, 1.0)[1]
        assert figure.right is verdict


def test_what_a_mix_of_instructions_allows():
    work = speed_kernels.Work
    # products alone fill half of a fused instruction; with a sum each they fill it
    assert bench_speed.allowed(work(100.0, 100.0), 10.0, 1.0) == pytest.approx(0.5)
    assert bench_speed.allowed(work(100.0, 50.0), 10.0, 1.0) == pytest.approx(1.0)
    # a root in ten operations, at a tenth of the pace of all of them
    assert bench_speed.allowed(work(100.0, 50.0, 10.0), 10.0, 0.5) == pytest.approx(0.5)


def test_no_unit_needs_more_than_its_part_of_the_work():
    bounds = bench_speed.Bounds.of(speed_kernels.Work(100.0, 60.0, 10.0, 8.0), 10.0, 1.0, 4.0)
    assert (bounds.ports, bounds.roots, bounds.memory) == pytest.approx((14.0, 10.0, 2.0))


def test_the_second_table_sets_the_time_beside_its_bounds(kernels, monkeypatch):
    monkeypatch.setattr(bench_speed, "kernels", lambda _: [kernels["solver step"]])
    (figure,) = bench_speed.measured(1, 1.0)[1]
    row = bench_speed.work_table([figure]).splitlines()[-1].split(" | ")
    assert float(row[1]) == pytest.approx(figure.work.flops / 1e6, rel=1e-3)
    assert 0 < max(figure.bounds.ports, figure.bounds.roots) < figure.seconds
