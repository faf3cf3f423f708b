"""What `pip install imdim` brings is enough for meshes: the extra [learn] is asked for only by what learns, and in one line."""

import json
import re
import subprocess
import sys
import tomllib
from importlib.metadata import distribution
from pathlib import Path
from typing import NamedTuple

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from tests.planted import box, cut, cylinder

from imdim.geometry.solid import to_manifold, to_trimesh

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
LEARN = ("torch", "hydra", "tensorboard", "safetensors")
WITHOUT = f"import sys; sys.modules.update(dict.fromkeys({(*LEARN, 'embreex', 'rtree')!r}))"


def run(script, *arguments):
    command = [sys.executable, "-c", f"{WITHOUT}; {script}", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)


class Ended(NamedTuple):
    """A command that one process ran after others: how it ended and what it said."""

    status: int
    out: str
    error: str


# most of the time a command loads what it needs
ALL = """
import io, json
from contextlib import redirect_stderr, redirect_stdout
from imdim.app.cli import main
for words in json.loads(sys.argv[1]):
    with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as error:
        status = main(words)
    print(json.dumps([status, out.getvalue(), error.getvalue()]))
"""


def run_all(*commands):
    ran = run(f"exec({ALL!r})", json.dumps([[*map(str, words)] for words in commands]))
    assert ran.returncode == 0, ran.stderr
    return [Ended(*json.loads(line)) for line in ran.stdout.splitlines()]


@pytest.fixture(scope="module")
def plate(tmp_path_factory):
    path = tmp_path_factory.mktemp("part") / "plate.stl"
    to_trimesh(to_manifold(cut(box(80, 50, 6), cylinder(3, 8, (-20, 0, 0)), cylinder(3, 8, (20, 0, 0))))).export(path)
    return path


def test_a_mesh_is_fitted_edited_and_exported_without_torch(plate, tmp_path):
    (out, wider, simple), name = (tmp_path / folder for folder in ("out", "wider", "simple")), "hole_diameter"
    fitted, listed, edited, exported = run_all(
        ["fit", plate, "-o", out],
        ["edit", out, "--list"],
        ["edit", out, "--set", f"{name}=8", "-o", wider],
        ["export", out, "--pick", "1", "-o", simple],
    )
    assert fitted.status == 0, fitted.error
    assert re.search(r"volume IoU (1\.0000|0\.9999)", fitted.out)
    assert re.search(rf"^{name}\b", listed.out, re.MULTILINE)
    assert "in kind as before: 1 body, 2 through-holes" in edited.out, edited.error
    assert exported.status == 0


def test_what_needs_torch_says_what_to_install(plate, tmp_path):
    settings = ("method=policy", "method=stump-net", "logdir=runs", "checkpoint=a.safetensors")
    for done in run_all(*(["fit", plate, setting, "-o", tmp_path / "out", "--quiet"] for setting in settings)):
        assert (done.status, done.out) == (2, "")
        assert re.fullmatch(r"imdim: .* needs torch.*: .*pip install .*\[learn\]\"\n", done.error)


@pytest.mark.parametrize("script", ["pretrain", "reinforce", "infer"])
def test_scripts_that_learn_say_what_to_install(script):
    done = run(f"sys.argv[1:] = []; import runpy; runpy.run_path({str(ROOT / script)!r} + '.py', run_name='__main__')")
    assert (done.returncode, done.stdout) == (2, "")
    assert re.fullmatch(rf"(imdim|{script}): {script}\.py needs .*: .*pip install .*\[learn\]\"\n", done.stderr)


def test_the_base_requires_nothing_that_learns_and_make_installs_it():
    names = {re.match(r"[\w-]+", requirement)[0] for requirement in PROJECT["dependencies"]}
    learn = {re.match(r"[\w-]+", requirement)[0] for requirement in PROJECT["optional-dependencies"]["learn"]}
    assert learn == {"torch", "hydra-core", "tensorboard", "safetensors"}
    assert not names & learn
    installs = re.findall(r"\$\(PIP\) -e '\.\[(.*)\]'", (ROOT / "Makefile").read_text())
    assert len(installs) == 2
    assert all("learn" in extras.split(",") for extras in installs)


def test_it_is_imported_in_a_tenth_of_a_second():
    """Of the processor, the quickest of three: what is heavy is loaded where it is used."""
    script = "import time; start = time.process_time(); import imdim; dir(imdim); print(time.process_time() - start)"
    took = [float(run(script).stdout) for _ in range(3)]
    assert min(took) < 0.1
    loaded = run(
        "import imdim; print(*(m for m in ('numpy', 'scipy', 'numba', 'trimesh', 'torch') if m in sys.modules and sys.modules[m]))"
    )
    assert loaded.stdout.split() == []


def test_the_base_is_small():
    """What `pip install imdim` puts on the disk, with all that it requires, by the files that each package lists, bytecode aside: most are
    llvmlite (180 MB) and SciPy (114 MB)."""
    sizes: dict[str, int] = {}
    todo = [requirement for requirement in PROJECT["dependencies"] if "extra ==" not in requirement]
    while todo:
        wanted = Requirement(todo.pop())
        if canonicalize_name(wanted.name) in sizes or (wanted.marker is not None and not wanted.marker.evaluate({"extra": ""})):
            continue
        found = distribution(wanted.name)
        files = [found.locate_file(file) for file in found.files or ()]
        there = [path for path in map(Path, map(str, files)) if path.is_file() and path.suffix != ".pyc"]
        sizes[canonicalize_name(wanted.name)] = sum(path.stat().st_size for path in there)
        todo += found.requires or ()
    own = sum(path.stat().st_size for path in (ROOT / "src").rglob("*") if path.is_file() and path.parent.name != "__pycache__")
    assert {"numpy", "scipy", "numba"} <= set(sizes)
    total = (sum(sizes.values()) + own) / 1e6
    assert total < 450, sizes
