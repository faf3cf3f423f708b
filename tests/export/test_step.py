import json
import math
import re
import subprocess
import sys
from collections import Counter
from functools import partial, reduce
from itertools import count

import pytest
from tests.export.blended import CASES
from tests.export.coincident import MEANT
from tests.known_programs import KNOWN

from imdim.deadline import NEVER, Deadline
from imdim.export import step, step_booleans, step_worker
from imdim.export.placed_edges import PlacedEdges
from imdim.export.step import StepError, read_step, shape_volume, step_volume, to_shape, write_stages, write_step
from imdim.export.step_booleans import ocp
from imdim.geometry.finish.overshoot import overshoot
from imdim.geometry.solid import volume
from imdim.program.codec import Meta, dumps
from imdim.program.edges import EdgeFeature, Face
from imdim.program.outline import Outline
from imdim.program.tree import Combine, Primitive, combine_all

pytest.importorskip("OCP", reason="the extra [step] is not installed")

PARTS = {**{n: known for n, known in KNOWN.items() if n != "nothing"}, **{n: meant[:2] for n, meant in MEANT.items()}}


def surface_kinds(path) -> dict[str, int]:
    """Surfaces by their STEP entity: one per face, since faces on the same surface were merged."""
    return dict(Counter(re.findall(r"= (PLANE|\w+_SURFACE\w*)\(", path.read_text())))


@pytest.mark.parametrize("name", PARTS)
def test_opencascade_rereads_the_exact_volume(name, tmp_path):
    program, exact = PARTS[name]
    write_step(overshoot(program), tmp_path / "part.step")
    assert step_volume(tmp_path / "part.step") == pytest.approx(exact, rel=1e-5)


def test_faces_are_analytic(tmp_path):
    write_step(overshoot(MEANT["bracket"][0]), tmp_path / "part.step")
    # boss, bore and hole; the plate's six faces, the boss's top, two of the notch, five of the pocket
    assert surface_kinds(tmp_path / "part.step") == {"PLANE": 6 + 1 + 2 + 5, "CYLINDRICAL_SURFACE": 3, "CONICAL_SURFACE": 1}


@pytest.mark.parametrize(("name", "kind"), [("sphere", "SPHERICAL_SURFACE"), ("torus", "TOROIDAL_SURFACE")])
def test_round_faces_are_analytic(name, kind, tmp_path):
    write_step(KNOWN[name][0], tmp_path / "part.step")
    assert surface_kinds(tmp_path / "part.step") == {kind: 1}


def test_step_is_in_millimetres_whatever_the_document_is_in(tmp_path):
    plate, boss = Primitive("box", (4.0, 4.0, 0.5)), Primitive("cylinder", (0.8, 1.2), (0.0, 0.0, 0.8))
    rim = EdgeFeature("chamfer", (0.1,), tuple((Face(0, "+z"), Face(0, side)) for side in ("+x", "-x", "+y", "-y")))
    for units in ("inch", "unspecified"):
        (tmp_path / f"{units}.json").write_text(dumps(Combine("union", plate, boss), Meta(units), edges=[rim]))
        job = step_worker.start_step(tmp_path / f"{units}.json", tmp_path / f"{units}.step")
        exported = step_worker.finish_step(job, NEVER.ahead(120.0))
        assert (exported.edges, exported.sharp) == (4, ())
    inches, plain = (step_volume(tmp_path / f"{units}.step") for units in ("inch", "unspecified"))
    assert inches == pytest.approx(25.4**3 * plain, rel=1e-6)


@pytest.mark.parametrize("name", ["core left standing", "bracket"])
def test_the_same_bytes_every_time(name, tmp_path):
    for number in range(2):
        write_step(PARTS[name][0], tmp_path / f"{number}.step")
    first, second = ((tmp_path / f"{number}.step").read_bytes() for number in range(2))
    assert first == second
    assert b"SI_UNIT(.MILLI.,.METRE.)" in first
    assert b"1970-01-01T00:00:00" in first


def test_what_opencascade_cannot_say_is_an_error(tmp_path):
    with pytest.raises(StepError, match="invalid or empty"):
        write_step(KNOWN["nothing"][0], tmp_path / "part.step")
    with pytest.raises(StepError, match="largest size is 1e-05"):
        write_step(Primitive("sphere", (1e-5,)), tmp_path / "part.step")
    (tmp_path / "part.step").write_text("no step")
    with pytest.raises(StepError, match="holds no STEP shape"):
        read_step(tmp_path / "part.step")


def test_a_process_of_its_own_gives_the_volume_or_the_reason(tmp_path, monkeypatch):
    program, exact = KNOWN["drilled block"]
    for name, part in (("good", program), ("empty", Combine("difference", program, program))):
        (tmp_path / f"{name}.json").write_text(dumps(part))
    good, empty = (step_worker.start_step(tmp_path / f"{name}.json", tmp_path / f"{name}.step") for name in ("good", "empty"))
    assert step_worker.finish_step(good, NEVER.ahead(60)).volume == pytest.approx(exact, rel=1e-9)
    with pytest.raises(StepError, match=r"^OpenCASCADE built an invalid or empty solid$"):
        step_worker.finish_step(empty, NEVER.ahead(60))
    slow = step_worker.start_step(tmp_path / "good.json", tmp_path / "slow.step")
    with pytest.raises(StepError, match="took more than 3 s"):
        step_worker.finish_step(slow, Deadline(3.0, partial(next, count(0.0))))  # by a clock of its own
    assert slow.process.returncode is not None
    assert sorted(path.name for path in tmp_path.glob("*.step")) == ["good.step"]


@pytest.mark.parametrize("blended", [False, True])
def test_the_worker_loads_no_compiled_kernels(blended, tmp_path):
    """Where edges lie is handed over."""
    features = [EdgeFeature("fillet", (0.05,), ((Face(0, "+x"), Face(0, "+y")), (Face(0, "+z"), Face(0, "+y"))))] if blended else []
    program = KNOWN["drilled block"][0]
    (tmp_path / "program.json").write_text(dumps(program, edges=features))
    placed = PlacedEdges.of(program, features).rows
    asked = json.dumps([str(tmp_path / "program.json"), str(tmp_path / "part.step"), "part", ["slab", "bore"], placed]).encode() + b"\n"
    command = [sys.executable, "-X", "importtime", "-m", step_worker.__name__]
    imports = tmp_path / "imports"  # a pipe that nobody empties would hold a worker up that loads much
    with imports.open("wb") as told, subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=told) as worker:
        assert worker.stdin is not None
        assert worker.stdout is not None
        worker.stdin.write(asked)
        worker.stdin.flush()
        assert [json.loads(worker.stdout.readline())[1:] for _ in range(1 + blended)][-1] == [2 if blended else 0, []]
        worker.communicate()
    loaded = {line.split("|")[-1].strip() for line in imports.read_text().splitlines()}
    assert "'slab'" in (tmp_path / "part.step").read_text()
    assert "OCP.OCP" in loaded
    assert not {"numba", "scipy", "trimesh"} & loaded


def test_edges_are_the_same_once_they_were_handed_over():
    program, features, *_ = CASES["filleted rim"]
    placed = PlacedEdges.of(program, features)
    again = PlacedEdges.from_rows(json.loads(json.dumps(placed.rows)))
    assert len(placed.edges) > 0
    assert again.rows == placed.rows
    assert [edge.points(3).tolist() for edge in again.edges] == [edge.points(3).tolist() for edge in placed.edges]


def test_the_process_ends_without_taking_opencascade_apart():
    code = "import atexit, runpy; atexit.register(print, 'apart'); runpy.run_module('imdim.export.step_worker', run_name='__main__')"
    done = subprocess.run([sys.executable, "-c", code], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_faces_have_the_names_that_are_handed_over(tmp_path):
    (tmp_path / "program.json").write_text(dumps(KNOWN["drilled block"][0]))
    handed, own = ["slab", "bore"], []
    for names, out in ((handed, "handed.step"), (own, "own.step")):
        step_worker.finish_step(step_worker.start_step(tmp_path / "program.json", tmp_path / out, "part", names), NEVER.ahead(120.0))
    text, plain = ((tmp_path / out).read_text() for out in ("handed.step", "own.step"))
    assert all(f"'{name}'" in text and f"'{name}'" not in plain for name in handed)


def test_a_worker_that_waits_writes_what_it_is_told_or_is_sent_home(tmp_path):
    program, exact = KNOWN["drilled block"]
    (tmp_path / "program.json").write_text(dumps(program))
    waiting, idle = step_worker.start_worker(), step_worker.start_worker()
    with step_worker.exporting(tmp_path, worker=waiting) as job:
        assert job.process is waiting.process
        volumes = {}
        assert step_worker.finish_or_skip_step(job, NEVER.ahead(60), volumes, []) == {}
    assert volumes["program.step"] == pytest.approx(exact, rel=1e-9)
    for worker in (waiting, idle):
        step_worker.stop_worker(worker)
        assert worker.process.poll() is not None
        assert worker.lifeline.closed


def test_an_export_ends_with_the_process_that_started_it(tmp_path):
    (tmp_path / "program.json").write_text(dumps(KNOWN["drilled block"][0]))
    job = step_worker.start_step(tmp_path / "program.json", tmp_path / "out.step")
    job.lifeline.close()  # as the system does when that process is killed
    assert job.process.wait(timeout=60) == 1
    step_worker.stop_step(job)
    assert not (tmp_path / "out.step").exists()


def test_an_export_that_ended_too_late_leaves_no_file_and_no_pipe(tmp_path, monkeypatch):
    """It ends between the moment at which its time is up and the one at which it is stopped."""
    (tmp_path / "part.json").write_text(dumps(KNOWN["drilled block"][0]))
    job = step_worker.start_step(tmp_path / "part.json", tmp_path / "part.step")
    job.process.wait(60)

    def late(timeout):
        raise subprocess.TimeoutExpired("step", timeout)

    monkeypatch.setattr(job.process, "communicate", late)
    assert job.out.exists()
    with pytest.raises(StepError, match="took more than 1 s"):
        step_worker.finish_step(job, NEVER.ahead(1))
    assert not job.out.exists()
    assert job.process.stdout.closed
    assert job.process.stderr.closed


def test_an_earlier_file_does_not_stand_for_a_shape_that_cannot_be_built(tmp_path, monkeypatch):
    path = tmp_path / "part.step"
    write_step(KNOWN["drilled block"][0], path)
    monkeypatch.setattr(step, "_write", lambda *_: None)  # whatever is read back is not valid
    with pytest.raises(StepError, match="not valid once it is read back"):
        write_step(KNOWN["drilled block"][0], path)
    assert not list(tmp_path.iterdir())


def test_the_first_file_stays_where_time_ends_the_look_for_a_better_one(tmp_path, monkeypatch):
    """A part of 36 features was in two solids after 18 s, and stopped after 30 without a file."""
    first, better = (to_shape(KNOWN["drilled block"][0]) for _ in range(2))

    def build(program, place, survives):
        for shape in (first, better):
            assert survives(shape)
            yield shape

    monkeypatch.setattr(step, "build", build)
    stages = write_stages(KNOWN["drilled block"][0], tmp_path / "part.step", PlacedEdges())
    told = next(stages)
    assert step_volume(tmp_path / "part.step") == pytest.approx(told.volume) == pytest.approx(KNOWN["drilled block"][1])
    assert [path.name for path in tmp_path.iterdir()] == ["part.step"]
    assert len(list(stages)) == 1
    (tmp_path / "part.json").write_text(dumps(KNOWN["drilled block"][0]))
    job = step_worker.start_step(tmp_path / "part.json", tmp_path / "part.step")

    def late(timeout):
        raise subprocess.TimeoutExpired("step", timeout, json.dumps([told.volume, 0, []]).encode() + b"\n[7")

    monkeypatch.setattr(job.process, "communicate", late)
    volumes: dict[str, float] = {}
    said = step_worker.finish_or_skip_step(job, NEVER.ahead(1), volumes, ())
    assert said == {"program.step": "written, the first valid one, perhaps in more solids: OpenCASCADE took more than 1 s"}
    assert volumes == {"program.step": told.volume}
    assert job.out.exists()


def test_without_opencascade_one_line_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setattr(step_worker, "find_spec", lambda name: None)
    with pytest.raises(StepError, match=r"pip install .*\[step\]"):
        step_worker.start_step(tmp_path / "program.json", tmp_path / "program.step")
    monkeypatch.setitem(sys.modules, "OCP", None)
    monkeypatch.setitem(sys.modules, "OCP.Message", None)
    with pytest.raises(StepError, match=r"pip install .*\[step\]"):
        write_step(KNOWN["drilled block"][0], tmp_path / "part.step")


def solids(path) -> int:
    return path.read_text().count("MANIFOLD_SOLID_BREP(")


def test_thin_skins_between_arcs_are_not_taken_for_wrong(tmp_path):
    """Few facets fall on a short arc of a large circle, so the polyhedron of a crescent lacks a percent and more of it."""
    chord, outer, inner = 30.0, 0.05, 0.047
    crescent = Outline((((0.0, 0.0, outer), (chord, 0.0, -inner)),))

    def segment(bulge: float) -> float:
        radius, angle = chord * (1 + bulge**2) / (4 * bulge), 4 * math.atan(bulge)
        return radius**2 * (angle - math.sin(angle)) / 2

    write_step(Primitive("extrude", (20.0,), outline=crescent), tmp_path / "part.step")
    assert step_volume(tmp_path / "part.step") == pytest.approx(20 * (segment(outer) - segment(inner)), rel=1e-5)
    assert surface_kinds(tmp_path / "part.step") == {"PLANE": 2, "CYLINDRICAL_SURFACE": 2}


def test_bodies_a_hair_apart_are_one_solid(tmp_path):
    gap = 1e-4  # of a part 100 long
    left, right = (Primitive("box", (50.0, 20.0, 10.0), (x, 0.0, 0.0)) for x in (-25.0 - gap / 2, 25.0 + gap / 2))
    write_step(Combine("union", left, right), tmp_path / "part.step")
    assert solids(tmp_path / "part.step") == 1
    assert step_volume(tmp_path / "part.step") == pytest.approx(20000, rel=1e-5)


def test_bodies_apart_stay_apart(tmp_path):
    left, right = (Primitive("box", (50.0, 20.0, 10.0), (x, 0.0, 0.0)) for x in (-25.005, 25.005))
    write_step(Combine("union", left, right), tmp_path / "part.step")
    assert solids(tmp_path / "part.step") == 2


@pytest.mark.parametrize(("others", "solids"), [(0, 1), (1, 2)])
def test_crumbs_are_no_solids(others, solids, tmp_path):
    """What booleans leave of faces that all but touch: here they are drawn, less than a ten-millionth of the part in all."""
    blocks = [Primitive("box", (10.0, 10.0, 10.0), (20.0 * i, 0.0, 0.0)) for i in range(1 + others)]
    crumbs = [Primitive("box", (0.02, 0.02, 0.02), (2.0 * i, 9.0, 0.0)) for i in range(3)]
    write_step(combine_all("union", [*blocks, *crumbs]), tmp_path / "part.step")
    assert step_booleans.solids_in(read_step(tmp_path / "part.step")) == solids
    assert step_volume(tmp_path / "part.step") == pytest.approx(1000.0 * (1 + others), rel=1e-9)


def test_what_opencascade_loses_at_near_coincident_edges_is_built_again(tmp_path):
    """Its union of these alone is an empty shape that it calls valid."""
    frame = Outline(
        (
            ((26.1999917, -10.4417035, 0.0), (18.2492006, 17.150064, 0.0), (-26.2000093, -10.4312059, 0.414213562)),
            ((-18.144497, -15.4499383, -0.414213562), (23.1999917, -10.4363935, -0.414213562), (18.182484, -15.4499383, 0.0)),
        )
    )
    window = Outline((((-7.4509106, 4.0971616, 0.0), (-4.999823, 6.4974438, 0.0), (-2.5490237, 4.0974438, 0.0)),))
    rib = Outline((((-17.8, -0.569, 0.0), (-14.8, -0.569, 0.0), (-14.8, 0.569, 0.0)),))
    part = Combine(
        "union",
        Combine(
            "intersection",
            Primitive("extrude", (30.0,), (29.4977927, 65.4419389, 20.57), outline=frame),
            Primitive("extrude", (41.096,), (29.0, 65.4419389, 20.57), (0.0, -90.0, -90.0), window),
        ),
        Primitive("extrude", (4.074,), (31.608, 64.792, 17.313), (45.0, 0.0, 90.0), rib),
    )
    write_step(part, tmp_path / "part.step")
    assert step_volume(tmp_path / "part.step") == pytest.approx(volume(part, 1024), rel=1e-4)


def test_a_solid_that_is_not_valid_once_read_back_is_not_left(tmp_path, monkeypatch):
    """Tolerances do not survive the file: what was valid before need not be so after."""

    class Spoilt:
        def __init__(self, shape):
            pass

        def IsValid(self):
            return False

    monkeypatch.setattr(step_booleans, "fits", lambda *_: True)
    monkeypatch.setattr(ocp("BRepCheck"), "BRepCheck_Analyzer", Spoilt)
    with pytest.raises(StepError, match="not valid once it is read back"):
        write_step(Primitive("box", (1.0, 2.0, 3.0)), tmp_path / "part.step")
    assert not (tmp_path / "part.step").exists()


def bowed_strip() -> Outline:
    """Straight above, an arc of ten degrees below: two or three chords of it leave a tenth of the strip out."""
    return Outline((((-100.0, 0.0, math.tan(math.radians(2.5))), (100.0, 0.0, 0.0), (100.0, 0.3, 0.0), (-100.0, 0.3, 0.0)),))


def test_a_thin_bent_wall_is_compared_with_its_own_volume(tmp_path, monkeypatch):
    """In 96 facets a turn the strip has another volume than its true arc has, even extrapolated."""
    whole = 20 * bowed_strip().area
    strip = Primitive("extrude", (20.0,), outline=bowed_strip())
    assert step_booleans._exact_leaf(strip).volume() == pytest.approx(whole, rel=1e-4)
    # where only a volume that is compared closely will do
    monkeypatch.setattr(step_booleans, "ROUGH", step_booleans.CLOSE)
    write_step(Combine("difference", strip, Primitive("cylinder", (0.5, 100.0), (0.0, -2.0, 0.0))), tmp_path / "part.step")
    assert step_volume(tmp_path / "part.step") == pytest.approx(whole - 5 * math.pi, rel=1e-6)


def test_what_several_cutters_spoil_together_is_cut_one_after_another(tmp_path, monkeypatch):
    plain = step_booleans._combine
    monkeypatch.setattr(step_booleans, "_combine", lambda op, shapes, fuzzy=0.0: plain(op, shapes[:2], fuzzy))  # the others are lost
    holes = [Primitive("cylinder", (1.0, 10.0), (x, 0.0, 0.0)) for x in (-6.0, 0.0, 6.0)]
    plate = Primitive("box", (20.0, 10.0, 4.0))
    write_step(combine_all("difference", [plate, *holes]), tmp_path / "part.step")
    assert step_volume(tmp_path / "part.step") == pytest.approx(800 - 12 * math.pi, rel=1e-6)


def test_a_shape_that_does_not_survive_the_file_is_made_in_another_way():
    """Each shape is asked whether it survives, merged and as it is, before the next way is tried."""
    tried = []

    def survives(shape):
        tried.append(shape)
        return len(tried) > 2  # neither with its faces merged nor as it is

    shape = to_shape(MEANT["bracket"][0], survives=survives)
    assert shape is tried[-1]
    assert len(tried) == 3
    with pytest.raises(StepError, match="not valid once it is read back"):
        to_shape(MEANT["bracket"][0], survives=lambda _: False)


def test_what_is_wrong_at_once_is_done_at_once_with_a_tolerance_on_the_parts(monkeypatch):
    """Of two freeform parts one was right with a tolerance alone, the other only where intersections were done on the parts too; one
    boolean after another, each of them compared, took three times as long."""
    plain, done = step_booleans.boolean, []

    def fragile(name, keep, tools, fuzzy=0.0):
        done.append((name, fuzzy))
        if not fuzzy and name == "Fuse":
            raise StepError("lost")
        return plain(name, keep, tools, fuzzy)

    monkeypatch.setattr(step_booleans, "boolean", fragile)
    monkeypatch.setattr(step_booleans, "_build_checked", lambda *_: pytest.fail("nothing was left to compare"))
    post, foot = Primitive("box", (1.0, 1.0, 4.0)), Primitive("box", (6.0, 4.0, 1.0), (0.0, 0.0, -1.5))
    whole = Combine("intersection", Combine("union", foot, post), Primitive("sphere", (2.9,)))
    assert shape_volume(to_shape(whole), 1e-6) == pytest.approx(volume(whole), rel=2e-3)
    assert [name for name, fuzzy in done if fuzzy] == ["Common", "Common", "Fuse"]


def test_where_what_was_joined_cannot_be_intersected_its_parts_are(monkeypatch):
    """A plate of 69 curves in a rounded frame: every way of cutting it with the frame was invalid, and none of cutting its parts."""
    plain, tried = step_booleans.boolean, []

    def fragile(name, keep, tools, fuzzy=0.0):
        explorer = ocp("TopExp").TopExp_Explorer(keep[0], ocp("TopAbs").TopAbs_ShapeEnum.TopAbs_FACE)
        faces = 0
        while explorer.More():
            faces += 1
            explorer.Next()
        if name == "Common" and faces > 6:
            tried.append(faces)
            raise StepError("lost")
        return plain(name, keep, tools, fuzzy)

    monkeypatch.setattr(step_booleans, "boolean", fragile)
    post, foot = Primitive("box", (1.0, 1.0, 4.0)), Primitive("box", (6.0, 4.0, 1.0), (0.0, 0.0, -1.5))
    hole = Primitive("cylinder", (0.3, 9.0), (2.0, 0.0, 0.0))
    whole = Combine("intersection", Combine("difference", Combine("union", foot, post), hole), Primitive("sphere", (2.9,)))
    assert step_booleans.solids_in(shape := to_shape(whole)) == 1
    assert 0 < len(tried) <= 1 + len(step_booleans.WAYS)  # at once, and each way once: other orders of these come after the parts
    assert shape_volume(shape, 1e-6) == pytest.approx(volume(whole), rel=2e-3)


def test_what_fails_at_once_is_done_one_after_another_before_other_ways(monkeypatch):
    """A plate with eleven cutters: three ways of cutting all at once took 18 s in vain, and one after another 5."""
    plain, together = step_booleans.boolean, []

    def fragile(name, keep, tools, fuzzy=0.0):
        if len(tools) > 1:
            together.append(fuzzy)
            raise StepError("lost")
        return plain(name, keep, tools, fuzzy)

    monkeypatch.setattr(step_booleans, "boolean", fragile)
    plate = Primitive("box", (12.0, 4.0, 1.0))
    drilled = reduce(
        lambda part, x: Combine("difference", part, Primitive("cylinder", (0.5, 3.0), (x, 0.0, 0.0))), (-4.0, -1.0, 2.0, 4.5), plate
    )
    assert shape_volume(to_shape(drilled), 1e-6) == pytest.approx(48 - 4 * math.pi * 0.25, rel=1e-4)
    assert together == pytest.approx([0.0, 3.6e-6, 3.6e-6])  # twice unchecked, once checked


def count_faces(shape) -> int:
    kind = ocp("TopAbs").TopAbs_ShapeEnum.TopAbs_FACE
    explorer, found = ocp("TopExp").TopExp_Explorer(shape, kind), 0
    while explorer.More():
        found += 1
        explorer.Next()
    return found


def test_needles_go_and_the_faces_beside_them_meet():
    """A block with a corner cut off by a thousandth of a thousandth: a face 5e-6 wide and as high as the block."""
    bevel = 3.5e-6
    ring = ((0.0, 0.0, 0.0), (20.0, 0.0, 0.0), (20.0, 10.0 - bevel, 0.0), (20.0 - bevel, 10.0, 0.0), (0.0, 10.0, 0.0))
    block = to_shape(Primitive("extrude", (8.0,), outline=Outline((ring,))))
    healed = step_booleans.drop_needles(block, 1e-5)
    assert (count_faces(block), count_faces(healed)) == (7, 6)
    assert shape_volume(healed, 1e-6) == pytest.approx(1600.0, rel=1e-6)
    assert count_faces(step_booleans.drop_needles(block, 1e-6)) == 7


def without_needles(monkeypatch, made) -> list[float]:
    """What is read back first counts as not valid, and `made` of a shape as that without its needles; the widths asked for."""
    asked: list[float] = []
    monkeypatch.setattr(step, "drop_needles", lambda shape, width: asked.append(width) or made(shape))
    monkeypatch.setattr(step, "is_valid", lambda shape: bool(asked))
    return asked


def test_a_shape_is_written_without_its_needles_where_it_is_not_valid_with_them(tmp_path, monkeypatch):
    asked = without_needles(monkeypatch, lambda shape: shape)
    write_step(Primitive("box", (4.0, 3.0, 20.0)), tmp_path / "part.step")
    assert asked == [pytest.approx(20.0 * step.NEEDLE)]
    assert step_volume(tmp_path / "part.step") == pytest.approx(240.0)


def test_but_not_where_more_goes_with_them(tmp_path, monkeypatch):
    """A valid file of another solid gives way to one that is made in another way."""
    asked = without_needles(monkeypatch, lambda _: to_shape(Primitive("box", (4.0, 3.0, 19.0))))
    write_step(Primitive("box", (4.0, 3.0, 20.0)), tmp_path / "part.step")
    assert len(asked) == 1
    assert step_volume(tmp_path / "part.step") == pytest.approx(240.0)
