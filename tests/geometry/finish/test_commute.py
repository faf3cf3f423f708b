"""Parts that stand apart in a program stand together, and the solid stays: checked against the exact solid of the program given."""

import numpy as np
import pytest
from manifold3d import Manifold
from tests.deadlines import PASSED
from tests.planted import box, common, cut, cylinder, sphere, union

from imdim.delivery.finish import finish
from imdim.geometry.finish.commute import Commutation
from imdim.geometry.solid import to_manifold
from imdim.program.patterns.detect import fold_repeats
from imdim.program.repeats import repeats, size
from imdim.program.tree import Combine, Program, leaves

CORNERS = [(x, y) for x in (-30.0, 30.0) for y in (-15.0, 15.0)]


def corner_hole(n: int, low: float = -10.0, high: float = 10.0) -> Program:
    return cylinder(3, high - low, (*CORNERS[n], (low + high) / 2))


def plated() -> Program:
    """A plate whose four holes are cut before and after unions that cover them, two of them before it is bounded."""
    first = cut(box(100, 60, 6), corner_hole(0), corner_hole(1))
    wide = cut(union(first, box(70, 80, 6, (0.0, 0.0, 8.0), (0.0, 0.0, 20.0))), box(90, 60, 8, (0.0, 0.0, 9.0)), corner_hole(2))
    bounded = common(union(wide, box(20, 90, 14, (0.0, 0.0, 4.0))), box(76, 46, 60))
    return cut(bounded, corner_hole(3))


def tubes() -> Program:
    """Tubes of three heights on a floor that closes them, their bores as long as each of them is or longer."""
    out: Program = box(60, 16, 2, (0.0, 0.0, 1.0))
    for x, height, over in ((-20.0, 30.0, 0.0), (0.0, 24.0, 9.0), (20.0, 18.0, 3.0)):
        out = union(out, cut(cylinder(7, height, (x, 0.0, height / 2)), cylinder(5, height + 4 + over, (x, 0.0, (height + over - 4) / 2))))
    return out


def pegs() -> Program:
    """Four pegs of one height, of which three sink into what they stand on, each more than the other; and slots between them."""
    out: Program = box(100, 20, 6)
    for i, depth in enumerate((0.0, 2.0, 3.0, 5.0)):
        out = cut(union(out, cylinder(4, 12 + depth, (-36 + 24.0 * i, 0.0, 9 - depth / 2))), box(2, 30, 2 + i, (-24 + 24.0 * i, 0.0, 3.0)))
    return out


def difference(a: Manifold, b: Manifold) -> float:
    return (a - b).volume() + (b - a).volume()


@pytest.mark.parametrize(
    ("program", "kind", "counts"),
    [(plated(), "grid", (2, 2)), (tubes(), "linear", (3,)), (pegs(), "linear", (4,))],
    ids=("plate", "tubes", "pegs"),
)
def test_what_stands_apart_repeats_and_the_solid_stays(program, kind, counts):
    assert fold_repeats(program) is None
    whole = finish(program)
    assert whole.folded is not None
    assert [(r.kind, r.counts) for _, r in repeats(whole.folded)] == [(kind, counts)]
    solid = to_manifold(program, 48)
    assert difference(solid, to_manifold(whole.program, 48)) < 1e-6 * solid.volume()


def test_past_the_deadline_a_program_is_delivered_as_it_stands():
    late = finish(plated(), deadline=PASSED)
    assert late.folded is None
    assert late.program == plated()
    assert finish(plated()).program != plated()


def test_what_does_not_repeat_stays_where_it_is():
    slot = box(10, 90, 3, (0.0, 0.0, 3.0))
    program = cut(union(cut(box(100, 60, 6), slot), box(40, 4, 10)), box(8, 8, 40, (20.0, 0.0, 0.0)))
    assert Commutation(program).commute() is not None
    assert list(leaves(finish(program).program))[1].center == slot.center
    assert [leaf.kind for leaf in leaves(finish(program).program)] == ["box"] * 4


def test_a_group_moves_whole():
    """Rounded corners, each a box without a cylinder."""

    def corner(x: float, y: float) -> Program:
        return cut(box(8, 8, 20, (50 * x, 30 * y, 0.0)), cylinder(4, 30, (46 * x, 26 * y, 0.0)))

    signs = [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)]
    program: Program = box(100, 60, 6)
    for i, (x, y) in enumerate(signs):
        program = union(cut(program, corner(x, y)), box(4, 61 + i, 9 + i, (-20.0 + 12 * i, 0.0, 0.0)))
        program = common(program, box(100, 61 + i, 30))
    moved = Commutation(program).commute(2)
    assert moved is not None
    assert len(moved.order) - moved.core >= 8
    folded = finish(program).folded
    assert folded is not None
    assert [(r.kind, r.number * size(r.part)) for _, r in repeats(folded)] == [("mirror", 8), ("mirror", 4)]


@pytest.mark.parametrize("seed", range(12))
def test_random_programs_keep_their_solid(seed):
    """Whatever is gathered: cutters that are filled again, parts that are cut again, any order."""
    rng = np.random.default_rng(seed)
    program: Program = box(20, 20, 20)
    for _ in range(9):
        center = tuple(map(float, rng.integers(-9, 10, 3)))
        kinds = (box(*map(float, rng.integers(3, 14, 3)), center), cylinder(float(rng.integers(2, 6)), 14.0, center), sphere(5.0, center))
        part = kinds[rng.integers(3)]
        program = Combine(("union", "difference", "difference", "intersection")[rng.choice(4, p=(0.4, 0.3, 0.2, 0.1))], program, part)
    solid = to_manifold(program, 64)
    gathering = Commutation(program)
    for largest in (1, 3):
        found = gathering.commute(largest)
        if found is not None:
            assert sorted(found.order) == list(range(10))
            assert difference(solid, to_manifold(found.program, 64)) <= 1e-4 * solid.volume()


def test_an_empty_solid_has_nothing_to_gather():
    assert Commutation(cut(box(2, 2, 2), box(4, 4, 4), cylinder(1, 9))).commute() is None
