import base64
import itertools
import json
import time

import numpy as np
import pytest
import trimesh
from PIL import Image
from tests.deadlines import PASSED
from tests.export.coincident import MEANT
from tests.known_programs import KNOWN
from tests.planted import box, cut, cylinder, mesh_of

from imdim.app.fit import summary
from imdim.deadline import NEVER, Deadline
from imdim.delivery import deliver as module
from imdim.delivery import finish as finishing
from imdim.delivery.deliver import OutputError, RunRecord, deliver, finish_flat
from imdim.delivery.finish import finish
from imdim.export import step_worker
from imdim.export.folder import FILES
from imdim.export.numbers import round_program
from imdim.export.preview import GAP, HEADER, PANEL
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.install import install_command
from imdim.program.codec import constraints_of, from_json, loads, parse
from imdim.program.outline import Outline, circle
from imdim.program.tree import Primitive, combine_all, leaves
from imdim.relations.discover import exact_relations
from imdim.relations.residuals import verify
from imdim.target.target import target_from

PROGRAM, EXACT, _ = MEANT["bracket"]
RUN = RunRecord("parts/bracket.stl", {"load": 0.5, "search": 2.25}, "tolerance met", 7, {"budget_s": 60.0})


@pytest.fixture(scope="module")
def target():
    return target_from(to_trimesh(to_manifold(PROGRAM, 200)))


@pytest.fixture(scope="module")
def delivered(target, tmp_path_factory):
    folder = tmp_path_factory.mktemp("results") / "bracket"
    return folder, deliver(PROGRAM, target, folder, RUN)


def test_the_holes_are_listed(delivered, tmp_path):
    """A bore through boss and plate, and a countersunk hole."""
    folder, report = delivered
    said = ["hole, diameter 6, through", "M8 clearance hole, diameter 10, through, countersink diameter 16, 90 degrees"]
    assert [group["says"] for group in report["holes"]] == said
    assert [(group["kind"], group["leaves"]) for group in report["holes"]] == [("through", [2]), ("countersink", [3, 4])]
    assert report["holes"][1]["diameters"] == [10, 16]
    assert f"  holes    {'; '.join(said)}\n" in summary(report, tmp_path)
    assert all(json.dumps(line) in (folder / "report.html").read_text() for line in said)


def test_the_folder_holds_every_file(delivered):
    folder, report = delivered
    missing = {name for name, state in report["files"].items() if state != "written"}
    assert missing <= {"program.step", "program.loops.scad"}
    written = set(FILES) - missing - {"edit.png"}  # which only an edit writes
    assert {path.name for path in folder.iterdir()} == written
    assert all((folder / name).stat().st_size > 100 for name in written)
    assert loads((folder / "program.json").read_text()) == finish_flat(PROGRAM)


@pytest.mark.usefixtures("without_step")
def test_late_results_are_the_program_as_it_was_found(target, tmp_path):
    report = deliver(PROGRAM, target, tmp_path / "late", RUN, finish_by=PASSED)
    assert loads((tmp_path / "late" / "program.json").read_text()) == round_program(PROGRAM) != finish_flat(PROGRAM)
    assert report["found"]["iou_with_delivered"] == pytest.approx(1, abs=1e-6)


@pytest.mark.usefixtures("without_step")
def test_a_program_that_cannot_be_named_in_time_is_the_one_that_was_found(target, tmp_path, delivered):
    report = deliver(PROGRAM, target, tmp_path / "nameless", RUN, name_by=PASSED)
    assert loads((tmp_path / "nameless" / "program.json").read_text()) == round_program(PROGRAM)
    assert report["parameters"] == {}
    assert delivered[1]["parameters"]
    assert report["left_out"] == ["sizes have no names: no time was left for those of 7 primitives"]
    assert report["scores"]["volume_iou"] == pytest.approx(delivered[1]["scores"]["volume_iou"], abs=1e-6)


@pytest.mark.parametrize(("seconds", "is_hurried"), [(0.1, False), (3.0, True)])
def test_a_program_whose_solid_takes_long_is_not_named_past_its_time(seconds, is_hurried, monkeypatch):
    """Threads of screws in a program of 77 features: three seconds each time that its solid was made, a hundred for its names."""
    monkeypatch.setattr(finishing, "time_solid", lambda *_: seconds)
    pegs = [cylinder(1, 4, (10.0 * k, 0.0, 0.0)) for k in range(finishing.FEW + 1)]
    found = finish(combine_all("union", pegs), name_by=Deadline(10.0, lambda: 0.0))
    assert found.hurried == is_hurried
    assert bool(found.parameters.values) != is_hurried


@pytest.mark.usefixtures("without_step")
def test_a_late_picture_is_a_coarser_one(target, tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(module, "preview", lambda *given: asked.append(given[-1]) or Image.new("RGB", (1, 1)))
    deliver(PROGRAM, target, tmp_path / "late", RUN, draw_by=PASSED)
    deliver(PROGRAM, target, tmp_path / "in time", RUN)
    assert asked == [1, 2]


def test_a_program_of_thousands_is_finished_as_it_was_found():
    """What looks at pairs of 2,048 boxes took ten minutes of it and more."""
    corners = itertools.product(range(16), range(16), range(8))
    many = combine_all("union", [Primitive("box", (1.0, 1.0, 1.0), tuple(2.0 * c for c in corner)) for corner in corners])
    before = time.process_time()
    found = finish(many)
    assert time.process_time() - before < 20
    assert sorted(leaf.center for leaf in leaves(found.program)) == sorted(leaf.center for leaf in leaves(many))
    assert finish(PROGRAM).program != round_program(PROGRAM), "a short one is finished"


def test_the_report_says_what_was_measured(delivered):
    folder, report = delivered
    assert json.loads((folder / "report.json").read_text()) == report
    assert (report["input"], report["stop"], report["seed"], report["settings"]) == (RUN.input, RUN.stop, 7, {"budget_s": 60.0})
    assert report["result"] == {
        "primitives": 7,
        "operations": 6,
        "without_copies": 7,
        "kinds": {"box": 3, "cylinder": 3, "cone": 1},
        "ops": {"union": 1, "difference": 5},
    }
    assert 0.999 < report["scores"]["volume_iou"] < 1
    sagitta = 6 * (1 - 0.99946)  # of the boss, at 96 segments
    assert 0 < report["scores"]["distance"]["target_to_result"]["max"] < 2 * sagitta
    for name in ("program.scad", "mesh.stl"):
        assert report["volumes"][name] == pytest.approx(EXACT, rel=1e-3)
    if "program.step" in report["volumes"]:
        assert report["volumes"]["program.step"] == pytest.approx(EXACT, rel=1e-7)
    assert report["timing"]["stages_s"] == {"load": 0.5, "search": 2.25}
    assert set(report["versions"]) >= {"python", "imdim", "numpy", "manifold3d"}


def test_the_report_says_what_became_of_the_surface(delivered, tmp_path):
    folder, report = delivered
    verdict = report["verdict"]
    assert verdict["overall"] == "exact"
    assert verdict["shares"] == {"exact": 1, "approximated": 0, "left out": 0}
    assert verdict["regions"] == []
    assert f"  verdict  exact: {verdict['says']}\n" in summary(report, tmp_path)
    assert verdict["says"] in (folder / "report.html").read_text()
    with Image.open(folder / "preview.png") as picture:
        assert picture.width == 4 * (PANEL + GAP)


@pytest.mark.usefixtures("without_step")
def test_what_the_result_lacks_is_named(tmp_path):
    part = target_from(mesh_of(cut(box(60, 40, 6), cylinder(3, 20, (-22, 0, 0)), cylinder(8, 20, (15, 0, 0)))))
    report = deliver(box(60, 40, 6), part, tmp_path / "out", RUN)
    regions = report["verdict"]["regions"]
    assert {region["verdict"] for region in regions} == {"left out"}
    assert sum(region["share"] for region in regions) == pytest.approx(report["verdict"]["shares"]["left out"], abs=1e-3)
    said = summary(report, tmp_path / "out")
    assert "  verdict  approximated: " in said
    assert f" left out, {regions[0]['what']} {regions[0]['where']}; " in said
    pixels = np.asarray(Image.open(tmp_path / "out" / "preview.png").convert("RGB"), int)[HEADER:, 3 * (PANEL + GAP) :]
    assert ((pixels[..., 0] > 100) & (pixels[..., 1] < 60)).sum() > 1000  # crimson, of the key and of more
    data = json.loads((tmp_path / "out" / "report.html").read_text().split('id="data">')[1].split("</script>")[0])
    assert set(base64.b64decode(data["target"]["verdicts"])) == {0, 2}


def test_the_same_run_gives_the_same_bytes(delivered, target, tmp_path):
    folder, report = delivered
    again = deliver(PROGRAM, target, tmp_path / "again", RUN)
    for name in set(FILES) - {"report.json", "report.html"}:
        first, second = ((place / name) for place in (folder, tmp_path / "again"))
        assert first.exists() == second.exists()
        assert not first.exists() or first.read_bytes() == second.read_bytes(), name
    assert {**report, "timing": None} == {**again, "timing": None}


def test_no_step_is_reported_and_an_earlier_one_does_not_stay(delivered, target, tmp_path, monkeypatch):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "program.step").write_text("earlier")
    monkeypatch.setattr(step_worker, "find_spec", lambda name: None)
    report = deliver(PROGRAM, target, tmp_path / "out", RUN)
    assert report["files"]["program.step"] == f"skipped: no STEP without OpenCASCADE: {install_command('step')}"
    assert not (tmp_path / "out" / "program.step").exists()


def test_step_gets_the_time_that_is_left_when_all_else_is_written(target, tmp_path, monkeypatch):
    """A moment where that is none, and never more than its own limit."""
    waited: list[float] = []
    monkeypatch.setattr(module, "finish_or_skip_step", lambda job, by, *_: waited.append(by.left()) or {"program.step": "skipped: late"})
    for by in (PASSED, Deadline(7.0, lambda: 2.0), NEVER):
        deliver(PROGRAM, target, tmp_path / "out", RUN, step_by=by)
    assert waited == pytest.approx([module.LEAST_STEP_S, 5.0, module.STEP_LIMIT_S], abs=0.5)


@pytest.mark.usefixtures("without_step")
def test_a_failure_leaves_the_earlier_results(target, tmp_path, monkeypatch):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "report.json").write_text("earlier")

    def full(*_):
        raise OSError("No space left on device")

    monkeypatch.setattr(module, "write_meshes", full)
    with pytest.raises(OutputError, match=r"out cannot be written: No space left"):
        deliver(PROGRAM, target, tmp_path / "out", RUN)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert (tmp_path / "out" / "report.json").read_text() == "earlier"


def test_an_empty_program_is_not_delivered(target, tmp_path):
    with pytest.raises(ValueError, match="empty"):
        deliver(KNOWN["nothing"][0], target, tmp_path / "out", RUN)
    assert list(tmp_path.iterdir()) == []


def test_a_cloud_and_a_tiny_part(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=4, radius=2e-6)
    report = deliver(Primitive("sphere", (2e-6,)), target_from(ball.vertices), tmp_path / "out", RUN)
    assert report["scores"]["volume_iou"] is None
    assert report["scores"]["volume_iou_missing"] == "the target is a cloud"
    assert report["volumes"]["mesh.stl"] == pytest.approx(4 / 3 * 3.14159 * 8e-18, rel=4e-3)
    assert report["files"]["program.step"].startswith("skipped: ")


@pytest.mark.usefixtures("without_step")
def test_constraints_are_delivered_as_they_hold_for_the_delivered_numbers(tmp_path):
    """Holes that end flush with the plate overshoot; the file says by how much, and its names are those of the report."""
    part = cut(box(40, 30, 6), *(cylinder(3, 6, (x, 0.0, 0.0)) for x in (-12.0, 12.0)))
    found = exact_relations(part)
    folder = tmp_path / "out"
    report = deliver(found.program, target_from(to_trimesh(to_manifold(part))), folder, RUN, constraints=found.constraints)
    document = parse((folder / "program.json").read_text())
    constraints = constraints_of(document)
    verify(from_json(document), constraints)
    assert [c["name"] for c in report["constraints"]] == [c.name for c in constraints]
    assert any(c.kind == "coplanar" and c.value > 0 for c in constraints)
    assert report["parameters"]["hole_diameter"] == 6
    assert "hole_diameter = 6\n" in (folder / "program.py").read_text()
    assert report["scores"]["volume_iou"] > 0.999


@pytest.mark.usefixtures("without_step")
def test_the_report_tells_what_delivery_kept(delivered, target, tmp_path, monkeypatch):
    _, report = delivered
    assert report["found"]["volume_iou"] == pytest.approx(report["scores"]["volume_iou"], abs=1e-6)
    assert report["found"]["iou_with_delivered"] == pytest.approx(1, abs=1e-6)
    assert "differs" not in summary(report, tmp_path)
    half = finish(box(20, 30, 6))
    monkeypatch.setattr(module, "finish", lambda *_: half)
    report = deliver(box(40, 30, 6), target_from(to_trimesh(to_manifold(box(40, 30, 6)))), tmp_path / "out", RUN)
    assert report["found"] == {"volume_iou": 1, "iou_with_delivered": 0.5}
    assert "  delivered differs from found: IoU 0.5000\n" in summary(report, tmp_path)


@pytest.mark.usefixtures("without_step")
def test_what_is_not_looked_at_is_told(tmp_path, monkeypatch):
    """A sieve has more round walls than holes are looked for among."""
    for user in ("imdim.geometry.holes", "imdim.delivery.report"):
        monkeypatch.setattr(f"{user}.MOST_WALLS", 30)
    rectangle = ((-100.0, -100.0, 0.0), (100.0, -100.0, 0.0), (100.0, 100.0, 0.0), (-100.0, 100.0, 0.0))
    rings = [circle(2.0, 10.0 * i - 85, 10.0 * j - 85) for i in range(6) for j in range(6)]
    sieve = Primitive("extrude", (3.0,), outline=Outline((rectangle, *rings)))
    report = deliver(sieve, target_from(mesh_of(sieve, 8)), tmp_path / "out", RUN, 8)
    assert report["holes"] == []
    assert report["left_out"] == ["holes were not looked for: 36 round walls, more than 30"]
    assert "  holes were not looked for: 36 round walls, more than 30\n" in summary(report, tmp_path / "out")
