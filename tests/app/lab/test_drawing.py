from dataclasses import replace

import numpy as np
import pytest

from imdim.app.lab import drawing, edits, texts
from imdim.app.lab.drawing import BROKEN_COLOUR, CUT, HELD_COLOUR, SELECTED, SPAN
from imdim.app.lab.edits import Theory
from imdim.app.lab.examples import PROGRAMS, example
from imdim.app.lab.panels.browse import LEAST, curves
from imdim.app.lab.solving import Lock
from imdim.app.lab.state import Step
from imdim.fitting import relations_of
from imdim.geometry.cloud import Frame
from imdim.geometry.solid import to_manifold
from imdim.program.constraints import Constraint, Ref
from imdim.program.front import Choice
from imdim.program.tree import Combine, Primitive

THEORY = Theory(*relations_of(PROGRAMS["Bracket"]()))
TARGET = example("Bracket")
FRAME = Frame.of(TARGET)


def test_of_a_mesh_fewer_points_are_shown_than_of_a_cloud():
    assert len(drawing.cloud(TARGET, FRAME)) == drawing.SHOWN_OF_MESH
    scanned = example("Bracket, scanned")
    assert len(drawing.cloud(scanned, Frame.of(scanned))) == len(scanned.points)
    many = replace(scanned, points=np.repeat(scanned.points, 13, axis=0))
    thinned = drawing.cloud(many, Frame.of(scanned))
    assert len(thinned) == drawing.SHOWN_POINTS
    everywhere = drawing.cloud(scanned, Frame.of(scanned))
    assert np.ptp(thinned, axis=0) == pytest.approx(np.ptp(everywhere, axis=0), rel=0.02)


def test_the_view_shows_each_primitive_by_what_it_does():
    shown = drawing.scene(THEORY, FRAME, None)
    assert [p.leaf for p in shown.pieces] == list(range(7))
    assert [p.leaf for p in shown.ghosts] == [2, 3, 4, 5, 6]
    assert all(p.colour == CUT and p.opacity < 0.5 for p in shown.ghosts)
    assert CUT not in [p.colour for p in shown.pieces[:2]]
    assert shown.volume == pytest.approx(to_manifold(THEORY.program).volume(), rel=1e-5)
    corners = np.concatenate([p.vertices for p in shown.pieces])
    assert np.linalg.norm(np.ptp(corners, axis=0)) == pytest.approx(SPAN, rel=1e-5)


def test_a_knob_is_clipped_by_its_box():
    program = PROGRAMS["Knob"]()
    assert drawing.roles(program) == ["union", "intersection", "union", "difference", "difference"]


def test_the_selected_primitive_stands_out():
    shown = drawing.scene(THEORY, FRAME, 1)
    assert [p.colour for p in shown.pieces if p.leaf == 1] == [SELECTED]
    assert [p.colour for p in shown.ghosts if p.leaf == 1] == [SELECTED]


def test_a_flush_hole_leaves_no_film():
    plate, off = Primitive("box", (10.0, 10.0, 2.0)), 1e-15
    flush = Combine("difference", plate, Primitive("cylinder", (2.0, 2.0), (0.0, 0.0, -off)))
    surface = drawing.scene(Theory(flush), FRAME, None).surface
    middle = surface.triangles_center[np.linalg.norm(surface.triangles_center[:, :2], axis=1) < 1.5]
    assert not len(middle)


def test_broken_constraints_are_red():
    held = drawing.overlay(THEORY, FRAME)
    assert {tuple(c) for c in held.colours[:, 0].tolist()} == {HELD_COLOUR}
    assert len(held.points) == 7
    broken = drawing.overlay(edits.with_number(THEORY, 2, "r", 4.0), FRAME)
    assert BROKEN_COLOUR in {tuple(c) for c in broken.colours[:, 0].tolist()}


def test_the_distance_map_is_hot_where_the_part_is_missed():
    surface = drawing.scene(edits.with_number(THEORY, 1, "r", 17.0), FRAME, None).surface
    points, colours, top = drawing.distance_map(TARGET, surface, FRAME)
    assert top == pytest.approx(3.0, abs=0.1)
    hot = np.linalg.norm(points[colours[:, 2] < 60][:, :2], axis=1) / (FRAME.scale * SPAN)
    assert hot.min() > 13
    assert hot.max() < 16


def test_the_tree_tells_names_numbers_units_and_locks():
    html = texts.tree(edits.with_lock(THEORY, Lock(1, "r"), True), 1, "mm")
    assert html.count("<button") == 7
    assert "r&nbsp;14&nbsp;mm&#128274;" in html
    assert html.count('aria-selected="true"') == 1
    assert "difference" in html


def test_the_code_has_a_line_to_click_for_each_primitive():
    html = texts.code(THEORY, 0)
    assert [f'data-n="{i}"' in html for i in range(8)] == [True] * 7 + [False]
    assert "cylinder(h = 24, r = 14" in html


def test_the_front_is_a_plot_and_a_strip_of_pictures():
    choices = [Choice(Primitive("box", (80.0, 50.0, 8.0)), 0.2), Choice(THEORY.program, 1e-3), Choice(Primitive("sphere", (1.0,)))]
    plot, strip = texts.front(choices, THEORY.program), texts.strip(choices, THEORY.program)
    assert plot.count('role="button"') == 2
    assert strip.count("data:image/png") == 3
    assert "7 primitives" in strip


def test_texts_of_nothing():
    for html in (texts.tree(None, None, ""), texts.code(None, None), texts.front([], None), texts.strip([], None)):
        assert "data-n" not in html


def test_names_of_constraints_are_no_markup():
    theory = Theory(THEORY.program, (Constraint("equal", (Ref(2, "r"), Ref(3, "r")), name="<b>x"),))
    assert "<b>x" not in texts.relations(theory, [0.0], 1e-6)


def test_a_curve_of_one_step_is_a_line_and_zero_is_on_a_scale_of_logarithms():
    steps = [Step(2.0, 0.1, 3, 0.0), Step(4.0, 0.0, 2, 1e-3)]
    assert curves(steps[:1]).tolist() == [[0.0, 0.1, 3.0, LEAST], [2.0, 0.1, 3.0, LEAST]]
    assert curves(steps)[1].tolist() == [4.0, LEAST, 2.0, 1e-3]
