"""Denoising against the planted part's own faces: points come nearer to them, strays are told from the rest."""

import numpy as np
from tests.detection.cloud_parts import plate

from imdim.detection.cloud_denoise import denoise, inliers
from imdim.detection.noise import measure_noise


def test_points_come_nearer_to_the_plates_large_faces():
    rng = np.random.default_rng(5)
    points, truth = plate().sample(rng, 8192)
    noisy = points + rng.normal(scale=0.025, size=points.shape)
    calm, normals = denoise(noisy, None, measure_noise(noisy, rng)[0], rng)
    middle = (np.abs(truth[:, 2]) > 0.5) & (np.abs(points[:, 0]) < 1.0) & (np.abs(points[:, 1]) < 1.2)
    before, after = (np.sqrt(np.mean((np.abs(p[middle, 2]) - 0.2) ** 2)) for p in (noisy, calm))
    assert after < 0.5 * before
    assert np.mean(np.abs(normals[middle, 2]) > np.cos(np.radians(10))) > 0.9


def test_strays_are_left_out_and_points_are_not():
    rng = np.random.default_rng(6)
    points, _ = plate().sample(rng, 8000)
    stray = rng.uniform((-2.2, -1.7, 0.8), (2.2, 1.7, 2.0), (160, 3))
    kept = inliers(np.vstack([points, stray]))
    assert kept[:8000].mean() > 0.99
    assert kept[8000:].mean() < 0.05
