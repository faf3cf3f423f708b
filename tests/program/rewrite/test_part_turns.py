"""An elbow is a ring that is turned by a quarter, and no ring in a box."""

import numpy as np
import pytest

from imdim.geometry.solid import symmetric_difference_volume, to_manifold
from imdim.program.outline import Outline
from imdim.program.rewrite.containment import axes
from imdim.program.rewrite.part_turns import turn_part_way
from imdim.program.tree import Combine, Primitive, leaves

RING = Primitive("torus", (25.0, 8.0), (3.0, -2.0, 5.0))
PROFILE = Outline((((10.0, -4.0, 0.0), (20.0, -4.0, 0.0), (15.0, 4.0, 0.0)),))
TURNED = Primitive("revolve", (360.0,), (3.0, -2.0, 5.0), (0.0, 0.0, 0.0), PROFILE)


def _box(low, high):
    """A box from one corner to another, as seen from the middle of the ring."""
    low, high = np.array(low, float), np.array(high, float)
    return Primitive("box", tuple((high - low).tolist()), tuple(((low + high) / 2 + RING.center).tolist()))


QUARTERS = [_box((0, 0, -9), (40, 50, 9)), _box((-40, 0, -9), (0, 50, 9)), _box((-40, -35, -9), (0, 0, 9)), _box((0, -33, -8), (33, 0, 8))]
HALVES = [
    _box((-40, 0, -9), (40, 50, 9)),
    _box((-40, -40, -9), (0, 50, 9)),
    _box((-40, -35, -9), (40, 0, 9)),
    _box((0, -33, -8), (33, 33, 8)),
]


@pytest.mark.parametrize("part", [RING, TURNED], ids=["ring", "turned"])
@pytest.mark.parametrize(("op", "boxes", "angle"), [
    ("intersection", QUARTERS, 90.0),
    ("intersection", HALVES, 180.0),
    ("difference", QUARTERS, 270.0),
    ("difference", HALVES, 180.0),
])  # fmt: skip
def test_what_a_box_keeps_or_leaves_of_a_turn_is_a_part_of_it(part, op, boxes, angle):
    for box in boxes:
        before = Combine(op, part, box)
        after = turn_part_way(before)
        assert isinstance(after, Primitive)
        assert (after.kind, after.size) == ("revolve", (angle,))
        off = symmetric_difference_volume(to_manifold(before), to_manifold(after))
        assert off < 0.002 * to_manifold(before).volume()


def test_the_box_may_stand_first_and_lie_aslant_as_the_ring_does():
    tilt = (30.0, 20.0, 50.0)
    ring, box = Primitive("torus", (25.0, 8.0), rotation=tilt), Primitive("box", (120.0, 60.0, 20.0), rotation=tilt)
    center = tuple(30.0 * c for c in axes(box)[1])
    before = Combine("intersection", Primitive("box", box.size, center, tilt), ring)
    after = turn_part_way(before)
    assert [p.size for p in leaves(after)] == [(180.0,)]
    assert symmetric_difference_volume(to_manifold(before), to_manifold(after)) < 0.002 * to_manifold(before).volume()


@pytest.mark.parametrize("box", [
    _box((1, 0, -9), (40, 50, 9)),  # beside the axis
    _box((0, 0, -7), (40, 50, 9)),  # which cuts the tube
    _box((0, 0, -9), (30, 50, 9)),
    _box((-40, -40, -9), (40, 40, 9)),  # which holds all
    _box((0, 0, 0), (40, 50, 9)),
])  # fmt: skip
def test_other_boxes_stay(box):
    for op in ("intersection", "difference"):
        before = Combine(op, RING, box)
        assert turn_part_way(before) == before


def test_no_box_is_read_as_one_that_is_turned_against_the_ring():
    before = Combine("intersection", RING, Primitive("box", (120.0, 60.0, 60.0), (3.0, 28.0, 5.0), (10.0, 0.0, 0.0)))
    assert turn_part_way(before) == before
