"""The wheel: what an index would say of it, what is in it, and a command of it from another folder.

It is unpacked beside the packages of this environment: a fresh one would fetch half a gigabyte.
"""

import json
import os
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest
import trimesh
from packaging.metadata import Metadata

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "wheel", str(ROOT), "--no-deps", "--no-build-isolation", "--quiet", "-w", str(folder)]
    environment = {**os.environ, "IMDIM_COMPILE": "0"}  # kernels take half a minute
    built = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert built.returncode == 0, built.stderr
    (found,) = folder.glob("*.whl")
    return found


def test_its_metadata_is_what_an_index_takes(wheel):
    with zipfile.ZipFile(wheel) as file:
        (name,) = (name for name in file.namelist() if name.endswith(".dist-info/METADATA"))
        told = Metadata.from_email(file.read(name), validate=True)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert told.name == "imdim"
    assert told.description_content_type == "text/markdown"
    assert told.description == (ROOT / "README.md").read_text(encoding="utf-8")
    assert set(told.provides_extra or ()) >= set(project["optional-dependencies"])


def test_it_holds_all_that_the_package_reads(wheel):
    with zipfile.ZipFile(wheel) as file:
        there = set(file.namelist())
    own = {path.relative_to(ROOT / "src").as_posix() for path in (ROOT / "src/imdim").rglob("*") if path.is_file()}
    assert {name for name in own if "__pycache__" not in name} - there == set()
    assert any(name.endswith("imdim-base.safetensors") for name in there), "the policy"
    assert not any(name.endswith((".nbi", ".nbc")) for name in there)
    assert wheel.stat().st_size < 20_000_000


def test_a_program_is_exported_with_it_from_another_folder(wheel, tmp_path):
    """With the kernels of this source tree, as a build compiles them into a wheel: to compile them takes half a minute."""
    with zipfile.ZipFile(wheel) as file:
        file.extractall(tmp_path / "installed")
    for kernel in (ROOT / "src").rglob("*.nb[ic]"):
        there = tmp_path / "installed" / kernel.relative_to(ROOT / "src")
        there.parent.mkdir(exist_ok=True)
        shutil.copyfile(kernel, there)
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "installed")}

    def run(*arguments):
        return subprocess.run([sys.executable, *arguments], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)

    assert Path(run("-c", "import imdim; print(imdim.__file__)").stdout.strip()).is_relative_to(tmp_path)
    done = run("-m", "imdim", "export", str(ROOT / "examples/bracket_front.json"), "--pick", "1", "-o", "out")
    assert done.returncode == 0, done.stderr
    assert trimesh.load(tmp_path / "out/mesh.stl").is_watertight


# Builds a package twice, into the folder given and as an editable one, with nothing that it could copy or compile; in a process of its own,
# since setuptools replaces parts of Python's library.
BUILD = """
import json, sys
from types import SimpleNamespace
import compiled_build as backend
from setuptools import Distribution

runs = []

def run(command, env, check):
    runs.append([command[1:], env["PYTHONPATH"], "NUMBA_CACHE_DIR" in env])
    return SimpleNamespace(returncode=1)

backend.build_py.run, backend.subprocess.run = lambda self: None, run
for editable in (False, True):
    step = backend.BuildCompiled(Distribution())
    step.build_lib, step.editable_mode = sys.argv[1], editable
    step.run()
print(json.dumps([backend.get_requires_for_build_wheel(), backend.get_requires_for_build_editable(), runs]))
"""


@pytest.mark.parametrize("asked", ["1", "0"])
def test_kernels_are_compiled_beside_the_copied_modules_alone(tmp_path, asked):
    """A source tree is left as it is; a build where they cannot be compiled says so and goes on."""
    environment = {**os.environ, "IMDIM_COMPILE": asked, "NUMBA_CACHE_DIR": "elsewhere", "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-c", BUILD, str(tmp_path)], env=environment, capture_output=True, text=True, check=True)
    needed, needed_in_place, runs = json.loads(done.stdout.splitlines()[-1])
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert needed_in_place == []
    if asked == "0":
        assert (needed, runs) == ([], [])
    else:
        assert needed == project["dependencies"]
        # before what the build has already: pip's isolated environment is a path too
        assert runs == [[["-m", "imdim.delivery.first_run", "all"], f"{tmp_path}{os.pathsep}{ROOT}", False]]
        assert done.stderr == "imdim: the kernels could not be compiled here; the first fit will do it\n"


def test_a_kernel_that_was_compiled_elsewhere_is_taken(tmp_path):
    """What installs a wheel writes its files anew, somewhere else and at another time."""
    script = "import kernel; print(kernel.double(2), sum(kernel.double.stats.cache_hits.values()))"
    built, installed = tmp_path / "built", tmp_path / "installed"
    built.mkdir()
    (built / "kernel.py").write_text("from numba import njit\n@njit(cache=True)\ndef double(x):\n    return 2 * x\n")

    def run(folder):
        environment = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"} | {"PYTHONPATH": str(folder)}
        return subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True).stdout.split()

    assert run(built) == ["4", "0"]
    shutil.copytree(built, installed, copy_function=shutil.copyfile)
    assert run(installed) == ["4", "1"]
