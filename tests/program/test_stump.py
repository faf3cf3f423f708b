import numpy as np
import pytest
from program_samples import cloud, inside, inside_primitive, random_primitive, random_program
from stump_forms import evaluate, to_stump

from imdim.program.stump import CsgStump, to_program
from imdim.program.tree import KINDS, Combine, Primitive, combine_all

CUBE, BALL, ROD = Primitive("box", (1.0, 1.0, 1.0)), Primitive("sphere", (0.6,)), Primitive("cylinder", (0.2, 3.0))


def columns(stump: CsgStump, points: np.ndarray) -> list[np.ndarray]:
    return [inside_primitive(p, points) for p in stump.primitives]


def test_matrices_of_a_known_tree():
    stump = to_stump(Combine("union", Combine("difference", CUBE, ROD), BALL))
    assert stump == CsgStump((CUBE, ROD, BALL), (0, 1, 0), ((1, 0), (1, 0), (0, 1)), (1, 1))


def test_a_primitive_needed_both_ways_appears_twice():
    stump = to_stump(Combine("union", Combine("difference", CUBE, BALL), Combine("difference", BALL, CUBE)))
    assert stump.primitives == (CUBE, CUBE, BALL, BALL)
    assert stump.complement == (0, 1, 0, 1)


@pytest.mark.parametrize("seed", range(40))
def test_tree_and_stump_are_the_same_solid(seed: int):
    rng = np.random.default_rng(seed)
    program = random_program(rng, int(rng.integers(1, 10)), kinds=KINDS, reuse=0.3)
    points = cloud(rng)
    truth = inside(program, points)
    stump = to_stump(program)
    assert np.array_equal(evaluate(stump, columns(stump, points)), truth)
    if any(stump.union):
        assert np.array_equal(inside(to_program(stump), points), truth)
    else:
        assert not truth.any()


@pytest.mark.parametrize("seed", range(20))
def test_random_matrices_and_their_tree_are_the_same_solid(seed: int):
    rng = np.random.default_rng(seed)
    k, c = rng.integers(2, 6, 2)
    w_c = (0, *(int(v) for v in rng.integers(0, 2, k - 1)))
    w_i = ((1,) * int(c), *(tuple(int(v) for v in row) for row in rng.integers(0, 2, (k - 1, c))))
    stump = CsgStump(tuple(random_primitive(rng, KINDS) for _ in range(k)), w_c, w_i, (1, *(int(v) for v in rng.integers(0, 2, c - 1))))
    points = cloud(rng)
    o = np.array(columns(stump, points), float)
    # the formulas of the paper, in numbers
    f = np.array(w_c)[:, None] * (1 - o) + (1 - np.array(w_c))[:, None] * o
    s = np.array([np.min([w_i[j][i] * f[j] + (1 - w_i[j][i]) for j in range(k)], axis=0) for i in range(c)])
    t = np.max([stump.union[i] * s[i] for i in range(c)], axis=0)
    assert np.array_equal(evaluate(stump, columns(stump, points)), t > 0.5)
    assert np.array_equal(inside(to_program(stump), points), t > 0.5)


def test_columns_may_be_bit_sets():
    stump = to_stump(Combine("difference", CUBE, Combine("union", BALL, ROD)))
    assert evaluate(stump, [0b1111, 0b0101, 0b0001]) == 0b1010


def test_a_solid_that_is_empty_by_logic_selects_nothing():
    stump = to_stump(Combine("difference", CUBE, Combine("union", CUBE, BALL)))
    assert stump.union == ()
    assert not evaluate(stump, [np.ones(3, bool)]).any()
    with pytest.raises(ValueError, match="empty"):
        to_program(stump)


def test_an_unbounded_solid_has_no_program():
    with pytest.raises(ValueError, match="unbounded"):
        to_program(CsgStump((CUBE,), (1,), ((1,),), (1,)))


def test_the_size_guard():
    rng = np.random.default_rng(0)
    unions = [combine_all("union", [random_primitive(rng) for _ in range(4)]) for _ in range(6)]
    program = combine_all("intersection", unions)
    with pytest.raises(ValueError, match="intersections"):
        to_stump(program)
    assert len(to_stump(program, max_terms=4**6).union) == 4**6


def test_a_deep_tree_is_no_problem():
    rng = np.random.default_rng(5)
    program = combine_all("union", [random_primitive(rng) for _ in range(600)])
    assert len(to_stump(program).union) == 600


@pytest.mark.parametrize(
    ("complement", "intersection", "union", "message"),
    [
        ((0, 0), ((1,),), (1,), "1 primitives need"),
        ((0,), ((1, 0),), (1,), "W_U has 1"),
        ((2,), ((1,),), (1,), "0 or 1, got 2"),
    ],
)
def test_shapes_and_entries_are_checked(complement: tuple, intersection: tuple, union: tuple, message: str):
    with pytest.raises(ValueError, match=message):
        CsgStump((CUBE,), complement, intersection, union)
