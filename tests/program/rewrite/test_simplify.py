from dataclasses import replace

import numpy as np
import pytest
from program_samples import cloud, inside, random_primitive, random_program
from tests.deadlines import PASSED

from imdim.geometry.solid import to_manifold
from imdim.program.cost import cost
from imdim.program.rewrite.simplify import reduce_program, simplify
from imdim.program.tree import KINDS, Combine, Op, Primitive, Program, combine_all, leaves

BLOCK = Primitive("box", (2.0, 2.0, 2.0))
ROD = Primitive("cylinder", (0.4, 3.0))
PIN = Primitive("cylinder", (0.2, 3.0))
BALL = Primitive("sphere", (0.9,))
FAR = Primitive("sphere", (0.5,), (5.0, 0.0, 0.0))
SIDE = Primitive("box", (1.0, 1.0, 1.0), (1.2, 0.3, 0.0), (0.0, 30.0, 0.0))
CORE = Primitive("sphere", (1.2,))
PIPE = Primitive("cylinder", (0.5, 3.0))
STUB = Primitive("cylinder", (0.6, 4.0), (0.0, 0.0, 1.0))
NEXT = Primitive("box", (2.0, 2.0, 2.0), (0.0, 2.0, 0.0))
SLAB = Primitive("box", (9.0, 9.0, 2.0), (0.0, 0.0, 1.5))
HOLE = Primitive("box", (2.0, 3.0, 2.0), (1.0, 0.0, 1.5))
POCKET = Primitive("box", (2.0, 3.0, 1.5), (1.0, 0.0, 1.75))
FLOOR = Primitive("box", (4.0, 9.0, 0.5), (1.0, 0.0, 0.75))
GROOVE = Primitive("box", (9.0, 9.0, 1.0), (0.0, 7.0, 2.0))


def cut(a: Program, *others: Program) -> Program:
    return combine_all("difference", [a, *others])


def unite(*parts: Program) -> Program:
    return combine_all("union", list(parts))


def meet(*parts: Program) -> Program:
    return combine_all("intersection", list(parts))


RULES = {
    "A | A is A": (unite(SIDE, SIDE), SIDE),
    "A & A is A": (meet(SIDE, SIDE), SIDE),
    "(A - B) - B is A - B": (cut(BLOCK, ROD, ROD), cut(BLOCK, ROD)),
    "(A - B) | B is A | B": (unite(cut(BLOCK, ROD), ROD), unite(BLOCK, ROD)),
    "(A | B) - B is A - B": (cut(unite(BLOCK, SIDE), SIDE), cut(BLOCK, SIDE)),
    "A & (A - B) is A - B": (meet(BLOCK, cut(BLOCK, ROD)), cut(BLOCK, ROD)),
    "(A - B - C) | F is A - D - C where F is a floor of A that fills the end of B and is apart from C": (
        unite(cut(SLAB, HOLE, GROOVE), FLOOR),
        cut(SLAB, POCKET, GROOVE),
    ),
    "A | (A & B) is A": (unite(SIDE, meet(SIDE, CORE)), SIDE),
    "A - (A & B) is A - B": (cut(BLOCK, meet(BLOCK, SIDE)), cut(BLOCK, SIDE)),
    "A - (A - B) is A & B": (cut(BLOCK, cut(BLOCK, SIDE)), meet(BLOCK, SIDE)),
    "a part inside another goes": (unite(BLOCK, BALL, SIDE), unite(BLOCK, SIDE)),
    "a factor around another goes": (meet(BLOCK, BALL), BALL),
    "a cut inside a cut goes": (cut(BLOCK, PIN, ROD), cut(BLOCK, ROD)),
    "a cut that misses goes": (cut(BLOCK, FAR, ROD), cut(BLOCK, ROD)),
    "a part cut away goes": (cut(unite(BLOCK, FAR), replace(FAR, size=(0.6,))), BLOCK),
    "a part apart from a factor goes": (meet(unite(SIDE, FAR), CORE), meet(SIDE, CORE)),
    "a cut inside a united part goes": (
        unite(cut(BLOCK, ROD), PIPE),
        unite(BLOCK, PIPE),
    ),
    "a cut that a united part fills as far as it cuts goes": (unite(cut(BLOCK, PIPE), STUB), unite(BLOCK, STUB)),
    "a spared core outside goes": (cut(BLOCK, cut(ROD, FAR)), cut(BLOCK, ROD)),
    "boxes in a row are one": (
        unite(BLOCK, NEXT, SIDE),
        unite(Primitive("box", (2.0, 4.0, 2.0), (0.0, 1.0, 0.0)), SIDE),
    ),
    "a slab cuts in the numbers": (
        cut(BLOCK, SLAB),
        Primitive("box", (2.0, 2.0, 1.5), (0.0, 0.0, -0.25)),
    ),
    "the same set in other numbers": (unite(ROD, replace(ROD, rotation=(180.0, 0.0, 20.0))), ROD),
}


@pytest.mark.parametrize("rule", RULES)
def test_rule(rule: str):
    program, expected = RULES[rule]
    points = np.random.default_rng(0).uniform(-3, 6, (5000, 3))
    assert np.array_equal(inside(program, points), inside(expected, points))
    assert reduce_program(program) == expected


@pytest.mark.parametrize("empty", [cut(BLOCK, BLOCK), meet(BLOCK, FAR), cut(BALL, unite(SIDE, BLOCK))])
def test_an_empty_solid_is_returned_as_given_and_a_part_of_nothing_goes(empty: Program):
    assert reduce_program(empty) is empty
    assert reduce_program(unite(empty, SIDE)) == SIDE
    assert reduce_program(cut(SIDE, empty)) == SIDE


@pytest.mark.parametrize("seed", range(60))
def test_the_solid_of_a_random_tree_stays_and_the_cost_never_grows(seed: int):
    rng = np.random.default_rng(seed)
    program = random_program(rng, int(rng.integers(2, 12)), kinds=KINDS, reuse=0.35)
    shorter = reduce_program(program)
    points = cloud(rng)
    assert np.array_equal(inside(shorter, points), inside(program, points))
    assert cost(shorter) <= cost(program)
    assert cost(reduce_program(shorter)) == cost(shorter)


def test_random_trees_with_repeats_do_get_shorter():
    rng = np.random.default_rng(0)
    programs = [random_program(rng, 8, reuse=0.35) for _ in range(40)]
    assert sum(cost(reduce_program(p)) for p in programs) < 0.8 * sum(map(cost, programs))


def aligned_box(rng: np.random.Generator) -> Primitive:
    low, high = np.sort(rng.integers(0, 5, (2, 3)), axis=0)
    size = np.maximum(high - low, 1)
    return Primitive("box", tuple(map(float, size)), tuple((low + size / 2).tolist()))


@pytest.mark.parametrize("seed", range(40))
def test_boxes_on_a_grid_with_their_touching_faces_keep_the_solid(seed: int):
    rng = np.random.default_rng(seed)
    program: Program = aligned_box(rng)
    for _ in range(7):
        op: Op = ("union", "union", "difference", "intersection")[rng.integers(4)]  # type: ignore[assignment]
        part: Program = aligned_box(rng) if rng.random() < 0.6 else Combine("union", aligned_box(rng), aligned_box(rng))
        program = Combine(op, program, part)
    shorter = reduce_program(program)
    points = rng.uniform(-0.5, 5.5, (5000, 3))
    assert np.array_equal(inside(shorter, points), inside(program, points))
    if inside(program, points).any():
        assert to_manifold(shorter).volume() == pytest.approx(to_manifold(program).volume(), rel=1e-9)
    assert cost(shorter) <= cost(program)


def same_volume(a: Program, b: Program) -> bool:
    """Symmetric difference below 0.1 % of the volume, by exact booleans."""
    one, other = to_manifold(a, 48), to_manifold(b, 48)
    return (one - other).volume() + (other - one).volume() < 1e-3 * one.volume()


def test_parts_without_effect_go_where_the_referee_agrees():
    # no pair of primitives proves that the two halves hold the pin, or that the ball is filled again
    halves = [Primitive("box", (1.0, 2.0, 2.0), (x, 0.0, 0.0), (0.0, 0.0, t)) for x, t in ((-0.45, 2.0), (0.45, 0.0))]
    pin = Primitive("cylinder", (0.3, 1.5))
    program = cut(unite(*halves, pin, SIDE), PIN, Primitive("sphere", (0.05,), (0.0, 0.05, 0.0)))
    assert cost(reduce_program(program)) > cost(cut(unite(*halves, SIDE), PIN))
    assert simplify(program, same_volume) == cut(unite(*halves, SIDE), PIN)


def test_near_equal_primitives_are_merged_where_the_referee_agrees():
    nearly = Primitive("cylinder", (0.4, 3.0002), (1e-5, 0.0, 0.0), (0.0, 0.001, 40.0))
    program = unite(cut(BLOCK, ROD), meet(nearly, SIDE))
    expected = unite(BLOCK, meet(ROD, SIDE))
    assert not same_volume(program, expected)
    assert cost(simplify(unite(cut(BLOCK, ROD), nearly), same_volume)) == 3
    assert simplify(unite(ROD, nearly), same_volume) in (ROD, nearly)


def test_a_referee_that_always_refuses_leaves_the_proven_form():
    program = unite(cut(BLOCK, ROD), ROD, SIDE)
    assert simplify(program, lambda a, b: False) == reduce_program(program)


def test_the_referee_sees_the_given_program_and_is_asked_a_bounded_number_of_times():
    rng = np.random.default_rng(2)
    program = random_program(rng, 12)
    asked: list[Program] = []

    def referee(given: Program, candidate: Program) -> bool:
        assert given is program
        asked.append(candidate)
        return False

    simplify(program, referee, max_checks=7)
    assert len(asked) == 7


@pytest.mark.parametrize("seed", range(6))
def test_with_a_referee_the_volume_stays(seed: int):
    rng = np.random.default_rng(seed)
    program = unite(BLOCK, random_program(rng, 6, reuse=0.3, kinds=("box", "cylinder", "cone")))
    shorter = simplify(program, same_volume)
    assert same_volume(program, shorter)
    assert cost(shorter) <= cost(reduce_program(program))


def test_a_long_program_is_no_problem():
    rng = np.random.default_rng(3)
    parts = [replace(random_primitive(rng), center=(3.0 * i, 0.0, 0.0)) for i in range(60)]
    program = unite(*parts, *parts)
    assert sorted(map(hash, leaves(reduce_program(program)))) == sorted(map(hash, parts))


def test_once_time_is_out_a_program_stays_as_it_is():
    twice = Combine("union", Primitive("sphere", (2.0,)), Primitive("sphere", (1.0,)))
    assert reduce_program(twice, deadline=PASSED) == twice
    assert reduce_program(twice) == twice.left
