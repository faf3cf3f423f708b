"""Blends of OpenCASCADE in STEP files: their faces by type, and volumes against closed forms."""

import math
import re
import subprocess
import sys
import time
from collections import Counter

import pytest
from scipy.integrate import quad

from imdim.export import step_blends, step_worker
from imdim.export.step import read_step, step_volume, write_step
from imdim.export.step_booleans import solids_in
from imdim.geometry.edge_solids import solid_with_edges
from imdim.program.codec import dumps
from imdim.program.edges import EdgeFeature, Face
from imdim.program.outline import Outline, circle
from imdim.program.tree import Combine, Primitive, Program

pytest.importorskip("OCP", reason="the extra [step] is not installed")

BOX = Primitive("box", (10.0, 20.0, 30.0))
RIM = tuple((Face(0, "+z"), Face(0, side)) for side in ("+x", "-x", "+y", "-y"))
UPRIGHT = tuple((Face(0, x), Face(0, y)) for x in ("+x", "-x") for y in ("+y", "-y"))
BEND = math.tan(math.pi / 8)  # a quarter of a turn
CORNERS = ((-8, -10, 0), (8, -10, BEND), (10, -8, 0), (10, 8, BEND), (8, 10, 0), (-8, 10, BEND), (-10, 8, 0), (-10, -8, BEND))
PLATE = Primitive("extrude", (5.0,), outline=Outline((tuple((float(x), float(y), float(b)) for x, y, b in CORNERS),)))
DISC = Primitive("extrude", (4.0,), outline=Outline((circle(5.0),)))
BOSSED = Combine("union", Primitive("box", (40.0, 40.0, 5.0)), Primitive("cylinder", (8.0, 12.0), (0.0, 0.0, 8.0)))
DRILLED = Combine("difference", Primitive("box", (40.0, 40.0, 5.0)), Primitive("cylinder", (5.0, 7.0)))
MOUTH = ((Face(0, "+z"), Face(1, "side")),)


def rim(curves: int) -> tuple[tuple[Face, Face], ...]:
    return tuple((Face(0, "+z"), Face(0, f"wall[0][{k}]")) for k in range(curves))


def fillet(radius: float, edges: tuple[tuple[Face, Face], ...]) -> EdgeFeature:
    return EdgeFeature("fillet", (radius,), edges)


def chamfer(sizes: tuple[float, ...], edges: tuple[tuple[Face, Face], ...]) -> EdgeFeature:
    return EdgeFeature("chamfer", sizes, edges)


def inset(t: float, radius: float) -> float:
    """By how much a rounded rim stands back, `t` below its face."""
    return radius - math.sqrt(radius**2 - (radius - t) ** 2)


def box_area(d: float) -> float:
    return (10 - 2 * d) * (20 - 2 * d)


def plate_area(d: float) -> float:
    return (20 - 2 * d) ** 2 - (4 - math.pi) * (2 - d) ** 2


def upright_area(d: float) -> float:
    return box_area(d) - (4 - math.pi) * (2 - d) ** 2


CASES: dict[str, tuple[Program, list[EdgeFeature], float, dict[str, int]]] = {
    "filleted edge": (BOX, [fillet(2.0, RIM[:1])], 6000 - 20 * (4 - math.pi), {"PLANE": 6, "CYLINDRICAL_SURFACE": 1}),
    "filleted rim": (
        BOX,
        [fillet(2.0, RIM)],
        28 * 200 + quad(lambda t: box_area(inset(t, 2.0)), 0, 2)[0],
        {"PLANE": 6, "CYLINDRICAL_SURFACE": 4},
    ),
    "chamfers of two distances": (
        BOX,
        [chamfer((1.0, 3.0), RIM)],
        27 * 200 + quad(lambda t: box_area(1 - t / 3), 0, 3)[0],
        {"PLANE": 10},
    ),
    "chamfered plate of round corners": (
        PLATE,
        [chamfer((1.0,), rim(8))],
        4 * plate_area(0) + quad(lambda t: plate_area(1 - t), 0, 1)[0],
        {"PLANE": 10, "CYLINDRICAL_SURFACE": 4, "CONICAL_SURFACE": 4},
    ),
    "filleted plate of round corners": (
        PLATE,
        [fillet(1.0, rim(8))],
        4 * plate_area(0) + quad(lambda t: plate_area(inset(t, 1.0)), 0, 1)[0],
        {"PLANE": 6, "CYLINDRICAL_SURFACE": 8, "TOROIDAL_SURFACE": 4},
    ),
    "two halves of a rim": (
        DISC,
        [chamfer((1.0,), rim(2))],
        math.pi * (75 + (25 + 16 + 20) / 3),
        {"PLANE": 2, "CYLINDRICAL_SURFACE": 1, "CONICAL_SURFACE": 1},
    ),
    "foot of a boss": (
        BOSSED,
        [fillet(2.0, MOUTH)],
        8000 + 64 * math.pi * 11.5 + 2 * math.pi * quad(lambda x: (8 + x) * inset(x, 2.0), 0, 2)[0],
        {"PLANE": 7, "CYLINDRICAL_SURFACE": 1, "TOROIDAL_SURFACE": 1},
    ),
    "mouth of a hole, deeper than wide": (
        DRILLED,
        [chamfer((1.0, 2.0), MOUTH)],
        8000 - 75 * math.pi - math.pi * 2 / 3 * (25 + 36 + 30),
        {"PLANE": 6, "CYLINDRICAL_SURFACE": 1, "CONICAL_SURFACE": 1},
    ),
    # which goes on round the corners, as a modeller's would
    "a rim over filleted corners": (
        BOX,
        [fillet(2.0, UPRIGHT), chamfer((0.5,), RIM)],
        29.5 * upright_area(0) + quad(lambda t: upright_area(0.5 - t), 0, 0.5)[0],
        {"PLANE": 10, "CYLINDRICAL_SURFACE": 4, "CONICAL_SURFACE": 4},
    ),
    # here they leave room for no arc
    "corners below a wide rim": (
        BOX,
        [fillet(1.0, UPRIGHT), chamfer((2.0,), RIM)],
        math.nan,
        {"PLANE": 10, "CYLINDRICAL_SURFACE": 4},
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_blends_are_analytic_faces_of_one_solid(name, tmp_path):
    program, edges, exact, kinds = CASES[name]
    path = tmp_path / "part.step"
    assert not write_step(program, path, edges).sharp
    assert Counter(re.findall(r"= (PLANE|\w+_SURFACE\w*)\(", path.read_text())) == kinds
    assert solids_in(read_step(path)) == 1
    if not math.isnan(exact):
        assert step_volume(path) == pytest.approx(exact, rel=1e-6)
    assert step_volume(path) == pytest.approx(solid_with_edges(program, edges).volume(), rel=1e-3)
    assert [p.name for p in tmp_path.iterdir()] == ["part.step"]


def test_a_blend_that_cannot_be_is_listed_and_the_rest_is_valid(tmp_path):
    path = tmp_path / "part.step"
    too_large = write_step(BOX, path, [fillet(2.0, RIM[:1]), fillet(25.0, RIM[1:2])])
    assert too_large.edges == ((0, 0), (1, 0))
    assert too_large.sharp == ((1, 0),)
    assert step_volume(path) == pytest.approx(6000 - 20 * (4 - math.pi), rel=1e-9)
    assert solids_in(read_step(path)) == 1


def test_edges_of_a_feature_are_tried_one_by_one(tmp_path):
    """A fillet of the edge of a plate is lost where the plate is too thin for it, and the others stay."""
    thin = Primitive("box", (30.0, 20.0, 1.0), (20.0, 0.0, -14.5))
    edges = (*RIM[1:2], (Face(1, "+z"), Face(1, "+x")), *RIM[2:3])
    blending = write_step(Combine("union", BOX, thin), tmp_path / "part.step", [fillet(2.0, edges)])
    assert blending.sharp == ((0, 1),)
    # two edges that meet, 20 and 10 long: the arcs' corner is theirs once
    lost = quad(lambda t: 200 - (10 - inset(t, 2.0)) * (20 - inset(t, 2.0)), 0, 2)[0]
    assert step_volume(tmp_path / "part.step") == pytest.approx(6000 + 30 * 20 - lost, rel=1e-6)


def test_what_opencascade_adds_of_its_own_is_refused(tmp_path):
    """It goes on round a rim whose edges are tangent, where but one of them was asked for."""
    blending = write_step(PLATE, tmp_path / "part.step", [chamfer((1.0,), rim(1))])
    assert blending.sharp == blending.edges == ((0, 0),)
    assert step_volume(tmp_path / "part.step") == pytest.approx(5 * plate_area(0), rel=1e-9)


def test_an_edge_that_is_none_is_not_counted(tmp_path):
    apart = ((Face(0, "+z"), Face(0, "-z")),)
    assert write_step(BOX, tmp_path / "part.step", [chamfer((1.0,), (*apart, *RIM[:1]))]).edges == ((0, 1),)


def test_a_file_without_edges_is_as_it_was(tmp_path):
    write_step(BOSSED, tmp_path / "none.step", [])
    write_step(BOSSED, tmp_path / "sharp.step")
    assert (tmp_path / "none.step").read_bytes() == (tmp_path / "sharp.step").read_bytes()
    for n in range(2):
        write_step(BOSSED, tmp_path / f"{n}.step", [fillet(2.0, MOUTH)])
    assert (tmp_path / "0.step").read_bytes() == (tmp_path / "1.step").read_bytes()


def test_time_that_is_up_leaves_edges_sharp(tmp_path, monkeypatch):
    monkeypatch.setattr(step_blends, "PATIENCE_S", -1.0)
    assert write_step(BOX, tmp_path / "part.step", [fillet(2.0, RIM)]).sharp == ((0, 0), (0, 1), (0, 2), (0, 3))
    assert step_volume(tmp_path / "part.step") == pytest.approx(6000, rel=1e-9)


# --- in a process of its own


def test_the_worker_reads_edges_and_says_which_are_sharp(tmp_path):
    (tmp_path / "program.json").write_text(dumps(BOX, edges=[fillet(2.0, RIM[:1]), fillet(25.0, RIM[1:2])]))
    volumes: dict[str, float] = {}
    with step_worker.exporting(tmp_path) as job:
        said = step_worker.finish_or_skip_step(job, 60, volumes)
    assert said == {"program.step": "written, 1 of 2 edges not blended"}
    assert volumes["program.step"] == pytest.approx(6000 - 20 * (4 - math.pi), rel=1e-9)
    (tmp_path / "program.json").write_text(dumps(BOX, edges=[fillet(2.0, RIM[:1])]))
    with step_worker.exporting(tmp_path) as job:
        assert step_worker.finish_or_skip_step(job, 60, volumes) == {}


def stand_in(folder, after: str) -> step_worker.StepJob:
    """A worker that has written the sharp part, of volume 6000 and two edges, and then does something else."""
    text = f"import os, time; open('program.step', 'w'); open('program.step.blended', 'w'); print('6000.0 2 2', flush=True); {after}"
    process = subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder)
    return step_worker.StepJob(process, folder / "program.step")


@pytest.mark.parametrize(
    ("after", "reason"), [("os.abort()", "OpenCASCADE ended with status -6"), ("time.sleep(60)", "OpenCASCADE took more than 2 s")]
)
def test_the_sharp_part_stays_where_opencascade_is_lost_in_blends(after, reason, tmp_path):
    volumes: dict[str, float] = {}
    said = step_worker.finish_or_skip_step(stand_in(tmp_path, after), 2, volumes)
    assert said == {"program.step": f"written, 2 of 2 edges not blended: {reason}"}
    assert volumes == {"program.step": 6000}
    assert [path.name for path in tmp_path.iterdir()] == ["program.step"]


def test_an_export_that_is_stopped_leaves_nothing(tmp_path):
    job = stand_in(tmp_path, "time.sleep(60)")
    while not (tmp_path / "program.step.blended").exists():
        time.sleep(0.01)
    step_worker.stop_step(job)
    assert not list(tmp_path.iterdir())
    assert job.process.returncode is not None
