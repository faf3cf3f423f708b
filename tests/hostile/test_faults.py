"""Full disks, read-only outputs, clocks that jump: one line, and outputs whole or absent."""

from __future__ import annotations

import itertools
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest
import trimesh

from imdim.app.batch.run import main as batch
from imdim.app.cli import main as imdim
from imdim.app.fit import fit
from imdim.program import codec
from imdim.program.tree import Combine, Primitive
from imdim.reconstruction.config import Settings

ROOT = Path(__file__).parents[2]
PART = Combine("difference", Primitive("box", (4.0, 2.0, 1.0)), Primitive("cylinder", (0.5, 2.0)))


SMALL_DISK = """
import resource, signal, sys
sys.dont_write_bytecode = True  # Python leaves modules that were cut short there, which no later process can load
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (400, 400))
from imdim.app.cli import main
sys.exit(main(["export", sys.argv[1], "-o", sys.argv[2], "--segments", "24"]))
"""


def test_a_full_disk_is_one_line_and_leaves_the_old_results_whole(tmp_path):
    """No file may grow beyond 400 bytes, as on a disk that is full by then."""
    source, out = tmp_path / "program.json", tmp_path / "out"
    source.write_text(codec.dumps(PART))
    out.mkdir()
    (out / "program.json").write_text("the results of an earlier run")
    done = subprocess.run(
        [sys.executable, "-c", SMALL_DISK, str(source), str(out)], capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 2
    assert re.fullmatch(r"imdim: output folder \S+ cannot be written: .*(File too large|No space left).*\n", done.stderr), done.stderr
    assert [path.name for path in out.iterdir()] == ["program.json"]
    assert (out / "program.json").read_text() == "the results of an earlier run"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "program.json"]


def test_a_full_disk_ends_a_batch_in_one_line_and_it_continues(tmp_path, monkeypatch, capsys):
    parts = tmp_path / "parts"
    parts.mkdir()
    for name in "abc":
        (parts / f"{name}.stl").write_text(name)
    command = [sys.executable, "-S", "-c", "import sys; sys.exit('no result')"]
    arguments = [str(parts), "-o", str(tmp_path / "out")]
    real, calls = os.replace, []

    def full(*arguments):
        calls.append(arguments)
        if len(calls) > 6:
            raise OSError(28, "No space left on device")
        return real(*arguments)

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", full)
        patch.setattr(Path, "replace", lambda path, other: full(path, other))
        assert batch(arguments, command) == 2
    error = capsys.readouterr().err
    assert "No space left on device" in error.splitlines()[-1]
    assert "Traceback" not in error
    assert batch(arguments, command) == 1
    assert "3 of 3 parts done, 3 failed" in (tmp_path / "out" / "results.html").read_text()


def test_an_output_that_is_read_only_is_one_line(tmp_path, capsys):
    """Root may write where a mode forbids it; nobody may make a folder in /proc."""
    if not Path("/proc/sys").is_dir():
        pytest.skip("no /proc")
    (tmp_path / "program.json").write_text(codec.dumps(PART))
    trimesh.creation.box().export(tmp_path / "part.stl")
    for arguments in (
        ["export", str(tmp_path / "program.json"), "-o", "/proc/sys/out"],
        ["fit", str(tmp_path / "part.stl"), "-o", "/proc/sys/out"],
        ["batch", str(tmp_path), "-o", "/proc/sys/out"],
        ["edit", str(tmp_path / "program.json"), "--set", "a=1", "-o", "/proc/sys/out"],
    ):
        assert imdim(arguments) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1
        assert error.startswith("imdim: ")


def test_a_clock_that_jumps_changes_nothing(tmp_path, monkeypatch):
    """The wall clock leaps by a day back and forth at every look; what takes time is measured by another."""
    leaps = itertools.cycle((86_400.0, -86_400.0))
    real = time.time
    monkeypatch.setattr(time, "time", lambda: real() + next(leaps))
    trimesh.creation.box((1.0, 2.0, 3.0)).export(tmp_path / "box.stl")
    report = fit(Settings(input=str(tmp_path / "box.stl"), output=str(tmp_path / "out"), budget_s=5.0, method="tree"))
    assert report["stop"] != "budget_spent"
    assert 0 < report["timing"]["total_s"] < 60
    assert all(0 <= seconds < 60 for part in ("stages_s", "delivery_s") for seconds in report["timing"][part].values())


def test_no_code_measures_by_a_clock_that_jumps():
    sources = [*(ROOT / "src").rglob("*.py"), *(ROOT / "scripts").rglob("*.py"), *ROOT.glob("*.py")]
    assert len(sources) > 100
    found = [f"{path.name}: {line.strip()}" for path in sources for line in path.read_text().splitlines() if JUMPS.search(line)]
    assert found == []


JUMPS = re.compile(r"\btime\.time\(|datetime\.now\(|datetime\.utcnow\(|from time import .*\btime\b")
