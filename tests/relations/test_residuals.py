"""Residuals of constraints against closed forms, and their derivatives against differences."""

import math
from dataclasses import replace

import numpy as np
import pytest

from imdim.geometry.lowering import lower
from imdim.geometry.pose import radii
from imdim.geometry.rotations import euler_from_matrix, matrix_from_euler
from imdim.program.constraints import Constraint, ConstraintError, Ref
from imdim.program.tree import Combine, Primitive, combine_all, leaves
from imdim.relations.residuals import holding, rebase_constraints, rows_of, verify

TILT = (20.0, -35.0, 50.0)
FRAME = matrix_from_euler(TILT)


def tilted(kind, size, at):
    """A leaf at `at` in a frame that lies slantwise in the world."""
    return Primitive(kind, size, tuple(FRAME @ np.array(at) + [1.0, 2.0, 3.0]), TILT)


def ring(n, radius, start=0.3):
    """Boxes that stand round the local z axis and turn with it."""
    out = []
    for i in range(n):
        angle = start + 2 * math.pi * i / n
        turn = FRAME @ matrix_from_euler((0.0, 0.0, math.degrees(angle)))
        center = FRAME @ np.array([radius * math.cos(angle), radius * math.sin(angle), 0.5]) + [1.0, 2.0, 3.0]
        out.append(Primitive("box", (0.3, 0.2, 0.4), tuple(center), euler_from_matrix(turn)))
    return out


PARTS = [
    tilted("box", (4.0, 3.0, 1.0), (0, 0, 0)),
    tilted("cylinder", (0.5, 2.0), (1, 1, 1.5)),
    tilted("cylinder", (0.5, 1.0), (-1, 1, 1.0)),
    tilted("sphere", (0.7,), (1, 1, 3)),
    tilted("cone", (0.5, 0.2, 1.0), (1, -1, 1.0)),
    *ring(5, 1.2),
    *(tilted("cylinder", (0.1, 0.4), (0.5 * i, -1.0, 0.3 * i)) for i in range(3)),
    tilted("cylinder", (0.3, 1.0), (1.48, 1.64, 0.0)),  # .8 from number 1, whose wall it touches from without
    tilted("cylinder", (0.2, 1.0), (1.18, 1.24, 0.0)),  # and this one from within
    tilted("sphere", (0.4,), (1.0, 0.1, 7.0)),  # a ball that touches number 1 ...
    tilted("sphere", (0.6,), (1.0, 0.1, 6.0)),  # ... and this ball the other
]
PROGRAM = combine_all("union", PARTS)  # type: ignore[arg-type]
HOLD = [
    Constraint("equal", (Ref(1, "r"), Ref(2, "r"), Ref(4, "r_bottom"))),
    Constraint("value", (Ref(3, "r"),), value=0.7),
    Constraint("parallel", (Ref(0, "z"), Ref(1, "z"), Ref(4, "z"))),
    Constraint("perpendicular", (Ref(0, "x"), Ref(2, "z"))),
    Constraint("coplanar", (Ref(0, "+z"), Ref(1, "-z"))),
    Constraint("coplanar", (Ref(0, "+z"), Ref(1, "+z")), value=2.0),
    Constraint("coplanar", (Ref(0, "-z"), Ref(1, "+z")), value=-3.0),
    Constraint("aligned", (Ref(1), Ref(2)), Ref(0, "y")),
    Constraint("aligned", (Ref(2), Ref(1)), Ref(0, "x"), 2.0),
    Constraint("coaxial", (Ref(1, "z"), Ref(3))),
    Constraint("symmetric", (Ref(1), Ref(2), Ref(0)), Ref(0, "x")),
    Constraint("symmetric", (Ref(1), Ref(4), Ref(0)), Ref(0, "y")),
    Constraint("circular", tuple(Ref(i, "x") for i in range(5, 10)), Ref(0, "z")),
    Constraint("circular", tuple(Ref(i) for i in range(5, 10)), Ref(5, "z")),
    Constraint("linear", (Ref(10), Ref(11), Ref(12))),
    Constraint("tangent", (Ref(1, "r"), Ref(0, "+y"))),
    Constraint("tangent", (Ref(1, "r"), Ref(13, "r"))),
    Constraint("tangent", (Ref(14, "r"), Ref(1, "r"))),
    Constraint("tangent", (Ref(15, "r"), Ref(1, "r"))),
    Constraint("tangent", (Ref(15, "r"), Ref(16, "r"))),
]


def test_what_holds_by_construction_holds():
    verify(PROGRAM, HOLD, 1e-12)


@pytest.mark.parametrize("constraint", HOLD, ids=str)
def test_a_disturbance_is_felt(constraint):
    rng = np.random.default_rng(1)
    disturbed = []
    for p in PARTS:
        size, center = np.array(p.size) * rng.uniform(0.8, 1.2, len(p.size)), p.center + rng.normal(size=3) * 0.1
        disturbed.append(Primitive(p.kind, tuple(size), tuple(center), tuple(rng.normal(size=3) * 5 + TILT)))
    with pytest.raises(ConstraintError, match=r"^constraints\[0\]"):
        verify(combine_all("union", disturbed), [constraint])


@pytest.mark.parametrize("constraint", HOLD, ids=str)
def test_derivatives_agree_with_differences(constraint):
    """Away from where it holds, so that no term is zero by chance."""
    rng = np.random.default_rng(2)
    numbers = lower(PROGRAM)
    numbers = replace(numbers, centers=numbers.centers + 0.1 * rng.normal(size=numbers.centers.shape))
    slopes = rows_of([constraint], numbers).jacobian
    h, sizes = 1e-6, radii(numbers)
    for column in np.flatnonzero(np.abs(slopes).sum(0) + (rng.random(slopes.shape[1]) < 0.1)):
        leaf, k = divmod(int(column), 9)
        values = [rows_of([constraint], moved(numbers, leaf, k, side * h, sizes[leaf])).residual for side in (1, -1)]
        np.testing.assert_allclose((values[0] - values[1]) / (2 * h), slopes[:, column], atol=1e-7)


def moved(numbers, leaf, k, h, radius):
    """One coordinate of one leaf: sizes, shift in its own frame, turn about its own axes times its radius."""
    sizes, centers, rotations = numbers.sizes.copy(), numbers.centers.copy(), numbers.rotations.copy()
    if k < 3:
        sizes[leaf, k] += h
    elif k < 6:
        centers[leaf] += h * rotations[leaf][:, k - 3]
    else:
        angles = [0.0] * 3
        angles[k - 6] = math.degrees(h / radius)
        rotations[leaf] = rotations[leaf] @ matrix_from_euler(tuple(angles))
    return replace(numbers, sizes=sizes, centers=centers, rotations=rotations)


@pytest.mark.parametrize(
    ("of", "apart"),
    [
        ((Ref(0, "r"), Ref(2, "+x")), 0.3),  # the nearer side of the plane
        ((Ref(0, "r"), Ref(1, "r")), 0.5),  # without
        ((Ref(3, "r"), Ref(0, "r")), -0.4),  # within
        ((Ref(4, "r"), Ref(0, "r")), -0.5),  # about one axis: by the difference of the radii
    ],
)
def test_how_far_walls_are_from_touching(of, apart):
    tubes = [Primitive("cylinder", (r, 4.0), (x, 0.0, 0.0)) for r, x in ((2.0, 0.0), (1.0, 3.5))]
    others = [Primitive("box", (2.0, 9.0, 4.0), (-3.3, 0.0, 0.0))]
    within = [Primitive("cylinder", (1.0, 4.0), (0.6, 0.0, 0.0)), Primitive("cylinder", (1.5, 4.0))]
    rows = rows_of([Constraint("tangent", of)], lower(combine_all("union", [*tubes, *others, *within])))
    assert rows.residual == pytest.approx([apart])


def test_what_cannot_hold_beside_the_others_names_them():
    plates = Combine("union", Primitive("box", (2.0, 2.0, 1.0)), Primitive("box", (2.0, 2.0, 1.0), (5.0, 0.0, 0.0)))
    faces = [Constraint("coplanar", (Ref(0, f"{s}z"), Ref(1, f"{s}z"))) for s in "+-"]
    verify(plates, [*faces, Constraint("equal", (Ref(0, "sz"), Ref(1, "sz")))])
    wrong = [*faces, Constraint("coplanar", (Ref(0, "+z"), Ref(1, "-z")), value=-2.0), Constraint("value", (Ref(1, "sz"),), value=1.0)]
    with pytest.raises(ConstraintError, match=r"constraints\[2\] .*: contradicts constraints 0, 3"):
        verify(plates, wrong)
    with pytest.raises(ConstraintError, match=r"constraints\[0\] .*: is off by 5"):
        verify(plates, [Constraint("aligned", (Ref(0), Ref(1)), Ref(-1, "x"))])


def test_levels_keep_the_distance_that_they_have():
    before = Combine("difference", Primitive("box", (4.0, 4.0, 1.0)), Primitive("cylinder", (0.5, 1.0)))
    held = (
        Constraint("coplanar", (Ref(0, "+z"), Ref(1, "+z"))),
        Constraint("concentric", (Ref(0), Ref(1))),
        Constraint("equal", (Ref(0, "sz"), Ref(1, "h"))),
    )
    verify(before, held)
    after = Combine("difference", Primitive("box", (4.0, 4.0, 1.0)), Primitive("cylinder", (0.5, 1.2)))
    kept = rebase_constraints(after, held)
    assert kept == (replace(held[0], value=0.1), held[1])
    verify(after, kept)


def test_what_a_person_holds_stays_where_it_is():
    held = [
        Constraint("fixed", (Ref(1, "r"),), value=0.4),
        Constraint("fixed", (Ref(3),), Ref(-1, "y"), 1.5),
        Constraint("fixed", (Ref(0, "z"),)),
    ]
    rows = rows_of(held, lower(PROGRAM))
    assert rows.residual == pytest.approx([0.1, list(leaves(PROGRAM))[3].center[1] - 1.5, 0.0])
    assert np.flatnonzero(rows.jacobian[0]).tolist() == [9]
    assert rows.jacobian[1, 30:33] == pytest.approx(FRAME[1])
    assert np.flatnonzero(rows.jacobian[2]).tolist() == [8]


def test_what_is_off_in_its_last_residual_does_not_hold():
    """Centres that part along z: the residuals along x and y are none."""
    part = combine_all("union", [Primitive("box", (2.0, 2.0, 2.0)), Primitive("sphere", (1.0,), (0.0, 0.0, 0.5))])
    concentric = Constraint("concentric", (Ref(0), Ref(1)))
    assert holding(part, [concentric]) == ()
    assert rebase_constraints(part, [concentric]) == ()
