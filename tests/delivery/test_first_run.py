"""The first fit on a machine compiles before its clock starts and says so; later ones find all that they need."""

import json
import os
import runpy
import shutil
import subprocess
import sys
import time
from importlib.util import find_spec
from pathlib import Path

import imdim

# The first fit in a process, with one kernel in the place of all.
FIRST = """
import sys
from numba import njit
from imdim.delivery import first_run

@njit
def kernel(number):
    return 2 * number

first_run.MESHES = first_run.MESHES._replace(compile=lambda: kernel(1))
first_run.CLOUDS = first_run.CLOUDS._replace(compile=lambda: kernel(1.0))
first_run.count_cores = lambda: 1
print(first_run.compile_kernels(sys.stderr, cloud=sys.argv[1:] == ["cloud"]))
"""

# A first fit that somebody stops.
STOPPED = FIRST.replace("lambda: kernel(1)", "lambda: 1 / 0")

READY = """
import json, sys
from numba.core.dispatcher import Dispatcher
from imdim.delivery import first_run

def ready():
    loaded = [m for name, m in sys.modules.items() if name.startswith("imdim")]
    kernels = {id(f): f for m in loaded for f in vars(m).values() if isinstance(f, Dispatcher)}
    return {f"{f.__module__}.{f.__name__}{s}" for f in kernels.values() for s in f.signatures}
"""

# Lists the kernels that the second process makes ready, those that the first one needs, and those that a reconstruction makes ready itself
# after that.
MESHES = f"""{READY}
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.program.outline import Outline, circle
from imdim.program.tree import Combine, Primitive
from imdim.reconstruction.config import Settings
from imdim.reconstruction.pipeline import reconstruct_best
from imdim.target.target import target_from

first_run.compile_second_half()
theirs = ready()
first_run._reconstruct_small_part()
ours = ready()
plate = ((-9.0, -5.0, 0.0), (9.0, -5.0, 0.0), (9.0, 5.0, 0.0), (0.0, 8.0, 0.5), (-9.0, 5.0, 0.0))
part = Combine("union", Primitive("extrude", (2.0,), outline=Outline((plate, circle(1.5, 5.0)))), Primitive("cylinder", (2.0, 6.0)))
for language in ("cad", "csg"):
    reconstruct_best(target_from(to_trimesh(to_manifold(part))), Settings(budget_s=30.0, language=language))
print(json.dumps([sorted(theirs), sorted(ours), sorted(ready() - ours)]))
"""


# The same of clouds: what the second process makes ready, what the first one needs, and what another noisy cloud needs beside.
CLOUDS = f"""{READY}
from itertools import count
import numpy as np
from imdim.reconstruction.config import Settings
from imdim.reconstruction.pipeline import reconstruct
from imdim.target.target import target_from

first_run.compile_second_half_of_clouds()
theirs = ready()
first_run._reconstruct_small_cloud()
ours = ready()
points = 0.8 * first_run._small_target().points[::80] * (1.0, 1.0, 2.0)
noisy = points + np.random.default_rng(1).normal(0, 0.1, points.shape)
settings = Settings(budget_s=first_run.LOOKS, checkpoint="none")
list(reconstruct(target_from(noisy), settings, np.random.default_rng(0), count().__next__))
print(json.dumps([sorted(theirs), sorted(ours), sorted(ready() - ours)]))
"""


def run(script, *arguments, **variables):
    ran = subprocess.run(
        [sys.executable, "-c", script, *arguments], capture_output=True, text=True, timeout=300, env={**os.environ, **variables}
    )
    assert ran.returncode == 0, ran.stderr
    return ran


def test_the_first_run_says_that_it_compiles_and_the_second_does_not(tmp_path):
    first = run(FIRST, NUMBA_CACHE_DIR=str(tmp_path))
    lines = first.stderr.splitlines()
    assert lines[0] == "imdim: first run on this machine: compiling, before the clock starts (about 60 s of a core)"
    assert lines[1].startswith("imdim: compiled in ")
    assert float(first.stdout) > 0.1
    second = run(FIRST, NUMBA_CACHE_DIR=str(tmp_path))
    assert second.stderr == ""


def test_the_first_cloud_says_so_too_and_a_mesh_does_not_wait_for_it(tmp_path):
    """What is compiled for a cloud is known by a mark of its own."""
    assert len(run(FIRST, NUMBA_CACHE_DIR=str(tmp_path)).stderr.splitlines()) == 2
    told = run(FIRST, "cloud", NUMBA_CACHE_DIR=str(tmp_path)).stderr.splitlines()
    assert told[0] == "imdim: first cloud on this machine: compiling, before the clock starts (about 30 s of a core)"
    assert len(told) == 2
    assert run(FIRST, "cloud", NUMBA_CACHE_DIR=str(tmp_path)).stderr == ""


def test_a_first_run_that_was_stopped_is_no_first_run(tmp_path):
    stopped = subprocess.run(
        [sys.executable, "-c", STOPPED], capture_output=True, text=True, timeout=300, env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    )
    assert "ZeroDivisionError" in stopped.stderr
    assert "imdim: compiled in " in run(FIRST, NUMBA_CACHE_DIR=str(tmp_path)).stderr


def test_kernels_that_are_newer_than_what_was_compiled_are_compiled_before_the_clock_starts(tmp_path):
    """As after `git pull`: the mark's own module has not changed."""
    source = Path(imdim.__file__).parents[2]
    shutil.copytree(source / "src", tmp_path / "src", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "pyproject.toml").touch()
    variables = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path / "src"), "PYTHONDONTWRITEBYTECODE": "1"}
    assert len(run(FIRST, **variables).stderr.splitlines()) == 2
    assert run(FIRST, **variables).stderr == ""
    os.utime(tmp_path / "src/imdim/__init__.py", (time.time() + 5, time.time() + 5))
    assert run(FIRST, **variables).stderr == "", "it has no kernels"
    kernels = tmp_path / "src/imdim/search/look_kernels.py"
    for path in (kernels, tmp_path / "src/imdim/search/lazy_bounds.py"):  # of a class that compiled code takes
        path.write_text(path.read_text().replace("AskedPlaces", "PlacesAsked"))
    os.utime(kernels, (time.time() + 5, time.time() + 5))
    assert len(run(FIRST, **variables).stderr.splitlines()) == 2
    (tmp_path / "pyproject.toml").unlink()
    assert run(FIRST, **variables).stderr == "", "what is installed has its files from one build"


def test_the_second_process_is_started_where_the_module_is_the_command_too(monkeypatch):
    """As at an installation: there its name is none that another process knows."""
    started = []

    class Started:
        def __init__(self, command, **_):
            started.append(command)

        def kill(self):
            pass

        def wait(self):
            pass

    monkeypatch.setattr(subprocess, "Popen", Started)
    monkeypatch.delitem(sys.modules, "imdim.delivery.first_run", raising=False)  # of another test in this process
    command = runpy.run_module("imdim.delivery.first_run", run_name="command")
    with command["_helper"](command["MESHES"], False):
        pass
    assert [(option, find_spec(module) is not None, stage) for _, option, module, stage in started] == [("-m", True, "run")]


def test_hardly_a_kernel_is_left_to_compile_for_a_noisy_cloud():
    theirs, ours, late = json.loads(run(CLOUDS).stdout.splitlines()[-1])
    assert len(theirs) > 15
    assert len(ours) > len(theirs) + 10
    assert len(late) <= 2, late


def test_hardly_a_kernel_is_left_to_compile_for_a_mesh():
    theirs, ours, late = json.loads(run(MESHES).stdout.splitlines()[-1])
    assert len(theirs) > 8
    assert set(theirs) <= set(ours), "what nobody needs would be compiled in vain"

    assert len(ours) > 20
    assert len(late) <= 2, late
