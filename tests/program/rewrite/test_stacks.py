"""Parts of one axis become a stack of cylinders and cones, each of which ends where its wall does."""

import pytest
from tests.planted import box, cone, cut, cylinder

from imdim.geometry.solid import to_manifold
from imdim.program.rewrite.stacks import stack_turned_parts
from imdim.program.tree import Primitive, Program, combine_all, leaves


def meet(*parts: Program) -> Program:
    return combine_all("intersection", list(parts))


def join(*parts: Program) -> Program:
    return combine_all("union", list(parts))


# a shaft of radius 10 with a collar of 15 between two slopes, as what two cones that reach far beyond it have in common with a cylinder
BARREL = join(
    meet(cone(50.0, 10.0, 40.0, (0.0, 0.0, 5.0)), cone(10.0, 50.0, 40.0, (0.0, 0.0, 5.0)), cylinder(15.0, 60.0)), cylinder(10.0, 60.0)
)


def told(program: Program) -> list[tuple[str, tuple[float, ...], float]]:
    return [(leaf.kind, tuple(round(s, 6) for s in leaf.size), round(leaf.center[2], 6)) for leaf in leaves(program)]


def stacked(program: Program) -> Program:
    after = stack_turned_parts(program)
    a, b = to_manifold(program), to_manifold(after)
    assert (a - b).volume() + (b - a).volume() < 1e-6 * a.volume()
    return after


def test_cones_end_where_their_walls_do() -> None:
    assert told(stacked(BARREL)) == [
        ("cylinder", (10.0, 60.0), 0.0),
        ("cone", (10.0, 15.0, 5.0), -12.5),
        ("cylinder", (15.0, 30.0), 5.0),
        ("cone", (15.0, 10.0, 5.0), 22.5),
    ]


def test_a_bored_part_is_stacked_inside_and_outside() -> None:
    bored = cut(meet(cylinder(12.0, 40.0), cone(22.0, 2.0, 40.0)), meet(cylinder(6.0, 50.0), cone(11.0, 1.0, 40.0)))
    assert told(stacked(bored)) == [
        ("cylinder", (12.0, 20.0), -10.0),
        ("cone", (12.0, 2.0, 20.0), 10.0),
        ("cylinder", (6.0, 20.0), -10.0),
        ("cone", (6.0, 1.0, 20.0), 10.0),
    ]


def test_a_ring_cut_out_of_a_cutter_makes_two_counterbores() -> None:
    body = box(60.0, 60.0, 30.0)
    part = cut(body, cut(cylinder(11.0, 40.0), cylinder(20.0, 16.0)), cylinder(7.0, 40.0))
    assert told(stacked(part))[1:] == [("cylinder", (11.0, 12.0), -14.0), ("cylinder", (11.0, 12.0), 14.0), ("cylinder", (7.0, 40.0), 0.0)]


@pytest.mark.parametrize(
    "program",
    [
        cut(join(cylinder(10.0, 10.0), cylinder(5.0, 30.0)), cylinder(3.0, 40.0)),  # each joined or cut by itself already
        meet(cylinder(10.0, 30.0), cylinder(10.0, 30.0, (4.0, 0.0, 0.0))),  # two axes
        meet(cylinder(10.0, 30.0), box(15.0, 15.0, 40.0)),  # not turned
        join(cut(cylinder(20.0, 5.0), cylinder(15.0, 9.0)), cylinder(8.0, 5.0)),  # a ring about a pin
    ],
    ids=["plain", "two axes", "square", "ring and pin"],
)
def test_what_is_no_stack_stays(program: Program) -> None:
    assert stack_turned_parts(program) == program


@pytest.mark.parametrize("turn", [(0.0, 180.0, 0.0), (30.0, 40.0, 50.0)])
def test_it_may_lie_anywhere(turn: tuple[float, float, float]) -> None:
    """Cones upside down about a slanted axis."""
    up, down = Primitive("cone", (20.0, 5.0, 30.0), (1.0, 2.0, 3.0), turn), Primitive("cone", (5.0, 20.0, 30.0), (1.0, 2.0, 3.0), turn)
    after = list(leaves(stacked(meet(up, down))))
    assert [leaf.kind for leaf in after] == ["cone", "cone"]
    assert all(leaf.size == pytest.approx((5.0, 12.5, 15.0)) or leaf.size == pytest.approx((12.5, 5.0, 15.0)) for leaf in after)
