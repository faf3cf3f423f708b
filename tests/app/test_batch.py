"""A batch with stand-ins for `imdim fit` that crash, hang and take memory: every part has its outcome, and a killed run continues."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote_to_bytes

import pytest
import trimesh
from tests.app.batches import make, rows
from tests.stand_ins import log, wait_for

from imdim.app.batch import folder
from imdim.app.batch.engine import run_local
from imdim.app.batch.process import Process, ProcessLimits, run
from imdim.app.batch.run import main
from imdim.app.cli import main as imdim

POISONED = ("crash", "hang", "blowup", "refused")


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().split(")")[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_each_poisoned_part_is_its_own_failure(parts, tmp_path, stand_in, capsys):
    make(parts, "a.stl", "b.ply", *(f"{name}.stl" for name in POISONED))
    out = tmp_path / "out"
    assert main([str(parts), "-o", str(out), "--jobs", "2", "--limit", "1.5", "--memory", "300"], stand_in()) == 1
    found = rows(out)
    assert {name: row["failure"] for name, row in found.items()} == {
        "a.stl": "",
        "b.ply": "",
        "crash.stl": "ended by signal SIGABRT",
        "hang.stl": "took more than 1.5 s and was ended",
        "blowup.stl": "took more than 300 MiB of memory and was ended",
        "refused.stl": "refused.stl: 0 points",
    }
    assert (found["a.stl"]["primitives"], found["a.stl"]["volume_iou"], found["a.stl"]["mean_distance"]) == ("7", "0.5", "0.25")
    assert 300 <= float(found["blowup.stl"]["peak_mib"]) < 600
    (child,) = [int(line.split()[1]) for line in log(tmp_path) if line.startswith("child")]
    assert not alive(child)  # what a hanging part had started ends with it
    said = capsys.readouterr()
    assert "6 parts, 4 failed" in said.out
    assert len([line for line in said.err.splitlines() if line.startswith("[")]) == 6
    assert "[6/6]" in said.err
    assert not (out / ".running").exists()


def test_a_batch_that_is_done_does_nothing_twice_and_notices_what_changed(parts, tmp_path, stand_in, capsys):
    make(parts, "a.stl", "refused.stl")
    arguments = [str(parts), "-o", str(tmp_path / "out")]
    main(arguments, stand_in())
    assert main(arguments, stand_in()) == 1
    assert log(tmp_path) == ["start a", "end a", "start refused"]
    assert main([*arguments, "--again"], stand_in()) == 1
    assert log(tmp_path)[3:] == ["start refused"]
    make(parts, "b.stl")
    (parts / "a.stl").write_text("another part")
    main(arguments, stand_in())
    assert log(tmp_path)[4:] == ["start a", "end a", "start b", "end b"]
    capsys.readouterr()
    assert main([*arguments, "--seed", "1"], stand_in()) == 2
    error = capsys.readouterr().err
    assert "seed=0 then, seed=1 now" in error
    assert error.count("\n") == 1
    assert log(tmp_path)[8:] == []


def started(arguments: list[str], command: list[str]) -> subprocess.Popen[str]:
    # a shell that runs the tests in the background lets them ignore Ctrl-C, and they hand that on
    code = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    code += f"import sys; from imdim.app.batch.run import main; sys.exit(main({arguments!r}, {command!r}))"
    return subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_a_run_that_is_stopped_continues(parts, tmp_path, stand_in, how):
    names = [f"p{i}" for i in range(5)]
    make(parts, *(f"{name}.stl" for name in names))
    out, arguments = tmp_path / "out", [str(parts), "-o", str(tmp_path / "out")]
    process = started(arguments, stand_in(0.3))
    wait_for(lambda: (out / "parts" / "p1" / "outcome.json").exists() and "start p2" in log(tmp_path))
    process.send_signal(how)
    _, error = process.communicate(timeout=20)
    if how != signal.SIGKILL:
        assert process.returncode == 130
        assert error.splitlines()[-1] == "imdim: stopped; the same command continues"
        assert "Traceback" not in error
        assert not (out / ".running").exists()
        assert rows(out).keys() == {"p0.stl", "p1.stl"}
    before = log(tmp_path)
    time.sleep(0.5)
    assert log(tmp_path) == before  # the part that ran has ended with the batch
    assert main(arguments, stand_in()) == 0
    assert [row["failure"] for row in rows(out).values()] == [""] * 5
    ends = [line.split()[1] for line in log(tmp_path) if line.startswith("end")]
    assert sorted(ends) == names  # nothing lost, nothing done twice
    assert log(tmp_path).count("start p2") == 2


def test_two_batches_do_not_share_a_folder(parts, tmp_path, stand_in, capsys):
    make(parts, "a.stl")
    arguments = [str(parts), "-o", str(tmp_path / "out")]
    first = started(arguments, stand_in(1.5))
    wait_for(lambda: log(tmp_path) == ["start a"])
    assert main(arguments, stand_in()) == 2
    assert "in use by another batch" in capsys.readouterr().err
    first.communicate(timeout=20)
    assert first.returncode == 0


class Page(HTMLParser):
    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.links: list[str] = []
        self.text: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list) -> None:
        self.tags.append(tag)
        self.links += [value for key, value in attrs if key in ("href", "src")]

    def handle_data(self, data: str) -> None:
        self.text.append(data)


HOSTILE = (
    "<script>alert(1)</script>.stl".replace("/", "∕"),
    'a"b&#39;%41?x=1#y.stl',
    "=HYPERLINK(1).stl",
    "line\nend.stl",
    "-o.stl",
    "x.y.stl",
)


def test_names_are_escaped_and_links_lead_somewhere(parts, tmp_path, stand_in):
    names = [*HOSTILE, os.fsdecode(b"bytes\xff.stl"), "long" * 62 + ".stl", ".hidden.stl", "..stl", "same.stl", "same.ply", "Same.off"]
    make(parts, *names)
    out = tmp_path / "out"
    assert main([str(parts), "-o", str(out)], stand_in()) == 0
    page = Page((out / "results.html").read_text(encoding="utf-8"))
    assert [t for t in page.tags if t == "script"] == ["script"], "its own"
    assert len([t for t in page.tags if t == "tr"]) == len(names) - 2 + 1
    assert "<script>alert(1)<∕script>.stl" in page.text
    assert page.links
    for link in page.links:
        assert (out / os.fsdecode(unquote_to_bytes(link))).exists()
    assert {path.name for path in (out / "parts").iterdir()} >= {"same.stl", "same.ply", "Same.off", "x.y", "-o"}
    assert sorted(path.name for path in out.iterdir()) == [".lock", "batch.json", "parts", "results.csv", "results.html"]


def test_the_page_reloads_only_while_it_runs(parts, tmp_path, stand_in):
    make(parts, "a.stl", "b.stl")
    out = tmp_path / "out"
    process = started([str(parts), "-o", str(out)], stand_in(0.6))
    wait_for(lambda: (out / "results.html").exists() and "1 of 2 parts done" in (out / "results.html").read_text())
    growing = (out / "results.html").read_text()
    assert 'http-equiv="refresh"' in growing
    assert "s left" in growing
    assert "waiting" in growing
    process.communicate(timeout=20)
    assert 'http-equiv="refresh"' not in (out / "results.html").read_text()
    assert "2 of 2 parts done, 0 failed" in (out / "results.html").read_text()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["missing", "-o", "out"], "missing: No such file"),
        (["empty", "-o", "out"], "0 model files among 1 entries"),
        (["parts", "-o", "foreign"], "holds thesis.tex"),
        (["parts", "-o", "file"], "cannot be written"),
        (["parts", "-o", "out", "budgets=3"], "did you mean budget_s?"),
        (["parts", "-o", "out", "output=x"], "PARTS and -o FOLDER"),
        (["parts", "-o", "out", "--jobs", "0"], "positive"),
        (["parts", "-o", "broken"], "not the note of a batch"),
    ],
)
def test_what_cannot_be_done_is_one_line(parts, tmp_path, monkeypatch, capsys, arguments, said):
    monkeypatch.chdir(tmp_path)
    make(parts, "a.stl")
    for name, file in (("empty", "a.step"), ("foreign", "thesis.tex"), ("broken", "batch.json")):
        (tmp_path / name).mkdir()
        (tmp_path / name / file).write_text("x")
    (tmp_path / "file").write_text("")
    assert imdim(["batch", *arguments]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_records_that_were_changed_by_hand_are_made_again(parts, tmp_path, stand_in):
    make(parts, "a.stl", "b.stl", "c.stl")
    arguments = [str(parts), "-o", str(tmp_path / "out")]
    main(arguments, stand_in())
    records = [tmp_path / "out" / "parts" / name / folder.OUTCOME for name in "abc"]
    records[0].write_text("{}")
    records[1].write_text(json.dumps({**json.loads(records[1].read_text()), "volume_iou": "<b>"}))
    main(arguments, stand_in())
    assert [line for line in log(tmp_path)[6:] if line.startswith("start")] == ["start a", "start b"]


def test_what_runs_ends_when_the_iteration_is_left(tmp_path):
    pids: list[int] = []

    class Spy(Process):
        def __init__(self, *arguments) -> None:
            super().__init__(*arguments)
            pids.append(self._child.pid)

    part = folder.Part("a", tmp_path / "a.stl", "")
    command = (sys.executable, "-c", "import time; time.sleep(600)")
    job = folder_job(part, tmp_path, command)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("imdim.app.batch.engine.Process", Spy)
        quick = folder_job(part, tmp_path, (sys.executable, "-c", "pass"))
        running = run_local([job, quick], 2)
        assert next(running)[1].why == ""
        running.close()
    assert len(pids) == 2
    assert not alive(pids[0])


def folder_job(part: folder.Part, staging: Path, command: tuple[str, ...]):
    from imdim.app.batch.engine import PartJob

    return PartJob(part, staging, command, (), ProcessLimits(60.0))


def test_a_sudden_allocation_is_refused_by_the_system(tmp_path):
    code = "import mmap; mmap.mmap(-1, 8 << 30, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)"
    ended = run([sys.executable, "-c", code], ProcessLimits(20.0, 100.0), tmp_path / "log")
    assert ended.status == 1
    assert "Cannot allocate memory" in ended.why
    assert run([sys.executable, "-c", code], ProcessLimits(20.0), tmp_path / "log").why == ""


def test_a_command_that_is_missing_is_an_outcome(tmp_path):
    ended = run(["/nowhere/at/all"], ProcessLimits(20.0), tmp_path / "log")
    assert (ended.status, ended.why) == (127, "/nowhere/at/all: No such file or directory")


def test_a_real_part_comes_out_of_a_batch(parts, tmp_path):
    trimesh.creation.box((1.0, 2.0, 3.0)).export(parts / "box.stl")
    assert imdim(["batch", str(parts), "-o", str(tmp_path / "out"), "--budget", "2", "method=tree"]) == 0
    (row,) = rows(tmp_path / "out").values()
    assert (row["primitives"], float(row["volume_iou"])) == ("1", pytest.approx(1.0))
    report = json.loads((tmp_path / "out" / "parts" / "box" / "report.json").read_text())
    assert report["settings"]["output"] == "parts/box"


def columns(page):
    return [re.sub("<.*?>", "", head) for head in re.findall(r"<th.*?</th>", page)]


def test_curves_have_a_column_where_a_part_has_outlines(parts, tmp_path, stand_in, capsys):
    make(parts, "a.stl")
    out = tmp_path / "out"
    main([str(parts), "-o", str(out)], stand_in())
    assert columns((out / "results.html").read_text())[2:4] == ["primitives", "volume IoU"]
    make(parts, "drawn.stl")
    main([str(parts), "-o", str(out)], stand_in())
    page = (out / "results.html").read_text()
    assert columns(page)[2:5] == ["features", "curves", "volume IoU"]
    assert re.findall(r'>(\d*)</td><td class="n"[^>]*>(\d*)</td><td class="n poor"[^>]*>0.5000', page) == [("7", ""), ("4", "45")]
    assert {name: row["curves"] for name, row in rows(out).items()} == {"a.stl": "", "drawn.stl": "45"}
    said = capsys.readouterr().err
    assert "a.stl: 7 primitives, IoU 0.5000" in said
    assert "drawn.stl: 4 features, 45 curves in outlines, IoU 0.5000" in said


def test_a_language_that_nobody_speaks_is_one_line(parts, tmp_path, stand_in, capsys):
    make(parts, "a.stl")
    assert main([str(parts), "-o", str(tmp_path / "out"), "language=step"], stand_in()) == 2
    assert capsys.readouterr().err == "imdim: unknown language 'step'; known are csg, cad\n"
    assert main([str(parts), "-o", str(tmp_path / "out"), "language=csg"], stand_in()) == 0
    assert json.loads((tmp_path / "out" / "batch.json").read_text())["settings"]["language"] == "csg"


def test_a_name_is_no_formula_of_a_spreadsheet():
    from imdim.app.batch.table import csv_text

    assert csv_text(("part", "iou"), [("=cmd|calc!A1.stl", -1.5), ("@a", 2), ("a=b", None)]).splitlines() == [
        "part,iou",
        "'=cmd|calc!A1.stl,-1.5",
        "'@a,2",
        "a=b,",
    ]
