"""What takes long in README and docs runs too: each line of a page that has such a block, in the order of reading, in one folder.

Not part of the suite: ``python -m pytest -m slow -s``, a quarter of an hour. A line that `SHORTER` does not know runs as the page has it.
"""

import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from urllib.request import urlopen

import numpy as np
import pytest
from tests.planted import cut, cylinder, mesh_of
from tests.test_docs import BLOCK, GIVEN, ROOT, SHARED

CONTENTS = (ROOT / "docs/README.md").read_text(encoding="utf-8")
READ = [ROOT / "README.md", *(ROOT / "docs" / name for name in re.findall(r"^\d+\. \[.*?\]\((\w+\.md)\)", CONTENTS, re.MULTILINE))]
SLOW = [page for page in READ if "```sh slow\n" in page.read_text(encoding="utf-8")]
LONGEST_S = 300

# what a line begins with, or has in it; what is put behind it, where a later value of a setting counts; why
SHORTER = (
    (r"^(python|torchrun .*) pretrain\.py", "max_minutes=0.1 device=cpu n_val=4 n_measure=1", "an hour's training, also on a GPU"),
    (r"^python reinforce\.py", "max_minutes=0.1 targets=1 n_val=2", "half an hour's training"),
    (r"^python scripts/bench/ablate\.py", "minutes=0.05 n=2 only=[pointing]", "eleven trainings of five minutes"),
    (r"^python scripts/bench/evaluate\.py", "first=1", "minutes of beam searches"),
    (r"^python scripts/bench/stump\.py", "--budget 5 --only flange", "four methods of a minute on each part"),
    (r"^python scripts/make_dataset\.py", "n_train=4 n_val=2", "the whole data set takes a quarter of an hour"),
    (r"^openscad ", "-D '$fn=12'", "exact booleans of circles with 96 corners take minutes"),
    (r"^imdim fit .*method=policy", "checkpoint=models/imdim-base.safetensors", "six seconds of training teach a policy nothing"),
)
ELSEWHERE = {
    "docker": "tests/test_docker.py builds the image and fits a part in it",
    "pip": "it needs the network; tests/test_wheel.py builds the package and runs it",
}
SERVERS = ("tensorboard",)
GUESSES = re.compile(r" method=policy\b"), (0, 3)  # the policy alone may not explain a scan, and its page says so


def pieces():
    """Python blocks whole, shell blocks line by line."""
    for page in SLOW:
        for language, slow, text in BLOCK.findall(page.read_text(encoding="utf-8")):
            for piece in {"python": [text], "sh": text.splitlines()}.get(language, []):
                yield pytest.param(page, language, slow, piece, id=f"{page.stem}: {piece.splitlines()[0]}")


@pytest.fixture(scope="module")
def reader(tmp_path_factory):
    """A checkout with a part and a scan of the reader's own; the results of the part, and those that `make demo` leaves."""
    home = tmp_path_factory.mktemp("reader")
    for name in (*SHARED, "Makefile", "pyproject.toml", "constraints.txt"):
        if name != "dataset":
            (home / name).symlink_to(ROOT / name)
    shutil.copytree(ROOT / "dataset/examples", home / "dataset/examples")  # not a link: a command writes samples beside it
    bolts = [(30 * math.cos(a), 30 * math.sin(a), 0.0) for a in np.radians(range(0, 360, 60))]
    flange = mesh_of(cut(cylinder(40, 8), *(cylinder(3, 20, center) for center in bolts)))
    (home / "parts").mkdir()
    flange.export(home / "part.stl")
    flange.export(home / "parts/flange.stl")
    shutil.copy(ROOT / "dataset/examples/bracket_cloud.ply", home / "scan.ply")
    provide_environment(home / ".venv")
    run("imdim fit part.stl -o out/part language=csg objective=description", home)
    run("imdim fit dataset/examples/bracket.stl -o out/demo", home)
    return home


def provide_environment(folder):
    """What `make` would install: here, the environment of the tests."""
    (folder / "bin").mkdir(parents=True)
    (folder / "bin/python").write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n', encoding="utf-8")
    (folder / "bin/python").chmod(0o755)
    (folder / "use").touch()


@pytest.fixture(scope="module")
def names():
    """Of each page: what its blocks of Python have defined so far."""
    return {page: {"__name__": "docs", **GIVEN} for page in SLOW}


@pytest.mark.slow
@pytest.mark.parametrize(("page", "language", "slow", "text"), pieces())
def test_it_runs(page, language, slow, text, reader, names, monkeypatch):
    monkeypatch.chdir(reader)
    if language == "python":
        exec(compile(text, str(page), "exec"), names[page])
        return
    command = shortened(text) if slow else text
    tool = command.split()[0]
    if tool in ELSEWHERE:
        pytest.skip(f"{tool}: {ELSEWHERE[tool]}")
    if tool == "openscad" and shutil.which(tool) is None:
        pytest.skip("OpenSCAD is not installed")
    (ask if tool in SERVERS else run)(command, reader)


def shortened(line):
    """`line` without its comment, with what `SHORTER` puts behind it."""
    command = re.sub(r"\s+#.*", "", line)
    return " ".join([command, *(words for pattern, words, _ in SHORTER if re.search(pattern, command))])


def start(command, folder):
    """In a group of its own, whose end ends what it started."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    words = ["bash", "-o", "pipefail", "-c", command]
    environment = {**os.environ, "PATH": path, "OMP_NUM_THREADS": "1"}
    return subprocess.Popen(
        words, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    )


def run(command, folder):
    """Fails unless `command` ends in time with the status that its page speaks of."""
    process = start(command, folder)
    try:
        said, _ = process.communicate(timeout=LONGEST_S)
    finally:
        end(process)
    pattern, endings = GUESSES
    assert process.returncode in (endings if pattern.search(command) else (0,)), f"{command}: status {process.returncode}\n{said[-3000:]}"
    assert "Traceback" not in said


def ask(command, folder):
    """Fails unless the server that `command` starts says where it is and shows there the run `base`."""
    process = start(command, folder)
    late = threading.Timer(60, end, [process])
    late.start()
    try:
        addresses = (re.search(r"http://\S+", line) for line in process.stdout or ())
        address = next((found[0] for found in addresses if found), None)
        assert address is not None, f"{command} did not say where it is"
        while "base" not in shown(address):
            time.sleep(0.5)
    finally:
        late.cancel()
        end(process)
        process.stdout.close()


def shown(address):
    """The runs that tensorboard has read so far; fails when it was ended because it took too long."""
    with urlopen(f"{address}data/runs", timeout=30) as answer:
        return json.load(answer)


def end(process):
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


@pytest.mark.slow
def test_all_pages_and_shorter_settings_are_used():
    having = {page for page in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")] if "```sh slow\n" in page.read_text(encoding="utf-8")}
    assert having == {*SLOW}
    lines = [line for page in SLOW for language, _, text in BLOCK.findall(page.read_text(encoding="utf-8")) for line in text.splitlines()]
    for pattern, *_ in SHORTER:
        assert any(re.search(pattern, line) for line in lines), f"no page has {pattern}"
