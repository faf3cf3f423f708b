"""The wheel: what an index would say of it, what is in it, and a command of it from another folder.

It is unpacked beside the packages of this environment: a fresh one would fetch half a gigabyte.
"""

import os
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
    built = subprocess.run(command, capture_output=True, text=True, check=False)
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
    assert wheel.stat().st_size < 20_000_000


def test_a_program_is_exported_with_it_from_another_folder(wheel, tmp_path):
    """No fit: its kernels would be compiled anew, for most of a minute."""
    with zipfile.ZipFile(wheel) as file:
        file.extractall(tmp_path / "installed")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "installed")}

    def run(*arguments):
        return subprocess.run([sys.executable, *arguments], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)

    assert Path(run("-c", "import imdim; print(imdim.__file__)").stdout.strip()).is_relative_to(tmp_path)
    done = run("-m", "imdim", "export", str(ROOT / "examples/bracket_front.json"), "--pick", "1", "-o", "out")
    assert done.returncode == 0, done.stderr
    assert trimesh.load(tmp_path / "out/mesh.stl").is_watertight
