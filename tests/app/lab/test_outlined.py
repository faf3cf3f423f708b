"""Primitives with outlines in the lab: their numbers, locks and edits, what is drawn of them, and that a solve keeps the outline."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from tests.drawn import BORED, BRACKET, PULLEY, centred

from imdim.app.lab import edits, plots, renderers
from imdim.app.lab.drawing import SKIN, enlarge_cutters
from imdim.app.lab.edits import ConstrainedProgram, LabEditError
from imdim.app.lab.outline_picture import draw_outline
from imdim.app.lab.panels.relate import features
from imdim.app.lab.solving import TURN, Lock, follow_constraints, violations
from imdim.program.constraints import Constraint, ConstraintError, Ref, check
from imdim.program.front import Choice
from imdim.program.tree import Combine, Primitive, leaves


def test_numbers_of_an_extrusion_and_of_a_turned_outline():
    plate, sector = centred(BRACKET, 8.0), replace(PULLEY, size=(90.0,))
    assert [(n.name, n.unit, n.lock) for n in edits.numbers(plate)[:2]] == [("h", "length", "h"), ("x", "length", "x")]
    assert [(n.name, n.unit, n.lock) for n in edits.numbers(sector)[:1]] == [("angle", "degrees", "angle")]
    assert edits.numbers(sector)[-1].lock == TURN


def test_an_edit_keeps_the_outline_and_refuses_more_than_a_turn():
    theory = ConstrainedProgram(Combine("difference", centred(BRACKET, 8.0), PULLEY))
    higher = next(leaves(edits.with_number(theory, 0, "h", 12.0).program))
    assert (higher.size, higher.outline) == ((12.0,), centred(BRACKET, 8.0).outline)
    with pytest.raises(LabEditError, match="at most 360"):
        edits.with_number(theory, 1, "angle", 400.0)


def test_constraints_follow_with_the_outline():
    """The end faces of plate and bore stay level while the plate is made higher."""
    level = Constraint("coplanar", (Ref(0, "+z"), Ref(1, "+z")), None, 6.0)
    assert violations(BORED, [level]) == [0.0]
    got = follow_constraints(edits.with_number(ConstrainedProgram(BORED), 0, "h", 10.0).program, [level], [Lock(0, "h")])
    plate, bore = leaves(got)
    assert plate.outline == next(leaves(BORED)).outline
    assert plate.size == (10.0,)
    assert bore != [*leaves(BORED)][1]
    assert violations(got, [level])[0] < 1e-9


def test_features_that_relations_can_name():
    assert features(3, centred(BRACKET, 8.0)) == "sizes 3.h; axes 3.z; faces 3.+z, 3.-z; centre 3"
    assert features(4, PULLEY) == "axes 4.z; centre 4"
    with pytest.raises(ConstraintError, match="is no size"):
        check(0, Constraint("value", (Ref(0, "angle"),), None, 90.0), [PULLEY])


def test_cutters_grow_with_their_outlines_and_never_beyond_a_turn():
    plate, cutter = leaves(enlarge_cutters(Combine("difference", centred(BRACKET, 8.0), PULLEY)))
    assert plate == centred(BRACKET, 8.0)
    assert cutter.size == (360.0,)
    assert cutter.outline.bounds[1][0] == pytest.approx(20 * (1 + SKIN))


def test_the_picture_shows_what_a_drawing_would_say():
    html = draw_outline(centred(BRACKET, 8.0), "mm")
    assert "60&nbsp;mm × 40&nbsp;mm, 10 curves" in html
    assert "radii 2.75&nbsp;mm, 6&nbsp;mm, 12&nbsp;mm" in html
    path = re.findall(r'<path d="([^"]*)"', html)[0]
    assert [path.count(letter) for letter in "MLAZ"] == [3, 6, 6, 3]
    ends = np.array([[float(v) for v in step.split()[-2:]] for step in re.findall(r"[MLA]([^MLAZ]*)", path)])
    assert math.isclose(*np.ptp(ends, axis=0) / (60, 40), rel_tol=1e-3)
    assert draw_outline(next(leaves(Combine("union", PULLEY, PULLEY))), "").count("<svg") == 1
    assert draw_outline([*leaves(BORED)][1], "mm") == ""


def test_the_tree_lists_an_outlined_primitive():
    html = renderers.tree(ConstrainedProgram(BORED), 0, "mm")
    assert "extrude" in html
    assert "h&nbsp;8&nbsp;mm" in html


def test_the_front_tells_features_and_curves():
    choices = [Choice(Primitive("box", (60.0, 40.0, 8.0)), 0.2), Choice(BORED, 1e-3)]
    plot, strip = plots.front(choices, BORED), renderers.strip(choices, BORED)
    assert "<title>1: 1 primitive, error 0.2</title>" in plot
    assert "<title>2: 2 features, 10 curves in outlines, error 0.001</title>" in plot
    assert "load 2: 2 features, 10 curves in outlines, error 0.001" in strip
