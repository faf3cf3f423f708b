"""The benchmark counts failures, keeps its limits, measures memory and continues; its parts are boxes whose scores are known."""

from __future__ import annotations

import csv
import json
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from tests.drawn import BORED
from tests.stand_ins import log, stand_in_for, wait_for

from imdim.app.batch.engine import run_shipped
from imdim.app.batch.process import ProcessLimits
from imdim.export.openscad import to_openscad
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.reconstruction.config import Settings
from imdim.target.scan import Condition, parse_condition, scan
from imdim.target.target import load_target, target_from

SCRIPTS = Path(__file__).parents[1] / "scripts" / "bench"
sys.path.insert(0, str(SCRIPTS))  # the scripts import each other by name

import benchmark  # noqa: E402
from benchmark_part import Row, Task, sample, score  # noqa: E402
from benchmark_table import markdown, summary  # noqa: E402

# stands in for `imdim fit`: delivers a unit cube whatever the part is; what else it does is decided by the part's name
STAND_IN = """
import json, os, pathlib, subprocess, sys, time
source, folder = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[3])
note = lambda what: open(LOG, "a").write(f"{what} {source.stem}\\n")
note("start")
if source.stem == "bad":
    sys.exit("bad.stl: 0 points")
if source.stem == "crash":
    os.abort()
if source.stem == "hang":
    time.sleep(600)
if source.stem == "blowup":
    hoard = []
    while True:
        hoard.append(b"x" * (1 << 24))
if source.stem == "large":
    hoard = bytearray(50 * 2**20)
    subprocess.run([sys.executable, "-c", "x = bytearray(100 * 2**20); import time; time.sleep(0.4)"])
time.sleep(PAUSE)
folder.mkdir(parents=True)
(folder / "settings").write_text(" ".join(sys.argv[4:]))
if source.stem == "silent":
    sys.exit(0)
text = "no program" if source.stem == "nonsense" else "$fn = 96;\\ncube([1, 1, 1], center = true);\\n"
(folder / "program.scad").write_text(text)
(folder / "report.json").write_text(json.dumps({"stop": "finished", "timing": {"stages_s": {"a": 1.5, "b": 1.0}}}))
note("end")
"""


@pytest.fixture
def make(tmp_path):
    """A folder of boxes, 1 by 1 by their heights, by name."""

    def parts(**heights: float) -> Path:
        folder = tmp_path / "parts"
        folder.mkdir(exist_ok=True)
        for name, height in heights.items():
            trimesh.creation.box((1.0, 1.0, height)).export(folder / f"{name}.stl")
        return folder

    return parts


@pytest.fixture
def stand_in(tmp_path):
    return lambda pause=0.0: stand_in_for(tmp_path, STAND_IN, PAUSE=pause)


@pytest.fixture
def scorer(tmp_path):
    path = tmp_path / "score.py"
    text = "import json, sys\nif 'cube' not in open(sys.argv[2]).read():\n    sys.exit(1)\n"
    path.write_text(text + 'print(json.dumps({"iou": 0.75, "hausdorff": 20, "leaves": len(sys.argv)}))\n')
    return path


@pytest.fixture(autouse=True)
def quiet_tree(monkeypatch):
    """Somebody may edit the package while its tests run."""
    monkeypatch.setattr(benchmark, "CODE", ())


def table(out: Path) -> dict[str, dict[str, str]]:
    with (out / "table.csv").open() as file:
        return {row["part"]: row for row in csv.DictReader(file)}


def test_a_folder_becomes_a_table(make, tmp_path, stand_in, capsys):
    parts, out = make(bad=1, cube=1, half=2), tmp_path / "out"
    (parts / "human.json").write_text(json.dumps({"cube": {"primitives": 1}, "half": {"primitives": 1}, "bad": {"primitives": 9}}))
    given = ["--jobs", "2", "--out", str(out), "--seed", "3", "--set", "evolution=false", "size_weight=0.01"]
    assert benchmark.main([str(parts), *given], stand_in()) == 0
    rows = table(out)
    assert list(rows) == ["bad", "cube", "half"]
    assert float(rows["cube"]["iou"]) == pytest.approx(1.0)
    assert float(rows["half"]["iou"]) == pytest.approx(0.5)
    assert float(rows["half"]["hausdorff"]) == pytest.approx(0.5 / 6**0.5, rel=1e-3)
    assert float(rows["half"]["search_s"]) == 2.5
    assert (rows["half"]["primitives"], rows["half"]["reference"]) == ("1", "1")
    assert (rows["bad"]["iou"], rows["bad"]["primitives"]) == ("0.0", "")
    assert rows["bad"]["stop"] == "FAILED, exit 1: bad.stl: 0 points"
    assert "bad.stl: 0 points" in (out / "bad" / "fit.log").read_text()
    settings = (out / "half" / "settings").read_text().split()
    assert {"evolution=false", "size_weight=0.01", "seed=3", "budget_s=60.0", "synthesis=true"} <= set(settings)
    said = capsys.readouterr().out
    for line in (
        "2 at a time, size_weight=0.01, evolution=false",
        "3 parts, 1 failed",
        "IoU >= 0.99: 1 of 3",
        "mean IoU 0.5",
        "no more primitives than the reference: 2 of 3",
    ):
        assert line in said
    assert "IoU >= 0.99 and no more primitives than the reference: 1 of 3 (33 %)" in said
    assert (out / "table.md").read_text() in said


@pytest.mark.skipif(sys.platform != "linux", reason="children's seconds are summed as Linux does")
def test_seconds_are_of_the_processor_where_that_is_the_clock(make, tmp_path, stand_in, scorer):
    for clock in ("wall", "processor"):
        out = tmp_path / clock
        given = ["--out", str(out), "--scorer", str(scorer), "--clock", clock]
        assert benchmark.main([str(make(cube=1)), *given], stand_in(1.0)) == 0  # it sleeps for a second
        assert (float(table(out)["cube"]["seconds"]) < 0.9) == (clock == "processor")


def test_a_budget_is_told_by_the_processor_where_that_is_the_clock():
    given = [sys.executable, SCRIPTS / "processor.py", "fit", "--help"]
    told = "import time; time.sleep(0.5); from processor import rule_the_clock; rule_the_clock(); print(time.perf_counter())"
    assert float(subprocess.run([sys.executable, "-c", told], cwd=SCRIPTS, capture_output=True, check=True).stdout) < 0.4
    assert b"imdim fit" in subprocess.run(given, capture_output=True, check=True).stdout


SPUN = r"""
import subprocess, sys, time
sys.path.insert(0, sys.argv[1])
from processor import rule_the_clock
rule_the_clock()
spin = "import time\nwhile time.process_time() < 0.6: pass\nprint(flush=True)\ntime.sleep(0.5)"
child = subprocess.Popen([sys.executable, "-c", spin], stdout=subprocess.PIPE)
child.stdout.readline()
time.sleep(0.1)
running = time.perf_counter()
child.wait()
time.sleep(0.1)
print(running, time.perf_counter())
"""


@pytest.mark.skipif(sys.platform != "linux", reason="children's seconds are summed as Linux does")
def test_the_clock_counts_what_other_processes_of_the_fit_have(tmp_path):
    """While one runs, and when it has ended; not what it waits."""
    script = tmp_path / "clock.py"
    script.write_text(SPUN)
    done = subprocess.run([sys.executable, str(script), str(SCRIPTS)], capture_output=True, text=True, check=True)
    running, ended = map(float, done.stdout.split())
    assert 0.6 <= running <= ended < running + 0.3


def test_a_part_is_fitted_and_scored(make, tmp_path):
    out = tmp_path / "out"
    assert benchmark.main([str(make(plate=0.2)), "--out", str(out), "--budget", "20", "--set", "checkpoint=none", "--sheet"]) == 0
    row = table(out)["plate"]
    assert (row["primitives"], row["stop"]) == ("1", "finished")
    assert float(row["iou"]) == pytest.approx(1.0, abs=1e-6)
    assert 0 < float(row["search_s"]) < float(row["seconds"])
    assert json.loads((out / "plate" / "program.json").read_text())["program"]["kind"] == "box"
    assert (out / "sheet.png").stat().st_size > 1000


def test_each_stubborn_part_is_its_own_row(make, tmp_path, stand_in, scorer):
    parts, out = make(**dict.fromkeys(("a", "crash", "hang", "blowup", "large", "silent", "nonsense"), 1.0)), tmp_path / "out"
    given = ["--jobs", "2", "--limit", "4", "--memory", "300", "--scorer", str(scorer), "--out", str(out)]
    assert benchmark.main([str(parts), *given], stand_in()) == 0
    rows = table(out)
    assert {name: row["stop"] for name, row in rows.items() if name not in ("silent", "nonsense")} == {
        "a": "finished",
        "crash": "FAILED, ended by signal SIGABRT",
        "hang": "FAILED, took more than 4 s and was ended",
        "blowup": "FAILED, took more than 300 MiB of memory and was ended",
        "large": "finished",
    }
    assert all(rows[name]["stop"].startswith("FAILED, not scored: ") for name in ("silent", "nonsense"))
    assert 150 < float(rows["large"]["peak_mib"]) < 230  # of the process and its children
    assert 4 <= float(rows["hang"]["seconds"]) < 30
    assert not (out / ".running").exists()


def test_a_scorer_that_breaks_the_job_is_a_row_too(make, tmp_path, stand_in, monkeypatch):
    job = tmp_path / "job.py"
    job.write_text("import os, sys\nif 'bad' in sys.argv[2]:\n    os.abort()\n")
    monkeypatch.setattr(benchmark, "JOB", (sys.executable, str(job)))
    assert benchmark.main([str(make(bad=1, cube=1)), "--out", str(tmp_path / "out")], stand_in()) == 0
    assert [row["stop"] for row in table(tmp_path / "out").values()] == ["FAILED, ended by signal SIGABRT", "FAILED, no readable row.json"]


def test_a_job_needs_nothing_of_this_folder_but_the_checkout(make, tmp_path, stand_in, scorer):
    (part,) = benchmark.find_parts(make(cube=1), set(), set())
    task = Task("cloud", str(scorer), stand_in(), 20.0, 1000.0)
    job = benchmark._job(part, tmp_path / "out", task, ProcessLimits(60.0), Settings())
    ended, files = run_shipped(replace(job, staging=Path(), part=replace(part, source=Path("cube.stl"))), part.source.read_bytes())
    assert ended.why == ""
    assert {"fit.log", "parts/cube/row.json", "parts/cube/cube.npy", "parts/cube/program.scad"} <= files.keys()
    assert json.loads(files["parts/cube/row.json"])["iou"] == 0.75


def test_a_part_is_sampled_by_its_condition_alone(make, tmp_path):
    part = make(cube=1) / "cube.stl"
    clouds = [np.load(sample(part, "noise=1%", tmp_path / f"{i}.npy")) for i in range(2)]
    assert clouds[0].shape == (8192, 3)
    assert (clouds[0] == clouds[1]).all()
    assert sample(part, "mesh", tmp_path / "x.npy") == part
    cloud = tmp_path / "cloud.xyz"
    np.savetxt(cloud, clouds[0])
    with pytest.raises(ValueError, match="a cloud cannot be sampled"):
        sample(cloud, "cloud", tmp_path / "x.npy")


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_a_benchmark_that_is_stopped_continues(make, tmp_path, stand_in, scorer, how, capsys):
    arguments = [str(make(p1=1, p2=2, p3=1)), "--out", str(tmp_path / "out"), "--scorer", str(scorer)]
    code = f"import sys; sys.path.insert(0, {str(SCRIPTS)!r}); import benchmark; benchmark.CODE = ()\n"
    code += f"sys.exit(benchmark.main({arguments!r}, {stand_in(0.5)!r}))"
    process = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    wait_for(lambda: (tmp_path / "out" / "p1" / "outcome.json").exists() and "start p2" in log(tmp_path))
    process.send_signal(how)
    _, error = process.communicate(timeout=20)
    if how == signal.SIGTERM:
        assert (process.returncode, error) == (130, "benchmark: stopped; the same command continues\n")
    before = log(tmp_path)
    time.sleep(0.7)
    assert log(tmp_path) == before  # the fit that ran has ended with the benchmark
    assert benchmark.main(arguments, stand_in(0.5)) == 0
    assert "1 of 3 parts are done already" in capsys.readouterr().err
    assert log(tmp_path)[len(before) :] == ["start p2", "end p2", "start p3", "end p3"]  # nothing lost, nothing done twice
    assert [row["stop"] for row in table(tmp_path / "out").values()] == ["finished"] * 3


def test_what_has_changed_is_done_again_or_refused(make, tmp_path, stand_in, scorer, capsys, monkeypatch):
    parts = make(a=1, bad=1)
    arguments = [str(parts), "--scorer", str(scorer), "--out", str(tmp_path / "out")]
    assert benchmark.main([*arguments, "--only", "a"], stand_in()) == 0
    assert benchmark.main(arguments, stand_in()) == 0
    assert benchmark.main([*arguments, "--again"], stand_in()) == 0
    assert log(tmp_path) == ["start a", "end a", "start bad", "start bad"]
    make(a=2)
    assert benchmark.main(arguments, stand_in()) == 0
    assert log(tmp_path)[4:] == ["start a", "end a"]
    assert float(table(tmp_path / "out")["a"]["iou"]) == 0.75
    (tmp_path / "out" / "a" / "row.json").write_text('{"part":')
    assert benchmark.main(arguments, stand_in()) == 0
    assert log(tmp_path)[6:] == ["start a", "end a"]
    capsys.readouterr()
    monkeypatch.setattr(benchmark, "CODE", ((tmp_path, "*.py"),))
    assert benchmark.main(arguments, stand_in()) == 2
    assert "code=" in capsys.readouterr().err
    monkeypatch.setattr(benchmark, "CODE", ())
    for wrong, said in ((["--seed", "1"], "seed=0 then, seed=1 now"), (["--condition", "cloud"], "condition=mesh then"), ([], "scorer=")):
        if not wrong:
            scorer.write_text("another")
        assert benchmark.main([*arguments, *wrong], stand_in()) == 2
        error = capsys.readouterr().err
        assert said in error
        assert error.count("\n") == 1
    assert len(log(tmp_path)) == 8


def test_an_independent_scorer_is_asked(tmp_path, scorer):
    (tmp_path / "x.scad").write_text("cube();")
    assert score(tmp_path / "cube.stl", tmp_path / "x.scad", scorer) == (0.75, 0.02, 3, None)


def test_features_and_curves_are_shown_where_the_scorer_counts_them(make, tmp_path, stand_in, scorer, capsys):
    scorer.write_text(scorer.read_text().replace('"iou": 0.75', '"iou": 0.995, "curves": 45'))
    out = tmp_path / "out"
    assert benchmark.main([str(make(bad=1, cube=1)), "--out", str(out), "--scorer", str(scorer)], stand_in()) == 0
    said = capsys.readouterr().out
    assert "  3 features, 45 curves  " in said
    assert "| part | IoU | Hausdorff / diagonal | features | curves | reference |" in said
    assert "| cube | 0.9950 | 0.0200 | 3 | 45 |  |" in said
    assert "| bad | 0.0000 | inf |  |  |  |" in said
    assert "- IoU >= 0.99 with at most 12 features: 1 of 2 (50 %)" in said
    assert table(out)["cube"]["curves"] == "45"


def test_few_features_are_twelve_and_only_counted_beside_curves():
    rows = [Row(str(n), iou=0.995, primitives=n, curves=n) for n in (11, 12, 13)] + [Row("poor", iou=0.98, primitives=1, curves=4)]
    assert "IoU >= 0.99 with at most 12 features: 2 of 4 (50 %)" in summary(rows, 60.0)
    assert "median features: 11.5, without copies not told" in summary(rows, 60.0)
    assert "median features: 11.5, without copies 1.5" in summary([replace(row, distinct=k) for k, row in enumerate(rows)], 60.0)
    assert not [line for line in summary([replace(row, curves=None) for row in rows], 60.0) if "features" in line]
    assert "features" not in markdown([Row("plain", primitives=3)])


def test_edges_are_features_and_the_mesh_has_them():
    plain = Row("plain", iou=0.999, primitives=3, curves=9, features=3, whole_iou=0.999)
    bevelled = Row("bevelled", iou=0.98, primitives=11, curves=20, features=11, edges=1, whole_iou=0.996)
    drawn = Row("drawn", iou=0.996, primitives=30, curves=90, features=11, edges=2, whole_iou=0.996)
    said = summary([plain, bevelled, drawn, Row("failed", stop="FAILED")], 60.0)
    few = "with at most 12 features, those of edges among them"
    assert f"with all edges, IoU >= 0.995: 3 of 4 (75 %), {few}: 2 of 4 (50 %)" in said
    assert "| bevelled | 0.9800 | inf | 11 | 20 | 1 | 0.9960 |  |" in markdown([plain, bevelled])
    assert "edge" not in markdown([plain]) + "".join(summary([plain], 60.0))


def test_parts_without_a_step_file_are_told():
    rows = [Row("solid", step=True), Row("late"), Row("failed", stop="FAILED")]
    assert "without STEP: 2" in summary(rows, 60.0)
    assert [line.split(" | ")[-2] for line in markdown(rows).splitlines()[2:]] == ["yes", "no", "no"]


def test_this_projects_own_scorer_counts_the_curves_of_outlines(tmp_path):
    to_trimesh(to_manifold(BORED, 96)).export(tmp_path / "part.stl")
    (tmp_path / "program.scad").write_text(to_openscad(BORED))
    judged = score(tmp_path / "part.stl", tmp_path / "program.scad", None)
    assert judged.iou == pytest.approx(1, abs=1e-3)
    assert (judged.primitives, judged.curves) == (2, 10)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["--only", "nothing"], "no part named nothing"),
        (["--skip", "cube"], "no part is left"),
        (["--condition", "clod"], "clod"),
        (["--set", "budgets=3"], "did you mean budget_s?"),
        (["--scorer", "nowhere.py"], "nowhere.py: No such file"),
        (["--jobs", "0"], "positive"),
    ],
)
def test_what_cannot_be_done_is_one_line(make, tmp_path, stand_in, capsys, given, said):
    assert benchmark.main([str(make(cube=1)), "--out", str(tmp_path / "out"), *given], stand_in()) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert log(tmp_path) == []


def test_reference_rivals_are_those_with_an_iou():
    better = Row("a", iou=0.98, primitives=9, reference=10, reference_iou=0.97)
    longer = Row("b", iou=0.99, primitives=50, reference=50, reference_iou=0.97)
    failed = Row("c", reference=10, reference_iou=0.9, stop="FAILED")
    lines = summary([better, longer, failed], 60.0)
    assert "IoU at least the reference's and fewer primitives: 1 of 3 (33 %)" in lines
    assert "IoU at least the reference's and fewer primitives, among those of at most 30 reference primitives: 1 of 2 (50 %)" in lines


def test_conditions_are_read():
    assert parse_condition("mesh") is None
    assert parse_condition("cloud+normals") == Condition(normals=True)
    assert parse_condition("noise=0.5%+outliers=2%+views=3") == Condition(noise=0.005, outliers=0.02, views=3)
    assert parse_condition("views=3+scanners") == Condition(views=3, scanners=True)
    assert parse_condition("views=12+points=20000") == Condition(views=12, points=20000)
    for wrong in ("clod", "noise", "views=13", "normals=1", "scanners", "points=0"):
        with pytest.raises(ValueError, match=wrong.split("=")[0]):
            parse_condition(wrong)


def test_a_scan_has_the_noise_and_the_outliers_that_were_asked_for():
    mesh = target_from(trimesh.creation.box((3.0, 4.0, 12.0))).mesh
    rng = np.random.default_rng(0)
    points, _ = scan(mesh, Condition(noise=0.005), rng)
    # the nearest face's distance is one component of the noise: a half-normal with mean sigma sqrt(2 / pi), sigma 0.005 * 13
    gap = np.abs(np.abs(points) - [1.5, 2, 6]).min(axis=1)
    assert gap.mean() == pytest.approx(0.065 * (2 / np.pi) ** 0.5, rel=0.05)
    points, normals = scan(mesh, Condition(normals=True, outliers=0.1), rng)
    off = np.abs(np.abs(points) - [1.5, 2, 6]).min(axis=1) > 1e-6
    assert off.mean() == pytest.approx(0.1, abs=0.005)
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1)


def test_one_view_sees_three_faces_of_a_box_and_not_into_a_blind_side():
    mesh = target_from(trimesh.creation.box()).mesh
    points, _ = scan(mesh, Condition(views=1), np.random.default_rng(0))
    assert len(points) == 8192
    assert points.max(axis=1) == pytest.approx(0.5)
    assert points.min() > -0.5


def test_twelve_views_see_all_faces_of_a_box_with_as_many_points_as_are_asked_for():
    mesh = trimesh.creation.box((1, 1, 1))
    points, _ = scan(mesh, Condition(views=12, points=3000), np.random.default_rng(0))
    assert len(points) == 3000
    for axis in range(3):
        assert {-0.5, 0.5} <= set(np.unique(points[:, axis].round(9)))


def test_a_cloud_of_views_says_where_it_was_seen_from(tmp_path):
    trimesh.creation.box((3.0, 4.0, 12.0)).export(tmp_path / "part.stl")
    target = load_target(sample(tmp_path / "part.stl", "views=2+scanners", tmp_path / "part.npy"))
    assert target.scanners is not None
    assert target.scanners.shape == (2, 3)
    # far off, and above what it shows
    assert (target.scanners[0] > 1000).all()
    assert target.points[:, 2].max() == pytest.approx(6.0)
