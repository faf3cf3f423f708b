"""Read-once formulas against all trees over a few sets."""

from itertools import product

import numpy as np
import pytest

from imdim.geometry import kernels
from imdim.program.tree import Combine, Primitive, Program
from imdim.search.exact.formula import Gate, Literal, holds, read_once, to_program

GROUPS = 12
EVERYTHING = (1 << GROUPS) - 1


def every_function(sets: tuple[int, ...]) -> set[int]:
    """What all read-once trees over all or some of the sets can hold, complements included."""
    known: dict[frozenset[int], set[int]] = {}
    members = range(len(sets))
    for chosen in sorted((frozenset(i for i in members if n >> i & 1) for n in range(1, 1 << len(sets))), key=len):
        found = {f for i in chosen for f in (sets[i], EVERYTHING & ~sets[i])}
        for half in known:
            if half < chosen:
                found |= {f for a, b in product(known[half], known[chosen - half]) for f in (a & b, a | b)}
        known[chosen] = found
    return known[frozenset(members)]


@pytest.mark.parametrize("seed", range(60))
def test_a_formula_is_found_where_any_tree_does(seed):
    rng = np.random.default_rng(seed)
    sets = tuple(int(v) for v in rng.integers(1, EVERYTHING, int(rng.integers(1, 5))))
    required = int(rng.integers(1, EVERYTHING))
    forbidden = EVERYTHING & ~required & int(rng.integers(1, EVERYTHING))
    if not forbidden:
        return
    possible = any(not required & ~f and not forbidden & f for f in every_function(sets))
    formula = read_once(sets, required, forbidden)
    assert (formula is not None) == possible
    if formula is not None:
        held = holds(formula, sets, EVERYTHING)
        assert not required & ~held
        assert not forbidden & held


@pytest.mark.parametrize("seed", range(40))
def test_a_planted_tree_of_eight_sets_is_found_again(seed):
    """Wide enough that each sign vector has a group: only formulas equal to the planted one fit."""
    rng = np.random.default_rng(seed)
    groups = 1 << 8
    sets = [sum(1 << g for g in range(groups) if g >> v & 1) for v in range(8)]
    everything = (1 << groups) - 1
    planted = random_formula(rng, list(rng.permutation(8)))
    goal = holds(planted, sets, everything)
    found = read_once(sets, goal, everything & ~goal)
    assert found is not None
    assert holds(found, sets, everything) == goal


def random_formula(rng: np.random.Generator, members: list[int]) -> Gate | Literal:
    if len(members) == 1:
        return Literal(int(members[0]), bool(rng.integers(2)))
    at = int(rng.integers(1, len(members)))
    return Gate(str(rng.choice(["or", "and"])), random_formula(rng, members[:at]), random_formula(rng, members[at:]))


@pytest.mark.parametrize("seed", range(30))
def test_the_tree_of_a_formula_is_its_solid(seed):
    rng = np.random.default_rng(seed)
    solids: list[Program] = [Primitive("box", tuple(rng.uniform(1, 2, 3)), tuple(rng.uniform(-1, 1, 3))) for _ in range(5)]
    formula = random_formula(rng, [0, 1, 2, 3, 4])
    points = rng.uniform(-2.5, 2.5, (500, 3))
    sets = [sum(1 << i for i in np.flatnonzero(kernels.inside(s, points)).tolist()) for s in solids]
    truth = holds(formula, sets, (1 << len(points)) - 1)
    program = to_program(formula, solids)
    if program is None:  # unbounded, so it holds what no solid holds
        assert truth & ~(sets[0] | sets[1] | sets[2] | sets[3] | sets[4])
    else:
        assert truth == sum(1 << i for i in np.flatnonzero(kernels.inside(program, points)).tolist())


def test_nested_difference():
    """A - (B - C) needs a nested tree."""
    sets = (0b0111, 0b0011, 0b0001)
    formula = read_once(sets, 0b0101, 0b1010)
    assert formula is not None
    a, b, c = (Primitive("sphere", (r,)) for r in (3.0, 2.0, 1.0))
    assert to_program(formula, [a, b, c]) in (
        Combine("difference", a, Combine("difference", b, c)),
        Combine("union", Combine("difference", a, b), c),
    )
