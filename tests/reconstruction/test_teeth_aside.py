"""Teeth of rims are set aside before the search and come back as one tooth, repeated: wherever they lie, and nothing else does."""

import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from tests.planted import box, cut, cylinder, union

from imdim.geometry.solid import mesh_to_manifold, to_manifold, to_trimesh, volume_iou
from imdim.program.outline import Outline
from imdim.program.tree import Primitive, leaves
from imdim.reconstruction.config import Settings
from imdim.reconstruction.pipeline import reconstruct_best
from imdim.reconstruction.teeth_aside import put_teeth_on, set_teeth_aside
from imdim.target.target import target_from

TOOTH = ((17.0, -2.6), (20.2, -2.0), (23.0, -0.9), (23.0, 0.9), (20.2, 2.0), (17.0, 2.6))
INNER = tuple((41.0 - x, y) for x, y in TOOTH[::-1])  # from a ring of 23 inwards


def teeth(count, tooth=TOOTH, turned=0.0, kept=None, height=10.0, z=0.0):
    """Extrusions on a circle, all or the first few that are `kept`."""
    for k in range(count if kept is None else kept):
        angle = math.radians(turned + 360 * k / count)
        c, s = math.cos(angle), math.sin(angle)
        loop = tuple((c * x - s * y, s * x + c * y, 0.0) for x, y in tooth)
        yield Primitive("extrude", (height,), (0.0, 0.0, z), outline=Outline((loop,)))


def gear(count, tooth=TOOTH, root=18.0, bore=4.0, turned=0.0, kept=None):
    """A gear of a height of 10 on the xy plane, as exact as its facets."""
    return cut(union(cylinder(root, 10), *teeth(count, tooth, turned, kept)), cylinder(bore, 20))


def set_aside(solid):
    return set_teeth_aside(target_from(to_trimesh(solid)))


@pytest.mark.parametrize("count", [8, 20, 31])
@pytest.mark.parametrize(
    "place", [((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), ((30.0, -7.0, 4.0), (90.0, 0.0, 0.0)), ((1.0, 2.0, 3.0), (20.0, 35.0, 50.0))]
)
def test_a_gear_is_a_disc_and_a_tooth(count, place):
    tooth = TOOTH if count < 24 else tuple((x, y / 2) for x, y in TOOTH)
    center, rotation = place
    solid = to_manifold(gear(count, tooth)).rotate(rotation).translate(center)
    bare = set_aside(solid)
    disc = cut(Primitive("cylinder", (18.0, 10.0), center, rotation), Primitive("cylinder", (4.0, 20.0), center, rotation))
    assert volume_iou(mesh_to_manifold(bare.target.mesh), to_manifold(disc)) > 1 - 3e-3
    toothed = put_teeth_on(disc, bare.rims)
    assert volume_iou(to_manifold(toothed), solid) > 1 - 3e-4
    own = [leaf for leaf in leaves(toothed) if leaf.outline]
    assert len(own) == count
    assert len({leaf.outline for leaf in own}) == 1


def test_the_first_tooth_is_at_a_round_angle():
    solid = to_manifold(gear(20, turned=4.5))
    (rim,) = set_aside(solid).rims
    first = list(leaves(put_teeth_on(cylinder(18, 10), (rim,))))[1]
    assert first.rotation[2] % 18 == pytest.approx(4.5, abs=1e-9)


def test_a_ring_with_teeth_inside_is_one_too():
    solid = to_manifold(union(cut(cylinder(30, 10), cylinder(23, 20)), *teeth(16, INNER)))
    bare = set_aside(solid)
    ring = cut(cylinder(30, 10), cylinder(23, 20))
    assert volume_iou(mesh_to_manifold(bare.target.mesh), to_manifold(ring)) > 1 - 3e-3
    assert volume_iou(to_manifold(put_teeth_on(ring, bare.rims)), solid) > 1 - 3e-4


def test_teeth_that_something_cuts_stay_and_the_others_do_not():
    notched = to_manifold(cut(gear(20), box(6, 9, 20, (22, 0, 0))))
    (rim,) = set_aside(notched).rims
    assert len(rim.places) in (17, 18, 19)
    assert rim.count == 20
    (half,) = set_aside(to_manifold(gear(40, tuple((x, y / 2) for x, y in TOOTH), kept=15))).rims
    assert (half.count, len(half.places)) == (40, 15)


def test_a_flange_keeps_what_stands_beside_the_teeth():
    solid = to_manifold(union(cylinder(25, 2, (0, 0, -6)), gear(20)))
    bare = set_aside(solid)
    assert volume_iou(mesh_to_manifold(bare.target.mesh), to_manifold(union(cylinder(25, 2, (0, 0, -6)), gear(20, kept=0)))) > 1 - 3e-3
    (rim,) = bare.rims
    assert sorted(rim.point[2] + rim.frame[2, 2] * level for level in (rim.low, rim.high)) == pytest.approx([-5, 5])


def test_teeth_begin_where_no_hole_is():
    holes = [cylinder(1.2, 20, (16.2 * math.cos(a), 16.2 * math.sin(a), 0)) for a in np.radians([0, 90, 180, 270])]
    solid = to_manifold(cut(gear(20), *holes))
    bare = set_aside(solid)
    disc = cut(cylinder(18, 10), cylinder(4, 20), *holes)
    assert volume_iou(to_manifold(put_teeth_on(disc, bare.rims)), solid) > 1 - 3e-4


@pytest.mark.parametrize(
    "solid",
    [
        to_manifold(cylinder(20, 10), 24),  # whose facets are no teeth
        to_manifold(gear(7)),
        to_manifold(
            cut(cylinder(20, 10), *(cylinder(3, 20, (20 * math.cos(a), 20 * math.sin(a), 0)) for a in np.radians(range(0, 360, 30))))
        ),
        to_manifold(
            cut(
                cylinder(20, 10),
                *(
                    Primitive("box", (1.5, 9, 20), (12 * math.cos(a), 12 * math.sin(a), 0), (0, 0, math.degrees(a) + 90))
                    for a in np.radians(range(0, 360, 30))
                ),
            )
        ),  # a grating
    ],
)
def test_other_parts_are_left(solid):
    bare = set_aside(solid)
    assert bare.rims == ()
    assert volume_iou(mesh_to_manifold(bare.target.mesh), solid) > 1 - 1e-9


def test_a_cloud_is_left():
    cloud = target_from(np.random.default_rng(0).normal(size=(500, 3)))
    assert set_teeth_aside(cloud).target is cloud


def test_a_scrap_that_bounds_nothing_is_left():
    corners = [(0, 0, 0), (9, 0, 0), (9, 1, 0), (0, 1, 0), (4, 0.5, 1e-9)]
    sides = [(0, 2, 1), (0, 3, 2), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)]
    scrap = target_from(trimesh.Trimesh(corners, sides, process=False))
    assert set_teeth_aside(replace(scrap, is_solid=True)).target.mesh is scrap.mesh


def test_a_gear_comes_back_with_one_tooth_to_edit():
    mesh = to_trimesh(to_manifold(union(gear(20), cut(cylinder(9, 8, (0, 0, 9)), cylinder(4, 20, (0, 0, 9))))))
    last = reconstruct_best(target_from(mesh), Settings(), 0)
    assert volume_iou(to_manifold(last.program), mesh_to_manifold(mesh)) > 0.999
    own = [leaf for leaf in leaves(last.program) if leaf.kind == "extrude" and len(leaf.outline.loops[0]) >= 6]
    assert len(own) == 20
    assert len({leaf.outline for leaf in own}) == 1
    assert len(list(leaves(last.program))) <= 23


@pytest.mark.parametrize("tip", [23.0, 22.6])
def test_a_tooth_begins_within_its_disc_at_a_round_number(tip):
    straight = ((17.3, -2.0), (tip, -2.0), (tip, 2.0), (17.3, 2.0))
    (rim,) = set_aside(to_manifold(gear(12, straight))).rims
    foot = rim.tooth[[0, -1], 0]
    assert foot.max() < 18.0
    assert foot == pytest.approx(np.round(2 * foot) / 2, abs=1e-9)
