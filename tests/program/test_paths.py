"""Tree surgery against occupancy: what was replaced or removed is what the solid shows."""

import numpy as np
import pytest
from program_samples import cloud, inside, random_primitive, random_program

from imdim.program.paths import at, leaf_paths, nodes, polarity, replace_at, without
from imdim.program.tree import KINDS, Combine, Program, leaves

POINTS = cloud(np.random.default_rng(9), 800)


def programs() -> list[Program]:
    rng = np.random.default_rng(0)
    return [random_program(rng, int(rng.integers(1, 9)), kinds=KINDS) for _ in range(30)]


def test_nodes_are_where_their_paths_lead():
    for program in programs():
        every = nodes(program)
        assert len(every) == 2 * len(list(leaves(program))) - 1
        assert all(at(program, path) is node for path, node in every)
        assert [leaf for _, leaf in leaf_paths(program)] == list(leaves(program))
        assert [len(p) for p, _ in every] != sorted((len(p) for p, _ in every), reverse=True) or len(every) == 1


def test_a_replacement_is_at_its_place_and_nothing_else_changes():
    new = random_primitive(np.random.default_rng(5))
    for program in programs():
        for path, _ in nodes(program):
            changed = replace_at(program, path, new)
            assert at(changed, path) is new
            others = [p for p, _ in nodes(program) if p[: len(path)] != path and path[: len(p)] != p]
            assert all(at(changed, p) is at(program, p) for p in others)


def reference_without(program: Program, gone: set, path: tuple = ()) -> Program | None:
    if path in gone:
        return None
    if not isinstance(program, Combine):
        return program
    left, right = reference_without(program.left, gone, (*path, 0)), reference_without(program.right, gone, (*path, 1))
    if left is None:
        return right if program.op in ("union", "intersection") else None
    return left if right is None else Combine(program.op, left, right)


def test_removal_is_what_recursion_says():
    rng = np.random.default_rng(1)
    for program in programs():
        every = [path for path, _ in nodes(program)]
        for count in (0, 1, 2, 3):
            gone = {every[i] for i in rng.choice(len(every), min(count, len(every)), replace=False)}
            assert without(program, gone) == reference_without(program, gone)


def test_a_node_of_positive_polarity_only_fills():
    rng = np.random.default_rng(2)
    for program in programs():
        before = inside(program, POINTS)
        for path, node in nodes(program):
            grown = inside(replace_at(program, path, Combine("union", node, random_primitive(rng))), POINTS)
            assert not (before & ~grown).any() if polarity(program, path) > 0 else not (grown & ~before).any()


def test_a_path_beyond_a_leaf_is_refused():
    leaf = random_primitive(np.random.default_rng(0))
    with pytest.raises(ValueError, match="leaves the tree"):
        at(leaf, (0,))
    with pytest.raises(ValueError, match="leaves the tree"):
        replace_at(leaf, (1,), leaf)
