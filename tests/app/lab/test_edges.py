"""Fillets and chamfers in the lab: drawn, selected, resized, removed, kept by the solver and in the files."""

import math

import pytest

from imdim.app.lab import drawing, edits, renderers, work
from imdim.app.lab.answers import take_snapshot
from imdim.app.lab.document import Document
from imdim.app.lab.drawing import BLENDED, SELECTED
from imdim.app.lab.edits import ConstrainedProgram
from imdim.app.lab.requests import request
from imdim.app.lab.state import State
from imdim.geometry.edge_solids import solid_with_edges
from imdim.geometry.solid import to_trimesh
from imdim.program.codec import edges_of, parse
from imdim.program.edges import EdgeFeature, Face
from imdim.program.front import Choice
from imdim.program.tree import Combine, Primitive
from imdim.reconstruction.config import Settings
from imdim.target.target import Frame, target_from

PART = Combine("union", Primitive("box", (40.0, 30.0, 10.0)), Primitive("box", (12.0, 10.0, 10.0), (0.0, 0.0, 10.0)))
RIM = tuple((Face(0, "+z"), Face(0, side)) for side in ("+x", "-x", "+y", "-y"))
FOOT = tuple((Face(0, "+z"), Face(1, side)) for side in ("+x", "-x", "+y", "-y"))
CHAMFER, FILLET = EdgeFeature("chamfer", (1.0,), RIM, "chamfer"), EdgeFeature("fillet", (2.0,), FOOT, "fillet")
THEORY = ConstrainedProgram(PART, edges=(CHAMFER, FILLET))
TARGET = target_from(to_trimesh(solid_with_edges(PART, THEORY.edges)), "block")
FRAME = Frame.of(TARGET)


def test_blends_are_drawn_and_belong_to_their_features():
    shown = drawing.scene(THEORY, FRAME, None)
    assert [p.leaf for p in shown.pieces] == [0, 1, 2, 3]
    assert [p.colour for p in shown.pieces[2:]] == [BLENDED, BLENDED]
    assert shown.volume == pytest.approx(solid_with_edges(PART, THEORY.edges).volume(), rel=1e-4)
    assert drawing.scene(THEORY, FRAME, 3).pieces[3].colour == SELECTED
    assert drawing.names(THEORY)[2:] == ["chamfer 1 of 4 edges", "fillet 2 of 4 edges"]
    assert drawing.middle_of(shown, 2)[2] == pytest.approx(drawing.place(FRAME, [[0.0, 0.0, 5.0]])[0, 2], abs=1e-4)
    tree = renderers.tree(THEORY, 3, "mm")
    assert 'data-n="3" aria-selected="true"' in tree
    assert "fillet 2 of 4 edges" in tree


def test_a_size_changes_and_what_has_no_room_is_refused():
    wider = edits.with_edge_size(THEORY, 0, 0, 1.5)
    assert wider.edges == (EdgeFeature("chamfer", (1.5,), RIM, "chamfer"), FILLET)
    with pytest.raises(edits.LabEditError, match=r"fillet 30 of 4 edges: 4 of them have no room for it"):
        edits.with_edge_size(THEORY, 1, 0, 30.0)
    with pytest.raises(edits.LabEditError, match="positive"):
        edits.with_edge_size(THEORY, 1, 0, -1.0)
    with pytest.raises(edits.LabEditError, match="positive"):
        edits.with_edge_size(THEORY, 1, 0, math.nan)


def test_features_and_primitives_go():
    assert edits.without(THEORY, 2).edges == (FILLET,)
    without_boss = edits.without(THEORY, 1)
    assert without_boss.edges == (CHAMFER,)
    only_boss = edits.without(THEORY, 0)
    assert (only_boss.edges, only_boss.size) == ((), 1)


def test_a_person_selects_edits_and_takes_back():
    document = Document(lambda *_: None)
    document.state.target = TARGET
    document.history.push("found", THEORY)
    document.select(3)
    assert document.state.selected == 3
    document.select(4)
    assert document.state.selected is None
    document.select(3)
    assert document.edit("number edge 1 0", lambda theory: edits.with_edge_size(theory, 1, 0, 3.0))
    assert document.theory.edges[1].sizes == (3.0,)
    assert not document.edit("number edge 1 0", lambda theory: edits.with_edge_size(theory, 1, 0, 30.0))
    assert "no room" in document.state.notice[1]
    document.undo()
    assert document.theory == THEORY
    document.load(Choice(PART, 0.0))
    assert document.theory.edges == THEORY.edges
    document.load(Choice(PART.left, 0.0))
    assert (document.theory.edges, document.theory.knows_edges) == ((), False)


def test_the_fit_tells_edges_the_solver_keeps_them_and_files_have_them():
    state = State()
    for message in work.fit(request("fit", TARGET, Settings()), lambda: 0.0):
        take_snapshot(state, "fit", message, frozenset())
    found = state.live
    assert sorted((f.kind, f.sizes) for f in found.edges) == [("chamfer", (1.0,)), ("fillet", (2.0,))]
    *_, solved = work.solve(request("solve", TARGET, Settings(), found, locks=[]), lambda: 0.0)
    assert edges_of(solved.values["document"]) == found.edges
    front = [{"error": 0.0, "document": solved.values["document"]}]
    (files,) = work.files(
        request("files", TARGET, Settings(), edits.without(found, found.size - 1), front=front, stop="finished"), lambda: 0.0
    )
    assert len(edges_of(parse(files.arrays["program.json"].tobytes().decode()))) == 1
    unknown = ConstrainedProgram(found.program, knows_edges=False)
    fewer, unknown = edits.without(found, found.size - 1), ConstrainedProgram(found.program, knows_edges=False)
    for theory, count in ((fewer, 1), (unknown, 2)):
        (files,) = work.files(request("files", TARGET, Settings(), theory, front=front, stop="finished"), lambda: 0.0)
        assert len(edges_of(parse(files.arrays["program.json"].tobytes().decode()))) == count
