"""Whether solids overlap, as points tell, against exact booleans and closed forms."""

import math

import numpy as np
import pytest

from imdim.geometry.finish.overlap import surely_overlap
from imdim.geometry.finish.section import CHECK_SEGMENTS
from imdim.geometry.solid import bounds_of, to_manifold
from imdim.program.outline import Outline, circle
from imdim.program.tree import Combine, Primitive

BOX = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
SPHERE = Primitive("sphere", (1.0,))
RING = Combine("difference", Primitive("cylinder", (1.0, 1.0)), Primitive("cylinder", (0.8, 2.0)))
DISC = Primitive("extrude", (1.0,), outline=Outline((circle(1.0, 0.0, 0.0),)))


def test_two_spheres_share_a_ball_of_half_their_lens_but_none_of_twice_its_volume() -> None:
    other = Primitive("sphere", (1.0,), (1.0, 0.0, 0.0))
    within = 4 / 3 * math.pi * 0.5**3  # the largest ball in the lens of two unit spheres one apart
    assert surely_overlap([SPHERE, other], BOX, 0.5 * within)
    assert not surely_overlap([SPHERE, other], BOX, within)


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (Primitive("box", (1.0, 1.0, 1.0)), Primitive("box", (1.0, 1.0, 1.0), (1.0, 0.0, 0.0))),
        (RING, Primitive("cylinder", (0.8, 1.0))),
        (DISC, Primitive("extrude", (1.0,), (2.0, 0.0, 0.0), outline=Outline((circle(1.0, 0.0, 0.0),)))),
    ],
)
def test_what_only_touches_does_not_overlap(a, b) -> None:
    assert not surely_overlap([a, b], bounds_of(to_manifold(a)), 0.0)


def test_what_lies_beside_a_part_is_told() -> None:
    pin = Primitive("cylinder", (0.9, 1.0))
    assert surely_overlap([pin], bounds_of(to_manifold(pin)), 1e-6, outside=[RING])
    assert not surely_overlap([pin], bounds_of(to_manifold(pin)), 1e-6, outside=[SPHERE, Primitive("box", (2.0, 2.0, 2.0))])


def test_half_distances_of_ellipsoids_tell_nothing() -> None:
    assert not surely_overlap([Primitive("ellipsoid", (1.0, 0.1, 0.1)), SPHERE], BOX, 1e-9)


def test_what_is_told_is_so_of_polyhedra() -> None:
    """What a ball shows, an exact boolean of the polyhedra bears out; and it is shown of most that overlap far."""
    rng, told, far = np.random.default_rng(5), 0, 0
    for _ in range(60):
        kinds = {"box": (1.0, 0.6, 0.3), "cylinder": (0.4, 0.8), "cone": (0.5, 0.2, 0.7), "torus": (0.5, 0.2), "sphere": (0.5,)}
        a, b = (
            Primitive(str(kind), kinds[str(kind)], tuple(rng.uniform(-0.4, 0.4, 3)), tuple(rng.uniform(-90, 90, 3)))
            for kind in rng.choice(list(kinds), 2)
        )
        one, other = to_manifold(a, CHECK_SEGMENTS), to_manifold(b, CHECK_SEGMENTS)
        shared, least = (one ^ other).volume(), 10.0 ** rng.uniform(-6, -2)
        says = surely_overlap([a, b], bounds_of(one), least)
        assert not says or shared > least
        told, far = told + says, far + (shared > 100 * least)
    assert told > 0.8 * far > 10
