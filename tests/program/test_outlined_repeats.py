"""Repeats of leaves with outlines: whatever frames the copies are drawn in, they are found, and the program keeps its solid."""

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.drawn import BRACKET, PULLEY, centred

from imdim.geometry import kernels
from imdim.geometry.rotations import matrix_from_euler
from imdim.program.motions import mirror, move_leaf, turn
from imdim.program.outline import Outline, reverse_loop
from imdim.program.patterns.detect import fold_repeats
from imdim.program.patterns.outlined import anchor_of, is_outlined_moved
from imdim.program.repeats import repeats
from imdim.program.tree import Primitive, Program, combine_all

LEAF = centred(BRACKET, 8.0)
SECTOR = replace(PULLEY, size=(100.0,))
LEAVES = {"extruded": LEAF, "turned": PULLEY, "turned in part": SECTOR}
MOTIONS = {"turn": turn((3.0, -2.0, 1.0), (0.6, 0.0, 0.8), 73.0), "mirror": mirror((1.0, 0.0, 2.0), (0.6, 0.8, 0.0))}


def redrawn(leaf: Primitive) -> Primitive:
    """The same solid about another origin and from another vertex; an extrusion also turned in its plane and upside down."""
    outline = leaf.outline
    assert outline is not None
    loops = tuple(reverse_loop((*loop[1:], loop[0])) for loop in reversed(outline.loops))
    if leaf.kind == "revolve":
        return replace(move_leaf(leaf, turn(leaf.center, (0, 0, 1), 0.0)), center=shifted(leaf, 2), outline=Outline(loops).shift(0.0, -2.0))
    flipped = Outline(tuple(tuple((x, -y, -b) for x, y, b in loop) for loop in Outline(loops).shift(-3.0, 0.0).loops))
    center = tuple(c + 3.0 * d for c, d in zip(leaf.center, local(leaf)[:, 0], strict=True))
    x_flipped = move_leaf(leaf, turn(leaf.center, tuple(local(leaf)[:, 0].tolist()), 180.0))
    return replace(x_flipped, center=center, outline=flipped)


def local(leaf: Primitive) -> np.ndarray:
    return matrix_from_euler(leaf.rotation)


def shifted(leaf: Primitive, by: float):
    return tuple((np.array(leaf.center) + by * local(leaf)[:, 2]).tolist())


def same_solid(a: Program, b: Program) -> bool:
    points = np.random.default_rng(0).uniform(-90, 90, (60_000, 3))
    left, right = kernels.program_sdf(a, points), kernels.program_sdf(b, points)
    assert (left < 0).sum() > 20
    return bool(((left < 0) == (right < 0))[np.abs(left) > 1e-6].all())


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("name", LEAVES)
def test_a_moved_leaf_is_known_in_any_frame(name, motion):
    leaf, way = LEAVES[name], MOTIONS[motion]
    there = move_leaf(leaf, way)
    other = redrawn(there)
    assert same_solid(there, other)
    for found in (there, other):
        assert is_outlined_moved(leaf, found, way, 1e-6)
        assert math.dist(way.point(anchor_of(leaf, leaf.outline)), anchor_of(found, found.outline)) < 1e-9
    for off in ((1e-3, 0.0, 0.0), (0.0, 1e-3, 0.0), (0.0, 0.0, 1e-3)):
        assert not is_outlined_moved(leaf, replace(there, center=tuple(np.add(there.center, off).tolist())), way, 1e-4)
    grown = replace(there, outline=Outline((tuple((x + 1e-3 * (k == 1), y, b) for k, (x, y, b) in enumerate(there.outline.loops[0])),)))
    assert not is_outlined_moved(replace(leaf, outline=Outline(leaf.outline.loops[:1])), grown, way, 1e-4)


def test_a_circle_of_outlines_is_written_once():
    arm = replace(centred(Outline(BRACKET.loops[:1]), 6.0), center=(55.0, 5.0, 0.0))
    copies = [move_leaf(arm, turn((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 60.0 * k)) for k in range(6)]
    program = combine_all("union", [copies[0], redrawn(copies[1]), *copies[2:]])
    folding = fold_repeats(program)
    assert folding is not None
    [(_, repeat)] = repeats(folding.folded)
    assert (repeat.kind, repeat.counts) == ("circular", (6,))
    assert same_solid(program, folding.program)


def test_pair_mirror_images_and_grids_of_outlines_are_written_once():
    row = [replace(LEAF, center=(70.0 * i - 35.0, 45.0 * k - 30.0, 0.0)) for i in range(2) for k in range(3)]
    folding = fold_repeats(combine_all("union", row))
    assert folding is not None
    assert [(r.kind, r.counts) for _, r in repeats(folding.folded)] == [("grid", (2, 3))]
    assert same_solid(combine_all("union", row), folding.program)
    right = [replace(LEAF, center=(40.0, 5.0 * z, z)) for z in (0.0, 30.0)]
    pairs = right + [move_leaf(leaf, mirror((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))) for leaf in right]
    folding = fold_repeats(combine_all("union", pairs))
    assert folding is not None
    assert "mirror" in {r.kind for _, r in repeats(folding.folded)}
    assert same_solid(combine_all("union", pairs), folding.program)


def test_outlines_that_differ_do_not_repeat():
    others = [
        replace(LEAF, center=(70.0 * i, 0.0, 0.0), outline=LEAF.outline.map_lengths(lambda v, i=i: v * (1 + 0.01 * i))) for i in range(4)
    ]
    assert fold_repeats(combine_all("union", others)) is None
