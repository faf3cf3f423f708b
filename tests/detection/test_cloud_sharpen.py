"""Clouds of planted parts with blends come back as those of the sharp parts."""

import numpy as np
import pytest

from imdim.detection.cloud_sharpen import sharpen_cloud
from imdim.detection.cloud_surfaces import detect_cloud
from imdim.detection.noise import measure_noise
from imdim.geometry.edge_solids import solid_with_edges
from imdim.geometry.kernels import program_sdf
from imdim.geometry.solid import to_trimesh
from imdim.program.edges import EdgeFeature, Face
from imdim.program.tree import Primitive
from imdim.target.target import sample_surface

PLATE = Primitive("box", (50.0, 35.0, 10.0))
RIM = tuple((Face(0, "+z"), Face(0, side)) for side in ("+x", "-x", "+y", "-y"))
CORNERS = tuple((Face(0, x), Face(0, y)) for x in ("+x", "-x") for y in ("+y", "-y"))


def cloud_of(feature: EdgeFeature | None, noise: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    mesh = to_trimesh(solid_with_edges(PLATE, [feature] if feature else [], 128))
    points, normals = sample_surface(mesh.vertices, mesh.faces, 5000, np.random.default_rng(3))
    return points + np.random.default_rng(4).normal(0, noise, points.shape), normals


def sharpened(points: np.ndarray, normals: np.ndarray | None = None):
    rng = np.random.default_rng(0)
    noise, kept = measure_noise(points, rng)
    normals = None if normals is None else normals[kept]
    patches, noise = detect_cloud(points[kept], normals, noise, rng)
    return sharpen_cloud(points[kept], normals, patches, noise)


@pytest.mark.parametrize("feature", [EdgeFeature("fillet", (3.0,), RIM), EdgeFeature("chamfer", (0.8,), RIM)], ids=["fillet", "chamfer"])
def test_points_of_blends_come_to_lie_on_the_faces(feature):
    points, normals = cloud_of(feature)
    off = np.abs(program_sdf(PLATE, points))
    assert (off > 0.05).mean() > 0.01
    found = sharpened(points, normals)
    assert len(found.blends) == 4
    assert (np.abs(program_sdf(PLATE, found.points)) > 0.05).sum() < 5  # in corners
    assert len(found.points) > 0.99 * len(points)
    assert (np.abs(found.normals).max(axis=1) < 0.999).sum() < 9  # all others along the faces' normals


def test_noise_stays_what_it_is():
    points, _ = cloud_of(EdgeFeature("fillet", (3.0,), RIM), 0.1)
    off = program_sdf(PLATE, sharpened(points).points)
    assert np.std(off) == pytest.approx(0.1, rel=0.15)
    assert abs(np.median(off)) < 0.01


def test_a_sharp_part_stays_and_so_do_corners_that_run_in_one_direction():
    """An outline draws these."""
    assert sharpened(cloud_of(None)[0]) is None
    assert sharpened(cloud_of(EdgeFeature("fillet", (4.0,), CORNERS))[0]) is None
