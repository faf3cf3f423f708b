"""Cutters end where they leave the part."""

import pytest
from tests.deadlines import PASSED
from tests.planted import ALONG_X, box, cone, cut, cylinder

from imdim.geometry.finish.free_ends import draw_back
from imdim.geometry.solid import to_manifold
from imdim.program.outline import Outline, circle
from imdim.program.tree import Primitive, Program, combine_all, leaves

PLATE = box(80.0, 50.0, 8.0, (0.0, 0.0, 4.0))  # from 0 to 8


def changed(program: Program) -> list[Primitive]:
    """The cutters that it then has; the solid stays."""
    after = draw_back(program)
    a, b = to_manifold(program), to_manifold(after)
    assert (a - b).volume() + (b - a).volume() < 1e-9 * a.volume()
    return list(leaves(after))[1:]


def span(leaf: Primitive, axis: int = 2) -> tuple[float, float]:
    size = leaf.size[axis] if leaf.kind == "box" else leaf.size[-1]
    return leaf.center[axis] - size / 2, leaf.center[axis] + size / 2


@pytest.mark.parametrize(
    ("cutter", "ends"),
    [
        (cylinder(5.0, 13.2, (10.0, 0.0, 2.0)), (0.0, 8.0)),
        (cylinder(5.0, 9.3, (10.0, 0.0, 0.35)), (0.0, 5.0)),
        (box(10.0, 10.0, 7.1, (0.0, 0.0, 6.55)), (3.0, 8.0)),
        (Primitive("extrude", (15.0,), (0.0, 0.0, 4.5), outline=Outline((circle(4.0),))), (0.0, 8.0)),
    ],
    ids=["through", "from below", "from above", "drawn"],
)
def test_a_cutter_ends_at_the_faces(cutter: Primitive, ends: tuple[float, float]) -> None:
    (after,) = changed(cut(PLATE, cutter))
    assert span(after) == pytest.approx(ends)


def test_a_countersink_is_as_wide_as_one_sees_it() -> None:
    (after,) = changed(cut(PLATE, cone(5.0, 10.0, 5.0, (0.0, 0.0, 6.5))))
    assert after.size == pytest.approx((5.0, 9.0, 4.0))


def test_so_is_one_that_is_turned() -> None:
    ring = ((0.0, 0.0, 0.0), (5.0, 0.0, 0.0), (10.0, 5.0, 0.0), (0.0, 5.0, 0.0))
    (after,) = changed(cut(PLATE, Primitive("revolve", (360.0,), (0.0, 0.0, 4.0), outline=Outline((ring,)))))
    assert after.outline is not None
    assert after.outline.bounds == (pytest.approx((0.0, 0.0)), pytest.approx((9.0, 4.0)))


def test_a_slot_ends_on_each_side() -> None:
    (after,) = changed(cut(PLATE, box(17.3, 61.9, 11.7, (38.65, 2.0, 5.85))))
    assert [span(after, axis) for axis in range(3)] == [
        pytest.approx((30.0, 40.0)),
        pytest.approx((-25.0, 25.0)),
        pytest.approx((0.0, 8.0)),
    ]


def test_in_a_round_wall_it_ends_at_a_round_place() -> None:
    shaft = cylinder(18.0, 90.0)  # whose diagonal of 103 lets cutters stand out by 1
    (after,) = changed(cut(shaft, cylinder(4.0, 38.77, (0.3, 0.0, 0.0), ALONG_X)))
    assert (after.center[0] - after.size[1] / 2, after.center[0] + after.size[1] / 2) == pytest.approx((-18.0, 18.0))


def test_a_slanted_cutter_stays_where_it_meets_no_face() -> None:
    """Its numbers are round, and those of where it comes out are not."""
    program = cut(PLATE, Primitive("cylinder", (2.0, 40.0), (0.0, 0.0, 4.0), (0.0, 30.0, 0.0)))
    assert draw_back(program) == program


def test_cutters_that_are_alike_stay_so() -> None:
    """On a step of the plate one has to go higher than the other."""
    steps = combine_all("union", [PLATE, box(20.0, 50.0, 12.0, (30.0, 0.0, 6.0))])
    after = list(leaves(draw_back(cut(steps, *(cylinder(3.0, 20.0, (x, 0.0, 6.0)) for x in (-30.0, 30.0))))))[2:]
    assert [span(leaf) for leaf in after] == [pytest.approx((0.0, 12.0))] * 2


def test_what_ends_within_the_part_stays() -> None:
    inside = cut(combine_all("union", [PLATE, box(10.0, 50.0, 40.0, (35.0, 0.0, 20.0))]), cylinder(5.0, 20.0, (0.0, 0.0, 12.0)))
    assert draw_back(inside) == inside


def test_past_its_deadline_all_stays() -> None:
    program = cut(PLATE, cylinder(5.0, 13.2, (10.0, 0.0, 2.0)))
    assert draw_back(program, PASSED) == program
