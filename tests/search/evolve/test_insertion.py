"""Insertions in trees against brute force over the cells."""

import numpy as np
import pytest
from tests.planted import PARTS, box, cut, cylinder
from tests.search.evolve.scenes import planted_scene
from tests.search.planted_families import random_candidates

from imdim.geometry.kernels import program_sdf
from imdim.program.paths import nodes, replace_at, without
from imdim.program.tree import OPS, Combine, Program, fold, leaves
from imdim.search.evolve.insertion import (
    cells_of,
    draw_gain,
    places,
    random_candidate,
    views,
    with_best_insertion,
    with_best_refit,
)

NAME = "tube on a flange"
OPERATIONS = {"union": np.logical_or, "intersection": np.logical_and, "difference": lambda a, b: a & ~b}


def random_tree(rng: np.random.Generator, k: int) -> Program:
    families = planted_scene(NAME).families
    assert families is not None
    parts: list[Program] = [families.primitive(c) for c in random_candidates(families, k, rng)]
    while len(parts) > 1:
        i = int(rng.integers(len(parts) - 1))
        parts[i : i + 2] = [Combine(OPS[rng.integers(3)], parts[i], parts[i + 1])]
    return parts[0]


def filled(program: Program) -> np.ndarray:
    cells = cells_of(program, planted_scene(NAME))
    return fold(program, lambda _, p: cells[p], OPERATIONS)  # type: ignore[arg-type]


def won(program: Program, gain: np.ndarray) -> float:
    return float(gain[filled(program)].sum())


@pytest.mark.parametrize("seed", range(6))
def test_a_node_decides_the_cells_where_its_change_changes_the_solid(seed):
    program = random_tree(np.random.default_rng(seed), 5)
    cells = cells_of(program, planted_scene(NAME))
    root = filled(program)
    for view in views(program, cells):

        def flipped(path, view=view):
            node = dict(nodes(program))[path]
            if path == view.path:
                return ~view.value
            return cells[node] if not isinstance(node, Combine) else OPERATIONS[node.op](flipped((*path, 0)), flipped((*path, 1)))

        assert np.array_equal(view.deciding, flipped(()) != root)
        assert (flipped(())[view.deciding & ~view.value] == (view.sign > 0)).all()


@pytest.mark.parametrize("seed", range(6))
def test_a_place_foretells_what_a_candidate_wins(seed):
    rng = np.random.default_rng(seed)
    scene, program = planted_scene(NAME), random_tree(rng, 4)
    assert scene.families is not None
    gain = draw_gain(scene, rng)
    (candidate,) = random_candidates(scene.families, 1, rng)
    mask = scene.families.mask(candidate)
    for place in places(views(program, cells_of(program, scene)), gain):
        changed = replace_at(program, place.view.path, Combine(place.op, place.view.node, scene.families.primitive(candidate)))
        field, constant = place.field(gain)
        assert constant + field[mask].sum() == pytest.approx(won(changed, gain) - won(program, gain), abs=1e-9)
        # a part of exactly the cells that win anything
        most = constant + np.maximum(field, 0).sum()
        assert place.potential == pytest.approx(most, abs=1e-9)
        assert place.potential >= constant + field[mask].sum() - 1e-9


def test_the_missing_part_is_found_again():
    scene, program = planted_scene(NAME), PARTS[NAME]
    assert scene.families is not None
    gain = scene.families.cells.gain
    for path, _ in nodes(program)[1:]:
        holed = without(program, [path])
        if holed is not None and won(holed, gain) < won(program, gain) * 0.999:
            mended = with_best_insertion(holed, scene, gain, np.random.default_rng(0))
            assert mended is not None
            assert won(mended, gain) > won(holed, gain)
            if len(list(leaves(holed))) == 2:
                assert won(mended, gain) == pytest.approx(won(program, gain), rel=1e-3)


def test_a_wrong_leaf_is_refitted():
    scene = planted_scene("plate with four holes")
    plate, holes = box(80, 50, 6), [cylinder(3, 8, (x, y, 0.0)) for x in (-30.0, 30.0) for y in (-15.0, 15.0)]
    wrong = cut(plate, *holes[:3], box(1, 1, 1))
    assert scene.families is not None
    gain = scene.families.cells.gain
    tried = [with_best_refit(wrong, scene, gain, np.random.default_rng(seed)) for seed in range(12)]
    assert min(s.volume for s in scene.scorer.score([t for t in tried if t])) < 1e-6


def test_random_candidates_hold_their_point():
    scene, rng = planted_scene(NAME), np.random.default_rng(0)
    assert scene.families is not None
    for _ in range(100):
        point = rng.uniform(*scene.families.arrangement.bounds)
        candidate = random_candidate(scene, point, rng)
        assert candidate is not None
        assert program_sdf(scene.families.primitive(candidate), point[None])[0] < 1e-6
