"""Blends in OpenSCAD text: what they are, what they follow, and what the real tool makes of them."""

import re
import shutil
import subprocess
from functools import partial

import pytest
import trimesh

from imdim.delivery.finish import FinishedProgram, finish
from imdim.export.delivered import meanings, texts_of
from imdim.export.edge_pieces import gather_pieces
from imdim.export.edge_text import draw_edges
from imdim.export.edit import change_values, lost_edges, open_delivered, solid_of
from imdim.export.openscad import to_openscad
from imdim.export.openscad_reader import are_drawn, read_openscad
from imdim.geometry.edge_solids import blend_solids, solid_with_edges
from imdim.geometry.solid import to_manifold
from imdim.program.codec import Meta, dumps, parse
from imdim.program.edges import EdgeFeature, Face
from imdim.program.outline import Outline, circle
from imdim.program.tree import Combine, Primitive, combine_all
from imdim.reconstruction.fitting import relations_of

PLATE = Primitive("box", (60.0, 40.0, 6.0), (0.0, 0.0, 3.0))
BOSS = Primitive("cylinder", (9.0, 14.0), (0.0, 0.0, 7.0))
HOLE = Primitive("cylinder", (4.0, 20.0), (0.0, 0.0, 7.0))
PROGRAM = Combine("difference", Combine("union", PLATE, BOSS), HOLE)
RIM = EdgeFeature("chamfer", (1.0,), tuple((Face(0, "+z"), Face(0, side)) for side in ("+x", "-x", "+y", "-y")))
FOOT = EdgeFeature("fillet", (2.0,), ((Face(0, "+z"), Face(1, "side")),))


def finished() -> FinishedProgram:
    return finish(*relations_of(PROGRAM), edges=(RIM, FOOT))


def delivered():
    found = finished()
    texts = texts_of(found.program, found.parameters, found.folded, 96, found.edges)
    return open_delivered(parse(dumps(found.program, Meta(), found.constraints, found.folded, found.edges)), texts)


def test_the_text_has_the_sharp_program_and_the_blended_one() -> None:
    found, text = finished(), delivered().texts["program.scad"]
    assert to_manifold(read_openscad(text)).volume() == pytest.approx(to_manifold(found.program).volume(), rel=1e-9)
    blended = solid_with_edges(found.program, found.edges)
    assert to_manifold(read_openscad(text, blended=True)).volume() == pytest.approx(blended.volume(), rel=1e-6)


def test_blends_of_few_statements_are_shown_though_they_hold_little() -> None:
    """Those of three parts are shown where they take three statements, and stay behind a switch where they take more."""
    below = EdgeFeature("chamfer", (0.5,), tuple((Face(0, "-z"), Face(0, side)) for side in ("+x", "-x", "+y", "-y")))
    for edges, shown in (((RIM, FOOT), True), ((RIM, FOOT, below), False)):
        found = finish(*relations_of(PROGRAM), edges=edges)
        read = partial(read_openscad, to_openscad(found.program, 96, found.parameters))
        drawn = draw_edges(found.edges, found.parameters.values, read, matter=False)
        assert (len(drawn.pieces) <= 3) == shown
        assert are_drawn(to_openscad(found.program, 96, found.parameters, drawn)) == shown
        assert draw_edges(found.edges, found.parameters.values, read, matter=True).shown


@pytest.mark.parametrize("factor", [0.7, 1.3])
def test_blends_follow_every_name(factor: float) -> None:
    before = delivered()
    names = [name for name in before.values if "hole" not in name]
    assert {"chamfer_distance", "fillet_radius"} < set(names)
    for name in names:
        after = change_values(before, {name: before.values[name] * factor})
        drawn = to_manifold(read_openscad(after.texts["program.scad"], blended=True), 96)
        assert drawn.volume() == pytest.approx(solid_of(after).volume(), rel=1e-6), name


def test_factors_are_simple_where_one_beside_them_is_not() -> None:
    # a slanted end beside a round one: along the slant blends move by a sine, everywhere else by eighths
    bulge = 0.41421356237309503
    ring = ((-20.0, -10.0, 0.0), (15.0, -10.0, 0.0), (25.0, 10.0, 0.0), (-15.0, 10.0, bulge), (-20.0, 5.0, 0.0))
    plate = Primitive("extrude", (6.0,), outline=Outline((ring,)))
    rim = EdgeFeature("chamfer", (1.0,), tuple((Face(0, "+z"), Face(0, f"wall[0][{k}]")) for k in range(5)))
    found = finish(plate, edges=(rim,))
    text = texts_of(found.program, found.parameters, found.folded, 96, found.edges)["program.scad"]
    factors = [float(f) for f in re.findall(r"chamfer_distance\*([\d.e-]+)", text)]
    assert factors  # along the slant
    assert all(abs(8 * f - round(8 * f)) > 8e-4 for f in factors), factors


@pytest.mark.tool
def test_openscad_draws_them(tmp_path) -> None:
    tool = shutil.which("openscad")
    if tool is None:
        pytest.skip("openscad is not installed")
    (tmp_path / "part.scad").write_text(delivered().texts["program.scad"], encoding="utf-8")
    found = finished()
    for drawn, wanted in (("true", solid_with_edges(found.program, found.edges, 96)), ("false", to_manifold(found.program, 96))):
        out = tmp_path / f"{drawn}.stl"
        subprocess.run([tool, "-q", "-D", f"edges={drawn}", "-o", str(out), str(tmp_path / "part.scad")], check=True, capture_output=True)
        assert trimesh.load_mesh(out).volume == pytest.approx(wanted.volume(), rel=1e-5)


def test_the_list_says_what_a_size_is_of() -> None:
    told = meanings(delivered())
    assert told["chamfer_distance"] == "size of chamfer 1 of 4 edges"
    assert told["fillet_radius"] == "size of fillet 2 of 1 edge"


def test_an_edit_tells_which_edges_are_no_more() -> None:
    before = delivered()
    assert lost_edges(before, before) == []
    after = change_values(before, {"boss_diameter": 90.0})  # wider than the plate
    assert lost_edges(before, after) == ["chamfer 1: 4 of 4 edges no more", "fillet 2: 1 of 1 edges no more"]


def test_an_edited_size_is_in_the_document() -> None:
    after = change_values(delivered(), {"chamfer_distance": 2.0})
    assert after.edges[0].sizes == (2.0,)
    assert "chamfer_distance = 2;" in after.texts["program.scad"]


def test_parallel_pieces_of_one_length_are_drawn_together() -> None:
    pieces = blend_solids(PLATE, [RIM]).pieces
    gathered = gather_pieces(pieces)
    assert (len(pieces), len(gathered)) == (4, 2)
    assert sum(to_manifold(p.solid).volume() for p in gathered) == pytest.approx(sum(to_manifold(p.solid).volume() for p in pieces))
    # rims of holes: round pieces stay as they are
    ring = Primitive("extrude", (4.0,), outline=Outline((circle(9.0), circle(4.0))))
    edges = tuple((Face(0, "+z"), Face(0, f"wall[{loop}][{k}]")) for loop in (0, 1) for k in (0, 1))
    found = blend_solids(ring, [EdgeFeature("chamfer", (0.5,), edges)]).pieces
    assert len(gather_pieces(found)) == len(found) == 4


def test_more_copies_have_the_edges_that_all_had() -> None:
    plate = Primitive("box", (120.0, 40.0, 6.0), (0.0, 0.0, 3.0))
    bosses = [Primitive("cylinder", (5.0, 14.0), (-40.0 + 20 * k, 0.0, 7.0)) for k in range(3)]
    feet = tuple((Face(0, "+z"), Face(1 + k, "side")) for k in range(3))
    tops = tuple((Face(1 + k, "+z"), Face(1 + k, "side")) for k in range(2))  # one stays sharp
    edges = (EdgeFeature("fillet", (2.0,), feet), EdgeFeature("chamfer", (0.5,), tops))
    found = finish(*relations_of(combine_all("union", [plate, *bosses])), edges=edges)
    assert found.folded is not None
    texts = texts_of(found.program, found.parameters, found.folded, 96, found.edges)
    before = open_delivered(parse(dumps(found.program, Meta(), found.constraints, found.folded, found.edges)), texts)
    (count,) = before.counts
    for copies, footed, topped in ((4, 4, 2), (2, 2, 2)):
        after = change_values(before, {count: copies})
        assert [len(f.edges) for f in after.edges] == [footed, topped]
        assert lost_edges(after, after) == []
        assert not blend_solids(after.program, after.edges).missing
        drawn = to_manifold(read_openscad(after.texts["program.scad"], blended=True), 96)
        assert drawn.volume() == pytest.approx(solid_of(after).volume(), rel=1e-6)
