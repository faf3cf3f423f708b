"""Outlines whose walls lean: insets against closed forms, and what has none."""

import json
import math
import re

import numpy as np
import pytest
from outlined_samples import rounded_rectangle
from tests.known_programs import ANGLE, OBLONG, ROUNDED, SQUARE

from imdim.program.codec import dumps, loads
from imdim.program.drafting import foot_of, inset_at_top, make_touch, shrink
from imdim.program.motions import mirror, move_leaf
from imdim.program.outline import Outline, arc_center, arc_radius, circle, ellipse, reverse_loop, ring_curves
from imdim.program.patterns.outlined import is_outlined_moved
from imdim.program.plain_outlines import to_simple
from imdim.program.rewrite.separation import separate_holes, separate_loops
from imdim.program.tree import Combine, Primitive, leaves, top_of


def test_corners_stay_corners_and_holes_get_wider():
    (ring,) = shrink(Outline((ANGLE,)), 0.1).loops
    assert np.allclose(np.array(ring)[:, :2], [(-0.4, -0.4), (0.4, -0.4), (0.4, -0.1), (-0.1, -0.1), (-0.1, 0.4), (-0.4, 0.4)])
    outline = foot_of(Outline((SQUARE, circle(0.1))))
    assert arc_radius(ring_curves(shrink(outline, 0.05).rings[1])[0]) == pytest.approx(0.15)
    assert shrink(outline, 0.0).area == pytest.approx(outline.area)
    assert shrink(shrink(outline, 0.05), -0.05).area == pytest.approx(outline.area)


def test_arcs_keep_their_centres_and_touch_their_neighbours():
    before, after = Outline((ROUNDED,)), shrink(Outline((ROUNDED,)), 0.06)
    for one, other in zip(ring_curves(before.rings[0]), ring_curves(after.rings[0]), strict=True):
        if one[4]:
            assert arc_center(one) == pytest.approx(arc_center(other))
            assert arc_radius(other) == pytest.approx(arc_radius(one) - 0.06)
        else:
            u, v = np.subtract(one[2:4], one[:2]), np.subtract(other[2:4], other[:2])
            assert abs(u[0] * v[1] - u[1] * v[0]) < 1e-12


@pytest.mark.parametrize(
    ("loops", "inset", "message"),
    [
        ((OBLONG,), 0.31, "an inset of 0.31 is too much: loop 0 curve 1 vanishes"),
        ((ROUNDED,), 0.2, "an inset of 0.2 is too much: loop 0 curve 1 vanishes"),
        ((OBLONG, circle(0.2)), 0.06, "an inset of 0.06 is too much: loop 0 curve 0 crosses or touches loop 1 curve 1"),
        ((ellipse(0.5, 0.3),), 0.1, "no draft for an ellipse: walls that all lean from it by one angle end in none"),
        (
            (((-0.5, 0.0, 0.0), (0.5, 0.0, 0.7)),),
            0.1,
            "no draft for loop 0 curve 0: an arc and its neighbour do not touch where they meet",
        ),
    ],
)
def test_what_has_no_inset_is_refused_in_one_line_that_names_it(loops, inset, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        shrink(foot_of(Outline(loops)), inset)


def drafted(*loops, height: float = 1.0, inset: float = 0.1) -> Primitive:
    return Primitive("drafted", (height, math.degrees(math.atan(inset / height))), (1.0, 2.0, 3.0), (10.0, 20.0, 30.0), Outline(loops))


@pytest.mark.parametrize("draft", [0.0, -3.0, 90.0, 120.0])
def test_a_draft_is_an_angle_above_nought_and_below_a_right_one(draft):
    with pytest.raises(ValueError, match="drafted needs"):
        Primitive("drafted", (1.0, draft), outline=Outline((OBLONG,)))


def test_a_document_with_walls_that_meet_is_refused_by_its_path():
    document = json.loads(dumps(drafted(OBLONG)))
    document["program"]["size"]["draft"] = 50
    with pytest.raises(ValueError, match=r"^\$\.program\.size: an inset of 1\.19\d+ is too much: loop 0 curve \d vanishes$"):
        loads(json.dumps(document))
    document["program"]["size"] = {"h": 1.0}
    with pytest.raises(ValueError, match=r"size.*draft"):
        loads(json.dumps(document))


def test_loops_are_kept_with_what_is_inside_on_their_left():
    one, other = drafted(OBLONG, circle(0.05)), drafted(reverse_loop(OBLONG), reverse_loop(circle(0.05)))
    assert one.outline is not None
    assert other.outline is not None
    assert [loop[0][2] for loop in (one.outline.loops[1], other.outline.loops[1])] == [-1, -1]
    assert one.outline.area == other.outline.area
    assert loads(dumps(one)) == one


def test_a_mirror_image_is_its_copy_and_what_is_upside_down_is_not():
    leaf = drafted(ANGLE)
    assert leaf.outline is not None
    motion = mirror((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    image = move_leaf(leaf, motion)
    assert is_outlined_moved(leaf, image, motion, 1e-9)
    across = mirror((1.0, 2.0, 3.0), (0.0, 0.0, 1.0))
    level = Primitive("drafted", leaf.size, (1.0, 2.0, 3.0), outline=leaf.outline)
    assert not is_outlined_moved(level, level, across, 1e-9)


def test_a_drafted_circle_is_a_cone_and_the_top_is_that_of_the_cone():
    leaf = drafted(circle(0.4))
    cone = to_simple(leaf)
    assert cone is not None
    assert (cone.kind, cone.size) == ("cone", pytest.approx((0.4, 0.3, 1.0)))
    assert top_of(leaf).area == pytest.approx(math.pi * 0.09)


def test_areas_are_taken_apart_and_holes_stay():
    """A hole in what leans inward gets wider on the way up, where one that is cut by itself would lean inward too."""
    two = drafted(SQUARE, circle(0.1), *Outline((OBLONG,)).shift(3.0, 0.0).loops)
    parts = separate_loops(two)
    assert isinstance(parts, Combine)
    assert parts.op == "union"
    assert sorted(len(leaf.outline.loops) for leaf in leaves(parts) if leaf.outline) == [1, 2]
    assert separate_holes(two) == two


def test_arcs_that_all_but_touch_are_made_to():
    """Where they are drawn along walls whose numbers are off by a little."""
    (ring,) = Outline((rounded_rectangle(2.0, 1.4, 0.3),)).loops
    assert isinstance(ring, tuple)
    off = tuple((x + 0.02 * (k == 1), y, b * (1.05 if k == 1 else 1)) for k, (x, y, b) in enumerate(ring))
    with pytest.raises(ValueError, match="do not touch"):
        shrink(Outline((off,)), 0.1)
    (mended,) = make_touch(Outline((off,))).rings
    assert shrink(Outline((mended,)), 0.1).area == pytest.approx(shrink(Outline((ring,)), 0.1).area, rel=0.01)
    assert np.allclose(make_touch(Outline((ring,))).loops, [ring])


def test_how_far_in_the_top_is():
    assert inset_at_top(10.0, 45.0) == pytest.approx(10.0)
