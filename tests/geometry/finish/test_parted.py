"""A body that its cuts part becomes its pieces, each with what the cuts take of it."""

import pytest
from tests.deadlines import PASSED
from tests.planted import box, cone, cut, cylinder

from imdim.geometry.finish.parted import part_bodies
from imdim.geometry.solid import to_manifold
from imdim.program.tree import Program, combine_all, leaves

# two plates of 3, each with a countersink of 1.5 to 3 that is 2 deep, as what two long cones leave of a block
BLOCK = cut(
    box(16.0, 16.0, 72.0, (0.0, 0.0, 36.0)),
    cone(52.5, 1.5, 68.0, (0.0, 0.0, 37.0)),
    cone(1.5, 52.5, 68.0, (0.0, 0.0, 35.0)),
)
LEGS = [box(3.0, 3.0, 72.0, (x, -6.5, 36.0)) for x in (-6.5, 6.5)]


def is_same(new: Program, old: Program) -> bool:
    a, b = to_manifold(new, 96), to_manifold(old, 96)
    return (a - b).volume() + (b - a).volume() < 1e-6 * b.volume()


def test_two_plates_are_not_what_cones_leave_of_a_block() -> None:
    drawn = cut(combine_all("union", [BLOCK, *LEGS]), cylinder(1.5, 80.0, (0.0, 0.0, 36.0)))
    after = part_bodies(drawn, is_same)
    assert is_same(after, drawn)
    sizes = sorted(tuple(round(s, 6) for s in leaf.size) for leaf in leaves(after) if leaf.kind in ("box", "cone"))
    assert sizes == [(1.5, 3.0, 2.0), (3.0, 1.5, 2.0), (3.0, 3.0, 72.0), (3.0, 3.0, 72.0), (16.0, 16.0, 3.0), (16.0, 16.0, 3.0)]


def test_a_slab_through_a_bar_leaves_two_bars() -> None:
    after = part_bodies(cut(box(60.0, 10.0, 4.0), box(20.0, 12.0, 6.0, (5.0, 0.0, 0.0))), is_same)
    assert [leaf.size for leaf in leaves(after)] == [pytest.approx((25.0, 10.0, 4.0)), pytest.approx((15.0, 10.0, 4.0))]


@pytest.mark.parametrize(
    "program",
    [
        box(60.0, 10.0, 4.0),
        cut(box(60.0, 10.0, 4.0), box(20.0, 6.0, 6.0)),  # a window
        cut(box(60.0, 10.0, 4.0), box(20.0, 12.0, 2.0, (0.0, 0.0, 1.0))),  # a groove
        cut(box(20.0, 20.0, 4.0), cut(cylinder(8.0, 6.0), cylinder(4.0, 8.0))),  # a core stands in its hole: one is not behind the other
    ],
    ids=["nothing is cut", "window", "groove", "core"],
)
def test_what_is_not_parted_stays(program: Program) -> None:
    assert part_bodies(program, is_same) == program


def test_whoever_asks_decides_and_time_ends_it() -> None:
    assert part_bodies(BLOCK, lambda new, old: False) == BLOCK
    assert part_bodies(BLOCK, is_same, PASSED) == BLOCK
