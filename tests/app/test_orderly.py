"""Commands whose streams are closed, whose memory is short, or that a signal ends: one line at most, results whole, nothing left behind."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys

import pytest

from imdim.app.orderly import LEAST_SPACE, run_in_order

RUN = "import sys\nfrom imdim.app.orderly import run_in_order\n"
CHATTY = RUN + (
    "def act():\n"
    "    for i in range(5000):\n"
    "        sys.stdout.write('said %d\\n' % i); sys.stderr.write('told %d\\n' % i)\n"
    "    open(sys.argv[1], 'w').write('done')\n"
    "    return 0\n"
    "sys.exit(run_in_order(act))\n"
)


@pytest.mark.parametrize(
    "how", [">&-", "2>&-", ">&- 2>&-", ">/dev/full", ">/dev/full 2>/dev/full", "2>/dev/null | head -0", "2>&1 | head -1"]
)
def test_nobody_who_listens_is_no_reason_to_fail(tmp_path, how):
    said = tmp_path / "script.py"
    said.write_text(CHATTY)
    line = f"{sys.executable} {said} {tmp_path / 'out'} {how}"
    ended = subprocess.run(["bash", "-c", f"set -o pipefail; {line}"], capture_output=True, text=True, timeout=60)
    assert ended.returncode == 0
    assert (tmp_path / "out").read_text() == "done"
    for word in ("Traceback", "BrokenPipe", "Exception", "internal error"):
        assert word not in ended.stderr


def test_without_memory_there_is_one_line(capsys):
    def act():
        raise MemoryError

    assert run_in_order(act) == 2
    assert capsys.readouterr().err == "imdim: out of memory: raise the limit, or give a smaller part\n"


@pytest.mark.parametrize("command", ["fit", "edit", "export", "lab", "batch", "mcp"])
def test_a_limit_below_what_the_libraries_need_is_one_line(command):
    limit = LEAST_SPACE // 2
    ended = subprocess.run(
        [sys.executable, "-m", "imdim.app.cli", command, "part.stl", "-o", "out"],
        capture_output=True,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)),
        timeout=60,
    )
    assert ended.returncode == 2
    assert ended.stderr == "imdim: the limit of memory (ulimit -v) is 0.65 GB, at least 1.3 GB are needed\n"


ENOUGH = 2 * LEAST_SPACE
ENDINGS_APART = {
    "os.kill(os.getpid(), signal.SIGSEGV)": (2, "imdim: out of memory: raise the limit, or give a smaller part\n"),
    "bytearray(10 ** 11)": (2, "imdim: out of memory: raise the limit, or give a smaller part\n"),
    "sys.exit(2)": (2, ""),
    "3": (3, ""),
    "os.kill(os.getppid(), signal.SIGTERM) or time.sleep(60)": (143, "imdim: ended by SIGTERM\n"),
    "os.kill(os.getpid(), signal.SIGINT) or time.sleep(60)": (130, "imdim: interrupted\n"),
}


@pytest.mark.parametrize("act", ENDINGS_APART)
def test_where_memory_is_limited_even_a_crash_is_one_line(act):
    """Libraries that check no allocation crash: the process that was started tells what became of the one that works."""
    script = RUN + f"import os, signal, time\nsys.exit(run_in_order(lambda: {act}))\n"

    def limit():
        resource.setrlimit(resource.RLIMIT_AS, (ENOUGH, ENOUGH))
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # what runs in the background of a shell ignores it

    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, preexec_fn=limit, timeout=30)
    assert (ended.returncode, ended.stderr) == ENDINGS_APART[act]


def test_what_works_where_memory_is_limited_ends_with_the_process_that_was_started():
    script = RUN + "import os, time\nsys.exit(run_in_order(lambda: print(os.getpid(), flush=True) or time.sleep(60)))\n"
    with subprocess.Popen(
        [sys.executable, "-c", script],
        stdout=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (ENOUGH, ENOUGH)),
    ) as process:
        assert process.stdout is not None
        assert int(process.stdout.readline()) != process.pid
        process.kill()
        assert process.stdout.read() == "", "its end of the pipe is closed"


WRITING = RUN + (
    "import time\nfrom pathlib import Path\nfrom imdim.export.folder import replacing\n"
    "def act():\n"
    "    with replacing(Path(sys.argv[1])) as partial:\n"
    "        (partial / 'mesh.stl').write_text('half')\n"
    "        print('writing', flush=True)\n"
    "        time.sleep(60)\n"
    "    return 0\n"
    "sys.exit(run_in_order(act))\n"
)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_in_the_middle_of_writing_leaves_nothing(tmp_path, number):
    before = signal.signal(number, signal.SIG_DFL)  # a suite under nohup ignores it, and its children would
    process = subprocess.Popen([sys.executable, "-c", WRITING, tmp_path / "out"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    signal.signal(number, before)
    assert process.stdout is not None
    assert process.stdout.readline() == "writing\n"
    os.kill(process.pid, number)
    _, said = process.communicate(timeout=30)
    assert process.returncode == 128 + number
    assert said == f"imdim: ended by {signal.Signals(number).name}\n"
    assert list(tmp_path.iterdir()) == []


def test_a_signal_that_was_to_be_ignored_is(tmp_path):
    act = RUN + "import os, signal\nsys.exit(run_in_order(lambda: os.kill(os.getpid(), signal.SIGHUP) or 0))\n"
    process = subprocess.run([sys.executable, "-c", act], preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN), timeout=30)
    assert process.returncode == 0
