"""Places that are one but for a hair are found across leaves and kinds, and made one; arcs go on touching the walls that move."""

import math
from dataclasses import replace

import pytest

from imdim.numbers.design_values import LENGTH
from imdim.numbers.shared_numbers import SharedNumber, find_parted_lengths, find_split_numbers, share_number
from imdim.program.outline import Outline, arc_center, arc_radius, circle, circle_of, ring_curves
from imdim.program.tree import Primitive

BULGE = math.tan(math.pi / 8)  # of a quarter turn
ROUNDED = Outline((((-10.0, -5.0, 0.0), (7.0, -5.0, BULGE), (10.0, -2.0, 0.0), (10.0, 5.0, 0.0), (-10.0, 5.0, 0.0)),))


def shared(parts, hair):
    for level in find_split_numbers(parts, hair):
        parts = share_number(parts, level)
    return parts


def test_a_box_and_a_drawing_share_a_plane_again():
    drawn = Primitive("extrude", (4.0,), (0.0, 0.0, 2.0), outline=ROUNDED)
    block = Primitive("box", (5.0, 6.0, 4.0), (12.5002, 0.0, 2.0003))
    assert find_split_numbers((drawn, block), 1e-3) == [
        SharedNumber(0, 10.0, 10.0002, 10.0),
        SharedNumber(2, 0.0, 0.0003, 0.0),
        SharedNumber(2, 4.0, 4.0003, 4.0),
    ]
    out = shared((drawn, block), 1e-3)
    assert out[0] == drawn
    assert out[1].center[0] - out[1].size[0] / 2 == 10.0
    assert out[1].center[2] - out[1].size[2] / 2 == 0.0
    assert find_split_numbers(out, 1e-3) == []


@pytest.mark.parametrize(("rotation", "axis"), [((0.0, 0.0, 0.0), 0), ((90.0, 0.0, 90.0), 1), ((0.0, 0.0, 180.0), 0)])
def test_a_drawn_wall_takes_an_arc_with_it(rotation, axis):
    """The wall at x = 10 of the drawing is a hair from a face with fewer digits; wherever it lies, the arc touches both lines after."""
    outline = Outline((tuple((x + (3e-4 if x > 9 else 0.0), y, b) for x, y, b in ROUNDED.loops[0]),))
    drawn = Primitive("extrude", (4.0,), (0.0, 0.0, 0.0), rotation, outline=outline)
    side = -1.0 if rotation == (0.0, 0.0, 180.0) else 1.0
    size = [30.0, 30.0, 30.0]
    size[axis] = 1.0
    center = [0.0, 0.0, 0.0]
    center[axis] = side * 10.5
    block = Primitive("box", tuple(size), tuple(center))
    (level,) = [found for found in find_split_numbers((drawn, block), 1e-3) if found.kind == axis]
    assert level.target == side * 10.0
    moved, kept = share_number((drawn, block), level)
    assert kept == block
    (arc,) = [curve for curve in ring_curves(moved.outline.rings[0]) if curve[4]]
    offset = moved.center[axis] * side
    assert arc[2] + offset == pytest.approx(10.0, abs=1e-12)
    (x, y), radius = arc_center(arc), arc_radius(arc)
    assert x + radius + offset == pytest.approx(10.0, abs=1e-9)
    assert y - radius == pytest.approx(moved.outline.bounds[0][1], abs=1e-9)
    assert radius == pytest.approx(3.0, abs=1e-3)


def test_radii_that_are_all_but_one_are_one():
    """An arc of 2.998 between two lines goes on touching both; a small radius that differs by as much is another one."""
    bend = math.tan(math.pi / 8)
    corners = ((-10.0, -5.0, 0.0), (7.002, -5.0, bend), (10.0, -2.002, 0.0), (10.0, 5.0, 0.0), (-10.0, 5.0, 0.0))
    rounded = Outline((corners, circle(0.5, 0.0, 0.0)))
    parts = (Primitive("extrude", (4.0,), outline=rounded), Primitive("cylinder", (3.0, 9.0)), Primitive("cylinder", (0.502, 9.0)))
    assert find_split_numbers(parts, 3e-3) == [SharedNumber(LENGTH, pytest.approx(2.998), 3.0, 3.0)]
    drawn, *others = shared(parts, 3e-3)
    assert tuple(others) == parts[1:]
    (arc,) = [curve for curve in ring_curves(drawn.outline.rings[0]) if curve[4]]
    assert arc_radius(arc) == pytest.approx(3.0, abs=1e-12)
    assert arc_center(arc) == pytest.approx((7.0, -2.0), abs=1e-12)
    assert circle_of(drawn.outline.loops[1]) == circle_of(rounded.loops[1])


@pytest.mark.parametrize(
    ("low", "high", "target"), [(0.99985, 1.001, 1.0), (-8.501133, -8.5, -8.5), (-2e-7, 3e-4, 0.0), (3.29778, 3.298, 3.298)]
)
def test_what_is_shared_is_the_roundest_number_between_them(low, high, target):
    ends = [Primitive("box", (40.0, 4.0, 4.0), (low - 20.0, 0.0, 0.0)), Primitive("box", (40.0, 6.0, 3.0), (high - 20.0, 0.0, 0.0))]
    assert target in [found.target for found in find_split_numbers(ends, 2e-3)]


TUBE = Outline((((2.0, -4.0, 0.0), (5.0, -4.0, 0.0), (5.0, 4.0, 0.0), (2.0, 4.0, 0.0)),))


def test_the_wall_of_a_turned_part_has_the_radius_of_the_hole_that_it_fills_again():
    """A hole of 21 and a ring of 20.983 in it, both 20.98275 before they were rounded, were bodies apart."""
    ring = Primitive("revolve", (360.0,), rotation=(0.0, 90.0, 60.0), outline=TUBE)
    before = (Primitive("cylinder", (5.0, 12.0)), ring, Primitive("cylinder", (2.0, 12.0)))
    drawn = Outline((tuple((5.002 if x == 5 else x, y, b) for x, y, b in TUBE.loops[0]),))
    after = (Primitive("cylinder", (5.1, 12.0)), replace(ring, outline=drawn), Primitive("cylinder", (2.0, 12.0)))
    (choices,) = find_parted_lengths(before, after, 1e-6)
    assert [choice.target for choice in choices] == [5.1, 5.002]
    for choice in choices:
        hole, filled, _ = share_number(after, choice)
        assert hole.size == (choice.target, 12.0)
        assert filled.outline.bounds[1] == pytest.approx((choice.target, 4.0), abs=1e-9)
        assert filled.outline.bounds[0] == (2.0, -4.0)
        assert find_parted_lengths(before, (hole, filled, after[2]), 1e-6) == []
    assert find_parted_lengths(after, after, 1e-6) == []
    assert find_parted_lengths(before, (after[0], Primitive("box", (1.0, 1.0, 1.0)), after[2]), 1e-6) == []


def test_what_is_further_apart_or_would_have_no_size_stays():
    parts = (Primitive("box", (4.0, 4.0, 4.0)), Primitive("box", (2.0, 2.0, 6.0), (1.01, 0.0, 1.0)))
    assert find_split_numbers(parts, 1e-3) == []
    sheet = (Primitive("box", (4.0, 4.0, 1e-4)),)
    assert shared(sheet, 1e-3) == sheet
