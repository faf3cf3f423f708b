"""Boxes and cones that stand for blends are found, and those that are features of their own are not."""

import sys
from pathlib import Path

from tests.planted import box, cone, cut, cylinder, union

from imdim.program.codec import dumps

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts" / "bench"))
import standins

PLATE = box(60.0, 40.0, 10.0)
BEVEL = box(3.0, 50.0, 3.0, (30.0, 0.0, 5.0), (0.0, 45.0, 0.0))
RIDGE = box(60.0, 2.0, 2.0, (0.0, 0.0, 5.0), (45.0, 0.0, 0.0))


def found(program):
    return [(s.number, s.kind) for s in standins.find_stand_ins(program)]


def test_bevels_and_flat_cones_stand_for_blends():
    assert found(cut(PLATE, BEVEL)) == [(1, "box")]
    assert found(union(PLATE, box(6.0, 60.0, 10.0, (-10.0, 0.0, 5.0)), box(2.0, 40.0, 2.0, (-7.0, 0.0, 5.0), (0.0, 45.0, 0.0)))) == [
        (2, "box")
    ]
    foot = union(PLATE, cylinder(8.0, 20.0, (0.0, 0.0, 10.0)), cone(9.5, 8.0, 1.5, (0.0, 0.0, 5.75)))
    assert found(foot) == [(2, "cone")]


def test_ridges_ramps_and_seats_stand_for_themselves():
    assert found(union(PLATE, RIDGE)) == []
    assert found(cut(PLATE, box(40.0, 50.0, 20.0, (30.0, 0.0, 12.0), (0.0, 25.0, 0.0)))) == []
    assert found(cut(PLATE, cylinder(1.7, 20.0), cone(1.7, 3.4, 1.7, (0.0, 0.0, 4.15)))) == []
    assert found(cut(PLATE, box(20.0, 2.0, 2.0, (0.0, 0.0, 5.0)))) == []


def test_the_script_tells_each_part(tmp_path, monkeypatch, capsys):
    for name, program in (("bevelled", cut(PLATE, BEVEL)), ("plain", PLATE)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "program.json").write_text(dumps(program))
    monkeypatch.setattr(sys, "argv", ["standins.py", str(tmp_path)])
    assert standins.main() == 1
    said = capsys.readouterr().out
    assert "bevelled: 1 (box, 3 wide" in said
    assert "plain: none" in said
    assert "2 parts: 1 primitives stand for a chamfer or a fillet" in said
