"""Parts that change nothing are left out."""

from tests.deadlines import PASSED
from tests.planted import box, common, cut, cylinder, sphere, union

from imdim.geometry.finish.idle_parts import drop_idle
from imdim.geometry.solid import to_manifold
from imdim.program.tree import leaves

PLATE = box(40, 30, 4)


def test_what_lies_in_the_rest_or_in_the_air_goes():
    """A boss in two plates that overlap, which neither holds alone, and a hole beside both."""
    plates = union(PLATE, box(40, 30, 4, (30, 0, 0)))
    boss, hole = cylinder(5, 4, (16, 0, 0)), cylinder(3, 8, (80, 0, 0))
    program = cut(union(plates, boss), hole)
    assert list(leaves(drop_idle(program))) == list(leaves(plates))


def test_of_two_cuts_that_do_the_same_one_stays():
    program = cut(PLATE, cylinder(3, 8), cylinder(3, 6))
    left = drop_idle(program)
    assert left == cut(PLATE, cylinder(3, 8))
    assert abs(to_manifold(left).volume() - to_manifold(program).volume()) < 1e-9


def test_what_matters_stays():
    """A mask too, all of whose inside is left."""
    program = common(cut(union(PLATE, box(10, 10, 20)), cylinder(2, 30)), box(30, 100, 100))
    assert drop_idle(program) is program


def test_balls_are_asked_too():
    program = cut(union(PLATE, sphere(1.5)), sphere(3, (10, 0, 3)))
    assert list(leaves(drop_idle(program))) == [PLATE, sphere(3, (10, 0, 3))]


def test_a_large_cutter_that_takes_little_stays():
    """A share of the plate that is far less of the cutter."""
    program = cut(PLATE, box(4000, 3000, 400, (0, 0, 201.99)))
    assert drop_idle(program) is program


def test_time_is_kept():
    program = cut(PLATE, cylinder(3, 8), cylinder(3, 6))
    assert drop_idle(program, PASSED) is program
