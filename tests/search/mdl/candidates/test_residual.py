"""Primitives guessed from points that nothing explains."""

import numpy as np
from tests.planted import cut

from imdim.geometry.sampling import surface_points
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.tree import Combine, Primitive
from imdim.search.mdl.candidates.residual import missing
from imdim.search.mdl.primitive_selection import Cloud

SIGMA = 0.1


def guesses(whole, seen):
    points, _ = surface_points(whole, 12000, np.random.default_rng(0))
    points = points + np.random.default_rng(1).normal(0, SIGMA, points.shape)
    return missing(seen, Cloud.of(points, SIGMA), np.eye(3), 3 * SIGMA)


def best(found, kind, part):
    return max((volume_iou(to_manifold(p), to_manifold(part)), p) for p in found if p.kind == kind)


def test_a_rib_in_a_tube_is_turned_as_its_points_are():
    tube = cut(Primitive("cylinder", (12.0, 40.0)), Primitive("cylinder", (10.0, 41.0)))
    angle = np.radians(25.0)
    rib = Primitive("box", (7.0, 3.0, 20.0), (6.5 * np.cos(angle), 6.5 * np.sin(angle), 0.0), (0.0, 0.0, 25.0))
    iou, found = best(guesses(Combine("union", tube, rib), tube), "box", rib)
    assert iou > 0.7, found


def test_a_boss_that_narrows_is_a_cone():
    plate, boss = Primitive("box", (40.0, 40.0, 4.0)), Primitive("cone", (8.0, 3.0, 10.0), (5.0, 5.0, 7.0))
    iou, found = best(guesses(Combine("union", plate, boss), plate), "cone", boss)
    assert iou > 0.85, found
    turned = Primitive("box", (4.0, 40.0, 40.0)), Primitive("cone", (3.0, 8.0, 10.0), (-7.0, 5.0, 5.0), (0.0, 90.0, 0.0))
    iou, found = best(guesses(Combine("union", *turned), turned[0]), "cone", turned[1])
    assert iou > 0.85, found
