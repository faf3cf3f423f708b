"""Blends of a mesh come back as edge features of the program that made it; those that belong nowhere are told."""

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.deadlines import PASSED

from imdim.delivery.finish import finish
from imdim.detection.blends import find_chains
from imdim.geometry.edge_solids import solid_with_edges
from imdim.geometry.edges import find_edges
from imdim.geometry.solid import mesh_to_manifold, to_manifold, to_trimesh, volume_iou
from imdim.program.cost import count
from imdim.program.edges import EdgeFeature, Face
from imdim.program.outline import Outline
from imdim.program.tree import Combine, Primitive, Program
from imdim.reconstruction.edge_features import SetAside, find_edge_features, set_edges_aside
from imdim.reconstruction.pipeline import reconstruct_best
from imdim.target.target import Target, target_from

ANGLE = Outline((((0.0, 0.0, 0.0), (40.0, 0.0, 0.0), (40.0, 8.0, 0.0), (8.0, 8.0, 0.0), (8.0, 30.0, 0.0), (0.0, 30.0, 0.0)),))
BRACKET = Combine(
    "difference",
    Primitive("extrude", (20.0,), outline=ANGLE.shift(-20, -15)),
    Primitive("cylinder", (3.0, 30.0), (10.0, -11.0, 0.0), (90.0, 0.0, 0.0)),
)
WALLS = [Face(0, f"wall[0][{k}]") for k in range(6)]
RIMS = tuple((Face(0, end), wall) for end in ("+z", "-z") for wall in WALLS)


def target_of(program: Program, *features: EdgeFeature) -> Target:
    return target_from(to_trimesh(solid_with_edges(program, features, 96)))


@pytest.mark.parametrize("feature", [EdgeFeature("chamfer", (0.8,), RIMS), EdgeFeature("fillet", (1.0,), RIMS[:6])], ids=str)
def test_edges_of_the_program_that_made_a_part_are_found(feature: EdgeFeature) -> None:
    target = target_of(BRACKET, feature)
    sharp, chains, _, kept = set_edges_aside(target)
    assert kept == ()
    assert sharp.mesh is not None
    assert volume_iou(mesh_to_manifold(sharp.mesh), to_manifold(BRACKET, 96)) > 0.9995
    found = find_edge_features(BRACKET, chains, target)
    assert not found.left_out
    (back,) = found.features
    assert (back.kind, back.sizes) == (feature.kind, pytest.approx(feature.sizes))
    assert {frozenset(edge) for edge in back.edges} == {frozenset(edge) for edge in feature.edges}
    assert target.mesh is not None
    assert volume_iou(solid_with_edges(BRACKET, found.features, 96), mesh_to_manifold(target.mesh)) > 0.9998


def test_a_fit_gives_the_sharp_program_and_its_chains() -> None:
    target = target_of(BRACKET, EdgeFeature("chamfer", (0.8,), RIMS))
    last = reconstruct_best(target)
    assert count(last.program).primitives <= 2
    assert [(f.kind, f.sizes) for f in last.edges] == [("chamfer", (0.8,))]
    assert target.mesh is not None
    assert volume_iou(solid_with_edges(last.program, last.edges, 96), mesh_to_manifold(target.mesh)) > 0.9995


def test_an_edge_that_faces_of_two_primitives_make_is_named_once() -> None:
    feature = EdgeFeature("chamfer", (0.8,), RIMS)
    target = target_of(BRACKET, feature)
    within = Combine("intersection", BRACKET, Primitive("box", (50.0, 40.0, 20.0)))  # its ends lie in the planes of the bracket's
    found = find_edge_features(within, set_edges_aside(target).chains, target)
    assert [len(f.edges) for f in found.features] == [len(RIMS)]


def test_of_faces_on_one_surface_that_names_an_edge_which_reaches_it() -> None:
    """A foot is as wide as the post on it: its side has no part in the post's rim, and leaves it as soon as one of the two is wider."""
    foot, post = Primitive("cylinder", (12.0, 4.0)), Primitive("cylinder", (12.0, 20.0), (0.0, 0.0, 12.0))
    cutter = Primitive("box", (60.0, 60.0, 20.0), (0.0, 0.0, 30.0))
    program = Combine("difference", Combine("union", foot, post), cutter)
    rim = EdgeFeature("chamfer", (0.8,), ((Face(2, "-z"), Face(1, "side")),))
    target = target_of(program, rim)
    found = find_edge_features(program, set_edges_aside(target).chains, target)
    assert {face for f in found.features for edge in f.edges for face in edge} == set(rim.edges[0])


def test_where_faces_meet_for_less_than_half_a_size_is_no_edge() -> None:
    rim = EdgeFeature("chamfer", (0.8,), tuple((Face(0, "+z"), Face(0, side)) for side in ("+x", "-x", "+y", "-y")))
    target = target_of(Primitive("box", (40.0, 30.0, 6.0)), rim)
    body, tooth = Primitive("box", (30.0, 30.0, 6.0), (-5.0, 0.0, 0.0)), Primitive("box", (12.0, 0.3, 6.0), (14.0, 0.0, 0.0))
    found = find_edge_features(Combine("union", body, tooth), set_edges_aside(target).chains, target)
    assert {face.leaf for f in found.features for edge in f.edges for face in edge} == {0}


def test_what_goes_on_beyond_an_edge_by_little_is_no_second_one() -> None:
    """A wall ends where a corner's arc touches it; a box in whose face it lies goes on, and leaves the arc by a hair at first."""
    x, y, radius, bend = 30.0, 20.0, 8.0, math.tan(math.pi / 8)
    a, b = x - radius, y - radius
    ends = [(-a, -y), (a, -y), (x, -b), (x, b), (a, y), (-a, y), (-x, b), (-x, -b)]
    plate = Primitive("extrude", (6.0,), outline=Outline((tuple((u, v, bend if i % 2 else 0.0) for i, (u, v) in enumerate(ends)),)))
    rim = EdgeFeature("chamfer", (1.0,), tuple((Face(0, "+z"), Face(0, f"wall[0][{k}]")) for k in range(len(ends))))
    target = target_of(plate, rim)
    within = Combine("intersection", plate, Primitive("box", (2 * x, 2 * y, 20.0)))
    found = find_edge_features(within, set_edges_aside(target).chains, target)
    assert [len(f.edges) for f in found.features] == [len(ends)]


def test_an_edge_that_follows_a_third_of_a_blend_is_none() -> None:
    rim = EdgeFeature("chamfer", (0.8,), tuple((Face(0, "+z"), Face(0, side)) for side in ("+x", "-x", "+y", "-y")))
    target = target_of(Primitive("box", (40.0, 30.0, 6.0)), rim)
    body, tooth = Primitive("box", (39.0, 30.0, 6.0), (-0.5, 0.0, 0.0)), Primitive("box", (12.0, 10.0, 6.0), (14.0, 0.0, 0.0))
    found = find_edge_features(Combine("union", body, tooth), set_edges_aside(target).chains, target)
    assert {face.leaf for f in found.features for edge in f.edges for face in edge} == {0}


def test_delivery_leaves_the_faces_whose_edges_are_blended() -> None:
    inner = Combine("intersection", replace(BRACKET.left, size=(20.0,)), Primitive("cylinder", (60.0, 20.0)))
    feature = EdgeFeature("chamfer", (0.8,), RIMS)
    assert not find_edges(inner, [feature]).missing
    done = finish(inner, edges=[feature])
    assert not find_edges(done.program, done.edges).missing
    assert not find_edges(finish(inner).program, [feature]).edges  # without them the plate would reach through the cylinder


def test_chains_beside_no_face_of_the_program_are_told() -> None:
    target = target_of(BRACKET, EdgeFeature("chamfer", (0.8,), RIMS))
    chains = set_edges_aside(target).chains
    elsewhere = Primitive("box", (5.0, 5.0, 5.0), (3.0, 2.0, 1.0))
    found = find_edge_features(elsewhere, chains, target)
    assert found.features == ()
    assert found.left_out == (f"{len(chains)} of {len(chains)} chains of chamfer 0.8 follow no edges of the program: these are sharp",)


def test_blends_where_the_target_has_none_are_not_added() -> None:
    chains = set_edges_aside(target_of(BRACKET, EdgeFeature("chamfer", (0.8,), RIMS))).chains
    assert find_edge_features(BRACKET, chains, target_of(BRACKET)).features == ()


def test_clouds_and_open_meshes_stay_as_they_are() -> None:
    target = target_of(BRACKET, EdgeFeature("chamfer", (0.8,), RIMS))
    cloud = target_from(np.asarray(target.points))
    assert set_edges_aside(cloud) == SetAside(cloud)
    assert find_edge_features(BRACKET, (), target).features == ()


def test_without_the_language_of_outlines_nothing_is_set_aside() -> None:
    from imdim.reconstruction.config import Settings

    plate = Primitive("box", (20.0, 12.0, 4.0))
    rim = EdgeFeature("chamfer", (0.5,), tuple((Face(0, "+z"), Face(0, s)) for s in ("+x", "-x", "+y", "-y")))
    assert reconstruct_best(target_of(plate, rim), Settings(language="csg")).edges == ()
    assert len(find_chains(to_trimesh(solid_with_edges(plate, [rim])))) == 1


def test_two_distances_keep_their_sides() -> None:
    plate = Primitive("box", (20.0, 12.0, 4.0))
    rim = EdgeFeature("chamfer", (0.5, 1.0), tuple((Face(0, "+z"), Face(0, s)) for s in ("+x", "-x", "+y", "-y")))
    target = target_of(plate, rim)
    (found,) = find_edge_features(plate, set_edges_aside(target).chains, target).features
    assert found.sizes == pytest.approx((0.5, 1.0))
    assert all(one.name == "+z" for one, _ in found.edges)
    assert math.isclose(to_manifold(plate).volume() - solid_with_edges(plate, [found]).volume(), 240 * 4 - target.mesh.volume, rel_tol=1e-3)


def test_without_time_for_a_second_look_edges_stay_on() -> None:
    target = target_of(BRACKET, EdgeFeature("chamfer", (0.8,), RIMS))
    aside = set_edges_aside(target, PASSED)
    assert aside.target is target
    assert (aside.chains, aside.kept) == ((), ())
    assert aside.patches
