"""Ellipsoids that were drawn come back with the semi-axes that were typed."""

import numpy as np
import pytest
import trimesh
from tests.planted import box, common, cut, cylinder, ellipsoid, mesh_of, sphere, union

from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.tree import leaves
from imdim.reconstruction.config import Settings
from imdim.reconstruction.pipeline import reconstruct
from imdim.target.target import target_from

PLANTED = {
    "plate with a dent": cut(box(60, 40, 20), ellipsoid(18, 12, 6, (4.0, -2.0, 10.0))),
    "plate with a turned dent": cut(box(60, 40, 20), ellipsoid(18, 9, 7, (4.0, -2.0, 10.0), (20.0, 15.0, 30.0))),
    "egg on a plate": union(box(60, 40, 6), ellipsoid(12, 12, 18, (5.0, 0.0, 15.0))),
    "half an ellipsoid": common(ellipsoid(30, 20, 15), box(80, 80, 40, (0.0, 0.0, 20.0))),
    "bored ellipsoid on a foot": cut(ellipsoid(30, 20, 15), cylinder(6, 60), box(80, 80, 20, (0.0, 0.0, -16.0))),
}


def found_in(points_or_mesh, language="cad"):
    """The program found by a clock that stands still."""
    *_, last = reconstruct(target_from(points_or_mesh), Settings(language=language), np.random.default_rng(0), lambda: 0.0)
    return last.program


def typed(program):
    return [tuple(sorted(leaf.size)) for leaf in leaves(program) if leaf.kind == "ellipsoid"]


@pytest.mark.parametrize("name", PLANTED)
def test_a_planted_ellipsoid_comes_back_from_its_mesh(name):
    program = PLANTED[name]
    found = found_in(mesh_of(program, 64))
    assert np.array(typed(found)) == pytest.approx(np.array(typed(program)), abs=1e-9)
    assert len(list(leaves(found))) == len(list(leaves(program)))
    assert volume_iou(to_manifold(found, 64), to_manifold(program, 64)) > 0.9999


@pytest.mark.parametrize("name", ["plate with a turned dent", "egg on a plate"])
def test_a_planted_ellipsoid_comes_back_from_a_cloud(name):
    program = PLANTED[name]
    points, _ = trimesh.sample.sample_surface(mesh_of(program, 128), 8000, seed=1)
    found = found_in(np.asarray(points), "csg")
    assert np.array(typed(found)) == pytest.approx(np.array(typed(program)), abs=1e-9)
    assert volume_iou(to_manifold(found, 64), to_manifold(program, 64)) > 0.9999


def test_balls_stay_spheres():
    assert typed(found_in(mesh_of(union(box(60, 40, 6), sphere(12, (5.0, 0.0, 8.0)))))) == []
