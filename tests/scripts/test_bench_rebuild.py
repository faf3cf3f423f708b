"""What the bench of edits calls refused, invalid, other faces and right, on programs where that is known."""

import math
import sys
from pathlib import Path

import pytest
from tests.planted import box, cut, cylinder, union

from imdim.export.edit import open_delivered, restate, solid_of, write
from imdim.program.codec import dumps, parse
from imdim.program.edges import Face
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Outline, circle, rectangle
from imdim.program.tree import Primitive

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts" / "bench"))

import rebuild

PLATE = cut(union(box(80.0, 50.0, 6.0), cylinder(8.0, 5.0)), cylinder(3.0, 8.0, (25.0, 0.0, 0.0)))


@pytest.mark.parametrize(
    ("name", "value", "kind", "reason"),
    [
        ("plate_thickness", 7.0, "right", ""),
        ("plate_thickness", 2.0, "other faces", "1.+z"),
        ("hole_diameter", 52.0, "invalid", "1 through-hole became 0"),
        ("plate_thickness", -1.0, "refused", "positive number"),
    ],
)
def test_edits_are_told_by_what_they_do(name, value, kind, reason):
    before = restate(open_delivered(parse(dumps(PLATE)), {}))
    found = rebuild.judge(before, solid_of(before), rebuild.Shown.of(before.program, before.segments), name, value)
    assert (found[0], reason in found[1]) == (kind, True), found


@pytest.mark.parametrize("sides", [5.0, 7.0])
def test_a_polygon_has_as_many_walls_as_sides(sides):
    rim = tuple((10 * math.cos(k * math.pi / 3), 10 * math.sin(k * math.pi / 3), 0.0) for k in range(6))
    nut = cut(Primitive("extrude", (5.0,), outline=Outline((rim,))), cylinder(4.0, 8.0))
    before = restate(open_delivered(parse(dumps(nut)), {}))
    name = next(name for name in before.values if name.endswith("sides"))
    found = rebuild.judge(before, solid_of(before), rebuild.Shown.of(before.program, before.segments), name, sides)
    assert found == ("right", "")


def test_faces_are_called_as_edges_call_them():
    drawn = Primitive("extrude", (5.0,), outline=Outline((*rectangle(30.0, 20.0).loops, circle(4.0))))
    shown = rebuild.Shown.of(cut(drawn, box(10.0, 30.0, 2.0, (0.0, 0.0, 2.0))), 48)
    walls = {Face(0, f"wall[0][{k}]") for k in range(4)} | {Face(0, f"wall[1][{k}]") for k in range(2)}
    assert set(shown.faces) == walls | {Face(0, "+z"), Face(0, "-z"), Face(1, "-z"), Face(1, "+x"), Face(1, "-x")}


def test_walls_of_ellipses_are_faces_without_edges():
    """One alone is a solid with three faces; in a plate it is told from the plate's own walls."""
    alone = Primitive("extrude", (5.0,), outline=Outline((Ellipse(8.0, 5.0),)))
    faces = rebuild.Shown.of(alone, 48).faces
    assert set(faces) == {Face(0, name) for name in ("+z", "-z", "wall[0]")}
    plate = Primitive("extrude", (5.0,), outline=Outline((*rectangle(30.0, 20.0).loops, Ellipse(8.0, 5.0, angle=30.0))))
    bored = rebuild.Shown.of(plate, 48).faces
    assert set(bored) == {Face(0, name) for name in ("+z", "-z", "wall[1]", *(f"wall[0][{k}]" for k in range(4)))}
    assert len(bored[Face(0, "wall[1]")]) == 2 * 48


def test_all_names_of_a_folder_are_tried(tmp_path, capsys, monkeypatch):
    write(open_delivered(parse(dumps(PLATE)), {}), tmp_path / "plate")
    monkeypatch.setattr(sys, "argv", ["rebuild.py", str(tmp_path)])
    assert rebuild.main() == 0
    names = len(open_delivered(parse(dumps(PLATE)), {}).values)
    row = capsys.readouterr().out.splitlines()[2].split("|")
    assert [cell.strip() for cell in row[1:5]] == ["plate", str(2 * names), "0", f"{2 * names} (100.0%)"]
    monkeypatch.setattr(sys, "argv", ["rebuild.py", str(tmp_path / "plate")])
    assert rebuild.main() == 2
    assert capsys.readouterr().err.count("\n") == 1
