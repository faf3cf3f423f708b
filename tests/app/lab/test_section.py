"""The section plane: what stays, and how the cut is filled."""

import math

import numpy as np
import pytest

from imdim.app.lab import drawing
from imdim.app.lab.drawing import CAP_OF, SPAN
from imdim.app.lab.edits import ConstrainedProgram
from imdim.app.lab.examples import PROGRAMS, example
from imdim.app.lab.section import Section, cut_drawing, cut_original, cut_points
from imdim.target.target import Frame, target_from

TARGET = example("Bracket")
FRAME = Frame.of(TARGET)


def area(pieces):
    """Of triangles, in the part's units."""
    out = 0.0
    for piece in pieces:
        a, b, c = np.moveaxis(piece.vertices[piece.faces].astype(float) / SPAN / FRAME.scale, 1, 0)
        out += np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    return out


def level_of(section):
    return section.level(TARGET.points.min(axis=0), TARGET.points.max(axis=0))


@pytest.mark.parametrize("flipped", [False, True])
def test_a_solid_is_cut_open_and_the_cut_is_filled(flipped):
    section = Section(1, 0.5, flipped)
    whole = drawing.scene(ConstrainedProgram(PROGRAMS["Bracket"]()), FRAME, None)
    assert level_of(section) == pytest.approx(0.0, abs=1e-3)
    cut = cut_drawing(whole, section, 0.0, FRAME)
    caps = [piece for piece in cut.pieces if piece.leaf == CAP_OF]
    # through the middle: the plate 80 x 8 and the boss 28 x 16, without the bore of 16 x 24
    assert area(caps) == pytest.approx(80 * 8 + 28 * 16 - 16 * 24, rel=1e-3)
    sides = np.concatenate([piece.vertices[:, 1] for piece in cut.pieces + cut.ghosts]) * (-1 if flipped else 1)
    assert sides.min() > -1e-5
    walls = [piece for piece in cut.pieces if piece.leaf != CAP_OF]
    assert area(walls) == pytest.approx(area(whole.pieces) / 2, rel=1e-2)
    assert cut.volume == whole.volume
    assert len(cut.edges)


def test_a_plane_beside_the_part_leaves_all_or_nothing():
    whole = drawing.scene(ConstrainedProgram(PROGRAMS["Bracket"]()), FRAME, None)
    assert area(cut_drawing(whole, Section(2, 1.0), 100.0, FRAME).pieces) == pytest.approx(area(whole.pieces), rel=1e-6)
    assert cut_drawing(whole, Section(2, 0.0), -100.0, FRAME).pieces == []


def test_the_part_itself_is_cut_too():
    piece, edges = drawing.original(TARGET, FRAME)
    pieces, left = cut_original(piece, edges, Section(2, 0.5), 0.0, FRAME)
    assert area([p for p in pieces if p.leaf == CAP_OF]) == pytest.approx(80 * 50 - math.pi * (8**2 + 4 * 3**2), rel=1e-2)
    assert len(left)
    open_mesh = TARGET.mesh.copy()
    open_mesh.update_faces(np.arange(len(open_mesh.faces)) > 40)
    target = target_from(open_mesh, "open")
    pieces, left = cut_original(*drawing.original(target, FRAME), Section(2, 0.5), 0.0, FRAME)
    assert [p.leaf for p in pieces] == [-1], "what is not closed is not filled"
    points = drawing.place(FRAME, np.array([[0.0, 0.0, -3.0], [0.0, 0.0, 3.0]]))
    assert len(cut_points(points, Section(2, 0.5), 0.0, FRAME)) == 1
