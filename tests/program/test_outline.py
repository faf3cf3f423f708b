"""Outlines against closed forms and finely sampled loops; what is wrong with one in one line; drawn leaves as JSON and back."""

import json
import math

import numpy as np
import pytest
from outlined_samples import random_drawn, random_outline, wraps

from imdim.geometry.census import census_of
from imdim.geometry.solid import to_manifold
from imdim.program.codec import dumps, from_json, loads, to_json
from imdim.program.outline import (
    MOST_CURVES,
    Loop,
    Outline,
    arc_center,
    arc_radius,
    are_near,
    check_crossings,
    circle,
    circle_of,
    flatten_loop,
    is_in_loop,
    loop_area,
    loop_curves,
    nesting,
    orient_loops,
    rectangle,
    reverse_loop,
)
from imdim.program.tree import OUTLINED, Primitive, combine_all, envelope, map_lengths

(SQUARE,) = rectangle(2.0, 2.0).loops
STADIUM: Loop = ((-1.0, -0.5, 0.0), (1.0, -0.5, 1.0), (1.0, 0.5, 0.0), (-1.0, 0.5, 1.0))
NICHE: Loop = ((-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, -1.0), (-1.0, 1.0, 0.0))  # a half disc taken out of a square
CAP: Loop = ((-1.0, 0.0, 0.0), (1.0, 0.0, math.tan(math.pi / 8)))  # of a quarter turn


@pytest.mark.parametrize(
    ("loops", "area"),
    [
        ((SQUARE,), 4.0),
        ((circle(0.7, 3.0, -1.0),), math.pi * 0.49),
        ((STADIUM,), 2 + math.pi / 4),
        ((NICHE,), 4 - math.pi / 2),
        ((CAP,), math.pi / 2 - 1),
        ((SQUARE, circle(0.5)), 4 - math.pi / 4),
        ((circle(0.5), reverse_loop(SQUARE)), 4 - math.pi / 4),
        ((SQUARE, circle(0.5), circle(0.25)), 4 - math.pi * (0.25 - 0.0625)),
        ((SQUARE, tuple((x + 5, y, b) for x, y, b in SQUARE)), 8.0),
    ],
)
def test_areas(loops: tuple[Loop, ...], area: float):
    assert Outline(loops).area == pytest.approx(area, rel=1e-12)


@pytest.mark.parametrize(
    ("loop", "low", "high"),
    [
        (SQUARE, (-1, -1), (1, 1)),
        (STADIUM, (-1.5, -0.5), (1.5, 0.5)),
        (NICHE, (-1, -1), (1, 1)),
        (CAP, (-1, 0), (1, math.sqrt(2) - 1)),
        (circle(0.7, 3.0, -1.0), (2.3, -1.7), (3.7, -0.3)),
    ],
)
def test_bounds(loop: Loop, low: tuple, high: tuple):
    for way in (loop, reverse_loop(loop)):
        np.testing.assert_allclose(Outline((way,)).bounds, (low, high), atol=1e-12)


def test_bounds_and_area_of_random_outlines_are_those_of_polygons():
    rng = np.random.default_rng(0)
    for _ in range(40):
        outline = random_outline(rng)
        points = np.array([p for loop in outline.loops for p in flatten_loop(loop, 20_000)])
        np.testing.assert_allclose(outline.bounds, (points.min(axis=0), points.max(axis=0)), atol=1e-6)
        flat = rng.uniform(*outline.bounds, (20_000, 2))
        share = outline.area / np.prod(np.ptp(outline.bounds, axis=0))
        assert wraps(outline, flat).mean() == pytest.approx(share, abs=4 * math.sqrt(share * (1 - share) / 20_000) + 1e-3)


def test_a_quarter_arc_has_its_centre_where_bulges_say():
    (arc,) = [c for c in loop_curves(CAP) if c[4]]
    assert arc_radius(arc) == pytest.approx(math.sqrt(2))
    np.testing.assert_allclose(arc_center(arc), (0, -1), atol=1e-12)


def test_membership_is_that_of_polygons_and_of_points_on_chords():
    rng = np.random.default_rng(1)
    for _ in range(20):
        outline = random_outline(rng)
        flat = rng.uniform(-0.7, 0.7, (200, 2))
        found = [sum(is_in_loop(loop, x, y) for loop in outline.loops) % 2 == 1 for x, y in flat.tolist()]
        assert (found != wraps(outline, flat, 20_000)).sum() <= 1  # but for points between an arc and its polygon
    assert all(is_in_loop(circle(1.0), x, 0.0) for x in (-0.9, -0.5, 0.0, 0.3, 0.9))
    assert not any(is_in_loop(circle(1.0), x, y) for x, y in ((1.1, 0.0), (-1.1, 0.0), (0.8, 0.8)))


def test_nested_loops_are_oriented_by_turns():
    ways = [loop_area(loop) > 0 for loop in orient_loops([circle(0.2), SQUARE, reverse_loop(circle(0.6)), reverse_loop(circle(0.1, 5.0))])]
    assert ways == [True, True, False, True]


def test_a_reversed_loop_is_the_same_loop():
    for loop in (SQUARE, STADIUM, NICHE, CAP, circle(0.3)):
        back = reverse_loop(loop)
        assert loop_area(back) == pytest.approx(-loop_area(loop))
        assert back[0][:2] == loop[0][:2]
        assert reverse_loop(back) == loop


def test_mirrored_and_moved_outlines():
    rng = np.random.default_rng(2)
    for _ in range(10):
        outline, flat = random_outline(rng), rng.uniform(-0.7, 0.7, (500, 2))
        np.testing.assert_array_equal(wraps(outline.mirror(), flat * (-1, 1), 2000), wraps(outline, flat, 2000))
        np.testing.assert_array_equal(wraps(outline.shift(3.0, -2.0), np.add(flat, (3.0, -2.0)), 2000), wraps(outline, flat, 2000))
        np.testing.assert_array_equal(wraps(outline.map_lengths(lambda v: 2 * v), 2 * flat, 2000), wraps(outline, flat, 2000))
        assert [loop_area(a) > 0 for a in outline.mirror().loops] == [loop_area(a) > 0 for a in outline.loops]


def test_a_circle_is_known_as_one():
    assert circle_of(circle(0.5, 1.0, 2.0)) == pytest.approx((1.0, 2.0, 0.5))
    assert circle_of(reverse_loop(circle(0.5))) == pytest.approx((0.0, 0.0, 0.5))
    assert circle_of(CAP) is None
    assert circle_of(SQUARE) is None


def test_near_outlines():
    assert are_near(None, None, 0.0)
    assert not are_near(None, Outline((SQUARE,)), 1.0)
    moved = Outline(((*STADIUM[:3], (-1.0, 0.501, 1.001)),))
    assert are_near(Outline((STADIUM,)), moved, 2e-3)
    assert not are_near(Outline((STADIUM,)), moved, 5e-4)
    assert not are_near(Outline((SQUARE,)), Outline((SQUARE, circle(0.1))), 9.0)


NAN = math.nan


@pytest.mark.parametrize(
    ("loops", "message"),
    [
        ((), "an outline needs at least one loop"),
        ((SQUARE, ((0.0, 0.0, 1.0),)), "loop 1 has 1 vertices; it needs 2 or more"),
        ((SQUARE, ()), "loop 1 has 0 vertices; it needs 2 or more"),
        (((*SQUARE, SQUARE[-1]),), "loop 0 curve 3 has no length: it starts and ends at (-1.0, 1.0)"),
        ((SQUARE, (*SQUARE[:2], (NAN, 0.0, 0.0))), "loop 1 curve 2 needs finite numbers, got (nan, 0.0, 0.0)"),
        (((*SQUARE[:3], (0.0, math.inf, 0.0)),), "loop 0 curve 3 needs finite numbers, got (0.0, inf, 0.0)"),
        (((*SQUARE[:3], (0.0, 2.0, NAN)),), "loop 0 curve 3 needs finite numbers, got (0.0, 2.0, nan)"),
        ((((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),), "loop 0 encloses nothing: its two curves are one"),
        ((((0.0, 0.0, 0.4), (1.0, 0.0, -0.4)),), "loop 0 encloses nothing: its two curves are one"),
        ((SQUARE,) * 501, f"an outline of 2004 curves; at most {MOST_CURVES} are read"),
    ],
)
def test_what_bounds_nothing_is_refused_by_name(loops: tuple[Loop, ...], message: str):
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        Outline(loops)
    assert str(caught.value) == message


BOW: Loop = ((-1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (1.0, -1.0, 0.0), (-1.0, 1.0, 0.0))


@pytest.mark.parametrize(
    ("loops", "which"),
    [
        ((BOW,), (0, 0, 0, 2)),
        ((SQUARE, circle(0.5, 1.0)), (0, 1, 1, 0)),  # its half arcs meet in the right side's middle, beside it the lower one cuts
        ((SQUARE, circle(0.5, 0.5)), (0, 1, 1, 0)),  # touches the right side from within
        ((SQUARE, circle(0.4), circle(0.4, 0.3)), (1, 0, 2, 0)),
        ((SQUARE, SQUARE), (0, 0, 1, 0)),
        ((SQUARE, ((1.0, 1.0, 0.0), (2.0, 1.0, 0.0), (2.0, 2.0, 0.0))), (0, 1, 1, 0)),  # a common corner of two loops
        ((SQUARE, ((1.0, -0.5, 0.0), (2.0, -0.5, 0.0), (2.0, 0.5, 0.0), (1.0, 0.5, 0.0))), (0, 1, 1, 0)),  # side by side
        ((((-1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),), (0, 0, 0, 1)),  # runs back along itself
        ((((-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (-1.0, 1.0, 0.0)),), (0, 0, 0, 2)),  # touches itself
        ((((-1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 1.5), (-1.0, 1.0, 0.0)),), None),
        ((((-1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, -1.2), (-1.0, 1.0, 0.0)),), (0, 0, 0, 2)),  # an arc through the opposite side
    ],
)
def test_curves_that_cross_or_touch_are_named(loops: tuple[Loop, ...], which: tuple[int, ...] | None):
    outline = Outline(loops)
    if which is None:
        check_crossings(outline)
        return
    with pytest.raises(ValueError, match="crosses or touches") as caught:
        check_crossings(outline)
    i, k, j, other = which
    assert str(caught.value) == f"loop {i} curve {k} crosses or touches loop {j} curve {other}"


@pytest.mark.parametrize("loops", [(SQUARE,), (STADIUM,), (NICHE,), (CAP,), (SQUARE, circle(0.5), circle(0.25)), (circle(0.1), SQUARE)])
def test_good_outlines_are_not_refused_whichever_way_they_run(loops: tuple[Loop, ...]):
    check_crossings(Outline(loops))
    check_crossings(Outline(tuple(map(reverse_loop, loops))))


def test_random_outlines_do_not_cross():
    rng = np.random.default_rng(4)
    for _ in range(60):
        check_crossings(random_outline(rng))


ACROSS = "revolve needs an outline at x >= 0, got one that crosses its axis to x = "


@pytest.mark.parametrize(
    ("kind", "size", "outline", "message"),
    [
        ("extrude", (1.0,), None, "extrude needs an outline"),
        ("revolve", (90.0,), None, "revolve needs an outline"),
        ("box", (1.0, 1.0, 1.0), Outline((SQUARE,)), "box needs no outline"),
        ("extrude", (0.0,), Outline((SQUARE,)), "extrude needs positive h, got 0.0"),
        ("extrude", (1.0, 2.0), Outline((SQUARE,)), "extrude needs 1 sizes ('h',), got (1.0, 2.0)"),
        ("revolve", (361.0,), Outline((circle(0.5, 1.0),)), "revolve needs an angle of at most 360, got 361.0"),
        ("revolve", (360.0,), Outline((SQUARE,)), ACROSS + "-1"),
        # the arc alone reaches across
        ("revolve", (9.0,), Outline((reverse_loop(((0.0, -1.0, 0.0), (0.0, 1.0, 1.0), (0.0, 0.0, 0.0))),)), ACROSS + "-0.5"),
    ],
)
def test_leaves_refuse_what_they_cannot_be_drawn_from(kind: str, size: tuple, outline: Outline | None, message: str):
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        Primitive(kind, size, outline=outline)
    assert str(caught.value) == message


def test_an_envelope_holds_and_lengths_scale():
    rng = np.random.default_rng(5)
    for kind in OUTLINED:
        leaf = random_drawn(rng, kind, 0.7, (0.1, 0.2, 0.3), (20.0, 30.0, 40.0))
        assert leaf.outline is not None
        (left, low), (right, high) = leaf.outline.bounds
        held_by = envelope(leaf)
        half = held_by.size[0] if kind == "revolve" else held_by.size[0] / 2
        assert half >= max(abs(left), abs(right)) - 1e-12
        assert held_by.size[1] / 2 >= max(abs(low), abs(high)) - 1e-12
        twice = map_lengths(leaf, lambda v: 2 * v, (0.0, 0.0, 0.0))
        assert twice.outline is not None
        assert twice.outline.area == pytest.approx(4 * leaf.outline.area)
        assert twice.size == (leaf.size if kind == "revolve" else (2 * leaf.size[0], *leaf.size[1:]))


@pytest.mark.parametrize("kind", OUTLINED)
def test_a_drawn_leaf_comes_back_exactly(kind: str):
    rng = np.random.default_rng(6)
    for _ in range(20):
        leaf = random_drawn(rng, kind, float(rng.uniform(0.1, 0.9)), (0.1, 1 / 3, 0.3), (20.0, 30.0, 1e-9))
        text = dumps(leaf)
        assert json.loads(text)["version"] == 4
        assert loads(text) == leaf
        assert dumps(loads(text)) == text


def drawn_document(outline: object, version: int = 4) -> dict:
    leaf = Primitive("extrude", (1.0,), outline=Outline((SQUARE,)))
    document = to_json(leaf)
    document["version"] = version
    document["program"]["outline"] = outline
    return document


@pytest.mark.parametrize(
    ("outline", "message"),
    [
        (5, "$.program.outline: expected a list of loops, got 5"),
        ([5], "$.program.outline[0]: expected a list of vertices, got 5"),
        ([[[0, 0], [1, 0], [1]]], "$.program.outline[0][2]: expected [x, y] or [x, y, bulge], got a list of 1"),
        ([[[0, 0], [1, 0], [1, 1, 0, 0]]], "$.program.outline[0][2]: expected [x, y] or [x, y, bulge], got a list of 4"),
        ([[[0, 0], [1, 0], [1, "1"]]], "$.program.outline[0][2][1]: expected a number, got '1'"),
        ([[[0, 0], [1, 0], [1, math.inf]]], "$.program.outline[0][2][1]: expected a finite number, got inf"),
        ([], "$.program.outline: an outline needs at least one loop"),
        ([[[0, 0]]], "$.program.outline: loop 0 has 1 vertices; it needs 2 or more"),
        ([[[0, 0], [0, 0], [1, 1]]], "$.program.outline: loop 0 curve 0 has no length: it starts and ends at (0.0, 0.0)"),
        ([[[0, 0], [2, 2], [2, 0], [0, 2]]], "$.program.outline: loop 0 curve 0 crosses or touches loop 0 curve 2"),
        ([[[0, 0]] * 2001], "$.program.outline: at most 2000 curves, got 2001"),
    ],
)
def test_a_wrong_outline_is_named_in_one_line(outline: object, message: str):
    with pytest.raises(ValueError, match=r"\$") as caught:
        from_json(drawn_document(outline))
    assert str(caught.value) == message


@pytest.mark.parametrize("version", [1, 2, 3])
def test_outlines_are_of_version_4(version: int):
    good = [[[0, 0], [1, 0], [1, 1, 0.5]]]
    assert isinstance(from_json(drawn_document(good)), Primitive)
    with pytest.raises(ValueError, match="version"):
        from_json(drawn_document(good, version))


def test_programs_without_outlines_keep_their_version():
    assert to_json(Primitive("box", (1.0, 1.0, 1.0)))["version"] == 1
    document = to_json(Primitive("box", (1.0, 1.0, 1.0)))
    document["program"]["outline"] = [[[0, 0], [1, 0], [1, 1]]]
    document["version"] = 4
    with pytest.raises(ValueError, match="unknown key 'outline'"):
        from_json(document)


def test_walls_on_one_circle_have_the_same_facets_whatever_drew_them():
    """Facets that cross would leave needles between a shaft and the flat that is drawn beside it."""
    x, y, radius = 4.3, math.sqrt(10**2 - 4.3**2), 10.0
    loop = ((-x, -y, math.tan(math.atan2(y, -x) / 2)), (-x, y, 0.0))
    corners = flatten_loop(loop, 96)
    assert all(math.hypot(*c) == pytest.approx(radius) for c in corners)
    round_ones = {(round(radius * math.cos(k * math.pi / 48), 9), round(radius * math.sin(k * math.pi / 48), 9)) for k in range(96)}
    assert {(round(a, 9), round(b, 9)) for a, b in corners} - round_ones == {(-x, round(-y, 9)), (-x, round(y, 9))}
    shaft = Primitive("cylinder", (radius, 8.0), (0.0, 0.0, 2.0))
    flat = Primitive("extrude", (8.0,), (0.0, 0.0, -2.0), outline=Outline((loop,)))
    assert census_of(to_manifold(combine_all("union", [shaft, flat]), 96)).kind == (1, 0, 0)


def test_where_arcs_go_on_in_one_another_is_no_corner():
    """It would stand out from the facets of a disc of that size, with a hole no wider than a hair between."""
    at = [(4.0 * math.cos(math.radians(a)), 4.0 * math.sin(math.radians(a))) for a in (17.0, 139.0, 301.0)]
    loop = tuple((x, y, math.tan(math.radians(turn) / 4)) for (x, y), turn in zip(at, (122.0, 162.0, 76.0), strict=True))
    corners = flatten_loop(loop, 96)
    steps = [math.degrees(math.atan2(y, x)) / 3.75 for x, y in corners]
    assert len(corners) == 96
    assert [s - round(s) for s in steps] == pytest.approx([0.0] * 96, abs=1e-9)
    assert len(flatten_loop(((*at[0], loop[0][2]), (*at[1], 0.0)), 96)) == 2 + 33


def test_holes_in_the_bulge_of_an_arc_are_holes():
    """Beyond all vertices, where only the arc reaches."""
    round_end = ((0.0, 0.0, 0.0), (1.0, 0.0, 3.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.0))
    hole = ((2.0, 0.4, 0.0), (2.2, 0.4, 0.0), (2.2, 0.6, 0.0), (2.0, 0.6, 0.0))
    beside = ((3.0, 0.4, 0.0), (3.2, 0.4, 0.0), (3.2, 0.6, 0.0), (3.0, 0.6, 0.0))
    assert nesting((round_end, hole, beside)) == [1, -1, 1]


def test_lines_that_fold_back_onto_their_neighbour_are_refused():
    with pytest.raises(ValueError, match="loop 0 curve 0 crosses or touches loop 0 curve 1"):
        check_crossings(Outline((((0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (1.0, 1e-12, 0.0), (1.0, 1.0, 0.0)),)))
