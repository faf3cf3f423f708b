"""What a tenth of a name would make cross itself, or leave without an arc, is measured so that it can be drawn."""

import math

import pytest
from tests.export.test_outlines import opened

from imdim.export.drawable import NONE, find_fault
from imdim.export.drawn_vertex import BendAngle, BendRadius, Center, DrawnPolygon, DrawnVertex, Reach, numbers_of
from imdim.export.edit import change_values
from imdim.program.outline import CrossingError, Outline, check_crossings, circle, rectangle
from imdim.program.tree import Primitive

WIDTH = 12.0


def _tooth(inner, outer):
    """Between two arcs, each of a radius about a place on the x axis, as wide as all others."""
    half, lines = WIDTH / 2, []
    for radius, centre in (inner, outer):
        lines.append((centre + math.sqrt(radius**2 - half**2), math.tan(math.asin(half / radius) / 2)))
    (left, back), (right, front) = lines
    return ((left, -half, 0.0), (right, -half, front), (right, half, 0.0), (left, half, -back))


def test_teeth_between_arcs_have_radii_that_follow_each_other():
    """Six of a scroll: a radius of 62.983 that alone becomes 56.685 takes the tooth's back through the one before."""
    teeth = (((38.083 + 8.3 * k, -31.95 - 3.3 * k), (40.905 + 8.3 * k, -31.95 - 3.65 * k)) for k in range(6))
    part = opened(Primitive("extrude", (5.0,), outline=Outline(tuple(_tooth(*tooth) for tooth in teeth))))
    assert part.values["body_radius_step_2"] == pytest.approx(8.3)
    for name, value in part.values.items():
        for factor in (0.9, 1.1):
            edited = change_values(part, {name: factor * value}).program
            assert isinstance(edited, Primitive)
            assert edited.outline is not None
            check_crossings(edited.outline)


def test_a_corner_told_from_one_wall_keeps_off_the_wall_beside_it():
    """A C whose upper arm ends half a millimetre below the level of its inside: at nine tenths of that level both ends met."""
    outer, inner = ((-9.0, -8.0), (9.0, -8.0), (9.0, 8.0), (-9.0, 8.0)), ((-5.5, 4.5), (-5.5, 5.0), (4.0, 5.0), (4.0, -5.0), (-5.5, -5.0))
    part = opened(Primitive("extrude", (5.0,), outline=Outline((tuple((x, y, 0.0) for x, y in (*outer, *inner)),))))
    assert part.values["plate_step_y"] == pytest.approx(0.5)
    assert "plate_width_2" not in part.values, "one of both widths follows the other"
    for name, value in part.values.items():
        for factor in (0.9, 1.1):
            change_values(part, {name: factor * value})


def test_the_tip_of_a_teardrop_stays_over_its_hole():
    """Where the tip had a place of its own, each of them alone could be moved so far that no line from one touched the other."""
    (x, y), radius, slope = (20.0, 4.0), 2.5, math.sqrt(0.5)
    bend = math.tan(math.radians(270) / 4)
    drop = ((x, y + radius / slope, 0.0), (x - radius * slope, y + radius * slope, bend), (x + radius * slope, y + radius * slope, 0.0))
    part = opened(Primitive("extrude", (5.0,), outline=Outline((*rectangle(60.0, 30.0).loops, drop))))
    assert part.values["plate_window_tip_y"] == pytest.approx(radius / slope)
    for name, axis in (("plate_round_x", 0), ("plate_round_y", 1)):
        edited = change_values(part, {name: part.values[name] + 3.0}).program
        assert isinstance(edited, Primitive)
        assert edited.outline is not None
        loop = edited.outline.loops[1]
        assert isinstance(loop, tuple)
        moved = [now - then for now, then in zip(loop[0][:2], drop[0][:2], strict=True)]
        assert moved == pytest.approx([3.0 * (k == axis) for k in range(2)], abs=1e-6)


@pytest.mark.parametrize("mirrored", [False, True])
def test_the_web_of_a_fillet_grows_with_its_radius(mirrored):
    """Its lines lean by a hair, and its arc all but touches both: with nine tenths of the radius, and the same ends, it crossed them."""
    corner, level, upright, turn = (2.0, 3.0), (12.0, 3.0), (1.94, 12.95), math.radians(88.5)
    radius = math.dist(level, upright) / 2 / math.sin(turn / 2)
    web = Outline((((*corner, 0.0), (*level, -math.tan(turn / 4)), (*upright, 0.0)),))
    part = opened(Primitive("extrude", (5.0,), outline=web.mirror() if mirrored else web))
    (name,) = (n for n in part.values if n.endswith("corner_radius"))
    assert part.values[name] == pytest.approx(radius)
    for each, value in part.values.items():
        for factor in (0.9, 1.1):
            change_values(part, {each: factor * value})
    loop = _loop(change_values(part, {name: 2 * radius}).program)
    ends = sorted(math.dist(v[:2], min(loop, key=lambda v: abs(v[0]) + v[1])[:2]) for v in loop)
    assert ends == pytest.approx([0.0, 2 * math.dist(corner, upright), 2 * math.dist(corner, level)], abs=1e-5)
    assert min(abs(v[2]) for v in loop if v[2]) == pytest.approx(math.tan(turn / 4))


def test_the_web_of_what_is_turned_has_a_height():
    """Levels of what is turned are measured from its ends, which a radius would not say."""
    web = ((6.0, 3.0, 0.0), (16.0, 3.0, -math.tan(math.radians(88.5) / 4)), (5.94, 12.95, 0.0))
    part = opened(Primitive("revolve", (360.0,), outline=Outline((web,))))
    assert part.values["turned_part_height"] == pytest.approx(9.95)


def _loop(program):
    assert isinstance(program, Primitive)
    assert program.outline is not None
    (loop,) = program.outline.loops
    assert isinstance(loop, tuple)
    return loop


def _drawn(*corners):
    return tuple(DrawnVertex(x, y, bend) for x, y, bend in corners)


@pytest.mark.parametrize(
    ("rings", "pairs"),
    [
        ((_drawn((0.0, 0.0, 0.0), (4.0, 0.0, 0.0), (4.0, 3.0, 0.0)),), 0),
        ((_drawn((0.0, 0.0, BendRadius(1.9, 1)), (4.0, 0.0, 0.0), (4.0, 3.0, 0.0)),), 3),  # spans at most 3.8
        ((_drawn((0.0, 0.0, Center(2.0, 0.0, 1)), (4.0, 0.0, 0.0), (4.0, 3.0, 0.0)),), 0),
        ((_drawn((0.0, 0.0, BendAngle(90.0, 1)), (4.0, 0.0, 0.0), (4.0, 3.0, 0.0)),), 0),
        ((_drawn((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (4.0, 3.0, 0.0)),), 3),
        ((DrawnPolygon(6.0, 2.0, 0.0, 0.0, 0.0),), 0),
        ((DrawnPolygon(6.0, -2.0, 0.0, 0.0, 0.0),), 1),
        ((_drawn((0.0, 0.0, 0.0), (4.0, 3.0, 0.0), (4.0, 0.0, 0.0), (0.0, 3.0, 0.0)),), 4),
    ],
)
def test_what_cannot_be_drawn_has_corners_too_near(rings, pairs):
    assert len(find_fault(rings, [number for ring in rings for number in numbers_of(ring)]).pairs) == pairs


def test_a_circle_that_misses_a_line_has_a_fault():
    def vertex(off):
        return (DrawnVertex(0.0, off, 0.0, Reach(0, 1, 5.0, off)), DrawnVertex(0.0, 9.0, 0.0), DrawnVertex(-3.0, 0.0, 0.0))

    for off, missing in ((4.9, False), (5.1, True)):
        ring = vertex(off)
        assert (find_fault((ring,), list(numbers_of(ring))) != NONE) == missing


def test_curves_that_cross_are_told():
    with pytest.raises(CrossingError) as caught:
        check_crossings(Outline((circle(2.0), circle(2.0, 3.0))))
    assert caught.value.curves == ((0, 0), (1, 0))
