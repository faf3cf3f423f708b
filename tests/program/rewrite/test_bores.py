"""Bores of turned drawings become cylinders and cones that are cut."""

import pytest
from tests.planted import box, cylinder

from imdim.geometry.solid import to_manifold
from imdim.program.outline import Outline
from imdim.program.rewrite.bores import separate_bores, stack_drawings
from imdim.program.tree import Primitive, Program, combine_all, leaves

# a hub of radius 18 on a conical foot, with a bore of 10 that widens at the top
HUB = ((10.0, 0.0, 0.0), (24.0, 0.0, 0.0), (18.0, 12.0, 0.0), (18.0, 28.0, 0.0), (13.5, 28.0, 0.0), (10.0, 21.0, 0.0))
# half a ball with a blind hole of radius 3 from below
DOME = ((3.0, 0.0, 0.0), (10.0, 0.0, 0.4142135623730951), (0.0, 10.0, 0.0), (0.0, 6.0, 0.0), (3.0, 6.0, 0.0))
CUP = ((0.0, 0.0, 0.0), (12.0, 0.0, 0.0), (12.0, 20.0, 0.0), (9.0, 20.0, 0.0), (9.0, 3.0, 0.0), (0.0, 3.0, 0.0))


def turned(*ring: tuple[float, float, float], angle: float = 360.0) -> Primitive:
    return Primitive("revolve", (angle,), (1.0, 2.0, 3.0), (0.0, 90.0, 20.0), Outline((ring,)))


def changed(change, program: Program) -> Program:
    """What it becomes; the solid stays."""
    after = change(program)
    a, b = to_manifold(program), to_manifold(after)
    assert (a - b).volume() + (b - a).volume() < 1e-9 * a.volume()
    return after


def kinds(program: Program) -> list[str]:
    return [leaf.kind for leaf in leaves(program)]


def test_a_hub_is_a_turned_body_less_its_bore() -> None:
    after = list(leaves(changed(separate_bores, turned(*HUB))))
    assert [leaf.kind for leaf in after] == ["revolve", "cylinder", "cone"]
    assert after[0].outline == Outline((((0.0, 0.0, 0.0), *HUB[1:4], (0.0, 28.0, 0.0)),))
    assert after[1].size == (10.0, 28.0)
    assert after[2].size == (10.0, 13.5, 7.0)


def test_its_walls_are_a_stack() -> None:
    after = list(leaves(changed(stack_drawings, turned(*HUB))))
    assert [(leaf.kind, leaf.size) for leaf in after[:2]] == [("cone", (24.0, 18.0, 12.0)), ("cylinder", (18.0, 28.0))]


@pytest.mark.parametrize("ring", [DOME, CUP], ids=["dome", "cup"])
def test_a_blind_hole_is_cut(ring) -> None:
    assert kinds(changed(separate_bores, turned(*ring)))[1:] == ["cylinder"]


def test_the_rest_of_the_program_stays() -> None:
    program = combine_all("difference", [combine_all("union", [box(90.0, 90.0, 2.0), turned(*HUB)]), cylinder(2.0, 9.0)])
    assert kinds(changed(separate_bores, program)) == ["box", "revolve", "cylinder", "cone", "cylinder"]


@pytest.mark.parametrize(
    "leaf",
    [
        turned((0.0, 0.0, 0.0), (9.0, 0.0, 0.0), (0.0, 9.0, 0.0)),
        turned(*HUB, angle=90.0),
        turned((6.0, 0.0, 1.0), (10.0, 0.0, 1.0)),
    ],
    ids=["without a bore", "a quarter turn", "round inside"],
)
def test_what_has_no_such_bore_stays(leaf: Primitive) -> None:
    assert separate_bores(leaf) == leaf


def test_what_goes_back_down_stays_drawn() -> None:
    """A groove that reaches behind an edge is no stack of walls."""
    ring = ((5.0, 0.0, 0.0), (20.0, 0.0, 0.0), (20.0, 20.0, 0.0), (5.0, 20.0, 0.0), (5.0, 15.0, 0.0), (8.0, 18.0, 0.0), (8.0, 10.0, 0.0))
    assert separate_bores(turned(*ring)) == turned(*ring)
