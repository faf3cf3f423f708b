"""Steps that add stand together, and so do those that cut; the solid stays."""

import pytest
from manifold3d import Manifold
from tests.deadlines import PASSED
from tests.planted import box, common, cut, cylinder, union

from imdim.geometry.finish.step_order import gather_steps
from imdim.geometry.solid import to_manifold
from imdim.program.tree import Program, leaves

PLATE, BOSS = box(60.0, 40.0, 6.0), cylinder(8.0, 20.0, (15.0, 0.0, 10.0))
RIB, HOLE = box(4.0, 40.0, 12.0, (-20.0, 0.0, 6.0)), cylinder(3.0, 30.0, (0.0, 12.0, 0.0))
BORE = cylinder(4.0, 60.0, (15.0, 0.0, 0.0))


def gather(program: Program) -> Program:
    after = gather_steps(program)
    a, b = to_manifold(program), to_manifold(after)
    assert (a - b).volume() + (b - a).volume() < 1e-9 * a.volume()
    return after


def test_cuts_that_nothing_fills_come_last() -> None:
    assert gather(cut(union(cut(union(cut(PLATE, HOLE), BOSS), BORE), RIB), box(9.0, 9.0, 9.0, (30.0, 20.0, 0.0)))) == cut(
        union(PLATE, BOSS, RIB), HOLE, BORE, box(9.0, 9.0, 9.0, (30.0, 20.0, 0.0))
    )


def test_a_cut_that_is_filled_again_stays_before_what_fills_it() -> None:
    """The hollow would take the wall; the hole does not."""
    hollow, wall = box(50.0, 30.0, 6.0, (0.0, 0.0, 2.0)), box(3.0, 34.0, 6.0, (-10.0, 0.0, 0.0))
    assert gather(cut(union(cut(PLATE, HOLE, hollow), wall), BORE)) == cut(union(cut(PLATE, hollow), wall), HOLE, BORE)


def test_a_cut_passes_what_fills_it_where_a_later_cut_takes_that() -> None:
    filled, wider = cylinder(3.0, 20.0, (0.0, 12.0, 10.0)), cylinder(3.5, 60.0, (0.0, 12.0, 0.0))
    assert gather(cut(union(cut(PLATE, HOLE), filled, BOSS), wider)) == cut(union(PLATE, filled, BOSS), HOLE, wider)


def test_an_intersection_cuts_what_lies_outside() -> None:
    bound = box(58.0, 38.0, 60.0)
    assert gather(union(cut(common(cut(PLATE, HOLE), bound), BORE), RIB)) == cut(union(common(PLATE, bound), RIB), HOLE, BORE)


def test_steps_that_lie_apart_are_told_by_their_boxes(monkeypatch: pytest.MonkeyPatch) -> None:
    """A hundred holes and a hundred studs in turn: that none of them overlap needs no booleans."""
    program, asked = box(200.0, 200.0, 6.0), []
    for x, y in ((18.0 * (k % 10) - 90.0, 18.0 * (k // 10) - 90.0) for k in range(100)):
        program = union(cut(program, cylinder(3.0, 20.0, (x, y, 0.0))), cylinder(4.0, 6.0, (x + 8.0, y, 5.0)))
    overlap = Manifold.__xor__
    monkeypatch.setattr(Manifold, "__xor__", lambda a, b: asked.append(a) or overlap(a, b))
    after = gather_steps(program)
    # each hole with the plate
    assert len(asked) <= 100
    assert [leaf.size for leaf in leaves(after)][1:] == [(4.0, 6.0)] * 100 + [(3.0, 20.0)] * 100


def test_past_the_deadline_they_stay_as_they_are() -> None:
    program = union(cut(PLATE, cylinder(30.0, 60.0), HOLE), box(20.0, 20.0, 6.0), BOSS)
    assert gather_steps(program, PASSED) is program


@pytest.mark.parametrize("program", [cut(union(PLATE, BOSS), HOLE), union(PLATE, BOSS), common(union(PLATE, BOSS), RIB)])
def test_what_is_gathered_already_stays_itself(program: Program) -> None:
    assert gather_steps(program) is program
