from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from outlined_samples import random_drawn
from program_samples import inside, inside_primitive, random_primitive, random_program

from imdim.geometry.rotations import euler_from_matrix, matrix_from_euler
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Outline
from imdim.program.rewrite.containment import bounding_radius, contains, disjoint, reach, same
from imdim.program.rewrite.containment_rules import ContainmentProver
from imdim.program.rewrite.fusion import fuse
from imdim.program.tree import KINDS, OPS, OUTLINED, SIMPLE, SIZE_NAMES, Combine, Primitive, Vec3

TURN = (20.0, -35.0, 50.0)


def placed(p: Primitive, euler_deg: Vec3 = TURN) -> Primitive:
    """`p` moved rigidly as a whole: turned about the origin and shifted."""
    turn = matrix_from_euler(euler_deg)
    center = turn @ p.center + (0.3, -0.2, 0.1)
    return replace(p, center=tuple(center.tolist()), rotation=euler_from_matrix(turn @ matrix_from_euler(p.rotation)))


def related_pair(rng: np.random.Generator, kinds: Sequence[str] = SIMPLE) -> tuple[Primitive, Primitive]:
    """Two primitives on one coarse grid, which often share an axis or a face, hold each other or are apart."""
    turns = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (180.0, 0.0, 0.0), (0.0, 90.0, 0.0), (0.0, 0.0, 30.0))

    def one() -> Primitive:
        kind = kinds[rng.integers(len(kinds))]
        size = tuple(float(v) for v in rng.choice((0.25, 0.5, 1.0), len(SIZE_NAMES[kind])))
        size = (max(size), 0.25) if kind == "torus" else size
        center = (float(rng.choice((0.0, 0.0, 0.0, 1.0))), 0.0, float(rng.choice((0.0, 0.25, 0.5, 1.0))))
        if kind in OUTLINED:
            return placed(random_drawn(rng, kind, size[0], center, turns[rng.integers(len(turns))]))
        return placed(Primitive(kind, size, center, turns[rng.integers(len(turns))]))

    return one(), one()


def samples(p: Primitive, rng: np.random.Generator, n: int = 600) -> np.ndarray:
    """Points [n, 3] in the ball about `p`."""
    v = rng.normal(size=(n, 3))
    v *= (rng.random(n) ** (1 / 3) * bounding_radius(p) / np.linalg.norm(v, axis=1))[:, None]
    return v + p.center


def test_no_proof_is_contradicted_by_a_point():
    rng = np.random.default_rng(0)
    held = apart = 0
    for _ in range(4000):
        a, b = related_pair(rng, KINDS)
        points, holds, parts = samples(b, rng), contains(a, b), disjoint(a, b)
        if not (holds or parts):
            continue
        in_a, in_b = inside_primitive(a, points), inside_primitive(b, points)
        held, apart = held + holds, apart + parts
        assert not holds or not (in_b & ~in_a).any(), (a, b)
        assert not parts or not (in_b & in_a).any(), (a, b)
    assert held > 100
    assert apart > 300


def test_most_true_containments_are_proven():
    rng = np.random.default_rng(1)
    true = proven = 0
    for _ in range(2000):
        a, b = related_pair(rng)
        points = samples(b, rng, 2000)
        if not (inside_primitive(b, points) & ~inside_primitive(a, points)).any():
            true += 1
            proven += contains(a, b)
    assert proven > 0.8 * true


@pytest.mark.parametrize(
    ("outer", "inner"),
    [
        (Primitive("box", (2.0, 2.0, 2.0)), Primitive("sphere", (1.0,))),
        (Primitive("box", (2.0, 2.0, 2.0)), Primitive("cylinder", (1.0, 2.0), rotation=(0.0, 90.0, 0.0))),
        (Primitive("cylinder", (1.0, 2.0)), Primitive("cone", (1.0, 0.2, 2.0), rotation=(180.0, 0.0, 0.0))),
        (Primitive("cone", (2.0, 1.0, 1.0)), Primitive("cylinder", (1.0, 1.0))),
        (Primitive("cone", (1.0, 0.0, 2.0)), Primitive("cone", (0.5, 0.0, 1.0), (0.0, 0.0, 0.5))),
        (Primitive("sphere", (2.0,)), Primitive("torus", (1.5, 0.5), rotation=TURN)),
        (Primitive("cylinder", (2.0, 1.0)), Primitive("torus", (1.5, 0.5))),
        (Primitive("torus", (1.5, 0.5)), Primitive("torus", (1.4, 0.4), rotation=(180.0, 0.0, 0.0))),
        (Primitive("torus", (1.5, 0.5)), Primitive("sphere", (0.5,), (0.0, 1.5, 0.0))),
        (Primitive("ellipsoid", (1.0, 2.0, 3.0)), Primitive("ellipsoid", (1.0, 1.9, 3.0))),
        (Primitive("ellipsoid", (1.0, 2.0, 3.0)), Primitive("sphere", (1.0,))),
        (Primitive("box", (2.0, 4.0, 6.0)), Primitive("ellipsoid", (1.0, 2.0, 3.0))),
    ],
)
def test_touching_containments_are_proven_in_any_frame(outer: Primitive, inner: Primitive):
    assert contains(outer, inner)
    assert not contains(inner, outer)
    for x, y, z in np.random.default_rng(0).uniform(-180, 180, (20, 3)).tolist():
        assert contains(placed(outer, (x, y, z)), placed(inner, (x, y, z)))


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (Primitive("box", (1.0, 1.0, 1.0)), Primitive("box", (1.0, 1.0, 1.0), (1.0, 0.3, 0.0))),
        (Primitive("sphere", (1.0,)), Primitive("sphere", (1.0,), (1.2, 1.2, 1.1))),
        (Primitive("cylinder", (1.0, 1.0)), Primitive("cylinder", (0.5, 3.0), (1.1, 1.1, 0.0))),
        (Primitive("cone", (1.0, 0.0, 1.0)), Primitive("box", (4.0, 4.0, 1.0), (0.0, 0.0, 1.0))),
    ],
)
def test_touching_neighbours_are_apart(a: Primitive, b: Primitive):
    assert disjoint(placed(a), placed(b))
    assert disjoint(b, a)
    assert not disjoint(a, a)


def test_the_same_set_in_other_numbers():
    assert same(Primitive("cylinder", (1.0, 2.0)), Primitive("cylinder", (1.0, 2.0), rotation=(180.0, 0.0, 77.0)))
    assert same(Primitive("cone", (1.0, 0.5, 2.0)), Primitive("cone", (0.5, 1.0, 2.0), rotation=(180.0, 0.0, 0.0)))
    assert same(Primitive("box", (1.0, 2.0, 3.0)), Primitive("box", (2.0, 1.0, 3.0), rotation=(0.0, 0.0, 90.0)))
    assert same(Primitive("torus", (1.0, 0.5)), Primitive("torus", (1.0, 0.5), rotation=(180.0, 0.0, 0.0)))
    assert not same(Primitive("box", (1.0, 2.0, 3.0)), Primitive("box", (2.0, 1.0, 3.0)))


@pytest.mark.parametrize("kind", KINDS)
def test_reach_is_the_farthest_point(kind: str):
    rng = np.random.default_rng(4)
    p = random_primitive(rng, [kind])
    points = samples(p, rng, 200_000)
    offsets = points[inside_primitive(p, points)] - p.center
    for n in rng.normal(size=(5, 3)):
        n /= np.linalg.norm(n)
        farthest = (offsets @ n).max()
        # of a drawn leaf the reach is that of what holds it
        most = farthest + 0.08 * bounding_radius(p) if kind in SIMPLE else bounding_radius(p)
        assert farthest <= reach(p, tuple(n.tolist())) <= most


@pytest.mark.parametrize("op", OPS)
def test_a_fused_pair_is_the_pair(op: str):
    rng = np.random.default_rng(5)
    fused = 0
    for _ in range(4000):
        a, b = related_pair(rng)
        one = fuse(op, a, b)  # type: ignore[arg-type]
        if one is None or contains(a, b) or contains(b, a):
            continue
        fused += 1
        points = np.concatenate([samples(a, rng), samples(b, rng)])
        assert np.array_equal(inside(Combine(op, a, b), points), inside_primitive(one, points)), (a, b)  # type: ignore[arg-type]
    assert fused >= 5


@pytest.mark.parametrize(
    ("op", "a", "b", "size", "center"),
    [
        ("union", ("box", (1.0, 1.0, 1.0), 0.0), ("box", (1.0, 1.0, 2.0), 1.5), (1.0, 1.0, 3.0), 1.0),
        ("union", ("cylinder", (1.0, 1.0), 0.0), ("cylinder", (1.0, 1.0), 0.7), (1.0, 1.7), 0.35),
        ("union", ("cone", (2.0, 1.0, 1.0), 0.0), ("cone", (1.0, 0.0, 1.0), 1.0), (2.0, 0.0, 2.0), 0.5),
        ("intersection", ("cone", (2.0, 0.0, 2.0), 0.0), ("box", (9.0, 9.0, 2.0), -1.0), (2.0, 1.0, 1.0), -0.5),
        ("difference", ("cylinder", (1.0, 2.0), 0.0), ("box", (9.0, 9.0, 2.0), 1.5), (1.0, 1.5), -0.25),
    ],
)
def test_known_fusions(op: str, a: tuple, b: tuple, size: tuple[float, ...], center: float):
    one, other = (Primitive(kind, s, (0.0, 0.0, z)) for kind, s, z in (a, b))
    assert fuse(op, one, other) == Primitive(one.kind, size, (0.0, 0.0, center))  # type: ignore[arg-type]


def test_a_difference_that_leaves_two_pieces_is_not_one():
    assert fuse("difference", Primitive("cylinder", (1.0, 3.0)), Primitive("box", (9.0, 9.0, 1.0))) is None


def test_proofs_about_programs_are_not_contradicted_by_points():
    rng = np.random.default_rng(6)
    prover = ContainmentProver()
    held = apart = 0
    for _ in range(400):
        a = random_program(rng, 3, kinds=("box", "sphere"))
        b = Combine(("intersection", "difference")[rng.integers(2)], a, random_primitive(rng))
        if rng.random() < 0.5:
            a = Combine("difference", random_primitive(rng), b)
        points = rng.uniform(-1.2, 1.2, (1000, 3))
        in_a, in_b = inside(a, points), inside(b, points)
        if prover.contains(a, b):
            held += 1
            assert not (in_b & ~in_a).any()
        if prover.disjoint(a, b):
            apart += 1
            assert not (in_a & in_b).any()
    assert held > 50
    assert apart > 50


def test_an_extruded_ellipse_holds_smaller_ones_of_its_plane() -> None:
    def elliptic(rx: float, ry: float, x: float = 0.0, angle: float = 0.0, height: float = 2.0) -> Primitive:
        return placed(Primitive("extrude", (height,), outline=Outline((Ellipse(rx, ry, x, 0.0, angle),))))

    outer = elliptic(3.0, 2.0)
    assert contains(outer, outer)
    assert contains(outer, elliptic(2.0, 3.0, angle=90.0))
    assert contains(outer, elliptic(2.0, 1.0, x=0.5))
    assert not contains(outer, elliptic(2.8, 1.9, x=0.5))
    assert not contains(outer, elliptic(3.0, 2.0, angle=10.0))
    assert not contains(outer, elliptic(2.0, 1.0, height=2.1))
    assert not contains(elliptic(2.0, 1.0, height=4.0), outer)
    taller = fuse("union", outer, replace(outer, center=placed(Primitive("box", (1.0, 1.0, 1.0), (0.0, 0.0, 1.5))).center))
    assert taller is not None
    assert taller.size == pytest.approx((3.5,))
