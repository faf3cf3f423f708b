"""Boxes of placed primitives against points on their surfaces, and what they hold and part against points inside."""

from dataclasses import replace
from functools import partial
from operator import mul

import numpy as np
import pytest
from outlined_samples import random_drawn
from tests.known_programs import LEAVES

from imdim.geometry.finish.posed import CHECK_SEGMENTS, PosedPrimitive, apart, diagonal, holds, side_of_ball
from imdim.geometry.sampling import leaf_surface
from imdim.geometry.solid import to_manifold
from imdim.program.tree import KINDS, OUTLINED, SIMPLE, SIZE_NAMES, Primitive, map_lengths


def drawn(kind, rng):
    size = sorted(rng.uniform(0.3, 1.5, len(SIZE_NAMES[kind])).tolist(), reverse=True)
    center, turn = rng.normal(0, 0.4, 3).tolist(), rng.uniform(-90, 90, 3).tolist()
    if kind in OUTLINED:
        return random_drawn(rng, kind, size[0] / 1.6, tuple(center), tuple(turn))
    return Primitive(kind, tuple(size), tuple(center), tuple(turn))


@pytest.mark.parametrize("kind", KINDS)
def test_bounds_are_reached_and_not_passed(kind):
    leaf = replace(drawn(kind, np.random.default_rng(1)), center=(1.0, -2.0, 3.0), rotation=(0.0, 0.0, 0.0))
    points, _ = leaf_surface(leaf, 20_000, np.random.default_rng(2))
    low, high = PosedPrimitive(leaf).bounds
    np.testing.assert_array_less(low - 1e-9, points.min(axis=0))
    np.testing.assert_array_less(points.max(axis=0), high + 1e-9)
    if kind in SIMPLE:  # the box of a drawn leaf lies about its origin, and is larger where the outline does not
        np.testing.assert_allclose(np.ptp(points, axis=0), high - low, rtol=0.05)


@pytest.mark.parametrize("leaf", LEAVES, ids=lambda p: f"{p.kind}{p.size}")
def test_the_polyhedron_holds_the_like_one(leaf):
    held = Primitive(leaf.kind, tuple(PosedPrimitive(leaf).sizes[1][: len(leaf.size)].tolist()), leaf.center, leaf.rotation)
    smooth = to_manifold(held, 4 * CHECK_SEGMENTS)
    assert (smooth - PosedPrimitive(leaf).solid).volume() < 1e-7 * smooth.volume()
    assert smooth.volume() > 0.97 * PosedPrimitive(leaf).solid.volume()


def test_what_is_held_is_inside_and_what_is_apart_is_outside():
    rng = np.random.default_rng(4)
    counted = {"holds": 0, "apart": 0, "neither": 0}
    for a in LEAVES:
        for b in (drawn(kind, rng) for kind in KINDS for _ in range(10)):
            shrunk = rng.uniform(0.05, 0.5)
            first, second = PosedPrimitive(a), PosedPrimitive(map_lengths(b, partial(mul, shrunk), b.center))
            share = (first.solid ^ second.solid).volume() / second.solid.volume()
            if holds(first, second):
                assert share == pytest.approx(1)
            if apart(first, second):
                assert share < 1e-9
            counted["holds" if holds(first, second) else "apart" if apart(first, second) else "neither"] += 1
    assert min(counted.values()) > 5


def test_the_diagonal_is_that_of_the_common_box():
    corners = [PosedPrimitive(Primitive("box", (2.0, 2.0, 2.0), at)) for at in [(0.0, 0.0, 0.0), (1.0, 4.0, 0.0)]]
    assert diagonal(corners) == pytest.approx(np.linalg.norm([3.0, 6.0, 2.0]))


@pytest.mark.parametrize("kind", KINDS)
def test_a_ball_about_a_box_that_lies_on_one_side_of_a_polyhedron_is_told(kind):
    rng, told = np.random.default_rng(4), []
    for _ in range(60):
        part = PosedPrimitive(drawn(kind, rng))
        center = rng.uniform(*part.bounds)
        box = PosedPrimitive(Primitive("box", (0.1, 0.06, 0.08), tuple(center.tolist()), tuple(rng.uniform(-90, 90, 3).tolist())))
        side = side_of_ball(part, box)
        told.append(side)
        share = (part.solid ^ box.solid).volume() / box.solid.volume()
        assert side == 0 or share == pytest.approx(0.0 if side > 0 else 1.0, abs=1e-6)
    assert {1, -1} <= {*told} or kind == "ellipsoid"  # whose value is no distance
