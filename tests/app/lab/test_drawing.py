from dataclasses import replace

import numpy as np
import pytest

from imdim.app.lab import drawing, edits, plots, renderers
from imdim.app.lab.drawing import BROKEN_COLOUR, CUT, HELD_COLOUR, SELECTED, SPAN
from imdim.app.lab.edits import ConstrainedProgram
from imdim.app.lab.examples import PROGRAMS, example
from imdim.app.lab.solving import Lock
from imdim.app.lab.state import CurvePoint
from imdim.geometry.solid import to_manifold
from imdim.program.constraints import Constraint, Ref
from imdim.program.front import Choice
from imdim.program.tree import Combine, Primitive
from imdim.reconstruction.fitting import relations_of
from imdim.target.target import Frame

THEORY = ConstrainedProgram(*relations_of(PROGRAMS["Bracket"]()))
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
    surface = drawing.scene(ConstrainedProgram(flush), FRAME, None).surface
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
    html = renderers.tree(edits.with_lock(THEORY, Lock(1, "r"), True), 1, "mm")
    assert html.count("<button") == 7
    assert "r&nbsp;14&nbsp;mm&#128274;" in html
    assert html.count('aria-selected="true"') == 1
    assert "difference" in html


def test_the_code_has_a_line_to_click_for_each_primitive():
    html = renderers.code(THEORY, 0)
    assert [f'data-n="{i}"' in html for i in range(8)] == [True] * 7 + [False]
    assert "cylinder(h = 24, r = 14" in html


def test_the_front_is_a_plot_and_a_strip_of_pictures():
    choices = [Choice(Primitive("box", (80.0, 50.0, 8.0)), 0.2), Choice(THEORY.program, 1e-3), Choice(Primitive("sphere", (1.0,)))]
    plot, strip = plots.front(choices, THEORY.program), renderers.strip(choices, THEORY.program)
    assert plot.count('role="button"') == 2
    assert strip.count("data:image/png") == 3
    assert "7 primitives" in strip


def test_texts_of_nothing():
    for html in (
        renderers.tree(None, None, ""),
        renderers.code(None, None),
        plots.front([], None),
        renderers.strip([], None),
        plots.curves([]),
    ):
        assert "data-n" not in html


def test_names_of_constraints_are_no_markup():
    theory = ConstrainedProgram(THEORY.program, (Constraint("equal", (Ref(2, "r"), Ref(3, "r")), name="<b>x"),))
    assert "<b>x" not in renderers.relations(theory, [0.0], 1e-6, -1, "mm")


def stairs(html, name):
    """The corners of a curve [n, 2] as they are drawn, y downwards."""
    curve = html.split(f'data-curve="{name}"')[1].split('points="')[1].split('"')[0]
    return np.array([corner.split(",") for corner in curve.split()], float)


def test_the_curves_are_stairs_on_scales_of_their_own():
    html = plots.curves([CurvePoint(2.0, 0.1, 3, 0.0), CurvePoint(4.0, 0.0, 2, 1e-3)])
    error, size, violation = (stairs(html, name) for name in ("error", "primitives", "relations off by"))
    for curve in (error, size, violation):
        (start, last), high = (plots.LEFT + (plots.WIDE - plots.LEFT - plots.RIGHT) * t for t in (0.5, 1.0)), curve[:, 1]
        assert curve[:, 0] == pytest.approx([start, last, last], abs=0.1)
        assert high[0] == high[1]
    assert error[0, 1] < error[-1, 1], "an error that falls is drawn downwards"
    assert size[0, 1] < size[-1, 1]
    assert violation[0, 1] > violation[-1, 1]
    for said in ("error: none", "primitives: 2", "relations off by: 0.001", "4 s"):
        assert said in html
    assert 'data-curve="error"' in plots.curves([CurvePoint(0.0, 0.0, 1, 0.0)]), "one program, at once"


def test_the_chosen_constraint_is_marked():
    html = renderers.relations(THEORY, [0.0] * len(THEORY.constraints), 1e-6, 2, "mm")
    assert html.split('aria-pressed="true"')[0].rsplit('data-n="', 1)[1].startswith('2"')
    assert html.count('aria-pressed="true"') == 1
