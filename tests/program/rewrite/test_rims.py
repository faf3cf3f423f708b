"""Notches, teeth and lobes of rims become features of their own, and the solid stays as it was."""

import math

import numpy as np
import pytest
from manifold3d import CrossSection, FillRule
from tests.planted import box, cut, cylinder

from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.outline import Outline, Ring, arc_radius, circle, ring_curves
from imdim.program.rewrite.rims import separate_rims
from imdim.program.tree import Primitive, Program, leaves

SEGMENTS, SAME = 384, 5e-6
NO_CORNERS = np.zeros((0, 3))
TURNED = {"center": (1.0, -2.0, 3.0), "rotation": (20.0, 30.0, 40.0)}


def extrude(*loops: Ring, height: float = 2.0, **place) -> Primitive:
    return Primitive("extrude", (height,), outline=Outline(loops), **place)


def take_apart(drawn: Program, corners: np.ndarray = NO_CORNERS, slack: float = SAME) -> Program:
    solid = to_manifold(drawn, SEGMENTS)
    return separate_rims(drawn, lambda trial: 1 - volume_iou(to_manifold(trial, SEGMENTS), solid), slack, corners)


def differ(a: Program, b: Program) -> float:
    """By exact booleans: arcs end between the corners of a circle, so that many are needed."""
    return 1 - volume_iou(to_manifold(a, SEGMENTS), to_manifold(b, SEGMENTS))


def kinds(program: Program) -> dict[str, int]:
    found = [leaf.kind for leaf in leaves(program)]
    return {kind: found.count(kind) for kind in dict.fromkeys(found)}


def sector(radius: float, a: float, b: float) -> tuple[float, float, float]:
    """The vertex at which an arc about the origin starts that turns from angle `a` to `b`, in radians."""
    return radius * math.cos(a), radius * math.sin(a), math.tan((b - a) / 4)


def knob(count: int, radius: float, rim: float, finger: float, outward: bool = False) -> Ring:
    """A disc with finger notches, or lobes, of radius `finger` whose middles are `rim` from its own."""
    # where the circles meet
    half = math.acos((radius**2 + rim**2 - finger**2) / (2 * radius * rim))
    reach = math.acos((rim**2 + finger**2 - radius**2) / (2 * rim * finger))
    bulge = math.tan((math.pi - reach) / 2) if outward else -math.tan(reach / 2)
    ring = []
    for k in range(count):
        middle = 2 * math.pi * k / count
        x, y = radius * math.cos(middle - half), radius * math.sin(middle - half)
        ring += [(x, y, bulge), sector(radius, middle + half, middle + 2 * math.pi / count - half)]
    return tuple(ring)


def castle(count: int, radius: float, floor: float, width: float) -> Ring:
    """A disc with slots square to its rim; teeth where `floor` is larger than `radius`."""
    half = math.asin(width / 2 / radius)
    ring = []
    for k in range(count):
        turn = 2 * math.pi * k / count
        c, s = math.cos(turn), math.sin(turn)
        ring.append((radius * math.cos(turn - half), radius * math.sin(turn - half), 0.0))
        ring += [(c * floor - s * v, s * floor + c * v, 0.0) for v in (-width / 2, width / 2)]
        ring.append(sector(radius, turn + half, turn + 2 * math.pi / count - half))
    return tuple(ring)


def comb(count: int, depth: float, bulge: float = 0.0) -> Ring:
    """A bar with slots or, of negative `depth`, tabs; `bulge` rounds their floors."""
    ring: list[tuple[float, float, float]] = [(0.0, -5.0, 0.0), (10.0 * count, -5.0, 0.0), (10.0 * count, 0.0, 0.0)]
    for k in reversed(range(count)):
        x = 10.0 * k
        ring += [(x + 7, 0.0, 0.0), (x + 7, -depth, bulge), (x + 3, -depth, 0.0), (x + 3, 0.0, 0.0)]
    return (*ring, (0.0, 0.0, 0.0))


HALF_ROUND = (
    (0.0, 0.0, 0.0),
    *(v for k in range(4) for v in ((5.0 + 10 * k, 0.0, -1.0), (9.0 + 10 * k, 0.0, 0.0))),
    (50.0, 0.0, 0.0),
    (50.0, 20.0, 0.0),
    (0.0, 20.0, 0.0),
)
CORNERS = ((3.0, 0.0, 0.0), (27.0, 0.0, -math.tan(math.pi / 8)), (30.0, 3.0, 0.0), (30.0, 17.0, -math.tan(math.pi / 8)), (27.0, 20.0, 0.0))
CORNERS = (*CORNERS, (3.0, 20.0, -math.tan(math.pi / 8)), (0.0, 17.0, 0.0), (0.0, 3.0, -math.tan(math.pi / 8)))


@pytest.mark.parametrize(
    ("loop", "found"),
    [
        (knob(8, 14.5, 15.5, 2.0), {"cylinder": 9}),
        (knob(5, 20.0, 20.0, 5.0, outward=True), {"cylinder": 6}),
        (castle(10, 30.0, 24.0, 6.0), {"cylinder": 1, "box": 10}),
        (castle(6, 10.0, 13.0, 5.0), {"cylinder": 1, "box": 6}),
        (castle(6, 10.0, 10.2, 5.0), {"cylinder": 1, "box": 6}),
        (comb(5, 3.0), {"box": 6}),
        (comb(5, -3.0), {"box": 6}),
        (comb(5, 2.0, bulge=-1.0), {"box": 6, "cylinder": 5}),
        (HALF_ROUND, {"box": 1, "cylinder": 4}),
        (CORNERS, {"box": 1, "cylinder": 4}),
    ],
    ids=["knob", "lobes", "castle", "spline", "low teeth", "comb", "tabs", "slots", "half rounds", "corners"],
)
def test_what_is_alike_becomes_features(loop: Ring, found: dict[str, int]) -> None:
    drawn = extrude(loop)
    program = take_apart(drawn)
    assert kinds(program) == found
    assert differ(program, drawn) <= SAME


@pytest.mark.parametrize(
    ("loop", "found"), [(castle(6, 10.0, 13.0, 5.0), {"cylinder": 1, "box": 6}), (HALF_ROUND, {"box": 1, "cylinder": 4})]
)
def test_it_may_lie_anywhere(loop: Ring, found: dict[str, int]) -> None:
    drawn = extrude(loop, **TURNED)
    program = take_apart(drawn)
    assert kinds(program) == found
    assert differ(program, drawn) <= SAME


def test_the_notches_of_a_knob_are_the_ones_that_were_cut() -> None:
    body, *fingers = leaves(take_apart(extrude(knob(20, 14.5, 15.5, 2.0))))
    assert body.size == pytest.approx((14.5, 2.0))
    assert {round(finger.size[0], 9) for finger in fingers} == {2.0}
    assert [math.hypot(*finger.center[:2]) for finger in fingers] == pytest.approx([15.5] * 20)


def test_a_hole_has_a_rim_too() -> None:
    """A spline's bore: a round hole, and boxes that are cut as well."""
    drawn = extrude(circle(20.0), castle(8, 8.0, 10.0, 3.0))
    program = take_apart(drawn)
    assert kinds(program) == {"cylinder": 2, "box": 8}
    assert differ(program, drawn) <= SAME


def test_keys_that_stand_into_a_hole_stay_in_it() -> None:
    drawn = extrude(circle(20.0), castle(4, 12.0, 10.0, 3.0))
    program = take_apart(drawn)
    assert kinds(program) == {"cylinder": 2, "box": 4}
    assert differ(program, drawn) <= SAME


def test_two_kinds_of_notches() -> None:
    lower = [
        v
        for k in range(3)
        for v in ((5.0 + 14 * k, 0.0, 0.0), (5.0 + 14 * k, 4.0, 0.0), (11.0 + 14 * k, 4.0, 0.0), (11.0 + 14 * k, 0.0, 0.0))
    ]
    upper = [v for k in reversed(range(3)) for v in ((9.0 + 14 * k, 20.0, -1.0), (5.0 + 14 * k, 20.0, 0.0))]
    drawn = extrude(((0.0, 0.0, 0.0), *lower, (50.0, 0.0, 0.0), (50.0, 20.0, 0.0), *upper, (0.0, 20.0, 0.0)))
    program = take_apart(drawn)
    assert kinds(program) == {"box": 4, "cylinder": 3}
    assert differ(program, drawn) <= SAME


@pytest.mark.parametrize(
    "loop",
    [
        tuple(
            (x, y, b * 0.41421356)
            for x, y, b in ((2, 0, 0), (18, 0, 1), (20, 2, 0), (20, 8, 1), (18, 10, 0), (2, 10, 1), (0, 8, 0), (0, 2, 1))
        ),
        knob(2, 14.5, 15.5, 2.0),
        ((0.0, 0.0, 0.0), (20.0, 0.0, 0.0), (20.0, 10.0, 0.0), (0.0, 6.0, 0.3)),
    ],
    ids=["rounded corners", "two notches", "odd"],
)
def test_others_stay_drawn(loop: Ring) -> None:
    assert take_apart(extrude(loop), slack=1e-2) == extrude(loop)


def test_what_is_not_drawn_stays() -> None:
    program = cut(box(2.0, 2.0, 1.0), cylinder(0.5, 3.0))
    assert take_apart(program) == program


def test_corners_of_a_mesh_say_how_large_a_rim_is_that_is_drawn_as_chords() -> None:
    """Between notches a facet or two of a round wall are lines, whose ends lie inside the circle that the mesh's corners are on."""
    segments = 64
    disc = CrossSection.circle(14.5, segments)
    fingers = [CrossSection.circle(2.0, segments).translate((15.5 * math.cos(a), 15.5 * math.sin(a))) for a in np.arange(20) * math.pi / 10]
    polygon = disc - CrossSection.compose(fingers)
    (corners,) = polygon.to_polygons()
    exact = knob(20, 14.5, 15.5, 2.0)
    chords = tuple((x, y, 0.0 if arc_radius(c) > 10 else b) for (x, y, b), c in zip(exact, ring_curves(exact), strict=True))
    drawn = extrude(tuple((x * 0.9998, y * 0.9998, b) for x, y, b in chords))
    mesh = np.concatenate([np.column_stack([corners, np.full(len(corners), z)]) for z in (-1.0, 1.0)])
    solid = CrossSection(polygon.to_polygons(), FillRule.Positive).extrude(2.0).translate((0.0, 0.0, -1.0))
    program = separate_rims(drawn, lambda trial: 1 - volume_iou(to_manifold(trial), solid), 2e-3, mesh)
    assert next(leaves(program)).size[0] == pytest.approx(14.5, rel=1e-5)
    assert kinds(program) == {"cylinder": 21}
