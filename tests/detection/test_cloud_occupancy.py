"""Labels of space against the parts' own definitions, normals of orientation against those of the sampled faces."""

import numpy as np
import pytest
from scipy.spatial import KDTree
from tests.detection.cloud_parts import PARTS, detected, plate

from imdim.deadline import Deadline
from imdim.detection.cloud_kernels import CONE, CYLINDER, PLANE, SPHERE, TORUS, distance_and_cosine, gradient, pack
from imdim.detection.cloud_occupancy import OccupancyConfig, inside_probability
from imdim.detection.cloud_rays import crossings
from imdim.geometry.surface import Surface
from imdim.geometry.surface import normals as surface_normals

SURFACES = [
    (PLANE, Surface("plane", (0.1, 0.2, 0.3), (0.6, 0.0, 0.8))),
    (SPHERE, Surface("sphere", (0.1, 0.2, 0.3), (0.0, 0.0, 1.0), (0.7,))),
    (CYLINDER, Surface("cylinder", (0.1, 0.2, 0.3), (0.6, 0.0, 0.8), (0.5,))),
    (CONE, Surface("cone", (0.1, 0.2, -0.9), (0.6, 0.0, 0.8), (0.4,))),
    (TORUS, Surface("torus", (0.1, 0.2, 0.3), (0.6, 0.0, 0.8), (0.6, 0.2))),
]


def signed(kind: int, surface: Surface, point: np.ndarray) -> float:
    return distance_and_cosine(kind, pack(surface), *point, 0.0, 0.0, 0.0)[0]


@pytest.mark.parametrize(("kind", "surface"), SURFACES)
def test_crossings_lie_on_the_surface_and_none_is_missed(kind, surface):
    rng = np.random.default_rng(kind)
    roots = np.empty(4)
    for _ in range(100):
        origin, direction = rng.uniform(-1, 1, 3), rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        count = crossings(kind, pack(surface), origin, direction, roots)
        steps = np.linspace(-3, 3, 4001)
        values = np.array([signed(kind, surface, origin + t * direction) for t in steps])
        seen = np.flatnonzero(np.diff(np.sign(values)))
        mine = np.sort([t for t in roots[:count] if abs(t) < 3])
        assert all(abs(signed(kind, surface, origin + t * direction)) < 1e-7 for t in mine)
        assert len(mine) >= len(seen)
        assert all(np.abs(mine - steps[i]).min() < 2e-3 for i in seen)


@pytest.mark.parametrize(("kind", "surface"), SURFACES)
def test_compiled_gradient_is_the_reference(kind, surface):
    points = np.random.default_rng(9).uniform((-0.7, -1.0, -0.6), (1.3, 1.0, 1.4), (50, 3))
    found = np.array([gradient(kind, pack(surface), *p) for p in points])
    assert found == pytest.approx(surface_normals(surface, points), abs=1e-9)


@pytest.mark.parametrize("name", PARTS)
def test_space_is_labelled_and_patches_face_outward(name):
    part, rng = PARTS[name](), np.random.default_rng(11)
    points, normals = part.sample(rng, 8192)
    patches = detected(points, None, rng)
    low, high = points.min(0), points.max(0)
    queries = low - 0.05 * (high - low) + 1.1 * (high - low) * rng.random((8000, 3))
    queries = queries[KDTree(part.sample(rng, 100_000)[0]).query(queries)[0] > 0.003 * np.linalg.norm(high - low)]
    truth = part.inside(queries)
    probability = inside_probability(patches, points, queries)
    assert ((probability > 0.5) == truth).mean() > 0.998
    assert probability.min() >= 0
    assert probability.max() <= 1
    near = KDTree(points)
    for p in patches:
        true_normals = normals[near.query(p.points)[1]]
        agree = (surface_normals(p.surface, p.points) * true_normals).sum(1) * p.outward
        assert np.mean(agree > 0) > 0.95


def test_a_missing_face_does_not_flood_the_part():
    part, rng = plate(), np.random.default_rng(12)
    points, _ = part.sample(rng, 8192)
    patches = detected(points, None, rng)
    open_patches = [p for p in patches if not (p.surface.kind == "plane" and abs(p.surface.axis[0]) > 0.9 and p.points[0, 0] > 0)]
    assert len(open_patches) == len(patches) - 1
    queries = rng.uniform((-2.2, -1.7, -0.4), (2.2, 1.7, 0.4), (4000, 3))
    truth = part.inside(queries)
    labels = inside_probability(open_patches, points, queries) > 0.5
    assert (labels == truth).mean() > 0.95


def test_no_patches_means_outside():
    assert inside_probability([], np.zeros((5, 3)), np.ones((3, 3))) == pytest.approx(np.zeros(3))


def test_labels_in_no_time_follow_those_that_were_asked():
    part, rng = plate(), np.random.default_rng(3)
    points, _ = part.sample(rng, 6000)
    patches = detected(points, None, rng)
    low, high = points.min(0), points.max(0)
    queries = low + (high - low) * rng.random((8000, 3))
    queries = queries[KDTree(points).query(queries)[0] > 0.02 * np.linalg.norm(high - low)]
    truth = part.inside(queries)
    asked = []
    late = inside_probability(patches, points, queries, deadline=Deadline(0.0, lambda: asked.append(1) or 1.0))
    assert len(asked) == 1
    assert ((late > 0.5) == truth).mean() > 0.98
    whole = inside_probability(patches, points, queries)
    assert ((whole > 0.5) == truth).mean() > 0.995


def test_votes_that_all_agree_need_not_all_be_asked():
    part, rng = plate(), np.random.default_rng(4)
    points, _ = part.sample(rng, 6000)
    patches = detected(points, None, rng)
    queries = points.min(0) + np.ptp(points, axis=0) * rng.random((4000, 3))
    every = inside_probability(patches, points, queries, OccupancyConfig(enough=99))
    assert ((inside_probability(patches, points, queries) > 0.5) == (every > 0.5)).mean() > 0.998
