"""Solutions against closed forms, conflicts against arithmetic, freedoms against constructions and against SolveSpace."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from imdim.sketch import named
from imdim.sketch.freedom import freedom
from imdim.sketch.residuals import FORMS
from imdim.sketch.solver import solve
from imdim.sketch.system import violations
from imdim.sketch.theory import ARITY, SketchConstraint, Theory, TheoryError

sys.path.insert(0, str(Path(__file__).parent))
from planted_sketches import measure, planted_forty  # pyright: ignore[reportMissingImports]

FORTY = planted_forty()
SLOTS = {"coincident": 2, "folded": 3, "straight": 3, "collinear": 3, "coplanar": 4} | ARITY


def near(planted, rng: np.random.Generator) -> np.ndarray:
    noise = 0.02 * rng.normal(size=planted.points.shape)
    return planted.points + noise * [1, 1, planted.theory.dimension - 2]


@pytest.mark.parametrize("form", FORMS)
def test_jacobians_are_the_slopes_of_the_residuals(form):
    rng = np.random.default_rng(1)
    x, target = rng.normal(size=(60, SLOTS[form], 3)), rng.uniform(0.3, 1, 60)
    _, jacobian = FORMS[form].residual(x, target)
    for direction in rng.normal(size=(4, SLOTS[form], 3)):
        plus, minus = (FORMS[form].residual(x + s * 1e-6 * direction, target)[0] for s in (1, -1))
        slope = np.einsum("rcki,ki->rc", jacobian, direction)
        np.testing.assert_allclose((plus - minus) / 2e-6, slope, atol=1e-6 * (1 + np.abs(slope).max()))


@pytest.mark.parametrize("form", ["straight", "folded", "collinear"])
def test_vector_residuals_are_smooth_where_they_vanish(form):
    on_line = np.array([[[0.3, 0, 0], [1.0, 0, 0], [1.9, 0, 0]]]) if form != "folded" else np.array([[[2.0, 0, 0], [0, 0, 0], [0.7, 0, 0]]])
    residual, jacobian = FORMS[form].residual(on_line, np.zeros(1))
    assert np.abs(residual).max() < 1e-15
    push = np.array([[0, 0, 0], [0, 0, 0], [0, 0.3, 0.4]])
    moved = FORMS[form].residual(on_line + 1e-5 * push, np.zeros(1))[0][0]
    np.testing.assert_allclose(moved, 1e-5 * np.einsum("cki,ki->c", jacobian[0], push), atol=1e-9)
    assert np.linalg.matrix_rank(jacobian[0].reshape(3, 9)) == 2


@pytest.mark.parametrize(
    ("constraint", "points"),
    [
        (SketchConstraint("torsion", (0, 1, 2, 3), math.pi / 2), [[1, 0, 0], [0, 0, 0], [0, 0, 1], [0, 1, 1]]),
        (SketchConstraint("torsion", (0, 1, 2, 3), 0.0), [[1, 0, 0], [0, 0, 0], [0, 0, 1], [2, 0, 1]]),
        (SketchConstraint("angle", (0, 1, 2), math.pi / 3), [[1, 0, 0], [0, 0, 0], [1, math.sqrt(3), 0], [9, 9, 9]]),
        (SketchConstraint("line_distance", (0, 1, 2), 2.0), [[0, 0, 0], [5, 0, 0], [7, 0, -2], [9, 9, 9]]),
        (SketchConstraint("plane_distance", (0, 1, 2, 3), 3.0), [[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, -3]]),
        (SketchConstraint("equal_length", (0, 1, 2, 3)), [[0, 0, 0], [3, 4, 0], [1, 1, 1], [1, 1, 6]]),
    ],
)
def test_known_positions_meet_their_constraint(constraint, points):
    assert violations(Theory(4, (constraint,)), np.array(points, float))[0] < 1e-15


def test_torsion_is_positive_clockwise_along_the_middle():
    x = np.array([[1, 0, 0], [0, 0, 0], [0, 0, 1], [math.cos(0.4), math.sin(0.4), 1]])
    assert violations(Theory(4, (SketchConstraint("torsion", (0, 1, 2, 3), 0.4),)), x)[0] < 1e-15


def test_an_angle_and_a_length_weigh_alike():
    x = np.array([[1, 1e-3, 0], [0, 0, 0], [0, 1.0, 0]])
    theory = Theory(3, (SketchConstraint("angle", (0, 1, 2), math.pi / 2), SketchConstraint("distance", (1, 2), 1.001)))
    assert violations(theory, x) == pytest.approx([1e-3, 1e-3], rel=2e-3)


def test_random_points_become_a_cube():
    for seed in range(10):
        found = solve(named.cube(2.0), rng=np.random.default_rng(seed))
        distances = np.linalg.norm(found.points[:, None] - found.points, axis=2)[np.triu_indices(8, 1)]
        assert found.violation <= 1e-9
        np.testing.assert_allclose(np.sort(distances), 2 * np.sqrt(np.repeat([1, 2, 3], [12, 12, 4])), atol=1e-8)


def test_a_chain_of_internal_coordinates_is_rigid_and_comes_back():
    rng = np.random.default_rng(3)
    constraints, n = [], 9
    for i in range(1, n):
        constraints.append(SketchConstraint("distance", (i - 1, i), rng.uniform(1, 2)))
        if i > 1:
            constraints.append(SketchConstraint("angle", (i - 2, i - 1, i), rng.uniform(1, 2.5)))
        if i > 2:
            constraints.append(SketchConstraint("torsion", (i - 3, i - 2, i - 1, i), rng.uniform(-3, 3)))
    theory = Theory(n, tuple(constraints))
    found = [solve(theory, rng=np.random.default_rng(s)) for s in (0, 1)]
    assert freedom(theory, found[0].points).verdict == "well-constrained"
    gaps = [np.linalg.norm(f.points[:, None] - f.points, axis=2) for f in found]
    np.testing.assert_allclose(*gaps, atol=1e-7)  # bond lengths, angles and signed torsions fix the shape, chirality included
    assert freedom(theory.only(range(len(constraints) - 1)), found[0].points).dof == 1


def test_same_seed_same_points():
    first, second = (solve(named.cube(), rng=np.random.default_rng(5)).points for _ in range(2))
    assert first.tobytes() == second.tobytes()


def test_the_triangle_that_breaks_the_inequality_is_named():
    sides = tuple(
        SketchConstraint("distance", pair, d) for pair, d in (((0, 1), 1.0), ((1, 2), 1.0), ((0, 2), 3.0), ((2, 3), 1.0), ((0, 3), 2.7))
    )
    found = solve(Theory(4, sides), rng=np.random.default_rng(0))
    assert (found.stop, found.conflict) == ("conflict", (0, 1, 2))
    with pytest.raises(TheoryError, match=r"constraint 0 \(distance 0-1 = 1\), constraint 1 .* constraint 2 .*3\) together"):
        found.raise_for_conflict(Theory(4, sides))


def test_a_length_given_twice_conflicts_in_a_cube():
    cube = named.cube()
    theory = Theory(8, (*cube.constraints, SketchConstraint("distance", (0, 7), 2.0)))
    found = solve(theory, rng=np.random.default_rng(0))
    assert found.stop == "conflict"
    assert 18 in found.conflict
    for left_out in found.conflict:  # minimal: without any one of them the rest can be met
        rest = theory.only(i for i in found.conflict if i != left_out)
        assert solve(rest, found.points, rng=np.random.default_rng(1)).stop == "solved"


@pytest.mark.parametrize("number", range(40))
def test_planted_freedoms_are_counted_and_redundant_constraints_named(number):
    planted = FORTY[number]
    found = solve(planted.theory, near(planted, np.random.default_rng(number)), rng=np.random.default_rng(number))
    assert found.stop == "solved"
    assert found.violation <= 1e-9
    free = freedom(planted.theory, found.points)
    assert (free.dof, free.redundant) == (planted.dof, planted.redundant)
    parts = ["under"] * bool(planted.dof) + ["over"] * bool(planted.redundant)
    assert free.verdict == ("- and ".join(parts) or "well") + "-constrained"


@pytest.mark.parametrize("number", range(40))
def test_solvespace_agrees(number):
    pytest.importorskip("python_solvespace", reason="the independent solver: pip install python-solvespace")
    from solvespace import Referee  # pyright: ignore[reportMissingImports]

    planted = FORTY[number]
    rng = np.random.default_rng(number)
    start = near(planted, rng)
    found = solve(planted.theory, start, rng=rng)
    if planted.redundant:
        assert not Referee(planted.theory, found.points).solve()  # it refuses redundant constraints ...
    theory = planted.theory.only(i for i in range(len(planted.theory.constraints)) if i not in planted.redundant)
    at_ours, from_start = Referee(theory, found.points), Referee(theory, start)
    assert at_ours.solve()  # ... and takes the rest
    assert at_ours.dof() == planted.dof == freedom(theory, found.points).dof
    if not planted.dof:
        np.testing.assert_allclose(at_ours.solution(), found.points, atol=1e-6)
    assert violations(theory, at_ours.solution()).max() < 1e-6
    assert from_start.solve()
    assert violations(theory, from_start.solution()).max() < 1e-6


def test_freedom_names_what_is_loose():
    rectangle = named.rectangle(3, 2)
    x = np.array([[0, 0, 0], [3, 0, 0], [3, 2, 0], [0, 2, 0.0]])
    assert freedom(rectangle, x).report(rectangle) == "well-constrained: 0 degrees of freedom"
    assert freedom(rectangle.only(range(4)), x).dof == 1
    assert freedom(rectangle.only((0, 1, 4)), x).loose == (3,)
    more = Theory(4, (*rectangle.constraints, measure("distance", (0, 2), x)), 2)
    assert freedom(more, x).report(more) == "over-constrained: 0 degrees of freedom; redundant constraint 5 (distance 0-2 = 3.60555)"


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([[0, 0, 0], [math.nan, 0, 0], [1, 1, 0]], r"control point 1 is not finite, used by constraint 0 \(angle 0-1-2"),
        ([[0, 0, 0], [0, 0, 0], [1, 1, 0]], r"constraint 0 \(angle 0-1-2 = 1\): its reference points coincide"),
        ([[0, 0, 0], [1, 0, 0]], r"need an array \[3, 3\], got \[2, 3\]"),
    ],
)
def test_positions_that_mean_nothing(points, message):
    with pytest.raises(TheoryError, match=message):
        violations(Theory(3, (SketchConstraint("angle", (0, 1, 2), 1.0),)), np.array(points, float))
