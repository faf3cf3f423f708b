"""What an agent may do, called without a server: each step changes what it says, is measured by exact volumes, and can be taken back."""

import json
import math
import threading

import pytest
import trimesh

from imdim.app.agent import changes
from imdim.app.agent.session import AgentSession
from imdim.app.agent.workplace import Workplace
from imdim.export.edit import change_values
from imdim.program import codec
from imdim.program.repeats import Repeat
from imdim.program.tree import Combine, Primitive

HOLE = {"kind": "cylinder", "size": {"r": 3, "h": 8}, "center": [0, 15, 0]}


def bore(diameter, depth=6.0, segments=96):
    """Volume of an inscribed cylinder."""
    return segments / 2 * math.sin(2 * math.pi / segments) * (diameter / 2) ** 2 * depth


def test_what_is_there(opened):
    status = opened.status()
    assert (status.part, status.program, status.features) == ("part.stl", "plate", 3)
    assert status.size == status.part_size == [80, 50, 6]
    assert status.volume == pytest.approx(80 * 50 * 6 - 2 * bore(6), rel=1e-5)
    features = opened.features()
    assert [(f.name, f.does) for f in features.features] == [("plate", "add"), ("hole", "cut"), ("hole", "cut")]
    assert features.features[1].numbers == {"r": 3, "h": 8, "x": -20, "y": 0, "z": 0, "turn_x": 0, "turn_y": 0, "turn_z": 0}
    assert len(features.holes) == 1
    assert "2 x" in features.holes[0]
    assert "(features 1, 2)" in features.holes[0]
    assert [p.name for p in opened.parameters("diameter").parameters] == ["hole_diameter"]
    assert opened.parameters("diameter").parameters[0].ties == [1, 2]


def test_evidence_is_the_share_of_the_surface(opened):
    evidence = opened.features().features
    walls = 2 * math.pi * 6 * 6
    whole = 2 * (80 * 50 - 2 * math.pi * 9) + 2 * 130 * 6 + walls
    assert evidence[1].explains == pytest.approx(walls / 2 / whole, rel=0.1)
    assert sum(f.explains for f in evidence) == pytest.approx(1, abs=1e-6)
    opened.set({"1.x": -25})
    moved = opened.features([1]).features[0]
    assert moved.off_max > 1.5
    assert opened.features([2]).features[0].off_max < 1e-3


def test_a_name_changes_all_that_share_it(opened):
    done = opened.set({"hole_diameter": 8})
    assert done.volume_before - done.volume == pytest.approx(2 * (bore(8) - bore(6)), abs=0.2)
    assert done.iou == pytest.approx(done.volume / done.volume_before, rel=1e-5)
    assert done.kind == ""
    assert opened.undo().iou == pytest.approx(1, abs=1e-6)
    assert opened.redo().iou == pytest.approx(done.iou)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"hole_diamter": 6}, "nearest are hole_diameter"),
        ({"hole_diameter": -1}, "positive number"),
        ({"hole_diameter": math.nan}, "finite number"),
        ({"7.x": 1}, "no primitive 7"),
        ({"1.q": 1}, "nearest|no number"),
        ({"1.x": math.inf}, "finite number"),
        ({"hole_diameter": 500}, "no solid is left"),
    ],
)
def test_what_cannot_be_set_is_one_line_and_changes_nothing(opened, values, message):
    before = opened.status()
    with pytest.raises(ValueError, match=message) as refused:
        opened.set(values)
    assert "\n" not in str(refused.value)
    assert opened.status() == before


def test_strict_refuses_what_opens_or_closes(opened):
    blind = opened.set({"1.h": 2, "1.z": 2})
    assert "2 through-holes became 1" in blind.kind
    opened.undo()
    with pytest.raises(ValueError, match="through-holes became"):
        opened.set({"1.h": 2, "1.z": 2}, strict=True)


def test_ties_are_broken_and_made(opened):
    apart = opened.untie("hole_diameter")
    assert set(apart.names) == {"hole2_diameter", "hole2_from_right"}
    assert "hole2_diameter (hole2 #2)" in apart.notes[0]
    wide = opened.set({"hole2_diameter": 7})
    assert wide.volume_before - wide.volume == pytest.approx(bore(7) - bore(6), abs=0.2)
    tied = opened.tie(["hole_diameter", "hole2_diameter"])
    assert tied.gone == ["hole2_diameter", "hole2_from_right"]
    assert tied.iou == pytest.approx(1, abs=1e-6)
    assert opened.parameters("hole_diameter").parameters[0].ties == [1, 2]
    for names in (["hole_diameter", "plate_thickness"], ["hole_diameter", "nothing"]):
        with pytest.raises(ValueError, match=r"cannot be tied|no parameter"):
            opened.tie(names)


def test_what_is_locked_stays(opened):
    opened.lock(["plate_thickness", "1.x"])
    assert opened.status().locked == ["plate_thickness", "1.x"]
    for values in ({"plate_thickness": 8}, {"1.x": 0}, {"0.sz": 8}):
        with pytest.raises(ValueError, match="is locked"):
            opened.set(values)
    with pytest.raises(ValueError, match="is locked"):
        opened.scale(2)
    opened.remove([2])
    assert opened.status().locked == ["plate_thickness", "1.x"]
    opened.lock(["plate_thickness"], locked=False)
    assert opened.set({"plate_thickness": 8}).size == [80, 50, 8]
    for name in ("nothing", "9.x", "1.q"):
        with pytest.raises(ValueError, match="to lock"):
            opened.lock([name])


def test_features_come_and_go(opened):
    added = opened.add("cut", HOLE)
    assert added.volume_before - added.volume == pytest.approx(bore(6), abs=0.2)
    assert (added.kind, added.notes) == ("2 through-holes became 3", ["it is feature 3"])
    removed = opened.remove([3])
    assert removed.iou == pytest.approx(1, abs=1e-6)
    rib = opened.add("add", {"kind": "extrude", "size": {"h": 4}, "outline": [[[0, 0], [10, 0], [0, 10]]], "center": [30, 0, 5]})
    assert rib.volume - rib.volume_before == pytest.approx(50 * 4, rel=1e-4)
    assert opened.features([3]).features[0].explains < 0.005
    with pytest.raises(ValueError, match=r"feature\.size: 'r' is missing"):
        opened.add("cut", {"kind": "cylinder", "size": {"h": 4}})
    with pytest.raises(ValueError, match="no feature 9"):
        opened.remove([9])
    with pytest.raises(ValueError, match="no solid"):
        opened.add("cut", {"kind": "box", "size": {"sx": 500, "sy": 500, "sz": 500}})


def test_a_repeat_is_added_and_a_copy_removed(opened):
    row = {"repeat": "linear", "count": 3, "step": [10, 0, 0], "part": {**HOLE, "center": [-10, 15, 0]}}
    added = opened.add("cut", row)
    assert added.volume_before - added.volume == pytest.approx(3 * bore(6), abs=0.2)
    program = opened._program().delivered
    assert any(isinstance(part, Repeat) for part in program.folded.parts)
    gone = opened.remove([4])
    assert gone.volume - gone.volume_before == pytest.approx(bore(6), abs=0.2)
    assert opened._program().delivered.folded is None


def test_what_is_added_before_the_cuts_is_cut_too(opened):
    opened.lock(["2.x"])
    boss = {"kind": "cylinder", "size": {"r": 5, "h": 2}, "center": [20, 0, 2]}
    assert opened.add("add", boss).kind == "2 through-holes became 1"
    opened.undo()
    added = opened.add("add", boss, before_cuts=True)
    assert (added.kind, added.notes, added.volume) == ("", ["it is feature 1"], added.volume_before)
    assert [f.kind for f in opened.features().features] == ["box", "cylinder", "cylinder", "cylinder"]
    assert opened.parameters("hole_diameter").parameters[0].ties == [2, 3]
    with pytest.raises(ValueError, match=r"3\.x is locked"):
        opened.set({"3.x": 0})


def test_removing_keeps_other_repeats(opened):
    for y in (15, -15):
        opened.add("cut", {"repeat": "linear", "count": 3, "step": [10, 0, 0], "part": {**HOLE, "center": [-10, y, 0]}})
    gone = opened.remove([1, 4])
    assert gone.volume - gone.volume_before == pytest.approx(2 * bore(6), abs=0.2)
    repeats = [part for part in opened._program().delivered.folded.parts if isinstance(part, Repeat)]
    assert [(r.counts, r.part.center[1]) for r in repeats] == [((3,), -15)]


def test_refit_goes_to_the_part(opened):
    opened.set({"1.x": -21, "2.x": 20.5, "hole_diameter": 6.6})
    opened.lock(["2.x"])
    done = opened.refit()
    one, two = (f.numbers for f in opened.features([1, 2]).features)
    assert (one["x"], two["x"], one["h"], one["z"]) == (pytest.approx(-20, abs=1e-3), 20.5, 8, 0)
    assert done.iou > done.iou_before
    opened.lock(["2.x"], locked=False)
    assert opened.refit(only=[2]).iou == pytest.approx(1, abs=1e-5)
    assert opened.parameters("hole_diameter").parameters[0].value == 6


def test_a_refit_that_leads_away_is_refused(opened, monkeypatch):
    before = opened.status()
    monkeypatch.setattr(changes, "refit", lambda delivered, *_: change_values(delivered, {"hole_diameter": 7}))
    with pytest.raises(ValueError, match="nothing nearer"):
        opened.refit()
    assert opened.status() == before


def test_relations_hold_and_go(opened):
    opened.set({"2.y": 1.0})
    held = opened.hold("aligned", "1, 2", "world.y")
    assert held.iou < 1
    one, two = (f.numbers["y"] for f in opened.features([1, 2]).features)
    assert one == pytest.approx(two, abs=1e-6)
    count = len(opened.features().relations)
    opened.drop(count - 1)
    assert len(opened.features().relations) == count - 1
    for asked in (("nothing", "1, 2"), ("equal", "1.r, 9.r"), ("equal", "one")):
        with pytest.raises(ValueError):  # noqa: PT011 - whatever it says is one line
            opened.hold(*asked)
    with pytest.raises(ValueError, match="no relation 99"):
        opened.drop(99)


def test_inches_become_millimetres(opened):
    small = opened.scale(1 / 25.4)
    assert small.iou == pytest.approx(0, abs=1e-3)
    assert opened.scale(25.4).iou == pytest.approx(1, abs=1e-6)
    assert opened.parameters("hole_diameter").parameters[0].ties == [1, 2]


def test_relate_finds_the_row(opened):
    opened.untie("hole_diameter")
    found = opened.relate()
    assert found.gone == ["hole_from_left", "hole2_diameter", "hole2_from_right"]
    assert found.iou == pytest.approx(1, abs=1e-6)


def test_a_point_and_a_box_are_explained(opened):
    opened.remove([2])
    wall = opened.explain(point=[-17, 0, 0])
    assert (wall.names, wall.verdict) == (["hole"], "exact")
    missed = opened.explain(low=[16, -4, -2.9], high=[24, 4, 2.9])
    assert (missed.verdict, missed.inside_part, missed.inside_program) == ("left out", False, True)
    assert 1.5 < missed.furthest <= 3
    assert missed.regions[0].furthest == pytest.approx(3, rel=0.01)
    assert missed.regions[0].low == pytest.approx([17, -3, -3], abs=0.01)
    for point, low, high in (
        (None, None, None),
        ([0, 0, 0], [0, 0, 0], None),
        (None, [1, 1, 1], [0, 0, 0]),
        ([math.nan, 0, 0], None, None),
    ):
        with pytest.raises(ValueError, match="explain needs"):
            opened.explain(point, low, high)


def test_the_measures(opened):
    assert (opened.measure().iou, opened.measure().verdict) == (pytest.approx(1, abs=1e-6), "exact")
    opened.remove([1])
    measured = opened.measure()
    assert measured.iou == pytest.approx((24000 - 2 * bore(6)) / (24000 - bore(6)), rel=1e-5)
    assert [r.verdict for r in measured.regions] == ["left out"]
    assert measured.to_program_max == pytest.approx(3, rel=0.1)


def test_every_step_is_taken_back(opened, folder):
    opened.set({"hole_diameter": 7})
    opened.add("cut", HOLE)
    opened.lock(["0.sz"])
    said = [opened.undo().step for _ in range(5)]
    assert said == ["lock 0.sz", "cut cylinder", "set hole_diameter = 7", "open plate", "open part.stl"]
    with pytest.raises(ValueError, match="nothing to undo"):
        opened.undo()
    assert opened.status().part == ""
    assert [opened.redo().step for _ in range(5)] == said[::-1]
    with pytest.raises(ValueError, match="nothing to redo"):
        opened.redo()
    assert opened.status().locked == ["0.sz"]


def test_export_writes_what_edit_writes(opened, folder):
    opened.set({"plate_thickness": 8})
    files = opened.export("out/thick").files
    assert {"program.json", "program.scad", "program.py", "program.cq.py", "mesh.stl", "mesh.glb", "mesh.3mf"} <= files.keys()
    assert trimesh.load_mesh(folder / "out/thick/mesh.stl").extents == pytest.approx([80, 50, 8])
    program = codec.from_json(json.loads((folder / "out/thick/program.json").read_text()))
    assert isinstance(program, Combine)
    again = AgentSession(Workplace(folder))
    assert again.open("out/thick").size == [80, 50, 8]
    assert [p.name for p in again.parameters("diameter").parameters] == ["hole_diameter"]
    (folder / "own").mkdir()
    (folder / "own/notes.txt").write_text("mine")
    with pytest.raises(OSError, match="own"):
        opened.export("own")
    assert (folder / "own/notes.txt").read_text() == "mine"


def test_without_a_part_or_a_program_it_says_so(session, folder):
    for call in (session.measure, session.features, session.parameters, session.relate, session.refit, session.fit):
        with pytest.raises(ValueError, match=r"no part is open|there is no program"):
            call()
    session.open("plate")
    assert session.features().features[0].explains is None
    assert session.explain(point=[-17, 0, 0]).names == ["hole"]
    with pytest.raises(ValueError, match="no part to measure against"):
        session.measure()
    (folder / "broken.json").write_text("{")
    (folder / "notes.md").write_text("")
    for path in ("broken.json", "notes.md", "gone"):
        with pytest.raises(ValueError):  # noqa: PT011 - the next line looks at what it says
            session.open(path)


def test_a_part_in_inches(session):
    assert session.open("part.stl", units="inch").part_size == pytest.approx([80 * 25.4, 50 * 25.4, 6 * 25.4])


def test_a_box_is_fitted(session, folder):
    trimesh.creation.box((30, 20, 10)).export(folder / "box.stl")
    session.open("box.stl")
    told = []
    done = session.fit(budget_s=20, progress=lambda seconds, total, said: told.append((seconds, total, said)))
    assert (done.features, done.iou) == (1, pytest.approx(1, abs=1e-6))
    assert told
    assert [seconds for seconds, _, _ in told] == sorted(seconds for seconds, _, _ in told)
    assert isinstance(session._program().delivered.program, Primitive)
    assert session.undo().step == "fit"


def test_a_fit_is_stopped(session, folder):
    trimesh.creation.icosphere(3, 10.0).export(folder / "ball.stl")
    session.open("ball.stl")
    before = session.status()
    asked = threading.Timer(0.3, session.stop_fit, kwargs={"keep": False})
    asked.start()
    with pytest.raises(ValueError, match=r"found no program: stopped|cancelled"):
        session.fit(budget_s=60)
    assert session.status() == before
    assert not session.stop_fit().stopped
