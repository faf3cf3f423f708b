"""Blends against closed forms: prismatoids, Pappus, and sections integrated over their heights."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from imdim.geometry.blended_edge import Track
from imdim.geometry.edge_solids import blend_solids, with_edges
from imdim.geometry.edges import FoundEdges, NearbyEdges, find_edges, has_room
from imdim.geometry.lowering import lower
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.program.edges import EdgeFeature, Face
from imdim.program.outline import Outline, circle
from imdim.program.tree import Combine, Primitive, Program

BOX = Primitive("box", (10.0, 20.0, 30.0))
RIM = tuple((Face(0, "+z"), Face(0, side)) for side in ("+x", "-x", "+y", "-y"))
QUARTER = math.tan(math.pi / 8)  # bulge


def volume(program: Program, *features: EdgeFeature, segments: int = 1024) -> float:
    return to_manifold(with_edges(program, features), segments).volume()


def rims(leaf: int, curves: int, loop: int = 0) -> tuple[tuple[Face, Face], ...]:
    return tuple((Face(leaf, "+z"), Face(leaf, f"wall[{loop}][{k}]")) for k in range(curves))


def test_a_chamfered_rim_is_a_frustum() -> None:
    frustum = (10 * 20 + 4 * 9 * 19 + 8 * 18) / 6  # a prismatoid one high
    assert volume(BOX, EdgeFeature("chamfer", (1.0,), RIM)) == pytest.approx(10 * 20 * 29 + frustum, rel=1e-9)


def test_two_distances_go_along_the_faces_in_their_order() -> None:
    # one edge: a prism of the two distances
    assert volume(BOX, EdgeFeature("chamfer", (1.0, 3.0), RIM[:1])) == pytest.approx(6000 - 20 * 1.5, rel=1e-9)
    corners = to_trimesh(to_manifold(with_edges(BOX, [EdgeFeature("chamfer", (1.0, 3.0), RIM[:1])]))).vertices
    # 1 along the face on top, 3 along the side
    assert corners[corners[:, 2] > 14.999, 0].max() == pytest.approx(4.0)
    assert corners[corners[:, 0] > 4.999, 2].max() == pytest.approx(12.0)


def test_a_fillet_takes_off_what_its_arc_leaves() -> None:
    assert volume(BOX, EdgeFeature("fillet", (2.0,), RIM[:1])) == pytest.approx(6000 - 20 * (4 - math.pi), rel=1e-6)


def test_a_fillet_of_an_edge_of_any_angle_touches_both_faces() -> None:
    # a regular triangle of side 10, 4 high: a corner of 60 degrees loses r^2 (cot 30 - pi / 3)
    corners = tuple(
        (10 / math.sqrt(3) * math.cos(a), 10 / math.sqrt(3) * math.sin(a), 0.0) for a in (0, 2.0943951023931953, 4.1887902047863905)
    )
    prism = Primitive("extrude", (4.0,), outline=Outline((corners,)))
    feature = EdgeFeature("fillet", (1.0,), ((Face(0, "wall[0][0]"), Face(0, "wall[0][1]")),))
    lost = 4 * (1 / math.tan(math.pi / 6) - math.pi / 3)
    assert volume(prism, feature) == pytest.approx(25 * math.sqrt(3) * 4 - lost, rel=1e-6)


def test_round_edges() -> None:
    shaft = Primitive("cylinder", (5.0, 10.0))
    chamfer = EdgeFeature("chamfer", (1.0,), ((Face(0, "+z"), Face(0, "side")),))
    assert volume(shaft, chamfer) == pytest.approx(math.pi * 25 * 9 + math.pi / 3 * (25 + 16 + 20), rel=1e-4)
    hole = Combine("difference", Primitive("box", (40.0, 40.0, 5.0)), Primitive("cylinder", (5.0, 7.0)))
    mouth = EdgeFeature("chamfer", (1.0,), ((Face(0, "+z"), Face(1, "side")),))
    widened = math.pi / 3 * (36 + 25 + 30) - 25 * math.pi
    assert volume(hole, mouth) == pytest.approx(8000 - 125 * math.pi - widened, rel=1e-5)


def test_a_blend_all_around_begins_where_its_circle_does() -> None:
    shaft = Primitive("cylinder", (6.0, 30.0))
    (piece,) = blend_solids(shaft, [EdgeFeature("chamfer", (1.0,), ((Face(0, "+z"), Face(0, "side")),))]).pieces
    assert isinstance(piece.solid, Primitive)
    assert piece.solid.rotation == (0.0, 0.0, 0.0)
    assert piece.solid.size == (360.0,)


def test_a_concave_edge_is_filled() -> None:
    plate, boss = Primitive("box", (40.0, 40.0, 5.0)), Primitive("cylinder", (8.0, 12.0), (0.0, 0.0, 8.0))
    foot = EdgeFeature("fillet", (2.0,), ((Face(0, "+z"), Face(1, "side")),))
    program = Combine("union", plate, boss)
    filled = 2 * math.pi * quad(lambda x: (8 + x) * (2 - math.sqrt(4 - (2 - x) ** 2)), 0, 2)[0]
    assert volume(program, foot) - volume(program) == pytest.approx(filled, rel=1e-3)


def test_blends_mitre_at_corners_of_both_senses() -> None:
    bent = Outline((((0, 0, 0), (20, 0, 0), (20, 10, 0), (10, 10, 0), (10, 20, 0), (0, 20, 0)),)).shift(-10, -10)
    rim = EdgeFeature("chamfer", (1.0,), rims(0, 6))
    # the section t below the top: offset inward, with five corners out and one in
    left = quad(lambda t: 300 - 80 * t + 4 * t * t, 0, 1)[0]
    assert volume(Primitive("extrude", (5.0,), outline=bent), rim) == pytest.approx(1200 + left, rel=1e-8)


def test_a_rim_of_lines_and_arcs_is_one_solid() -> None:
    loop = ((-8, -10, 0), (8, -10, QUARTER), (10, -8, 0), (10, 8, QUARTER), (8, 10, 0), (-8, 10, QUARTER), (-10, 8, 0), (-10, -8, QUARTER))
    plate = Primitive("extrude", (5.0,), outline=Outline((tuple((float(x), float(y), b) for x, y, b in loop),)))
    rim = EdgeFeature("fillet", (1.0,), rims(0, 8))
    blends = blend_solids(plate, [rim])
    assert len(blends.pieces) == 8
    assert not blends.missing

    def area(inset: float) -> float:
        return (20 - 2 * inset) ** 2 - (4 - math.pi) * (2 - inset) ** 2

    solid = to_manifold(with_edges(plate, [rim]), 512)
    assert solid.volume() == pytest.approx(4 * area(0) + quad(lambda z: area(1 - math.sqrt(1 - z * z)), 0, 1)[0], rel=2e-5)
    assert (solid.genus(), len(solid.decompose())) == (0, 1)


def test_an_edge_ends_where_another_part_stands_on_it() -> None:
    tower = Primitive("box", (4.0, 6.0, 10.0), (5.0, 0.0, 15.0))
    chamfer = EdgeFeature("chamfer", (1.0,), RIM[:1])
    # the tower covers the edge's middle, 6 of its 20
    blends = blend_solids(Combine("union", BOX, tower), [chamfer])
    assert len(blends.pieces) == 2
    assert volume(Combine("union", BOX, tower), chamfer) == pytest.approx(volume(Combine("union", BOX, tower)) - 14 * 0.5, rel=1e-6)


def test_half_circles_of_one_loop_share_its_rim() -> None:
    disc = Primitive("extrude", (4.0,), outline=Outline((circle(5.0),)))
    one, two = rims(0, 2)
    whole = volume(disc, EdgeFeature("chamfer", (1.0,), (one, two)))
    assert whole == pytest.approx(math.pi * 25 * 3 + math.pi / 3 * (25 + 16 + 20), rel=1e-4)
    lost = volume(disc) - whole
    assert volume(disc) - volume(disc, EdgeFeature("chamfer", (1.0,), (one,))) == pytest.approx(lost / 2, rel=1e-4)


def test_faces_that_meet_in_no_edge_are_told() -> None:
    apart = EdgeFeature("chamfer", (1.0,), ((Face(0, "+z"), Face(0, "-z")), (Face(0, "+z"), Face(0, "+x"))))
    assert blend_solids(BOX, [apart]).missing == ((0, 0),)
    covered = Combine("union", BOX, Primitive("box", (30.0, 40.0, 10.0), (0.0, 0.0, 14.0)))
    assert blend_solids(covered, [EdgeFeature("chamfer", (1.0,), RIM[:1])]).missing == ((0, 0),)


def test_places_of_edges_are_told() -> None:
    """The front upper edge of a box on which a tower stands, and the mouth of a countersunk hole, whose first face is the cone."""
    tower = Primitive("box", (4.0, 6.0, 10.0), (5.0, 0.0, 15.0))
    found = find_edges(Combine("union", BOX, tower), [EdgeFeature("chamfer", (1.0, 2.0), ((Face(0, "+x"), Face(0, "+z")),))])
    ends = sorted(tuple(sorted(float(y) for y in edge.points(3)[[0, -1], 1])) for edge in found.edges)
    assert ends == [pytest.approx((-10, -3)), pytest.approx((3, 10))]
    for edge in found.edges:
        assert (edge.feature, edge.edge, edge.sizes) == (0, 0, (1.0, 2.0))
        assert edge.points(3)[:, [0, 2]] == pytest.approx(np.tile([5.0, 15.0], (3, 1)))
        assert edge.first_along == pytest.approx([0, 0, -1])
        assert edge.distances(np.array([[5.0, 0.0, 15.0], [5.0, 11.0, 15.0], [5.0, 20.0, 11.0]]))[0] == pytest.approx(3.0)
    sunk = Combine("difference", BOX, Primitive("cone", (1.0, 3.0, 2.0), (0.0, 0.0, 14.0)))
    (mouth,) = find_edges(sunk, [EdgeFeature("fillet", (0.5,), ((Face(1, "side"), Face(0, "+z")),))]).edges
    assert np.hypot(*mouth.points(5)[:, :2].T) == pytest.approx(3.0)
    middle = mouth.points(3)[1]
    # down into the cone, which narrows by one in one
    assert mouth.first_along == pytest.approx([*(-middle[:2] / 3 / math.sqrt(2)), -1 / math.sqrt(2)])
    assert mouth.distances(np.array([[0.0, 4.0, 15.0], [0.0, -3.0, 17.0]])) == pytest.approx([1.0, 2.0])


def test_an_arc_ends_where_its_wall_does() -> None:
    disc = Primitive("extrude", (4.0,), outline=Outline((circle(5.0),)))
    (half,) = find_edges(disc, [EdgeFeature("chamfer", (1.0,), rims(0, 1))]).edges
    middle = half.points(3)[1]
    assert half.distances(np.array([middle, half.end(0), half.end(1)])) == pytest.approx([0, 0, 0], abs=1e-9)
    # across the centre, the nearest points are the ends
    assert half.distances(middle[None] * [-1, -1, 1]) == pytest.approx([5 * math.sqrt(2)])


def test_it_does_not_matter_how_the_program_is_placed() -> None:
    def placed(p: Primitive) -> Primitive:
        return Primitive(p.kind, p.size, (100.0, -7.0, 3.0), (20.0, 30.0, 40.0), p.outline)

    rim = EdgeFeature("chamfer", (1.0,), RIM)
    assert volume(placed(BOX), rim) == pytest.approx(volume(BOX, rim), rel=1e-9)


def test_blends_that_are_larger_than_the_part_or_cannot_be_told_are_none() -> None:
    for size in (1e-9, 1e9):
        assert blend_solids(BOX, [EdgeFeature("chamfer", (size,), RIM)]).missing == ((0, 0), (0, 1), (0, 2), (0, 3))


def test_room_for_a_blend_is_what_its_faces_leave() -> None:
    thin = Primitive("box", (10.0, 20.0, 2.0))
    (narrow,) = find_edges(thin, [EdgeFeature("chamfer", (3.0,), RIM[:1])]).edges
    (fits,) = find_edges(thin, [EdgeFeature("chamfer", (1.5,), RIM[:1])]).edges
    assert (has_room(lower(thin), narrow), has_room(lower(thin), fits)) == (False, True)


def test_an_edge_is_of_the_face_that_reaches_it_and_not_of_one_in_its_plane() -> None:
    # a comb: the walls on top of its two teeth lie in one plane
    comb = ((0, 0), (30, 0), (30, 10), (20, 10), (20, 4), (10, 4), (10, 10), (0, 10))
    leaf = Primitive("extrude", (5.0,), outline=Outline((tuple((float(x), float(y), 0.0) for x, y in comb),)).shift(-15, -5))
    own, other = ((Face(0, f"wall[0][{top}]"), Face(0, "wall[0][1]")) for top in (2, 6))
    assert blend_solids(leaf, [EdgeFeature("chamfer", (1.0,), (own, other))]).missing == ((0, 1),)


def test_edges_of_a_program_that_differs_by_a_little_are_those_that_looking_for_all_finds() -> None:
    block = Primitive("extrude", (10.0,), outline=Outline((((0.0, 0.0, 0.0), (30.0, 0.0, 0.0), (30.0, 12.0, 0.0), (0.0, 20.0, 0.0)),)))
    post = Primitive("box", (6.0, 6.0, 10.0), (12.0, 3.0, 5.0))
    program = Combine("union", block, post)
    rim = EdgeFeature("chamfer", (0.5,), tuple((Face(0, "+z"), Face(0, f"wall[0][{k}]")) for k in range(4)))
    foot = EdgeFeature("fillet", (0.4,), tuple((Face(0, "+z"), Face(1, side)) for side in ("+x", "-x", "+y", "-y")))
    near = NearbyEdges(program, [rim, foot])
    assert len(near.found.edges) >= 8
    wider = Outline((((0.0, 0.0, 0.0), (30.02, 0.0, 0.0), (30.02, 12.0, 0.0), (0.0, 20.0, 0.0)),))
    moved = [
        replace(program, right=replace(post, center=(12.01, 3.0, 5.0))),
        replace(program, right=replace(post, size=(6.01, 6.0, 10.0))),
        replace(program, left=replace(block, size=(10.01,))),
        replace(program, left=replace(block, outline=wider)),
    ]
    for other in moved:
        assert _are_same(near.at(other, [rim, foot]), find_edges(other, [rim, foot]))
        assert not _are_same(near.found, find_edges(other, [rim, foot]))
    larger = replace(rim, sizes=(0.6,))
    assert _are_same(near.at(program, [larger, foot]), find_edges(program, [larger, foot]))


def _are_same(one: FoundEdges, two: FoundEdges) -> bool:
    told = [[(e.feature, e.edge, e.sizes, e.goes_on) for e in found.edges] for found in (one, two)]
    ends = [np.array([e.points(2) for e in found.edges]) for found in (one, two)]
    return one.missing == two.missing and told[0] == told[1] and np.allclose(*ends, atol=1e-5)


@pytest.mark.parametrize("radius", [0.0, 7.0])
def test_places_around_a_track_are_those_of_each_way_alone(radius: float) -> None:
    frame = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    track = Track(np.array([1.0, -2.0, 0.5]), frame, np.array([[1.0, 0.2], [0.0, 1.0]]), radius)
    t, ways = np.linspace(0.1, 5.0, 17), 1e-3 * track.quadrants
    each = [track.at(t, np.broadcast_to(way, (len(t), 2))) for way in ways]
    assert track.around(t, ways).tobytes() == np.concatenate(each).tobytes()
