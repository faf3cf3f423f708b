"""Compiled questions to carriers: as `signed_distance` and `normals` answer them, of every kind."""

import numpy as np
import pytest

from imdim.detection.member_kernels import Carrier, follow, lie_within
from imdim.detection.mesh_support import to_ball
from imdim.geometry.surface import FRAMED, SURFACE_KINDS, Surface, normals, signed_distance, unit

SIZES = {"sphere": (2.0,), "cylinder": (1.5,), "cone": (0.4,), "torus": (3.0, 0.7), "ellipsoid": (2.0, 1.0, 3.0), "elliptic": (2.0, 1.0)}
SLACK, BLUR = 0.8, 0.9


@pytest.mark.parametrize("kind", SURFACE_KINDS)
def test_kernels_answer_as_the_surface_does(kind):
    rng = np.random.default_rng(0)
    axis, across = np.linalg.qr(rng.normal(size=(3, 2)))[0].T
    surface = Surface(kind, (0.4, -0.2, 0.7), tuple(axis), SIZES.get(kind, ()), tuple(across))
    corners = rng.normal(0, 2, (600, 1, 3)) + rng.normal(0, 0.3, (600, 3, 3))
    chosen = np.sort(rng.permutation(600)[:400])
    some = corners[chosen]
    off = np.abs(signed_distance(surface, some.reshape(-1, 3))).reshape(-1, 3)
    turns = rng.random((600, 3)) < 0.9
    good = lie_within(Carrier.of(surface), corners, turns, chosen, SLACK)
    assert (good == ((off <= SLACK) | ~turns[chosen]).all(1)).all()
    assert 5 < good.sum() < 395

    facing = unit(rng.normal(size=(400, 3)))
    probes = np.concatenate([some, some.mean(1, keepdims=True)], axis=1)
    directions = normals(surface, probes.reshape(-1, 3))
    if kind in FRAMED:
        directions, faces = to_ball(surface, directions), to_ball(surface, facing)
    else:
        faces = facing
    cosines = np.abs((directions.reshape(probes.shape) * faces[:, None]).sum(2))
    if kind == "cone":
        near = np.linalg.norm(probes - surface.point, axis=2) < BLUR
        assert near.any()
        cosines[near] = 1.0
    least, middle, away = follow(Carrier.of(surface), corners, facing, chosen, BLUR)
    assert least == pytest.approx(cosines.min(1), abs=1e-9)
    assert middle == pytest.approx(cosines[:, 3], abs=1e-9)
    assert away == pytest.approx(np.abs(signed_distance(surface, probes[:, 3])), abs=1e-9)
