"""Normals against clouds drawn with known ones."""

import numpy as np
from scipy.spatial import KDTree
from tests.detection.cloud_parts import thin_tube

from imdim.detection.cloud_normals import estimate_normals
from imdim.detection.noise import measure_noise


def principal(points):
    """The least principal direction of the 12 nearest points."""
    around = points[KDTree(points).query(points, k=12)[1]]
    around = around - around.mean(1, keepdims=True)
    return np.linalg.eigh(np.einsum("nki,nkj->nij", around, around))[1][:, :, 0]


def test_a_thin_wall_is_not_noise_and_keeps_its_normals():
    rng = np.random.default_rng(2)
    points, truth = thin_tube().sample(rng, 8192)
    noise, _ = measure_noise(points, rng)
    assert not noise.blurs
    found, trust = estimate_normals(points, noise, rng)
    good = np.abs((found * truth).sum(1)) > np.cos(np.radians(15))
    # principal directions blend the two sides of a wall that is thinner than the spacing
    blended = np.abs((principal(points) * truth).sum(1)) > np.cos(np.radians(15))
    assert good.mean() > 0.9
    assert blended.mean() < 0.6
    assert trust[good].mean() > trust[~good].mean()
