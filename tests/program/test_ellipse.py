"""Ellipses as loops of outlines: what they enclose, what they may not cross, and how documents say them."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from imdim.program.codec import dumps, loads
from imdim.program.cost import count
from imdim.program.edges import faces_of
from imdim.program.ellipse import Ellipse, are_near_ellipses, ellipse_point, meet_conic
from imdim.program.motions import mirror, turn
from imdim.program.outline import (
    Outline,
    are_near,
    check_crossings,
    circle,
    ellipse,
    flatten_loop,
    is_in_loop,
    nesting,
    rectangle,
    regions,
)
from imdim.program.patterns.outlined import is_outlined_moved
from imdim.program.plain_outlines import to_simple
from imdim.program.tree import Primitive

OVAL = Ellipse(5.0, 2.0, 1.0, -0.5, 30.0)
(BOX,) = rectangle(20.0, 20.0).loops


def refusal(*loops) -> str:
    with pytest.raises(ValueError, match="loop") as refused:
        check_crossings(Outline(loops))
    return str(refused.value)


def test_area_and_bounds_are_those_of_its_polygon():
    corners = np.array(flatten_loop(OVAL, 20_000))
    outline = Outline((OVAL,))
    assert outline.area == pytest.approx(math.pi * 10)
    np.testing.assert_allclose(outline.bounds, [corners.min(0), corners.max(0)], atol=1e-6)
    assert outline.curve_count == len(outline.curves) == 1


def test_equal_semi_axes_are_a_circle():
    assert ellipse(3.0, 3.0, 1.0, 2.0, 20.0) == circle(3.0, 1.0, 2.0)
    leaf = Primitive("extrude", (4.0,), outline=Outline((ellipse(3.0, 3.0),)))
    assert to_simple(leaf) == Primitive("cylinder", (3.0, 4.0))
    assert to_simple(replace(leaf, outline=Outline((OVAL,)))) is None


def test_right_angles_are_exact_and_the_plain_one_lies_along_the_axes():
    assert Ellipse(5.0, 2.0, angle=90.0).along == (0.0, 1.0)
    assert Ellipse(5.0, 2.0, 1.0, 0.0, 90.0).plain == Ellipse(2.0, 5.0, 1.0, 0.0, 0.0)
    assert Ellipse(5.0, 2.0, angle=-150.0).plain == Ellipse(5.0, 2.0, angle=30.0)
    assert are_near_ellipses(Ellipse(5.0, 2.0, angle=45.0), Ellipse(2.0, 5.0, angle=-45.0 + 1e-9), 1e-6)
    assert not are_near_ellipses(OVAL, replace(OVAL, angle=31.0), 1e-2)


def test_holes_and_islands_are_told_apart():
    outline = Outline((BOX, OVAL, circle(0.5, 1.0, -0.5), Ellipse(1.0, 0.5, 8.0, 8.0)))
    check_crossings(outline)
    assert nesting(outline.loops) == [1, -1, 1, -1]
    assert outline.area == pytest.approx(400 - 10 * math.pi + 0.25 * math.pi - 0.5 * math.pi)
    assert [len(area) for area in regions(outline)] == [3, 1]
    assert is_in_loop(OVAL, *ellipse_point(replace(OVAL, rx=4.9, ry=1.9), 0.7))
    assert not is_in_loop(OVAL, *ellipse_point(replace(OVAL, rx=5.1, ry=2.1), 0.7))


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ((*BOX[:2], (0.0, 1.0, 0.0)), "crosses or touches"),
        (circle(3.0), "crosses or touches"),
        (Ellipse(5.0, 2.0, 1.0, -0.5, 120.0), "crosses or touches"),
        (OVAL, "crosses or touches"),
        (Ellipse(2.0, 5.0, 1.0, -0.5, -60.0), "crosses or touches"),  # the same one
    ],
)
def test_what_crosses_is_refused_by_loop_and_curve(other, said):
    assert refusal(OVAL, other).startswith("loop 0 curve 0 " + said + " loop 1 curve")


@pytest.mark.parametrize("gap", [1e-6, 0.0, -1e-6])
def test_what_touches_is_refused_and_what_clears_is_not(gap):
    """Tangent outside at the end of an axis: a line, a circle and another ellipse."""
    upright = replace(OVAL, x=0.0, y=0.0, angle=0.0)
    line = ((5.0 + gap, -1.0, 0.0), (9.0, 0.0, 0.0), (5.0 + gap, 1.0, 0.0))
    for other in (line, circle(1.0, 6.0 + gap), Ellipse(2.0, 1.0, 0.0, 4.0 + gap, 90.0), Ellipse(0.5, 7.0, 5.5 + gap, 0.0)):
        if gap > 0:
            check_crossings(Outline((upright, other)))
        else:
            assert "crosses or touches" in refusal(upright, other)


def test_inside_without_touching_is_no_crossing():
    check_crossings(Outline((OVAL, replace(OVAL, rx=4.99, ry=1.99), circle(1.0, 1.0, -0.5))))


@pytest.mark.parametrize(
    ("loop", "said"),
    [
        ({"rx": 0, "ry": 2}, "loop 1: an ellipse needs positive semi-axes, got 0 and 2"),
        ({"rx": 3, "ry": -2}, "loop 1: an ellipse needs positive semi-axes, got 3 and -2"),
        ({"rx": 3}, r"\.outline\[1\]"),
        ({"rx": 3, "ry": "2"}, r"\.outline\[1\]\.ry"),
        ({"rx": 3, "ry": 2, "center": [1]}, r"\.outline\[1\]\.center: expected a list of 2"),
        ({"rx": 3, "ry": 2, "tilt": 1}, r"\.outline\[1\]"),
        ({"rx": 3, "ry": 12}, "loop 0 curve 0 crosses or touches loop 1 curve 0"),
        ({"rx": 3, "ry": 1e-12}, "loop 1 is too narrow"),
    ],
)
def test_bad_documents_are_refused_in_one_line(loop, said):
    document = json.loads(dumps(Primitive("extrude", (1.0,), outline=Outline((BOX,)))))
    document["program"]["outline"].append(loop)
    with pytest.raises(ValueError, match=said) as refused:
        loads(json.dumps(document).encode())
    assert "\n" not in str(refused.value)


def test_a_document_reads_back():
    leaf = Primitive("extrude", (1.0,), (1.0, 2.0, 3.0), (10.0, 20.0, 30.0), Outline((BOX, OVAL)))
    text = dumps(leaf)
    assert '{"rx": 5.0, "ry": 2.0, "center": [1.0, -0.5], "angle": 30.0}' in " ".join(text.split())
    assert loads(text.encode()) == leaf
    assert str(count(leaf)) == "1 feature, 5 curves in outlines"
    assert faces_of(leaf) == ["+z", "-z", "wall[0][0]", "wall[0][1]", "wall[0][2]", "wall[0][3]"]


@pytest.mark.parametrize("motion", [turn((0.1, 0.2, 0.3), (0.6, 0.0, 0.8), 77.0), mirror((0.3, 0.0, 0.1), (0.0, 0.6, 0.8))])
@pytest.mark.parametrize("kind", ["extrude", "revolve"])
def test_a_motion_is_known_whatever_the_frame(motion, kind):
    from imdim.program.motions import move_leaf

    one = Primitive(kind, (4.0,) if kind == "extrude" else (360.0,), (1.0, 2.0, 3.0), (10.0, 20.0, 30.0), Outline((replace(OVAL, x=9.0),)))
    there = move_leaf(one, motion)
    assert is_outlined_moved(one, there, motion, 1e-9)
    assert there.outline is not None
    (loop,) = there.outline.loops
    assert isinstance(loop, Ellipse)
    drawn_otherwise = replace(there, outline=Outline((Ellipse(loop.ry, loop.rx, loop.x, loop.y, loop.angle + 90.0),)))
    assert is_outlined_moved(one, drawn_otherwise, motion, 1e-9)
    assert not is_outlined_moved(one, replace(there, outline=Outline((replace(loop, angle=loop.angle + 1.0),))), motion, 1e-3)


def test_scaled_shifted_and_mirrored():
    outline = Outline((OVAL, circle(0.5, 1.0, -0.5)))
    assert outline.map_lengths(lambda v: 2 * v).loops[0] == Ellipse(10.0, 4.0, 2.0, -1.0, 30.0)
    assert outline.shift(1.0, 0.5).loops[0] == Ellipse(5.0, 2.0, 2.0, 0.0, 30.0)
    assert outline.mirror().loops[0] == Ellipse(5.0, 2.0, -1.0, -0.5, -30.0)
    assert are_near(outline.mirror().mirror(), outline, 1e-12)


def test_a_conic_meets_it_where_both_equations_hold():
    line = (0.0, 0.0, 0.0, 1.0, -2.0, 0.3)
    found = [p for p in meet_conic(OVAL, line) if abs(p[0] - 2 * p[1] + 0.3) < 1e-9]
    assert len({(round(x, 6), round(y, 6)) for x, y in found}) == 2
