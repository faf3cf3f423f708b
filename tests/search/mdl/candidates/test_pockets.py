"""The holes of drawings as cuts."""

import numpy as np
import pytest
from tests.planted import cut
from tests.search.mdl.candidates.test_drawn import ANGLE, BLOCK, POCKETS, TRAY, cloud

from imdim.geometry.solid import to_manifold, volume_iou
from imdim.numbers.ties import ties_of
from imdim.program.tree import Combine, Primitive, leaves
from imdim.search.mdl.candidates.drawn import trace_extruded_outlines
from imdim.search.mdl.candidates.pockets import pockets
from imdim.search.mdl.description_length import PARALLEL_DEG
from imdim.search.mdl.primitive_selection import Cloud


def found_in(part, sigma, levels):
    points = cloud(part, sigma)
    drawn = [*trace_extruded_outlines(points, np.eye(3), 2, levels, sigma)]
    return pockets(drawn, Cloud.of(points, sigma))


def volume_apart(a, b):
    return 1 - volume_iou(to_manifold(a), to_manifold(b))


def test_pockets_in_a_row_are_one_cut_of_equal_boxes():
    """They end over the floors, which lie higher than the base, and their block goes down to that."""
    found = found_in(TRAY, 0.65, [0.0, 20.0])
    assert len([*leaves(found[0])]) == 7
    assert len(ties_of(found[0], PARALLEL_DEG).twins) == 6
    for leaf, truth in zip(sorted(leaves(found[0]), key=lambda leaf: leaf.center[1]), POCKETS, strict=True):
        assert leaf.center[:2] == pytest.approx(truth.center[:2], abs=0.3)
        assert sorted(leaf.size[:2]) == pytest.approx([9.0, 22.0], abs=0.6)
        assert leaf.center[2] - leaf.size[2] / 2 == pytest.approx(4.0, abs=0.5)
    block = next(p for p in found if isinstance(p, Combine) and p.op == "difference")
    assert volume_apart(block, cut(BLOCK, *POCKETS)) < 0.15
    assert sum(isinstance(p, Primitive) for p in found) == 7


def test_holes_that_go_through_end_beyond_the_part_and_what_has_no_walls_is_no_hole():
    plate = cut(
        Primitive("box", (60.0, 40.0, 10.0), (0.0, 0.0, 5.0)), *(Primitive("cylinder", (5.0, 30.0), (x, 0.0, 5.0)) for x in (-18.0, 18.0))
    )
    found = found_in(plate, 0.3, [0.0, 10.0])
    holes = next(own for own in ([*leaves(p)] for p in found) if [leaf.kind for leaf in own] == ["cylinder"] * 2)
    assert all(hole.center[2] - hole.size[1] / 2 < -0.5 and hole.center[2] + hole.size[1] / 2 > 10.5 for hole in holes)
    empty = Cloud.of(np.random.default_rng(1).uniform(-30, 30, (4000, 3)) * (1.0, 0.6, 0.5), 0.3)
    assert pockets([ANGLE], empty) == []
