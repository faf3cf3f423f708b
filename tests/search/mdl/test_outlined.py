"""Programs with outlines in the searches of noisy clouds: what they cost, and that parts with outlines are weighed beside the others."""

import numpy as np
from tests.drawn import BRACKET, PULLEY, centred
from tests.planted import box

from imdim.geometry.sampling import surface_points
from imdim.numbers.likelihood import Noise
from imdim.program.sequence import Step
from imdim.search.mdl.batched_likelihood import BatchedLikelihood, PointScene
from imdim.search.mdl.description_length import numbers
from imdim.search.mdl.part_tables import PartTableCache
from imdim.search.mdl.primitive_selection import Cloud, PoolConfig, PrimitivePool, distinct

PLATE = centred(BRACKET, 8.0)
POINTS = surface_points(PLATE, 4000, np.random.default_rng(0))[0]
BLOCK = box(60, 40, 8, (30, 20, 0))


def test_numbers_of_an_outline_are_counted():
    """Eight vertices and two arcs, of which six lines along x or y join one coordinate each, two circles of three numbers each, four for
    its plane and its turn, one height; five vertices, of which three level lines join one coordinate each, on an axis, and no angle."""
    assert numbers(PLATE) == 8 * 2 + 2 - 6 + 2 * 3 + 4 + 1
    assert numbers(PULLEY) == 5 * 2 - 3 + 4


def test_the_outline_explains_its_cloud_better_than_its_box():
    scene = PointScene(PartTableCache(POINTS), Noise(0.2))
    likelihood = BatchedLikelihood.of(scene, [PLATE, BLOCK], [])
    drawn, block = likelihood.lengths([(Step("union", 0),), (Step("union", 1),)])
    assert drawn < block - 0.1


def test_a_pool_holds_outlines_beside_other_primitives():
    cloud = Cloud.of(POINTS, 0.0)
    pool = PrimitivePool.of([BLOCK, PLATE], cloud, PoolConfig())
    assert np.abs(pool.table[1]).max() < 1e-4 < np.abs(pool.table[0]).max()
    assert pool.cost((Step("union", 1),)) < pool.cost((Step("union", 0),))
    assert distinct([PLATE, BLOCK, PLATE], cloud) == [PLATE, BLOCK]
