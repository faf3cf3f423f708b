"""Intersections of what was joined and cut are those of its parts."""

import pytest
from tests.planted import box, cylinder, sphere, union

from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.rewrite.spread import spread_intersections
from imdim.program.tree import Combine, leaves

PARTS = union(Combine("difference", box(40, 30, 6), cylinder(4, 20, (8.0, 0.0, 0.0))), cylinder(7, 16, (-9.0, 2.0, 8.0)))
BALL = sphere(17, (0.0, 2.0, 3.0))


@pytest.mark.parametrize(
    "program",
    [
        Combine("intersection", PARTS, BALL),
        Combine("intersection", Combine("intersection", PARTS, BALL), box(25, 60, 60)),
        Combine("difference", Combine("intersection", PARTS, union(BALL, box(12, 12, 40))), Combine("intersection", PARTS, box(9, 9, 9))),
    ],
)
def test_the_solid_stays_and_nothing_joined_or_cut_is_intersected(program):
    spread = spread_intersections(program)
    assert volume_iou(to_manifold(spread), to_manifold(program)) == pytest.approx(1.0, abs=1e-9)

    def left_of_intersections(node):
        if isinstance(node, Combine):
            if node.op == "intersection":
                yield node.left
            yield from left_of_intersections(node.left)

    assert all(not isinstance(node, Combine) or node.op == "intersection" for node in left_of_intersections(spread))
    assert spread_intersections(spread) == spread


def test_without_intersections_nothing_changes():
    assert spread_intersections(PARTS) is not None
    assert [*leaves(spread_intersections(PARTS))] == [*leaves(PARTS)]
