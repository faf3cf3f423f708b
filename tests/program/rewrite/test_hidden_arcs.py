"""Lines that end at arcs which other parts hide go on until they meet; the solid stays as it was."""

import math

import pytest
from tests.planted import cylinder

from imdim.geometry.finish.active_zone import change_with
from imdim.geometry.solid import to_manifold, volume, volume_iou
from imdim.program.outline import Outline, Ring, arc_radii
from imdim.program.rewrite.hidden_arcs import without_hidden_arcs
from imdim.program.rewrite.separation import separate_loops
from imdim.program.tree import Primitive, Program, combine_all, leaves

POSTS = [(x, y) for x in (-6.0, 6.0) for y in (-4.0, 4.0)]
PLACES = [{}, {"center": (1.0, -2.0, 3.0), "rotation": (20.0, 30.0, 40.0)}]


def rib(x: float, y: float, length: float) -> Ring:
    """A wall of thickness 1 along x between posts of radius 1."""
    reach = math.sqrt(1 - 0.25)
    low, high = x - length / 2 + reach, x + length / 2 - reach
    bulge = -math.tan(math.asin(0.5) / 2)
    return (low, y - 0.5, 0.0), (high, y - 0.5, bulge), (high, y + 0.5, 0.0), (low, y + 0.5, bulge)


def turn(ring: Ring) -> Ring:
    return tuple((-y, x, bulge) for x, y, bulge in ring)


def frame(place) -> Primitive:
    walls = (rib(0.0, -4.0, 12.0), rib(0.0, 4.0, 12.0), turn(rib(0.0, -6.0, 8.0)), turn(rib(0.0, 6.0, 8.0)))
    return Primitive("extrude", (2.0,), outline=Outline(walls), **place)


def posts(place, count: int = 4) -> Primitive:
    circles = tuple(((x - 1.0, y, 1.0), (x + 1.0, y, 1.0)) for x, y in POSTS[:count])
    return Primitive("extrude", (3.0,), outline=Outline(circles), **place)


def curves(program: Program) -> list[int]:
    return [leaf.outline.curve_count for leaf in leaves(program) if leaf.outline]


@pytest.mark.parametrize("place", PLACES, ids=["flat", "turned"])
def test_a_frame_between_posts_is_two_rectangles(place) -> None:
    drawn = combine_all("union", [frame(place), posts(place)])
    program = without_hidden_arcs(drawn, change_with, 1e-9 * volume(drawn))
    assert curves(program) == [8, 4]
    assert volume_iou(to_manifold(program), to_manifold(drawn)) == pytest.approx(1.0, abs=1e-7)
    box, inner, *round_parts = leaves(separate_loops(program))
    assert (sorted(box.size), sorted(inner.size)) == (pytest.approx([2.0, 9.0, 13.0]), pytest.approx([2.0, 7.0, 11.0]))
    assert [leaf.kind for leaf in round_parts] == ["cylinder"] * 4


def test_arcs_that_show_stay() -> None:
    """Three posts of four: the circle of the fourth is bare, and only that."""
    drawn = combine_all("union", [frame({}), posts({}, 3)])
    program = without_hidden_arcs(drawn, change_with, 1e-9 * volume(drawn))
    assert volume_iou(to_manifold(program), to_manifold(drawn)) == pytest.approx(1.0, abs=1e-7)
    walls = next(leaf for leaf in leaves(program) if leaf.outline)
    assert walls.outline is not None
    assert len(arc_radii(walls.outline)) < 8


def test_a_round_hole_is_no_arc_that_is_hidden() -> None:
    """A plug hides the hole that it fills, but no line runs into it."""
    plate = Primitive("extrude", (2.0,), outline=Outline((((-6, -6, 0), (6, -6, 0), (6, 6, 0), (-6, 6, 0.1)), ((-1, 0, 1), (1, 0, 1)))))
    drawn = combine_all("union", [plate, cylinder(1.0, 2.0)])
    assert without_hidden_arcs(drawn, change_with, 1e-9) == drawn
