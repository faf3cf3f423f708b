import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from imdim.export.folder import OutputError, check_writable, replacing


def results(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in folder.iterdir()}


def write(folder: Path, text: str) -> None:
    with replacing(folder) as partial:
        (partial / "report.json").write_text(text)
        (partial / "program.scad").write_text(text)


def test_results_replace_earlier_results_whole(tmp_path):
    folder = tmp_path / "deep" / "out"
    write(folder, "one")
    with replacing(folder) as partial:
        (partial / "report.json").write_text("two")
        assert set(results(folder)) == {"report.json", "program.scad"}
    assert results(folder) == {"report.json": "two"}
    assert [path.name for path in folder.parent.iterdir()] == ["out"]


def stopped(folder: Path) -> None:
    with replacing(folder) as partial:
        (partial / "report.json").write_text("half")
        raise KeyboardInterrupt


def test_what_is_stopped_leaves_the_earlier_results(tmp_path):
    folder = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        stopped(folder)
    assert list(tmp_path.iterdir()) == []
    write(folder, "one")
    with pytest.raises(KeyboardInterrupt):
        stopped(folder)
    assert results(folder) == {"report.json": "one", "program.scad": "one"}
    assert list(tmp_path.iterdir()) == [folder]


def test_foreign_files_are_never_touched(tmp_path):
    folder = tmp_path / "out"
    write(folder, "one")
    (folder / "thesis.txt").write_text("mine")
    for attempt in (check_writable, lambda f: write(f, "two")):
        with pytest.raises(OutputError, match=r"out holds thesis\.txt"):
            attempt(folder)
    assert results(folder) == {"report.json": "one", "program.scad": "one", "thesis.txt": "mine"}
    assert list(tmp_path.iterdir()) == [folder]


def foreign_meanwhile(folder: Path) -> None:
    with replacing(folder) as partial:
        (partial / "report.json").write_text("two")
        (folder / "thesis.txt").write_text("mine")


def test_a_foreign_file_that_came_meanwhile_is_not_touched(tmp_path):
    folder = tmp_path / "out"
    write(folder, "one")
    with pytest.raises(OutputError, match="thesis"):
        foreign_meanwhile(folder)
    assert results(folder)["thesis.txt"] == "mine"
    assert list(tmp_path.iterdir()) == [folder]


def test_unusable_folders_are_named(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    cases = {
        tmp_path / "file": "is a file",
        tmp_path / "file" / "below" / "out": "cannot be written: Not a directory",
        Path(): "cannot be replaced as a whole",
        Path("/proc/nowhere/out"): "cannot be written",
    }
    for folder, message in cases.items():
        with pytest.raises(OutputError, match=message) as caught:
            check_writable(folder)
        assert str(folder.resolve()) in str(caught.value)
        assert "\n" not in str(caught.value)
    check_writable(tmp_path / "new" / "out")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "here"]


KILLED = """
import os, pathlib, sys
from imdim.export.folder import replacing

rename = pathlib.Path.rename

def last(self, to):
    rename(self, to)
    os.kill(os.getpid(), 9)

pathlib.Path.rename = last
with replacing(pathlib.Path(sys.argv[1])) as partial:
    (partial / "report.json").write_text("half")
    if sys.argv[2] == "writing":
        os.kill(os.getpid(), 9)
"""


def killed(folder: Path, when: str) -> None:
    assert subprocess.run([sys.executable, "-c", KILLED, str(folder), when], check=False).returncode == -signal.SIGKILL


def test_what_was_killed_while_it_wrote_is_swept_by_the_next_run(tmp_path):
    folder = tmp_path / "out"
    write(folder, "one")
    killed(folder, "writing")
    assert len(list(tmp_path.iterdir())) == 2
    assert results(folder) == {"report.json": "one", "program.scad": "one"}
    with replacing(folder) as partial:
        assert set(tmp_path.iterdir()) == {folder, partial}


def test_results_set_aside_by_what_was_killed_come_back(tmp_path):
    folder = tmp_path / "out"
    write(folder, "one")
    killed(folder, "renaming")
    assert not folder.exists()
    with pytest.raises(KeyboardInterrupt):
        stopped(folder)
    assert results(folder) == {"report.json": "one", "program.scad": "one"}
    assert list(tmp_path.iterdir()) == [folder]


def test_what_another_process_is_writing_is_left_alone(tmp_path):
    folder = tmp_path / "out"
    with replacing(folder) as first:
        (first / "report.json").write_text("one")
        write(folder, "two")
        assert results(first) == {"report.json": "one"}
        other = first.with_name(first.name.replace(f"-{os.getpid()}-", "-1-"))
        other.mkdir()
        foreign = tmp_path / ".out-of-this-world"
        foreign.mkdir()
        write(folder, "three")
        assert other.exists()
    assert foreign.exists()
    assert results(folder) == {"report.json": "one"}


def test_a_name_as_long_as_file_systems_allow_is_written_and_a_longer_one_named(tmp_path):
    folder = tmp_path / ("n" * 255)
    write(folder, "one")
    write(folder, "two")
    assert results(folder)["report.json"] == "two"
    assert [path.name for path in tmp_path.iterdir()] == [folder.name]
    for bad in ("n" * 256, "a\0b"):
        with pytest.raises(OutputError, match="cannot be written") as caught:
            check_writable(tmp_path / bad)
        assert len(str(caught.value)) < 300
