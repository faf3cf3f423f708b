"""Relations discovered from noisy clouds of planted programs, against relations found by brute force over the exact numbers."""

from dataclasses import replace

import numpy as np
import pytest
from tests.deadlines import PASSED
from tests.planted import PARTS, PLATE_WITH_HOLES, box, cut, cylinder, union
from tests.relations.planted_relations import Truth

from imdim.geometry.lowering import lower, pack, unpack
from imdim.geometry.sampling import surface_points
from imdim.numbers.face_coordinates import lift_numbers
from imdim.numbers.refine import refine
from imdim.program.constraints import Constraint, ConstraintError, Ref
from imdim.program.tree import Primitive, Program, combine_all, leaves, map_leaves
from imdim.relations.belief import CUT, WeightedCloud, covariance, noise_of, prior
from imdim.relations.discover import discover, exact_relations, hold_constraints
from imdim.relations.hold import fit_under_constraints
from imdim.relations.residuals import rows_of, verify
from imdim.relations.select import RelationCandidate, RelationSelection


def cloud_of(program: Program, n: int, noise: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Exact points, and the same with noise as a share of the diagonal."""
    exact = surface_points(program, n, rng)[0]
    return exact, exact + noise * np.linalg.norm(np.ptp(exact, axis=0)) * rng.normal(size=exact.shape)


def disturbed(program: Program, rng: np.random.Generator, length: float) -> Program:
    _, params = pack(program)
    noise = rng.uniform(-1, 1, params.shape)
    return unpack(
        program, np.hstack([params[:, :3] * (1 + 0.02 * noise[:, :3]), params[:, 3:] + noise[:, 3:] * ([0.005 * length] * 3 + [1.0] * 3)])
    )


def flange() -> Program:
    """Six holes round the axis of a disc, tilted as a whole."""
    from imdim.geometry.rotations import matrix_from_euler

    turn = (25.0, 10.0, 0.0)
    holes = [cylinder(6, 24, (32 * np.cos(a), 32 * np.sin(a), 0.0)) for a in np.arange(6) * np.pi / 3]
    upright = cut(union(cylinder(45, 20), cylinder(20, 40, (0, 0, 30))), *holes)
    return map_leaves(upright, lambda _, p: replace(p, center=tuple(matrix_from_euler(turn) @ np.array(p.center)), rotation=turn))


@pytest.mark.parametrize(("name", "share"), [("plate with four holes", 0.3), ("L bracket", 0.8), ("rounded plate", 0.8), ("flange", 0.3)])
def test_planted_relations_come_back_from_noisy_clouds(name, share):
    """`share` of the error without relations is left: numbers move onto the relations, no further."""
    program = flange() if name == "flange" else PARTS[name]
    rng = np.random.default_rng(0)
    exact, noisy = cloud_of(program, 6000, 0.005, rng)
    length = float(np.linalg.norm(np.ptp(exact, axis=0)))
    free = refine(disturbed(program, rng, length), noisy).program
    found = discover(free, noisy)
    truth = Truth(program, exact)
    pairs = truth.pairs(found.constraints)
    spanned, rank = truth.spanned([p for p in pairs if truth.holds(p)])
    assert [str(p) for p in pairs if not truth.holds(p)] == []
    assert spanned >= 0.9 * rank
    assert rank >= 9
    assert truth.error(found.program) < share * truth.error(free)
    verify(found.program, found.constraints, 1e-9)


def test_the_flange_is_a_circle():
    found = exact_relations(flange())
    circle = next(c for c in found.constraints if c.kind == "circular")
    assert {ref.leaf for ref in circle.of} == set(range(2, 8))
    assert next(c for c in found.constraints if c.kind == "equal" and Ref(2, "r") in c.of).name == "hole_radius"


def test_a_row_is_a_row():
    holes = [cylinder(2, 10, (x, 5.0, 0.0)) for x in (-30.0, -10.0, 10.0, 30.0)]
    found = exact_relations(cut(Primitive("box", (80.0, 30.0, 6.0)), *holes))
    assert any(c.kind == "linear" and [ref.leaf for ref in c.of] == [1, 2, 3, 4] for c in found.constraints)


def test_constraints_are_independent():
    found = exact_relations(PLATE_WITH_HOLES)
    rows = rows_of(found.constraints, lower(found.program))
    kept = [row for row in rows.jacobian if np.linalg.norm(row) > 0]
    # parallel axes of a box share its turns, so that one group may say a turn twice
    for number in range(len(found.constraints)):
        others = rows.jacobian[rows.owner != number]
        assert np.linalg.matrix_rank(np.array(kept), tol=1e-6) > np.linalg.matrix_rank(others, tol=1e-6), found.constraints[number]


def test_nothing_is_made_up_where_nothing_is_planted():
    rng = np.random.default_rng(4)
    parts = [
        Primitive("box", (2.03, 1.37, 0.91), (0.0, 0.0, 0.0), (11.0, 23.0, 37.0)),
        Primitive("cylinder", (0.43, 1.71), (2.61, 0.4, 0.35), (48.0, -17.0, 5.0)),
        Primitive("sphere", (0.77,), (-0.5, 2.7, 1.2)),
    ]
    program = combine_all("union", parts)  # type: ignore[arg-type]
    _, noisy = cloud_of(program, 4000, 0.003, rng)
    assert discover(refine(program, noisy).program, noisy).constraints == ()
    assert exact_relations(program).constraints == ()


def test_finished_numbers_stay():
    """Numbers that are exact already are not moved, to the last digit."""
    for program in PARTS.values():
        assert list(leaves(exact_relations(program).program)) == list(leaves(program))


def test_what_is_level_along_the_worlds_axes_is_not_told_along_an_odd_one():
    """Two tilted fins have axes along which the holes are level, too: told along those, tops that were level would drift apart."""
    fins = [Primitive("box", (20, 6, 30), (x, y, 12.3), (tilt, 0, 0)) for x, y, tilt in ((-30, 17, -11.215859), (25, -17, 11.310048))]
    holes = [Primitive("cylinder", (5, 12), (x, y, 2)) for x, y in ((-36.0003, 0.0), (-1.0, 2e-4), (34.0001, -1e-4))]
    body = combine_all("union", [Primitive("box", (100, 60, 8)), *fins])
    found = exact_relations(combine_all("difference", [body, *holes]))
    about_fins = [c for c in found.constraints if c.about is not None and c.about.leaf in (1, 2)]
    assert not about_fins
    assert any(c.kind == "coplanar" and {3, 4, 5} >= {r.leaf for r in c.of} for c in found.constraints)


def test_the_same_points_give_the_same_relations():
    rng = np.random.default_rng(7)
    _, noisy = cloud_of(PLATE_WITH_HOLES, 3000, 0.005, rng)
    first, again = discover(PLATE_WITH_HOLES, noisy), discover(PLATE_WITH_HOLES, noisy)
    assert (first.program, first.constraints) == (again.program, again.constraints)


def test_the_covariance_is_that_of_repeated_fits():
    """A sphere from clouds of one noise: the spread of fitted numbers over repetitions is the one that is told."""
    ball = Primitive("sphere", (1.0,), (0.2, -0.1, 0.4))
    rng = np.random.default_rng(3)
    fits = []
    for _ in range(60):
        exact = surface_points(ball, 800, rng)[0]
        noisy = exact + 0.02 * rng.normal(size=exact.shape)
        fits.append(pack(refine(ball, noisy).program)[1][0, [0, 3, 4, 5]])
    told = np.sqrt(np.diag(covariance(lower(ball), WeightedCloud.of(noisy), 0.02, 1e-9)))[[0, 3, 4, 5]]
    np.testing.assert_allclose(np.std(fits, axis=0), told, rtol=0.35)


def test_savings_are_the_logarithm_of_a_bayes_factor():
    """One size of known deviation: the closed form for two normal distributions."""
    balls = combine_all("union", [Primitive("sphere", (1.0,)), Primitive("sphere", (1.02,), (5.0, 0.0, 0.0))])
    numbers = lower(balls)
    deviation, width = 0.01, 8.0
    choice = RelationSelection(numbers, deviation**2 * np.eye(18), prior(numbers, width))
    judged = choice.judge(RelationCandidate(Constraint("equal", (Ref(0, "r"), Ref(1, "r"))), 5.0))
    z2 = 0.02**2 / (2 * deviation**2)
    assert judged.saving == pytest.approx(np.log2(width / deviation) - z2 / 2 / np.log(2) - 5.0)
    choice.accept(Constraint("equal", (Ref(0, "r"), Ref(1, "r"))))
    assert choice.judge(RelationCandidate(Constraint("equal", (Ref(1, "r"), Ref(0, "r"))), 5.0)).rank == 0
    assert choice.covariance[0, 9] == pytest.approx(choice.covariance[0, 0])
    assert choice.covariance[0, 0] == pytest.approx(deviation**2 / 2)


@pytest.mark.parametrize("spread", [0.0, -1e-18], ids=["exact", "less by rounding"])
def test_of_what_is_known_without_doubt_nothing_is_saved(spread):
    """A covariance from which all is taken is nothing, or less by rounding: no logarithm of it, and no root."""
    parts = [Primitive("cylinder", (1.0, 4.0)), Primitive("cylinder", (1.0, 4.0), (5.0, 0.0, 0.0))]
    numbers = lower(combine_all("union", parts))
    choice = RelationSelection(numbers, spread * np.eye(18), prior(numbers, 8.0))
    for relation in (Constraint("equal", (Ref(0, "r"), Ref(1, "r"))), Constraint("parallel", (Ref(0, "z"), Ref(1, "z")))):
        judged = choice.judge(RelationCandidate(relation, 5.0))
        assert (judged.saving, judged.rank) == (0.0, 0)


def test_held_numbers_meet_their_constraints_and_the_cloud():
    rng = np.random.default_rng(5)
    _, noisy = cloud_of(PLATE_WITH_HOLES, 4000, 0.004, rng)
    radii = tuple(Ref(i, "r") for i in range(1, 5))
    constraints = [Constraint("equal", radii), Constraint("symmetric", (Ref(1), Ref(3), Ref(0)), Ref(0, "x"))]
    cloud, start = WeightedCloud.of(noisy), lower(PLATE_WITH_HOLES)
    numbers, _ = fit_under_constraints(start, constraints, cloud, CUT * noise_of(start, cloud))
    parts = list(leaves(lift_numbers(PLATE_WITH_HOLES, start, numbers)))
    assert np.ptp([p.size[0] for p in parts[1:]]) < 1e-9
    assert np.abs(rows_of(constraints, numbers).residual).max() < 1e-9 * cloud.length
    assert parts[1].size[0] == pytest.approx(3.0, abs=0.05)


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.full((5, 3), np.nan), np.ones((5, 3)), np.ones((5, 2))])
def test_points_that_say_nothing_are_refused(points):
    with pytest.raises(ValueError, match="relations need"):
        discover(PLATE_WITH_HOLES, points)


def test_without_time_no_relation_of_places_is_taken():
    program = PARTS["plate with four holes"]
    exact, _ = cloud_of(program, 2000, 0.005, np.random.default_rng(0))
    for found in (discover(program, exact, PASSED), exact_relations(program, PASSED)):
        assert len(found.constraints) < len(exact_relations(program).constraints)
        assert len(list(leaves(found.program))) == len(list(leaves(program)))


def test_a_bolt_circle_that_was_rounded_keeps_its_round_radius():
    """Of six holes on a circle two have round places; the others come to them, not to the mean."""
    turns = np.radians(60.0 * np.arange(6))
    at = [(round(30 * np.cos(t), 2), round(30 * np.sin(t), 2), 0.0) for t in turns]
    holes = [cylinder(3.5, 12.0, place) for place in at]
    found = exact_relations(cut(cylinder(40.0, 8.0), *holes))
    assert "circular" in {c.kind for c in found.constraints}
    radii = [np.hypot(*leaf.center[:2]) for leaf in list(leaves(found.program))[1:]]
    np.testing.assert_allclose(radii, 30.0, atol=1e-6)


def test_what_rounding_broke_is_held_again():
    """Two heights meant equal, of which rounding moved one: it comes to the rounder; the other numbers stay."""
    equal = Constraint("equal", (Ref(0, "sz"), Ref(1, "sz")))
    already = Constraint("equal", (Ref(0, "sx"), Ref(1, "sy")))
    program, constraints = hold_constraints(union(box(10, 10, 10), box(10, 10, 10.02, (20.0, 0.0, 0.0))), [equal, already])
    first, second = leaves(program)
    assert first.size[2] == pytest.approx(second.size[2], abs=1e-9)
    assert first.size[2] == pytest.approx(10.0, abs=1e-6)
    assert (first.size[:2], second.size[:2]) == ((10, 10), (10, 10))
    assert constraints == (equal, already)


def test_a_thin_plate_is_not_rounded_to_nothing():
    """A tenth of a millimetre that gives way to a face is a number with one decimal, of which none was left."""
    plate = box(6.0, 6.0, 0.1, (0.0, 0.0, 1.0))
    flush = Constraint("coplanar", (Ref(1, "-z"), Ref(0, "+z")))
    program, held = hold_constraints(union(box(4.86, 11.51, 8.3, (1.3, -0.9, -2.7)), plate), [flush])
    assert held == (flush,)
    assert 0 < [*leaves(program)][1].size[2] < 0.1
    both = Constraint("coplanar", (Ref(1, "+z"), Ref(0, "+z")))
    with pytest.raises(ConstraintError, match="part 1 without extent"):
        hold_constraints(union(box(10, 9, 10, (-2.5, -0.88, 0.12)), box(6, 6, 0.04, (0.0, 0.0, 5.0))), [flush, both])


@pytest.mark.parametrize("widths", [(8.65, 8.651, 8.651), (8.652, 8.651, 8.651), (8.652, 8.65, 8.651)])
def test_round_numbers_that_give_way_meet_at_a_round_place(widths):
    """Three tabs of one width, which rounding has left a thousandth apart: their mean is no number that anyone typed."""
    equal = Constraint("equal", tuple(Ref(i, "sx") for i in range(3)))
    tabs = [box(width, 10.0, 4.0, (12.0 * i, 0.0, 0.0)) for i, width in enumerate(widths)]
    program, held = hold_constraints(union(*tabs), [equal])
    assert held == (equal,)
    found = [leaf.size[0] for leaf in leaves(program)]
    assert found == pytest.approx([round(found[0], 3)] * 3, abs=1e-9)


def test_round_numbers_stay_where_others_come_to_them():
    plate, rib = box(40, 20, 6), replace(box(3, 10, 4, (8.5, 2.5, 5)), rotation=(0.0, 0.0, 30.0))
    other = replace(box(3, 10, 4, (-8.5, 2.5, 5)), rotation=(0.0, 0.0, 30.00002))
    found = exact_relations(union(plate, rib, other))
    assert any(c.kind == "parallel" for c in found.constraints)
    assert [p.rotation[2] for p in leaves(found.program)][1] == 30.0
    assert [p.rotation[2] for p in leaves(found.program)][2] == pytest.approx(30.0, abs=1e-9)
