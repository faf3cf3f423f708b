"""Blends of OpenCASCADE in STEP files: their faces by type, and volumes against closed forms."""

import math
import re
import subprocess
import sys
import time
from collections import Counter

import pytest
from scipy.integrate import quad
from tests.export.blended import BOSSED, BOX, CASES, MOUTH, PLATE, RIM, chamfer, fillet, inset, rim

from imdim.deadline import NEVER
from imdim.export import step_blends, step_worker
from imdim.export.step import read_step, step_volume, write_step
from imdim.export.step_booleans import solids_in
from imdim.geometry.edge_solids import solid_with_edges
from imdim.program.codec import dumps
from imdim.program.edges import Face
from imdim.program.tree import Combine, Primitive

pytest.importorskip("OCP", reason="the extra [step] is not installed")


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


def test_what_is_left_of_an_edge_is_swept_where_opencascade_blends_some_of_it(tmp_path):
    """Flats cut the rims of a pin in two, and of each OpenCASCADE blends one half."""
    pin = Combine("intersection", Primitive("cylinder", (6.72, 13.44)), Primitive("box", (16.2, 10.752, 13.64), (-1.28, 0.0, 0.0)))
    part = Combine("difference", pin, Primitive("cylinder", (4.4, 13.64)))
    edges = [chamfer((1.44,), tuple((Face(0, "side"), Face(0, end)) for end in ("-z", "+z")))]
    assert not write_step(part, tmp_path / "part.step", edges).sharp
    assert step_volume(tmp_path / "part.step") == pytest.approx(solid_with_edges(part, edges).volume(), rel=1e-3)


def test_edges_of_several_radii_meet_in_a_corner(tmp_path):
    """One after the other OpenCASCADE would go on round the first of them."""
    blending = write_step(BOX, tmp_path / "part.step", [fillet(2.0, RIM[:1]), fillet(6.0, RIM[2:3])])
    assert not blending.sharp
    left = quad(lambda t: (10 - (inset(t, 2.0) if t < 2 else 0)) * (20 - inset(t, 6.0)), 0, 6, points=[2])[0]
    assert step_volume(tmp_path / "part.step") == pytest.approx(24 * 200 + left, rel=1e-6)


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
    """It goes on round a rim whose edges are tangent, where but one of them was asked for: that one is swept."""
    one = [chamfer((1.0,), rim(1))]
    blending = write_step(PLATE, tmp_path / "part.step", one)
    assert not blending.sharp
    assert step_volume(tmp_path / "part.step") == pytest.approx(solid_with_edges(PLATE, one, 512).volume(), rel=1e-4)
    assert step_volume(tmp_path / "part.step") > solid_with_edges(PLATE, [chamfer((1.0,), rim(2))], 512).volume()


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
    edges = [fillet(2.0, RIM[:1]), fillet(25.0, RIM[1:2])]
    (tmp_path / "program.json").write_text(dumps(BOX, edges=edges))
    volumes: dict[str, float] = {}
    with step_worker.exporting(tmp_path) as job:
        said = step_worker.finish_or_skip_step(job, NEVER.ahead(60), volumes, edges)
    one, other = RIM[1]
    assert said == {"program.step": f"written, 1 of 2 edges not blended: fillet2: {one} with {other}"}
    assert volumes["program.step"] == pytest.approx(6000 - 20 * (4 - math.pi), rel=1e-9)
    (tmp_path / "program.json").write_text(dumps(BOX, edges=[fillet(2.0, RIM[:1])]))
    with step_worker.exporting(tmp_path) as job:
        assert step_worker.finish_or_skip_step(job, NEVER.ahead(60), volumes, []) == {}


def stand_in(folder, after: str) -> step_worker.StepJob:
    """A worker that has written the sharp part, of volume 6000 and two edges, and then does something else."""
    stage = [6000.0, 2, [[0, 0], [0, 1]]]
    text = f"import os, time; open('program.step', 'w'); open('program.step.blended', 'w'); print({stage}, flush=True); {after}"
    process = subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=folder)
    return step_worker.StepJob(process, folder / "program.step")


@pytest.mark.parametrize(
    ("after", "reason"), [("os.abort()", "OpenCASCADE ended with status -6"), ("time.sleep(60)", "OpenCASCADE took more than 2 s")]
)
def test_the_sharp_part_stays_where_opencascade_is_lost_in_blends(after, reason, tmp_path):
    volumes: dict[str, float] = {}
    said = step_worker.finish_or_skip_step(stand_in(tmp_path, after), NEVER.ahead(2), volumes, [fillet(2.0, RIM[:2])])
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
