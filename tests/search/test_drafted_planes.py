"""Walls that lean by one angle: which are drawn together, on which side of them an outline may lie, and that it comes back."""

import math

import numpy as np
import pytest
from tests.known_programs import ANGLE, ROUNDED
from tests.planted import box, cone, cut, cylinder, mesh_of, union

from imdim.detection.mesh_surfaces import detect_patches
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.outline import Loop, Outline, circle
from imdim.program.tree import Primitive, Program, leaves
from imdim.reconstruction.config import Settings
from imdim.reconstruction.pipeline import reconstruct
from imdim.search.arrangement import ArrangementConfig, arrange
from imdim.search.drafted_planes import DraftedPlane, _check_arcs, find_drafted_planes
from imdim.search.outline_families import find_planes
from imdim.search.outline_kernels import LEFT, NEITHER, RIGHT, Graph, _close_region
from imdim.target.target import target_from


def draft(h: float, degrees: float, *loops: Loop, center=(0.0, 0.0, 0.0), rotation=(0.0, 0.0, 0.0)) -> Primitive:
    return Primitive("drafted", (h, degrees), center, rotation, Outline(loops))


def scaled(loop, factor: float) -> Loop:
    return tuple((x * factor, y * factor, b) for x, y, b in loop)


def planes_of(program: Program) -> list[DraftedPlane]:
    """The arrangements of the faces of a solid's mesh that lean."""
    mesh = mesh_of(program)
    patches = detect_patches(mesh)
    found = arrange([p.surface for p in patches], [p.area for p in patches], mesh.bounds, ArrangementConfig())
    assert not any(isinstance(plane, DraftedPlane) for plane in find_planes(found, drafted=False))
    return list(find_drafted_planes(found, 90))


def rectangle(width: float, height: float) -> Loop:
    x, y = width / 2, height / 2
    return ((-x, -y, 0.0), (x, -y, 0.0), (x, y, 0.0), (-x, y, 0.0))


def test_walls_that_lean_alike_are_drawn_for_both_ways():
    up, down = planes_of(draft(12.0, 8.0, rectangle(40, 24)))
    assert (up.narrows, down.narrows) == (True, False)
    assert math.degrees(math.atan(up.lean.tangent)) == pytest.approx(8.0, abs=1e-3)
    assert len(up.walls.offsets) == 4
    inner = up.segments.wall >= 0
    assert set(up.sides[inner].tolist()) == {LEFT, RIGHT}
    assert set(up.sides[~inner].tolist()) <= {NEITHER}
    assert (up.sides[inner] == -down.sides[inner]).all()


@pytest.mark.parametrize(
    "upright",
    [box(40, 24, 12), union(box(40, 24, 12), cylinder(8, 30)), draft(12.0, 45.0, rectangle(60, 50))],
    ids=["box", "boss", "roof"],
)
def test_upright_walls_and_roofs_are_no_draft(upright):
    assert planes_of(upright) == []


def test_a_ring_between_walls_that_lean_one_way_is_filled_or_gone():
    """Of a tray the outer and the inner wall both lean outward: what lies between has one of them on its wrong side."""
    none = np.empty(0, np.int64)
    # face 0 is the ring, 1 the pocket, 2 what is outside
    faces = np.array([[0, 2], [1, 0]])
    graph = Graph(none, np.empty(0, bool), none, faces, faces, np.ones(2), none, none, np.array([LEFT, LEFT], np.int8))
    for adds, wanted in ((True, [True, True, False]), (False, [False, False, False])):
        region = np.array([True, False, False])
        assert _close_region(graph, region, adds)
        assert region.tolist() == wanted
    open_one = graph._replace(sides=np.array([NEITHER, LEFT], np.int8))
    assert not _close_region(open_one, np.array([True, False, False]), True)


PLANTED = {
    "block on a plate": (union(box(60, 40, 6), draft(18.0, 8.0, rectangle(40, 24), center=(0, 0, 12))), 2),
    "angle with a hole": (cut(draft(15.0, 6.0, scaled(ANGLE, 40)), cylinder(3, 40, (-10, -10, 0))), 2),
    "rounded boss upside down": (draft(10.0, 5.0, scaled(ROUNDED, 60), rotation=(180, 0, 0)), 1),
    "pockets of a mould": (
        cut(
            box(100, 60, 25, (0, 0, -12.5)),
            *(draft(18.0, 10.0, rectangle(36, 40), center=(x, 0, -9), rotation=(180, 0, 0)) for x in (-25, 25)),
        ),
        3,
    ),
    "hole that widens": (draft(10.0, 4.0, rectangle(50, 30), circle(5.0, 8.0, 2.0)), 1),
    "tray": (
        cut(
            draft(20.0, 5.0, scaled(ROUNDED, 80), rotation=(180, 0, 0)),
            draft(17.0, 5.0, scaled(ROUNDED, 74), center=(0, 0, 1.5), rotation=(180, 0, 0)),
        ),
        2,
    ),
}


@pytest.mark.parametrize("name", PLANTED)
def test_what_is_drafted_comes_back(name):
    truth, features = PLANTED[name]
    *_, last = reconstruct(target_from(mesh_of(truth)), Settings(), np.random.default_rng(0))
    found = list(leaves(last.program))
    assert volume_iou(to_manifold(last.program), to_manifold(truth)) > 0.9995
    assert len(found) == features
    drafted = [leaf for leaf in found if leaf.kind == "drafted"]
    wanted = sorted({leaf.size for leaf in leaves(truth) if leaf.kind == "drafted"})
    np.testing.assert_allclose(sorted({leaf.size for leaf in drafted}), wanted)


def test_cones_and_arcs_in_a_row_are_left_to_others():
    """Holes that get narrower in one plane are cones; a loop of arcs would be left with arcs that touch nothing by the next edit."""
    row = [cone(6, 4, 20, (x, 0, 0)) for x in (-20, 0, 20)]
    *_, last = reconstruct(target_from(mesh_of(cut(box(70, 30, 20), *row))), Settings(), np.random.default_rng(0))
    assert sorted(leaf.kind for leaf in leaves(last.program)) == ["box", "cone", "cone", "cone"]
    quarter = math.tan(math.pi / 8)
    drop = Outline((((0.0, -10.0, 0.0), (10.0, -10.0, quarter), (20.0, 0.0, 1.0), (0.0, 0.0, 0.0)),))
    with pytest.raises(ValueError, match="its arcs lie between them"):
        _check_arcs(drop)
    _check_arcs(Outline((scaled(ROUNDED, 1.0), circle(0.1))))
