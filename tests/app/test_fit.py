"""The command from end to end with a stand-in reconstruction: exit statuses, what is written, what is said."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, fields
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from tests.drawn import BORED

from imdim import side_process
from imdim.app.cli import main as imdim
from imdim.app.fit import NOT_THE_PART, _EarlyStep, fit, one_line, summary
from imdim.app.fit import main as run
from imdim.app.orderly import run_in_order
from imdim.app.piped import guess_format, load_piped
from imdim.app.progress import show_progress
from imdim.export import step_worker
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.program.front import Choice
from imdim.program.tree import Combine, Primitive, Program
from imdim.reconstruction.config import LANGUAGES, MEANINGS, OBJECTIVES, Settings, from_hydra

pytestmark = pytest.mark.usefixtures("without_step")
ROOT = Path(__file__).parents[2]
BOX = Primitive("box", (1.0, 2.0, 3.0))
REPORT = {
    "scores": {"volume_iou": 1.0, "distance_relative_to_diagonal": {"target_to_result": {"mean": 0.0}}},
    "result": {"primitives": 1, "without_copies": 1},
    "timing": {"total_s": 0.0},
    "stop": "finished",
    "found": {"iou_with_delivered": 1.0},
    "files": {"program.scad": "written"},
}


@dataclass(frozen=True)
class Snap:
    stage: str
    program: Program
    error: float
    seconds: float
    stop: str | None = None
    constraints: tuple = ()
    front: tuple = ()
    proof: str = "proved minimal over these candidates"
    notes: tuple = ()
    edges: tuple = ()
    noisy: bool = False
    noise: None = None
    edge_sizes: tuple = ()


def box_found(target, settings, rng):
    yield Snap("seeding", Primitive("sphere", (1.0,)), 0.5, 0.25)
    yield Snap("search", BOX, 0.125, 1.0)
    yield Snap("search", BOX, 0.0, 1.5, "tolerance_reached")


@pytest.fixture
def part(tmp_path):
    path = tmp_path / "box.stl"
    trimesh.creation.box((1.0, 2.0, 3.0)).export(path)
    return path


def test_the_results_are_written_and_named(part, tmp_path, capsys):
    settings = Settings(input=str(part), output=str(tmp_path / "out"), seed=4)
    assert run(lambda: settings, box_found) == 0
    shown_text = capsys.readouterr()
    assert "1 primitive, volume IoU 1.0000" in shown_text.out
    assert str(tmp_path / "out" / "preview.png") in shown_text.out
    assert (tmp_path / "out" / "preview.png").is_file()
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["stop"] == "tolerance_reached"
    assert report["proof"] == "proved minimal over these candidates"
    assert report["seed"] == 4
    assert report["settings"]["budget_s"] == 60.0
    stages = report["timing"]["stages_s"]
    assert (stages["seeding"], stages["search"]) == pytest.approx((0.25, 1.25))


def test_lengths_in_inches_are_written_in_millimetres(part, tmp_path, capsys):
    def larger_found(target, settings, rng):
        assert target.mesh.extents == pytest.approx((25.4, 50.8, 76.2))
        assert target.mesh.bounds[0] == pytest.approx((-12.7, -25.4, 0.0))
        yield Snap("search", Primitive("box", (25.4, 50.8, 76.2), (0.0, 0.0, 38.1)), 0.0, 1.5, "finished")

    out = tmp_path / "out"
    assert run(lambda: Settings(input=str(part), output=str(out), units="inch", origin="base"), larger_found) == 0
    said = capsys.readouterr().err
    assert "imdim: box.stl: Lengths are read as inches: each becomes 25.4 millimetres.\n" in said
    assert "imdim: box.stl: Moved by 0, 0, 38.1: origin=base.\n" in said
    report, program = (json.loads((out / name).read_text()) for name in ("report.json", "program.json"))
    assert report["scores"]["volume_iou"] == pytest.approx(1.0)
    assert (report["target"]["units"], program["units"]) == ("millimeter", "millimeter")
    assert trimesh.load_mesh(out / "mesh.stl").extents == pytest.approx((25.4, 50.8, 76.2))
    assert run(lambda: Settings(input=str(part), output=str(tmp_path / "plain")), box_found) == 0
    assert json.loads((tmp_path / "plain" / "program.json").read_text())["units"] == "unspecified"


def test_features_and_curves_are_told_where_there_are_outlines(tmp_path, capsys):
    part = tmp_path / "bracket.stl"
    to_trimesh(to_manifold(BORED)).export(part)

    def bracket_found(target, settings, rng):
        yield Snap("search", BOX, 0.5, 0.5)
        yield Snap("finished", BORED, 0.0, 1.5, "finished", front=(Choice(BOX, 0.5), Choice(BORED, 0.0)))

    out = tmp_path / "out"
    assert run(lambda: Settings(input=str(part), output=str(out)), bracket_found) == 0
    said = capsys.readouterr()
    assert "2 features, 10 curves in outlines, volume IoU 1.0000, " in said.out
    assert " 1 primitive, " in said.err
    assert " 2 features, 10 curves in outlines, " in said.err
    assert "primitives" not in said.out + said.err
    report, front = (json.loads((out / name).read_text()) for name in ("report.json", "front.json"))
    assert {key: report["result"][key] for key in ("primitives", "features", "curves")} == {"primitives": 2, "features": 2, "curves": 10}
    assert report["result"]["free_numbers"] == 0  # every corner of the bracket follows a name
    assert report["settings"]["language"] == "cad"
    assert [choice.get("curves") for choice in front["choices"]] == [None, 10]
    page = (out / "report.html").read_text()
    assert '"features":2,"curves":10' in page


def test_what_was_left_out_is_told_and_written(part, tmp_path, capsys):
    def box_found(target, settings, rng):
        yield Snap("finished", BOX, 0.0, 1.5, "finished", notes=("box body 2: no inside found; left out",))

    settings = Settings(input=str(part), output=str(tmp_path / "out"))
    assert run(lambda: settings, box_found) == 0
    assert "imdim: box body 2: no inside found; left out\n" in capsys.readouterr().err
    assert json.loads((tmp_path / "out" / "report.json").read_text())["target"]["notes"] == ["box body 2: no inside found; left out"]


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [("missing.stl", None, "no such file"), ("part.step", b"x", "unknown format"), ("few.csv", b"0,0,0\n1,1,1\n0,1,0\n", "3 points")],
)
def test_bad_input_is_one_line_and_writes_nothing(tmp_path, capsys, name, content, said):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    before = sorted(tmp_path.iterdir())
    assert imdim(["fit", str(tmp_path / name), "-o", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert said in error
    assert name in error
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("name", [b"two\nlines.stl", b"no \xff text.stl", b"tab\t.stl", b'"); import os.stl'])
def test_any_name_of_a_file_is_delivered(part, tmp_path, capfd, name):
    odd = tmp_path / os.fsdecode(name)
    part.rename(odd)
    assert imdim_fit(odd, os.fsdecode(os.fsencode(tmp_path) + b"/out-" + name)) == 0
    folder = next(path for path in tmp_path.iterdir() if path.is_dir())
    assert (folder / "preview.png").is_file()
    shown = json.loads((folder / "report.json").read_text())["target"]["name"]
    assert shown.isprintable()
    assert shown.endswith(".stl")


def imdim_fit(source, folder):
    return run_in_order(lambda: run(lambda: Settings(input=str(source), output=str(folder)), box_found))


def test_results_that_were_changed_by_hand_are_replaced_only_by_force(part, tmp_path, capsys):
    folder = tmp_path / "out"
    settings = Settings(input=str(part), output=str(folder))
    assert run(lambda: settings, box_found) == 0
    assert run(lambda: settings, box_found) == 0  # nobody changed them
    written = {path.name: path.read_bytes() for path in folder.iterdir()}
    for name in ("program.scad", "program.json", "program.py"):
        (folder / name).write_bytes(written[name] + b"\n")
        capsys.readouterr()
        assert run(lambda: settings, box_found) == 2
        assert capsys.readouterr().err.endswith(f"{name} changed since it was written: give another folder, or --force\n")
        assert {path.name: path.read_bytes() for path in folder.iterdir()} == {**written, name: written[name] + b"\n"}
        (folder / name).write_bytes(written[name])
    (folder / "program.py").write_bytes(b"mine")
    assert run(lambda: settings, box_found, force=True) == 0
    assert (folder / "program.py").read_bytes() == written["program.py"]


def test_a_person_who_stops_the_search_gets_the_best_so_far(part, tmp_path, capsys):
    def stopped(target, settings, rng):
        yield Snap("seeding", Primitive("sphere", (1.0,)), 0.5, 0.25)
        yield Snap("search", BOX, 0.125, 1.0)
        raise KeyboardInterrupt

    settings = Settings(input=str(part), output=str(tmp_path / "out"))
    assert run(lambda: settings, stopped) == 0
    said = capsys.readouterr()
    assert "imdim: stopped by hand; the best program so far is written" in said.err
    assert "1 primitive, volume IoU 1.0000" in said.out
    assert "(stopped: by hand)" in said.out


SEARCHING = """
import sys, time
from imdim.app.fit import main
from imdim.app.orderly import run_in_order
from imdim.program.tree import Primitive
from imdim.reconstruction.config import Settings
from imdim.reconstruction.pipeline import Snapshot

def search(target, settings, rng):
    yield Snapshot("search", Primitive("box", (1.0, 2.0, 3.0)), 0.0, 1.0)
    print("searching", flush=True)
    time.sleep(60)

settings = Settings(input=sys.argv[1], output=sys.argv[2])
sys.exit(run_in_order(lambda: main(lambda: settings, search)))
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_in_the_middle_of_the_search_gets_the_best_so_far(part, tmp_path, number):
    before = signal.signal(number, signal.SIG_DFL)  # a suite under nohup ignores it, and its children would
    command = [sys.executable, "-c", SEARCHING, part, tmp_path / "out"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    signal.signal(number, before)
    assert process.stdout is not None
    assert process.stdout.readline() == "searching\n"
    os.kill(process.pid, number)
    out, said = process.communicate(timeout=120)
    assert process.returncode == 128 + number
    assert f"imdim: stopped by {signal.Signals(number).name}; the best program so far is written\n" in said
    assert "1 primitive, volume IoU 1.0000" in out
    assert json.loads((tmp_path / "out" / "report.json").read_text())["stop"] == f"by {signal.Signals(number).name}"


WRITING = """
import sys, time
from imdim.app.fit import main
from imdim.app.orderly import run_in_order
from imdim.delivery import deliver as delivery
from imdim.program.tree import Primitive
from imdim.reconstruction.config import Settings
from imdim.reconstruction.pipeline import Snapshot

def search(target, settings, rng):
    yield Snapshot("finished", Primitive("box", (1.0, 2.0, 3.0)), 0.0, 1.0)

def deliver(*given, write=delivery.deliver, **more):
    print("writing", flush=True)
    time.sleep(2)
    return write(*given, **more)

delivery.deliver = deliver
settings = Settings(input=sys.argv[1], output=sys.argv[2])
sys.exit(run_in_order(lambda: main(lambda: settings, search)))
"""


@pytest.mark.parametrize(
    ("asked", "status", "written"),
    [
        ([signal.SIGINT], 0, True),
        ([signal.SIGTERM], 143, True),
        ([signal.SIGINT, signal.SIGINT], 130, False),
        ([signal.SIGINT, signal.SIGTERM], 143, False),
    ],
)
def test_a_result_that_is_being_written_is_written_unless_it_is_asked_for_twice(part, tmp_path, asked, status, written):
    before = {number: signal.signal(number, signal.SIG_DFL) for number in asked}  # what a suite ignores its children would
    command = [sys.executable, "-c", WRITING, part, tmp_path / "out"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    for number, how in before.items():
        signal.signal(number, how)
    assert process.stdout is not None
    assert process.stdout.readline() == "writing\n"
    for number in asked:
        os.kill(process.pid, number)
        time.sleep(0.5)
    out, said = process.communicate(timeout=120)
    assert said.count("imdim: the result is being written") == 1
    assert (process.returncode, (tmp_path / "out" / "report.json").exists()) == (status, written)
    assert ("volume IoU 1.0000" in out) == (status == 0)
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


def test_a_person_who_stops_before_there_is_a_program_gets_nothing(part, tmp_path, capsys):
    def stopped(target, settings, rng):
        raise KeyboardInterrupt
        yield

    assert run(lambda: Settings(input=str(part), output=str(tmp_path / "out")), stopped) == 130
    assert "interrupted, nothing was written" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_step_file_that_took_too_long_comes_with_the_command_that_writes_it(tmp_path):
    files = {"program.step": "skipped: OpenCASCADE took more than 1 s", "program.ucad": "skipped: µcad has no polygons"}
    lines = summary({**REPORT, "files": files}, tmp_path).splitlines()
    export = f"imdim export {tmp_path / 'program.json'} -o {tmp_path}-step waits 60 s for it"
    assert f"  program.step skipped: OpenCASCADE took more than 1 s; {export}" in lines
    assert "  program.ucad skipped: µcad has no polygons" in lines


@pytest.mark.parametrize("name", ["n" * 252 + ".stl", "two\nlines.stl"])
def test_a_name_that_no_file_can_have_or_has_is_one_line(tmp_path, capsys, name):
    assert imdim(["fit", str(tmp_path / name), "-o", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_an_output_that_cannot_be_written_is_one_line(part, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert imdim(["fit", str(part), "-o", str(tmp_path / "file" / "out")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["budgets=3"], "did you mean budget_s?"),
        (["seed=x"], "seed"),
        (["nonsense"], "key=value"),
        (["segments=2"], "at least 3, got 2"),
        (["language=step"], "unknown language 'step'; known are csg, cad"),
        (["objective=curves"], "unknown objective 'curves'; known are auto, description, primitives"),
    ],
)
def test_a_bad_setting_is_one_line(part, tmp_path, capsys, arguments, said):
    assert imdim(["fit", str(part), "-o", str(tmp_path / "out"), *arguments]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert said in error
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("given", [[], ["language=csg"]])
def test_the_language_is_set_like_any_setting(part, tmp_path, monkeypatch, given):
    seen = []

    def draw(target, settings, rng):
        seen.append(settings.language)
        yield Snap("search", BOX, 0.0, 0.0)

    monkeypatch.setattr("imdim.delivery.deliver.deliver", lambda *_, **__: REPORT)
    monkeypatch.setattr("imdim.reconstruction.pipeline.reconstruct", draw)
    monkeypatch.setattr("imdim.delivery.first_run.compile_kernels", lambda stream, cloud: 0.0)
    assert imdim(["fit", str(part), "-o", str(tmp_path / "out"), *given]) == 0
    assert run(lambda: from_hydra(ROOT / "configs", "infer", [f"input={part}", f"output={tmp_path / 'out'}", *given])) == 0
    assert seen == ["csg" if given else "cad"] * 2


@pytest.mark.parametrize("command", ["fit", "batch"])
def test_the_help_names_the_languages_and_objectives(command, capsys):
    with pytest.raises(SystemExit):
        imdim([command, "--help"])
    said = " ".join(capsys.readouterr().out.split())
    assert all(f"language={word}" in said for word in LANGUAGES)
    assert all(f"objective={word}" in said for word in OBJECTIVES)


def test_the_help_explains_every_setting_with_its_default(capsys):
    with pytest.raises(SystemExit):
        imdim(["fit", "--help"])
    said = capsys.readouterr().out
    assert list(MEANINGS) == [f.name for f in fields(Settings)]
    optioned = {"input", "output", "budget_s", "seed"}
    for setting in fields(Settings):
        default = str(setting.default).lower() if setting.type == "bool" else setting.default
        assert (f"  {setting.name}={default} " in said) == (setting.name not in optioned), setting.name
    assert "--budget SECONDS      time for the search (default 60)" in said


@pytest.fixture
def stands_in(monkeypatch):
    monkeypatch.setattr("imdim.reconstruction.pipeline.reconstruct", box_found)
    monkeypatch.setattr("imdim.delivery.first_run.compile_kernels", lambda stream, cloud: 0.0)


def test_without_an_output_the_results_are_named_after_the_part(part, tmp_path, monkeypatch, capsys, stands_in):
    monkeypatch.chdir(tmp_path)
    assert imdim(["fit", part.name]) == 0
    assert (tmp_path / "box.imdim" / "report.json").is_file()
    assert "box.imdim/preview.png" in capsys.readouterr().out


def test_quiet_says_nothing_and_json_the_report(part, tmp_path, monkeypatch, capsys, stands_in):
    out = tmp_path / "out"
    monkeypatch.setattr("imdim.delivery.deliver.deliver", lambda *_, **__: REPORT)
    assert imdim(["fit", str(part), "-o", str(out), "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")
    assert imdim(["fit", str(part), "-o", str(out), "--json"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out) == REPORT
    assert "search" in said.err
    assert imdim(["fit", "none.stl", "--quiet", "--json"]) == 2
    assert capsys.readouterr() == ("", "imdim: none.stl: no such file\n")


def test_a_part_comes_through_a_pipe(part, tmp_path, monkeypatch, capsys, stands_in):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(part.read_bytes())))
    assert imdim(["fit", "-", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert (report["input"], report["target"]["name"]) == ("-", "stdin.stl")
    assert (tmp_path / "stdin.imdim" / "program.scad").is_file()
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"")))
    assert imdim(["fit", "-"]) == 2
    assert capsys.readouterr().err == "imdim: stdin.xyz: the file is empty (0 bytes)\n"


@pytest.mark.parametrize("suffix", ["stl", "ascii.stl", "obj", "off", "ply", "3mf", "glb", "xyz", "csv", "npy", "npz", "pcd"])
def test_the_format_of_a_pipe_is_seen_in_its_bytes(tmp_path, suffix):
    mesh = trimesh.creation.icosphere()
    path = tmp_path / f"part.{suffix}"
    points = np.asarray(mesh.vertices)
    if suffix in ("xyz", "csv"):
        np.savetxt(path, points, delimiter="," if suffix == "csv" else " ")
    elif suffix in ("npy", "npz"):
        np.save(path, points) if suffix == "npy" else np.savez(path, points=points)
    elif suffix == "pcd":
        head = "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {0}\nHEIGHT 1\nPOINTS {0}\nDATA ascii\n"
        path.write_text(head.format(len(points)) + "".join(f"{x} {y} {z}\n" for x, y, z in points))
    elif suffix == "ascii.stl":
        path.write_text(trimesh.exchange.stl.export_stl_ascii(mesh))
    else:
        mesh.export(path)
    assert guess_format(path.read_bytes()) == path.suffix
    target = load_piped(path.read_bytes())
    assert len(target.points) >= len(points)
    assert (target.mesh is not None) == (suffix in ("stl", "ascii.stl", "obj", "off", "ply", "3mf", "glb"))


def infer(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, str(ROOT / "infer.py"), *arguments], capture_output=True, text=True, check=False, timeout=60)


def test_the_hydra_entry_refuses_in_one_line_and_leaves_no_trace(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for arguments, said in (
        (["input=missing.stl", "output=out"], "missing.stl: no such file"),
        (["input=a.stl", "ouput=out"], "did you mean output?"),
        (["input=a.stl", "output=out", "language=step"], "unknown language 'step'; known are csg, cad"),
    ):
        done = infer(*arguments)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr.count("\n") == 1
        assert said in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("command", "said"), [("fit", "done\n"), ("export", "done\nlate\n")])
def test_a_fit_leaves_what_it_holds_to_the_system(command, said):
    code = f"""if True:
        import atexit, sys
        from imdim.app import cli
        atexit.register(print, "late")
        cli.main = lambda: print("done") or 3
        sys.argv = ["imdim", "{command}"]
        cli.run()"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout) == (3, said)


def test_help_answers_at_once():
    start = time.perf_counter()
    done = subprocess.run([sys.executable, "-X", "importtime", "-m", "imdim.app.cli", "--help"], capture_output=True, text=True, check=True)
    assert time.perf_counter() - start < 2.0  # 0.05 s where nothing else runs
    assert "CAD program" in done.stdout
    heavy = {"numpy", "torch", "numba", "trimesh", "hydra", "rich"}
    assert not heavy & {line.split("|")[-1].strip() for line in done.stderr.splitlines()}


def test_a_defect_is_one_line_too(capsys):
    try:
        raise RuntimeError("first\nsecond")
    except RuntimeError as error:
        one_line(RuntimeError, error, error.__traceback__)
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "internal error, RuntimeError: first at test_fit.py:" in said


def test_plain_progress_is_one_line_per_stage_or_two_seconds():
    two = Combine("union", BOX, BOX)
    snaps = [Snap("a", BOX, 0.5, 0.1), Snap("a", BOX, 0.4, 0.2), Snap("b", two, 0.6, 0.3), Snap("b", two, 0.1, 3.0)]
    out = io.StringIO()
    assert list(show_progress(snaps, 10.0, out)) == snaps
    first, *lines = out.getvalue().splitlines()
    assert first == "   0.0 s  finding surfaces, 10 s left"
    assert [line.split()[2] for line in lines] == ["a", "b", "b"]
    assert "error 0.4 " in lines[1]  # the best so far, though this snapshot is worse
    assert "2 primitives, 7 s left" in lines[2]


def test_the_error_of_a_body_that_shows_no_inside_is_unknown():
    out = io.StringIO()
    list(show_progress(iter([Snap("solve", BOX, 1.0, 0.1)]), 10.0, out))
    assert "error unknown   1 primitive" in out.getvalue()


def test_live_progress_passes_every_snapshot_on():
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    out = Terminal()
    assert len(list(show_progress(iter([Snap("search", BOX, 0.5, 0.1)]), 10.0, out))) == 1
    assert "s left" in out.getvalue()


def test_the_seed_reaches_the_reconstruction(part, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr("imdim.delivery.deliver.deliver", lambda *_, **__: {})

    def draw(target, settings, rng):
        drawn.append(rng.random())
        yield Snap("search", BOX, 0.0, 0.0)

    for seed in (0, 0, 1):
        fit(Settings(input=str(part), output=str(tmp_path / "out"), seed=seed), draw)
    assert drawn[0] == drawn[1] == np.random.default_rng(0).random() != drawn[2]


def test_the_budget_runs_from_when_the_command_began(part, tmp_path, monkeypatch):
    """What loads before is part of what a user waits for."""
    given = []
    monkeypatch.setattr("imdim.delivery.deliver.deliver", lambda *_, **__: {})

    def draw(target, settings, rng):
        given.append(settings.budget_s)
        yield Snap("search", BOX, 0.0, 0.0)

    for late in (0.0, 7.0):
        settings = Settings(input=str(part), output=str(tmp_path / "out"), budget_s=60.0)
        fit(settings, draw, began=time.perf_counter() - late)
    assert given[0] - given[1] == pytest.approx(7.0, abs=0.5)


def test_what_is_mostly_left_out_does_not_end_well(tmp_path, capsys):
    """A box for a tower of which it is the foot: files are written, but last line and exit status say that they are not the part."""
    tower = trimesh.creation.box((1.0, 2.0, 30.0))
    tower.apply_translation((0.0, 0.0, 13.5))
    tower.export(tmp_path / "tower.stl")
    settings = Settings(input=str(tmp_path / "tower.stl"), output=str(tmp_path / "out"))
    assert run(lambda: settings, box_found) == NOT_THE_PART
    said = capsys.readouterr().out
    assert "  verdict  left out: " in said
    assert said.endswith("this is not the part: most of its surface is left out\n")
    assert (tmp_path / "out" / "program.scad").is_file()


def test_a_cloud_that_the_program_does_not_explain_does_not_end_well(tmp_path, capsys):
    """A plate for a fence of bars: no point is far from its surface, and by distances nothing is wrong."""
    rng = np.random.default_rng(0)
    bars = [
        trimesh.creation.box((0.4, 2.0, 0.15), transform=trimesh.transformations.translation_matrix((x, 0, 0)))
        for x in (-0.9, -0.3, 0.3, 0.9)
    ]
    points = trimesh.sample.sample_surface(trimesh.util.concatenate(bars), 8192, seed=1)[0]
    np.save(tmp_path / "fence.npy", points + rng.normal(0, 0.02, points.shape))

    def plate_found(target, settings, rng):
        yield Snap("finished", Primitive("box", (2.2, 2.0, 0.15)), 0.0, 1.0, "finished")

    settings = Settings(input=str(tmp_path / "fence.npy"), output=str(tmp_path / "out"))
    assert run(lambda: settings, plate_found) == NOT_THE_PART
    said = capsys.readouterr().out
    assert "  verdict  not explained: " in said
    assert "  doubt    the program does not explain the points" in said
    assert said.endswith("this is not the part: the program does not explain what was measured\n")
    told = json.loads((tmp_path / "out" / "report.json").read_text())["verdict"]
    assert told["explanation"]["gain"] < 0
    assert told["doubts"]


def test_regions_that_are_alike_are_told_once() -> None:
    def region(share: float, what: str, where: str) -> dict:
        return {"verdict": "left out", "what": what, "where": where, "share": share}

    regions = [
        region(0.03, "4 x 4 x 6", "at (1, 2, 3)"),
        region(0.03, "4 x 4 x 6", "at (9, 2, 3)"),
        region(0.01, "12 teeth", "at (0, 0, 0)"),
    ]
    verdict = {"overall": "approximated", "says": "93.0 % is exact", "regions": [*regions, region(1e-4, "1 x 1 x 1", "at (5, 5, 5)")]}
    said = summary({**REPORT, "verdict": verdict}, Path("out"))
    where = "6.0 % left out, 2 x (4 x 4 x 6), the first at (1, 2, 3); 1.0 % left out, 12 teeth at (0, 0, 0)"
    assert f"  verdict  approximated: 93.0 % is exact\n  where    {where}\n" in said
    assert "hint" not in said
    cut_short = {**REPORT, "verdict": verdict, "stop": "budget_spent", "settings": {"budget_s": 30.0}}
    assert "  hint     the time ended the search: try --budget 60\n" in summary(cut_short, Path("out"))


def test_edges_are_told_with_the_way_to_draw_them() -> None:
    told = {"edges": [{"says": "chamfer 0.4 of 40 edges"}], "edges_drawn": False}
    report = {
        **told,
        "scores": {"volume_iou": 0.99, "distance_relative_to_diagonal": {"target_to_result": {"mean": 0.0}}},
        "result": {"primitives": 1, "without_copies": 1, "features": 1, "curves": 16},
        "timing": {"total_s": 4.0},
        "stop": "finished",
        "found": {"iou_with_delivered": 1.0},
        "files": {"program.step": "written, 2 of 40 edges not blended", "program.scad": "written"},
    }
    said = summary(report, Path("out"))
    assert "edges    chamfer 0.4 of 40 edges (program.scad draws them with -D edges=true)" in said
    assert "program.step written, 2 of 40 edges not blended" in said
    assert "-D edges=true" not in summary({**report, "edges_drawn": True}, Path("out"))


@pytest.mark.parametrize(("cores", "early"), [(2, ["simplify"]), (1, [])])
def test_opencascade_is_loaded_while_numbers_are_looked_for(monkeypatch, cores, early):
    """On another core, once the structure is found."""
    passed, started, stopped = [], [], []
    monkeypatch.setattr(side_process, "count_cores", lambda: cores)
    monkeypatch.setattr(step_worker, "start_worker", lambda: started.append(passed[-1]) or started)
    monkeypatch.setattr(step_worker, "stop_worker", stopped.append)
    with _EarlyStep() as step:
        snapshots = (passed.append(stage) or SimpleNamespace(stage=stage) for stage in ("search", "simplify", "solve"))
        assert [snapshot.stage for snapshot in step.watch(snapshots)] == passed
        assert not stopped
    assert started == early
    assert len(stopped) == len(early)
