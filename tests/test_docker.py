"""The Dockerfile: it copies what the installation needs, and where Docker runs it is built and fits a part."""

import json
import os
import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest
from tests.planted import box, cut, cylinder

from imdim.geometry.solid import to_manifold, to_trimesh

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "Dockerfile").read_text(encoding="utf-8")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
COPIED = [name for line in re.findall(r"^COPY (?!--from)(.*) \S+$", TEXT, re.MULTILINE) for name in line.split()]
KEPT = [line.removeprefix("!") for line in (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines() if line.startswith("!")]


def test_it_copies_what_is_installed():
    assert all((ROOT / name).exists() for name in COPIED)
    assert set(COPIED) == set(KEPT), "what .dockerignore keeps is what is copied"
    needed = [PROJECT["project"]["readme"], *PROJECT["tool"]["setuptools"]["packages"]["find"]["where"]]
    needed += [name for names in PROJECT["tool"]["setuptools"]["data-files"].values() for name in names]
    assert [name for name in needed if name.split("/")[0] not in COPIED] == []


def test_it_runs_imdim_as_no_root():
    lines = TEXT.splitlines()
    assert lines.index("USER imdim") < lines.index('ENTRYPOINT ["imdim"]')
    assert not any(line.startswith("USER root") for line in lines)
    assert "imdim" in PROJECT["project"]["scripts"]
    extras = re.findall(r"EXTRAS=([\w,]+)", TEXT)
    assert extras
    assert {name for text in extras for name in text.split(",")} <= PROJECT["project"]["optional-dependencies"].keys()


@pytest.mark.tool
def test_the_image_fits_a_part(tmp_path):
    tool = shutil.which("docker")
    if tool is None or subprocess.run([tool, "info"], capture_output=True, check=False).returncode:
        pytest.skip("Docker is not installed, or does not run here")
    subprocess.run([tool, "build", "-q", "-t", "imdim-test", ROOT], check=True, capture_output=True, timeout=1800)
    to_trimesh(to_manifold(cut(box(80, 50, 6), cylinder(3, 8, (-20, 0, 0)), cylinder(3, 8, (20, 0, 0))))).export(tmp_path / "plate.stl")
    run = [tool, "run", "--rm", "--user", str(os.getuid()), "-v", f"{tmp_path}:/part", "imdim-test"]
    fitted = subprocess.run([*run, "fit", "plate.stl", "--json", "--quiet"], check=True, capture_output=True, timeout=300)
    assert b"first run" not in fitted.stderr, "the image has what a first fit compiles"
    report = json.loads(fitted.stdout)
    assert report["files"]["program.step"] == "written"
    assert (tmp_path / "plate.imdim/program.scad").read_text().count("hole_diameter") > 1
