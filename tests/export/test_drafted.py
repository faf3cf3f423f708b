"""Drafted outlines under edits: names drive them in every text, and a draft at which walls would meet is refused."""

import math
import shutil
import subprocess

import numpy as np
import pytest
import trimesh
from tests.export.outlined import rounded
from tests.export.test_freecad import measured
from tests.planted import box, cut, cylinder, union

from imdim.delivery.finish import finish
from imdim.export.blend_texts import BlendTexts
from imdim.export.delivered import Delivered, EditError, texts_of
from imdim.export.edit import change_values, open_delivered, solid_of
from imdim.export.freecad import to_freecad
from imdim.export.numbers import Rounding
from imdim.export.openscad import to_openscad
from imdim.export.openscad_reader import read_openscad
from imdim.export.parameters import Parameters
from imdim.export.script import CURVES, RINGS, to_script
from imdim.geometry.faces import corners
from imdim.geometry.lowering import lower
from imdim.geometry.solid import to_manifold, volume
from imdim.program.codec import dumps, parse
from imdim.program.edges import EdgeFeature, Face
from imdim.program.outline import Outline, are_near, circle
from imdim.program.tree import Primitive, Program, leaves
from imdim.reconstruction.fitting import relations_of


def boss(draft: float = 6.0, length: float = 40.0, height: float = 15.0) -> Primitive:
    return Primitive("drafted", (height, draft), (0.0, 0.0, 4.0 + height / 2), outline=Outline((rounded(length, 24.0, 5.0),)))


def mount(**numbers: float) -> Program:
    """A boss with a draft on a plate, and a hole through both."""
    return cut(union(box(60, 40, 8), boss(**numbers)), cylinder(4, 80))


@pytest.fixture(scope="module")
def delivered() -> Delivered:
    found = finish(*relations_of(mount()))
    texts = texts_of(found.program, found.parameters, found.folded, 96)
    return open_delivered(parse(dumps(found.program, None, found.constraints, found.folded)), texts)


EDITS = {
    "steeper": ({"boss_draft_angle": 10.0}, {"draft": 10.0}),
    "longer": ({"boss_length": 50.0}, {"length": 50.0}),
    "higher": ({"boss_height": 20.0}, {"height": 20.0}),
}


@pytest.mark.parametrize("edit", EDITS)
def test_a_name_changes_what_it_says_and_nothing_else(delivered, edit):
    values, numbers = EDITS[edit]
    assert solid_of(change_values(delivered, values)).volume() == pytest.approx(to_manifold(mount(**numbers)).volume(), rel=1e-9)


def test_a_plate_that_gets_thicker_lifts_its_boss(delivered):
    before, after = solid_of(delivered), solid_of(change_values(delivered, {"plate_thickness": 10.0}))
    assert after.volume() - before.volume() == pytest.approx(2 * (60 * 40 - math.pi * 16), rel=1e-3)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"boss_draft_angle": 60.0}, "too much"),
        ({"boss_draft_angle": -5.0}, "needs a positive number, got -5"),
        ({"boss_draft_angle": 90.0}, "drafted needs a draft below 90 degrees"),
        ({"boss_corner_radius": 1.0}, "vanishes"),
    ],
)
def test_walls_that_would_meet_are_refused_in_one_line(delivered, values, message):
    with pytest.raises(EditError, match=message) as refused:
        change_values(delivered, values)
    assert "\n" not in str(refused.value)


@pytest.mark.tool
def test_the_tools_follow_the_angle(tmp_path):
    found = finish(*relations_of(mount()))
    wanted = volume(mount(draft=10.0), 512)
    assert measured(to_freecad(found.program, found.parameters), tmp_path, boss_draft_angle="10 deg") == pytest.approx(wanted, rel=1e-4)
    tool = shutil.which("openscad")
    if tool is None:
        pytest.skip("openscad is not installed")
    (tmp_path / "part.scad").write_text(to_openscad(found.program, 128, found.parameters))
    command = [tool, "-o", tmp_path / "part.stl", "-D", "boss_draft_angle=10", tmp_path / "part.scad"]
    said = subprocess.run(command, check=True, capture_output=True, timeout=120, text=True).stderr
    assert "WARNING" not in said
    mesh = trimesh.load_mesh(tmp_path / "part.stl")
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(wanted, rel=1e-3)


def test_edges_of_walls_that_lean_are_picked_by_where_these_are():
    """What the scripts select by: points of the wall at every height, and none of the upright one over the same curve."""
    leaf = boss(draft=10.0)
    edges = [EdgeFeature("fillet", (1.0,), tuple((Face(0, "+z"), Face(0, f"wall[0][{k}]")) for k in range(8)))]
    text = to_script(leaf, edges=edges)
    assert f"draft={leaf.size[1]:g}" in text
    helpers = BlendTexts.of(leaf, edges, Parameters.none(leaf), Rounding.of(leaf)).helpers("")
    space: dict = {}
    exec("\n".join(["from math import *", "from cmath import exp, phase", RINGS, CURVES, *helpers]), space)
    numbers = lower(leaf)
    for k in range(8):
        wall = space["wall_face"](leaf.center, [list(v) for v in leaf.outline.loops[0]], k, height=leaf.size[0], draft=leaf.size[1])
        for point in corners(Face(0, f"wall[0][{k}]"), leaf, numbers):
            assert wall(tuple(point)) == pytest.approx(0.0, abs=1e-9)
        inward = np.subtract((0.0, 0.0, point[2]), point) / 100
        assert wall(tuple(point + inward)) > 1e-3


def test_areas_and_their_holes_are_read_in_the_order_that_they_have():
    """Equal areas, whose sizes differ by their last digits alone, and a hole that was drawn behind both."""
    loops = [tuple((x + off, y, b) for x, y, b in rounded(20.0 + 1e-9 * k, 10.0, 2.0)) for k, off in enumerate((-20.0, 20.0))]
    leaf = Primitive("drafted", (4.0, 8.0), outline=Outline((*loops, circle(2.0, -20.0))))
    assert leaf.outline is not None
    assert [len(loop) for loop in leaf.outline.loops] == [8, 2, 8]
    (read,) = leaves(read_openscad(to_openscad(leaf)))
    assert read.outline is not None
    assert are_near(read.outline, leaf.outline, 1e-6)


def test_a_plate_with_a_draft_is_as_thick_as_it_is_high():
    found = finish(*relations_of(Primitive("drafted", (4.0, 8.0), outline=Outline((rounded(50.0, 30.0, 5.0),)))))
    assert found.parameters.values["plate_thickness"] == 4
    assert found.parameters.values["plate_draft_angle"] == 8
    assert found.parameters.angles == {"plate_draft_angle"}
