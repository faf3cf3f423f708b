"""The moments of the kill test, and what is told of a process."""

from __future__ import annotations

import importlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

sys.path += [str(Path(__file__).parents[2] / "scripts" / folder) for folder in ("fuzz", "bench")]  # they import each other by name
kill_test = importlib.import_module("kill")
bench_sizes = importlib.import_module("sizes")
processor = importlib.import_module("processor")
SPIN = "while True: pass"


def test_a_moment_after_an_event_counts_from_it():
    happened: list[int] = []
    due = kill_test.after(lambda: bool(happened), 0.5)
    assert not due(3.0)
    happened.append(1)
    assert not due(4.0)
    assert not due(4.4)
    assert due(4.5)


def test_versions_of_a_file_are_counted(tmp_path):
    file = tmp_path / "state.pt"
    reached = kill_test.versions(file, 2)
    assert not reached()
    for stamp in (1, 2):
        file.touch()
        os.utime(file, ns=(stamp, stamp))
        assert reached() == (stamp == 2)


def test_a_command_is_killed_when_it_is_due_or_has_ended(tmp_path):
    assert kill_test.killed([sys.executable, "-c", SPIN], tmp_path, kill_test.at_share(0.1, 1.0))
    assert not kill_test.killed([sys.executable, "-c", "pass"], tmp_path, lambda _: False)
    with pytest.raises(RuntimeError, match="exit status 3"):
        kill_test.ended([sys.executable, "-c", "import sys; sys.exit(3)"], tmp_path)


def test_what_a_process_has_had_of_the_processor():
    process = subprocess.Popen([sys.executable, "-c", SPIN])
    try:
        while processor.processor_s(process.pid) < 0.1:
            time.sleep(0.01)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    assert processor.processor_s(process.pid) == 0.0


def test_memory_is_that_of_the_process_itself():
    hoard = "import time; hoard = bytearray(200 << 20); time.sleep(0.3)"
    small, large = (bench_sizes.cost([sys.executable, "-c", code]).mib for code in ("import time; time.sleep(0.3)", hoard))
    assert small < 60
    assert 190 < large - small < 260


def test_files_of_a_size(tmp_path):
    from imdim.target.readers import read

    assert len(read(bench_sizes.made(tmp_path, "cloud", 1000, "pcd")).points) == 1000
    faces = read(bench_sizes.made(tmp_path, "mesh", 5000, "stl")).faces
    assert faces is not None
    assert 4000 < len(faces) < 6000
