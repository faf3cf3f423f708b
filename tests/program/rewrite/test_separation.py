"""Loops that are features of their own become features, and cuts stand behind the body; the solid stays as it was."""

import pytest
from tests.planted import box, cut, cylinder

from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Outline, circle
from imdim.program.rewrite.separation import hoist_cuts, separate_loops
from imdim.program.rewrite.simplify import reduce_program
from imdim.program.tree import Combine, Primitive, leaves


def ring(x0: float, y0: float, x1: float, y1: float, bulge: float = 0.0):
    return ((x0, y0, 0.0), (x1, y0, bulge), (x1, y1, 0.0), (x0, y1, bulge))


def drawing(*loops, height: float = 0.5, **place) -> Primitive:
    return Primitive("extrude", (height,), outline=Outline(loops), **place)


def same(a, b) -> bool:
    return volume_iou(to_manifold(a), to_manifold(b)) == pytest.approx(1.0, abs=1e-7)


def kinds(program) -> list[str]:
    return [leaf.kind for leaf in leaves(program)]


@pytest.mark.parametrize("place", [{}, {"center": (1.0, -2.0, 3.0), "rotation": (20.0, 30.0, 40.0)}], ids=["flat", "turned"])
@pytest.mark.parametrize(
    ("loops", "found"),
    [
        ((ring(0, 0, 4, 3), circle(0.5, 1.0, 1.5), ring(2, 1, 3, 2)), ["box", "cylinder", "box"]),
        ((ring(0, 0, 4, 3, 0.4), circle(0.5, 1.0, 1.5)), ["extrude", "cylinder"]),
        ((ring(0, 0, 4, 3), ring(1, 1, 2, 2, 1.0)), ["extrude"]),  # a slot stays drawn
        (tuple(ring(k, 0, k + 0.5, 3) for k in range(5)), ["box"] * 5),
        ((ring(0, 0, 6, 6), ring(1, 1, 5, 5), ring(2, 2, 4, 4)), ["box", "box", "box"]),  # an island in a hole
        ((circle(2.0), circle(1.0)), ["cylinder", "cylinder"]),
        ((ring(0, 0, 4, 3), Ellipse(1.0, 0.5, 2.0, 1.5, 30.0)), ["box", "extrude"]),
        ((Ellipse(3.0, 2.0), Ellipse(2.5, 1.5)), ["extrude", "extrude"]),
    ],
    ids=["plate", "round plate", "slot", "ribs", "island", "tube", "elliptic hole", "elliptic tube"],
)
def test_loops_become_features(loops, found, place) -> None:
    drawn = drawing(*loops, **place)
    program = separate_loops(drawn)
    assert sorted(kinds(program)) == sorted(found)
    assert same(program, drawn)


def test_an_elliptic_tube_with_a_floor_becomes_a_cup() -> None:
    """The floor, drawn as a second plate, joins the outer wall, and the hole that went through is a pocket."""
    wall, bore = Ellipse(3.0, 2.0), Ellipse(2.5, 1.5)
    drawn = Combine("union", drawing(wall, bore, height=8.0), drawing(wall, center=(0.0, 0.0, -3.75)))
    program = reduce_program(separate_loops(drawn))
    assert [leaf.size for leaf in leaves(program)] == [(8.0,), (7.5,)]
    assert same(program, drawn)


def test_turned_areas_are_parts_too() -> None:
    drawn = Primitive("revolve", (360.0,), outline=Outline((ring(0, 0, 2, 1), ring(3, 0, 4, 1))))
    program = separate_loops(drawn)
    assert kinds(program) == ["revolve", "cylinder"] or kinds(program) == ["cylinder", "revolve"]
    assert same(program, drawn)


def test_others_stay_as_they_are() -> None:
    program = cut(box(2.0, 2.0, 1.0), cylinder(0.5, 3.0))
    assert separate_loops(program) == program


def test_cuts_through_several_levels_become_one() -> None:
    """A plate and the hub on it, bored through: two rings by their drawings, one bore by the part."""
    plate, hub = drawing(ring(-3, -2, 3, 2), circle(0.5)), drawing(circle(1.0), circle(0.5), height=2.0, center=(0.0, 0.0, 1.0))
    drawn = Combine("union", plate, hub)
    solid = to_manifold(drawn)
    program = reduce_program(hoist_cuts(separate_loops(drawn), lambda c: (to_manifold(c) ^ solid).volume() < 1e-7))
    assert kinds(program) == ["box", "cylinder", "cylinder"]
    assert isinstance(program, Combine)
    assert program.op == "difference"
    assert same(program, drawn)


def test_a_cut_that_another_part_fills_stays_inside() -> None:
    filled = Combine("union", cut(box(4.0, 4.0, 1.0), cylinder(1.0, 2.0)), cylinder(0.5, 5.0))
    solid = to_manifold(filled)
    program = hoist_cuts(filled, lambda c: (to_manifold(c) ^ solid).volume() < 1e-7)
    assert program == filled
