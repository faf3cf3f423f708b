import math

import numpy as np
import pytest
import trimesh
from tests.planted import box, cylinder, mesh_of, union

from imdim.detection.faceting import chord_heights
from imdim.detection.facets import facets_of


@pytest.mark.parametrize("sides", [8, 16, 96])
def test_the_chords_of_a_cylinder(sides):
    """The sagitta of a regular polygon."""
    facets = facets_of(trimesh.creation.cylinder(10, 30, sections=sides))
    height, radius = chord_heights(facets)
    wall = np.abs(facets.normals[:, 2]) < 0.5
    assert height[wall] == pytest.approx(10 * (1 - math.cos(math.pi / sides)), rel=0.01)
    assert radius[wall] == pytest.approx(10, rel=0.1)
    assert not height[~wall].any()


def test_flats_have_none():
    for height in chord_heights(facets_of(mesh_of(union(box(60, 40, 6), box(10, 10, 20))))):
        assert not height.any()


def test_walls_beside_a_rounding_are_flats():
    """A slot with round ends, whose flat sides are no chords of them."""
    facets = facets_of(mesh_of(union(box(40, 10, 6), cylinder(5, 6, (-20, 0, 0)), cylinder(5, 6, (20, 0, 0)))))
    height, _ = chord_heights(facets)
    long = facets.areas > 200
    assert long.sum() == 4
    assert not height[long].any()
    assert (height[np.abs(facets.normals[:, 0]) > 0.5] > 0).all()
