"""The four phases of the design (section 5.3) against what was planted."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from imdim.sketch.freedom import freedom
from imdim.sketch.solver import solve
from imdim.sketch.theory import SketchConstraint, Theory

PHASES = Path(__file__).parents[2] / "examples" / "phases"
sys.path.insert(0, str(PHASES))
import phase2_projection as phase2  # noqa: E402
import phase3_evolution as phase3  # noqa: E402
import phase4_pruning as phase4  # noqa: E402
from cloud_fit import fit  # noqa: E402
from outlines import project_on_faces, to_arc, to_circle, to_faces, to_polygon  # noqa: E402
from theory_evolution import complexity, evolve, free_polygon  # noqa: E402


def test_phase_1_runs_as_its_docstring_says(tmp_path):
    picture = tmp_path / "cube.png"
    run = subprocess.run(
        [sys.executable, PHASES / "phase1_cube.py", picture, "3"], capture_output=True, text=True, check=True, cwd=tmp_path
    )
    assert "solved" in run.stdout
    assert "well-constrained" in run.stdout
    with Image.open(picture) as image:
        assert len(image.getcolors(1 << 20) or []) > 3


def test_phase_2_recovers_the_box(tmp_path):
    fitted, sizes = phase2.run(tmp_path / "box.png", seed=1)
    edges = np.sort([np.linalg.norm(fitted.corners[a] - fitted.corners[0]) for a in (1, 2, 4)])
    np.testing.assert_allclose(edges, np.sort(sizes), atol=0.01)  # noise 0.02, a face has more than 100 points
    assert fitted.violation <= 1e-9
    assert fitted.rms == pytest.approx(0.02, rel=0.1)  # the planted noise, along the normal alone
    assert fitted.cube_rms > 5 * fitted.rms
    np.testing.assert_allclose(fitted.weights.sum(axis=1), 1)
    assert fitted.weights.min() >= 0
    assert (fitted.weights > 0).sum(axis=1).max() <= 4


def test_weights_project_to_the_nearest_point_of_a_box():
    rng = np.random.default_rng(0)
    cloud = rng.uniform(-1, 2, (500, 3))
    corners = phase2.CORNERS
    projected = project_on_faces(cloud, corners, phase2.named.CUBE_FACES) @ corners
    outside = np.linalg.norm(cloud - cloud.clip(0, 1), axis=1)
    inside = np.minimum(cloud, 1 - cloud).min(axis=1)
    np.testing.assert_allclose(np.linalg.norm(cloud - projected, axis=1), np.where(outside > 0, outside, inside), atol=1e-12)


@pytest.mark.parametrize("seed", [0, 7])
def test_phase_3_discovers_the_rectangle(seed, tmp_path):
    best, planted = phase3.run(tmp_path / "rectangle.png", seed)
    assert phase3.is_rectangle(best, planted.sides)
    again = solve(best.theory, best.points, rng=np.random.default_rng(0))
    assert again.violation <= 1e-9
    sides = np.sort(np.linalg.norm(again.points - np.roll(again.points, -1, axis=0), axis=1))
    np.testing.assert_allclose(sides, np.sort([*planted.sides] * 2), atol=0.03 * math.hypot(*planted.sides))
    assert best.stop in ("no_progress", "generations_spent")


def test_evolution_repeats_from_its_seed():
    cloud = phase3.rectangle_cloud(np.random.default_rng(2)).cloud
    runs = [next(g for g in evolve(cloud, rng=np.random.default_rng(4)) if g.number == 5) for _ in range(2)]
    assert runs[0].theory == runs[1].theory
    assert runs[0].fitness == runs[1].fitness


def test_phase_4_prunes_and_bends(tmp_path):
    pruned, circle, arc = phase4.run(tmp_path / "curves.png", seed=0)
    assert len(pruned.theory.constraints) == 5
    assert freedom(pruned.theory, pruned.points).verdict == "well-constrained"
    for curve in (circle, arc):  # five standard errors of 300 points with noise 0.01; an arc's centre is held less firmly
        np.testing.assert_allclose(curve.points[0, :2], (0.4, -0.2), atol=0.01)
        assert curve.radius == pytest.approx(1.3, abs=0.005)
        assert curve.violation <= 1e-9
        assert curve.f < curve.polygon_f
    ends = 1.3 * np.array([[math.cos(a), math.sin(a)] for a in (0.5, 0.5 + math.radians(200))]) + (0.4, -0.2)
    np.testing.assert_allclose(arc.points[1:, :2], ends, atol=0.1)


def test_a_circle_is_no_simpler_for_a_square():
    cloud = np.array([[x, y, 0.0] for t in np.linspace(0, 1, 40) for x, y in ((t, 0), (1, t), (1 - t, 1), (0, 1 - t))])
    curve = phase4.fit_curve(cloud, phase4.CIRCLE)
    assert curve.f > curve.polygon_f


def test_a_cubes_spare_constraints_are_named_and_the_rest_suffice():
    cube, corners = phase4.full_cube(), phase2.CORNERS
    free = freedom(cube, corners)
    assert (free.rank, free.dof, len(free.redundant)) == (18, 0, 24)
    kept = cube.only(i for i in range(42) if i not in free.redundant)
    start = corners + 0.03 * np.random.default_rng(0).normal(size=(8, 3))
    found = solve(kept, start, rng=np.random.default_rng(0))
    gaps = np.linalg.norm(found.points[:, None] - found.points, axis=2)[np.triu_indices(8, 1)]
    np.testing.assert_allclose(np.sort(gaps), np.sqrt(np.repeat([1, 2, 3], [12, 12, 4])), atol=1e-7)


@pytest.mark.parametrize(
    ("make", "n", "flat"),
    [(to_polygon, 5, True), (to_circle, 2, True), (to_arc, 3, True), (lambda c: to_faces(c, phase2.named.CUBE_FACES), 8, False)],
)
def test_slopes_of_distances(make, n, flat):
    rng = np.random.default_rng(5)
    cloud = rng.normal(size=(200, 3)) * [1, 1, not flat]
    points = phase2.CORNERS + 0.0 if n == 8 else rng.normal(size=(n, 3)) * [1, 1, 0]
    if n == 3:  # the slopes hold where both ends are equally far
        points = np.array([[0.1, 0.2, 0], [1.1, 0.2, 0], [0.1, 1.2, 0]])
    step = rng.normal(size=points.shape) * [1, 1, not flat]
    if n == 8:
        step = np.broadcast_to(step[0], step.shape)  # faces stay parallelograms
    plus, minus = (make(cloud)(points + s * 1e-6 * step)[0] for s in (1, -1))
    slope = np.einsum("mni,ni->m", make(cloud)(points)[1], step)
    close = np.abs((plus - minus) / 2e-6 - slope) < 1e-4
    assert close.mean() > 0.97  # all but those at a seam between two nearest parts


def test_free_polygon_finds_the_corners():
    corners = np.array([[0, 0, 0], [3, 0, 0], [2.5, 2, 0], [0.4, 1.7, 0]])
    t = np.linspace(0, 1, 60)[:, None]
    cloud = np.vstack([a + t * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])
    found = free_polygon(cloud, 4)
    assert np.linalg.norm(found[:, None] - corners, axis=2).min(axis=0).max() < 1e-3


def test_complexity_counts_numbers_once():
    right = SketchConstraint("angle", (0, 1, 2), math.pi / 2)
    two = tuple(SketchConstraint("distance", pair, 2.0) for pair in ((0, 1), (2, 3)))
    assert complexity(Theory(4, (right, *two), 2)) == 4 + 3 + 1
    assert complexity(Theory(4, (right, *two, SketchConstraint("distance", (1, 2), 3.0)), 2)) == 4 + 4 + 2


def test_a_fit_keeps_its_constraints_against_the_cloud():
    cloud = phase4.arc_cloud((0, 0), 1.0, 0, 2 * math.pi, np.random.default_rng(0))
    held = Theory(2, (SketchConstraint("distance", (0, 1), 0.8),), 2)
    points, rms, violation = fit(held, np.array([[0.1, 0, 0], [0.9, 0, 0]]), to_circle(cloud))
    assert violation <= 1e-9
    assert np.linalg.norm(points[1] - points[0]) == pytest.approx(0.8, abs=1e-9)
    assert rms == pytest.approx(0.2, abs=0.01)
