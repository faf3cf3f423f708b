"""Parts that cost more than they are worth go, and no others."""

import numpy as np
import pytest
from tests.deadlines import PASSED
from tests.planted import box, cut, cylinder, mesh_of, union

from imdim.program.outline import Outline, circle
from imdim.program.tree import Primitive, Program, leaves
from imdim.reconstruction.observation import Observation, UnitBody, observe
from imdim.reconstruction.spare_parts import drop_spare
from imdim.target.target import target_from

PLATE = box(0.8, 0.6, 0.1)
HOLE, SECOND = (cylinder(0.05, 0.2, (x, 0.1, 0.0)) for x in (0.2, -0.2))
SCRATCH = box(0.3, 0.1, 0.002, (0.0, -0.1, 0.05))
SPLINTER = box(0.01, 0.01, 0.01, (0.1, 0.1, 0.055))


@pytest.fixture(scope="module")
def seen() -> Observation:
    target, rng = target_from(mesh_of(cut(PLATE, HOLE, SECOND))), np.random.default_rng(0)
    return observe(UnitBody.of(target, rng), 2.5e-4, rng, outlines=True, curve=0.1)


@pytest.mark.parametrize("spare", [SCRATCH, box(0.01, 0.01, 0.01, (0.1, 0.1, 0.05))], ids=["scratch", "pit"])
def test_a_cut_that_the_part_has_not_goes(seen: Observation, spare: Program) -> None:
    found = drop_spare(cut(PLATE, HOLE, spare, SECOND), seen.price, seen.exact_price, seen.size_weight)
    assert list(leaves(found)) == [PLATE, HOLE, SECOND]


def test_a_splinter_goes(seen: Observation) -> None:
    found = drop_spare(cut(union(PLATE, SPLINTER), HOLE, SECOND), seen.price, seen.exact_price, seen.size_weight)
    assert list(leaves(found)) == [PLATE, HOLE, SECOND]


def test_a_loop_that_is_worth_nothing_goes(seen: Observation) -> None:
    """Two windows are drawn as one cut, of which the part has one; what is left of the drawing is a cylinder."""
    loops = (circle(0.05, 0.2, 0.1), circle(0.004, 0.0, -0.1))
    program = cut(PLATE, SECOND, Primitive("extrude", (0.2,), outline=Outline(loops)))
    found = drop_spare(program, seen.price, seen.exact_price, seen.size_weight)
    assert [leaf.kind for leaf in leaves(found)] == ["box", "cylinder", "cylinder"]
    assert list(leaves(found))[2].size == pytest.approx(HOLE.size)


def test_what_is_worth_its_price_stays(seen: Observation) -> None:
    program = cut(PLATE, HOLE, SECOND)
    assert drop_spare(program, seen.price, seen.exact_price, seen.size_weight) == program


def test_a_part_whose_crumbs_cannot_be_mended_stays(seen: Observation) -> None:
    program = cut(PLATE, HOLE, SCRATCH, SECOND)
    price = seen.price, seen.exact_price, seen.size_weight
    assert drop_spare(program, *price, mend=lambda _: None) == program
    mended = cut(PLATE, HOLE, cylinder(0.05, 0.201, (-0.2, 0.1, 0.0)))
    assert drop_spare(program, *price, mend=lambda _: mended) == mended
    costly = cut(PLATE, HOLE, SECOND, cylinder(0.1, 0.2, (0.0, -0.1, 0.0)))
    assert drop_spare(program, *price, mend=lambda _: costly) == program


def test_past_the_deadline_all_stays(seen: Observation) -> None:
    program = cut(PLATE, HOLE, SCRATCH, SECOND)
    assert drop_spare(program, seen.price, seen.exact_price, seen.size_weight, PASSED) == program


def test_the_price_is_asked_only_where_the_estimate_does_not_tell() -> None:
    asked: list[Program] = []

    def price(program: Program) -> float:
        asked.append(program)
        return 0.0

    program = cut(PLATE, HOLE, SECOND)
    worth = dict.fromkeys((PLATE, HOLE, SECOND), 1.0)

    def estimate(fewer: Program) -> float:
        return -sum(worth[leaf] for leaf in leaves(fewer))  # each is worth far more than the slack

    assert drop_spare(program, estimate, price, 0.1) == program
    assert not asked
