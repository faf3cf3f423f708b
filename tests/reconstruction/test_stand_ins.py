"""Boxes and cones that stand for blends are found, those that are features of their own are not, and boxes become chamfers of edges."""

import pytest
from tests.deadlines import PASSED
from tests.planted import box, cone, cut, cylinder, mesh_of, union

import imdim
from imdim.geometry.census import find_pieces
from imdim.geometry.edge_solids import solid_with_edges
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.outline import Outline
from imdim.program.tree import Combine, Primitive, leaves
from imdim.reconstruction import stand_ins
from imdim.reconstruction.edge_features import find_edge_features
from imdim.reconstruction.stand_ins import find_stand_ins, take_off_stand_ins
from imdim.target.target import target_from

PLATE = box(60.0, 40.0, 10.0)
BEVEL = box(3.0, 50.0, 3.0, (30.0, 0.0, 5.0), (0.0, 45.0, 0.0))
RIDGE = box(60.0, 2.0, 2.0, (0.0, 0.0, 5.0), (45.0, 0.0, 0.0))


def found(program):
    return [(s.number, s.kind) for s in find_stand_ins(program)]


def test_bevels_and_flat_cones_stand_for_blends():
    assert found(cut(PLATE, BEVEL)) == [(1, "box")]
    assert found(union(PLATE, box(6.0, 60.0, 10.0, (-10.0, 0.0, 5.0)), box(2.0, 40.0, 2.0, (-7.0, 0.0, 5.0), (0.0, 45.0, 0.0)))) == [
        (2, "box")
    ]
    foot = union(PLATE, cylinder(8.0, 20.0, (0.0, 0.0, 10.0)), cone(9.5, 8.0, 1.5, (0.0, 0.0, 5.75)))
    assert found(foot) == [(2, "cone")]


def test_what_does_not_overshoot_is_looked_at_once(monkeypatch):
    """Cutters that stick out as far as they may do what they did; and no solid is made anew to see what a cutter does."""
    looked: list[object] = []
    monkeypatch.setattr(stand_ins, "overshoot", lambda program, **_: program)
    monkeypatch.setattr(stand_ins, "find_pieces", lambda change, least: looked.append(change) or find_pieces(change, least))
    ridge = union(PLATE, RIDGE)
    assert take_off_stand_ins(ridge, target_from(mesh_of(ridge))) == (ridge, ())
    assert len(looked) == 1
    monkeypatch.setattr(
        stand_ins, "to_manifold", lambda *given: to_manifold(*given) if len(given) == 2 or given[0] in leaves(part) else None
    )
    part = cut(PLATE, box(12.0, 50.0, 12.0, (30.0, 0.0, 5.0), (0.0, 45.0, 0.0)), box(1.0, 1.0, 1.0, (0.0, 0.0, 20.0), (0.0, 45.0, 0.0)))
    assert take_off_stand_ins(part, target_from(mesh_of(part))) == (part, ())
    assert len(looked) == 1


def test_the_zone_of_a_primitive_is_what_changes_without_it(monkeypatch):
    """Except of one that an intersection keeps: without it the rest is whole beyond it."""
    kept = Combine("intersection", cylinder(30.0, 10.0), cone(39.5, 29.5, 10.0))
    foot = union(PLATE, cylinder(8.0, 20.0, (0.0, 0.0, 10.0)), cone(9.5, 8.0, 1.5, (0.0, 0.0, 5.75)))
    within = Combine("intersection", cut(PLATE, BEVEL), cylinder(34.0, 20.0))
    programs = [kept, cut(kept, RIDGE), cut(foot, BEVEL, box(12.0, 50.0, 12.0, (-30.0, 0.0, 5.0), (0.0, 45.0, 0.0))), within]
    told = [[(s.number, s.share) for s in find_stand_ins(program)] for program in programs]
    monkeypatch.setattr(stand_ins, "_keeps_others", lambda *_: True)
    anew = [[(s.number, s.share) for s in find_stand_ins(program)] for program in programs]
    for zones, solids in zip(told, anew, strict=True):
        assert [number for number, _ in zones] == [number for number, _ in solids]
        assert [share for _, share in zones] == pytest.approx([share for _, share in solids])
    assert [number for number, _ in told[2]] == [2, 3]
    assert [number for number, _ in told[3]] == [1]


def test_ridges_ramps_and_seats_stand_for_themselves():
    assert found(union(PLATE, RIDGE)) == []
    assert found(cut(PLATE, box(40.0, 50.0, 20.0, (30.0, 0.0, 12.0), (0.0, 25.0, 0.0)))) == []
    assert found(cut(PLATE, cylinder(1.7, 20.0), cone(1.7, 3.4, 1.7, (0.0, 0.0, 4.15)))) == []
    assert found(cut(PLATE, box(20.0, 2.0, 2.0, (0.0, 0.0, 5.0)))) == []


def test_boxes_become_chamfers_of_the_edges_that_they_cut():
    rail, gusset = box(6.0, 60.0, 10.0, (-10.0, 0.0, 5.0)), box(2.0, 40.0, 2.0, (-7.0, 0.0, 5.0), (0.0, 45.0, 0.0))
    program = cut(union(PLATE, rail, gusset), BEVEL, cylinder(4.0, 20.0, (15.0, 0.0, 0.0)))
    target = target_from(mesh_of(program))
    sharp, chains = take_off_stand_ins(program, target)
    assert [leaf.kind for leaf in leaves(sharp)] == ["box", "box", "cylinder"]
    features = find_edge_features(sharp, chains, target).features
    assert sorted((f.kind, f.sizes, len(f.edges)) for f in features) == [
        ("chamfer", (pytest.approx(2**0.5, rel=1e-2),), 1),
        ("chamfer", (pytest.approx(3 / 2**0.5, rel=1e-2),), 1),
    ]
    assert volume_iou(solid_with_edges(sharp, features), to_manifold(program)) > 1 - 1e-4
    assert take_off_stand_ins(program, target, PASSED) == (program, ())


def test_a_fit_of_a_bevelled_bar_has_a_chamfer():
    corners = ((-30.0, -20.0), (30.0, -20.0), (30.0, 0.0), (0.0, 0.0), (0.0, 20.0), (-30.0, 20.0))
    angle = Primitive("extrude", (10.0,), outline=Outline((tuple((x, y, 0.0) for x, y in corners),)))
    bevel = box(4.0, 60.0, 4.0, (-30.0, 0.0, 5.0), (0.0, 45.0, 0.0))
    result = imdim.reconstruct(mesh_of(cut(angle, bevel)))
    assert not list(find_stand_ins(result.program))
    # of the two boxes in one line the one that reaches all along it has the edge
    assert [leaf.kind for leaf in leaves(result.program)] == ["box", "box"]
    assert [len(f.edges) for f in result.edges] == [1]
    assert volume_iou(solid_with_edges(result.program, result.edges), to_manifold(cut(angle, bevel))) > 1 - 1e-4
