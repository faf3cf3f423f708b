"""Drawings whose other walls do not show are boxes, and segments of circles whole circles."""

from __future__ import annotations

import math

import pytest
from tests.planted import cylinder

from imdim.geometry.finish.active_zone import change_with
from imdim.program.outline import Outline, Ring, circle
from imdim.program.rewrite.widening import list_boxes_around, list_with_circles, widen
from imdim.program.tree import Combine, Primitive, Program, leaves

RIM = 10.0
GROOVE: Ring = ((11.0, -math.sqrt(3.0), 0.0), (11.0, math.sqrt(3.0), math.tan(math.radians(60.0))))  # of radius 2 about (10, 0)


def knob(*loops: Ring) -> Program:
    return Combine("difference", cylinder(RIM, 4.0), Primitive("extrude", (5.0,), outline=Outline(loops)))


def complete(program: Program) -> Program:
    return widen(program, list_with_circles, lambda leaf, wider: True, change_with, 1e-9)


def test_a_groove_that_opens_at_a_rim_is_a_whole_circle() -> None:
    _, groove = leaves(complete(knob(GROOVE)))
    assert groove.kind == "cylinder"
    assert groove.center == pytest.approx((10.0, 0.0, 0.0))
    assert groove.size == pytest.approx((2.0, 5.0))


def test_grooves_that_are_drawn_together_stay_so() -> None:
    left = tuple((-x, -y, bulge) for x, y, bulge in GROOVE)
    _, grooves = leaves(complete(knob(GROOVE, left)))
    assert grooves.outline is not None
    right, left = grooves.outline.rings
    assert (right[0], left[0]) == (pytest.approx(circle(2.0, 10.0)[0]), pytest.approx(circle(2.0, -10.0)[0]))


def test_a_chord_that_shows_stays() -> None:
    flat = knob(tuple((x - 8.0, y, bulge) for x, y, bulge in GROOVE))
    assert complete(flat) == flat, "the flat of a D-shaped hole"
    program = knob(GROOVE)
    assert widen(program, list_with_circles, lambda leaf, wider: False, change_with, math.inf) == program, "asked in vain"


def test_what_is_no_segment_stays() -> None:
    square = knob(((11.0, -1.0, 0.0), (11.0, 1.0, 0.0), (9.0, 1.0, 0.0), (9.0, -1.0, 0.0)))
    slot = knob(((14.0, -2.0, 0.0), (14.0, 2.0, 0.0), (10.0, 2.0, 1.0), (10.0, -2.0, 0.0)))
    for program in (square, slot):
        assert complete(program) == program


@pytest.mark.parametrize("turn", [0.0, 30.0])
def test_a_rib_that_leans_on_a_boss_is_a_box(turn: float) -> None:
    rib = ((3.0, -1.0, 0.0), (6.0, -1.0, 0.0), (6.0, 1.0, 0.0), (3.0, 1.0, -0.2))
    drawn = Combine("union", cylinder(4.0, 2.0), Primitive("extrude", (1.0,), rotation=(0.0, 0.0, turn), outline=Outline((rib,))))
    program = widen(drawn, list_boxes_around, lambda leaf, box: True, change_with, 1e-9)
    assert [leaf.kind for leaf in leaves(program)] == ["cylinder", "box"]
    assert widen(drawn, list_boxes_around, lambda leaf, box: False, change_with, math.inf) == drawn, "asked in vain"
    assert sorted(list(leaves(program))[1].size) == pytest.approx([1.0, 2.0, 3.0])


def test_what_shows_stays_drawn() -> None:
    bent = ((3.0, -1.0, 0.0), (6.0, -1.0, 0.3), (6.0, 1.0, 0.0), (3.0, 1.0, 0.0))
    drawn = Combine("union", cylinder(4.0, 2.0), Primitive("extrude", (0.5,), outline=Outline((bent,))))
    assert widen(drawn, list_boxes_around, lambda leaf, box: True, change_with, 1e-9) == drawn
