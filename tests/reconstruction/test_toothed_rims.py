"""Rims of equal teeth become a disc and one tooth, repeated: wherever they lie, and nothing else does."""

import math

import numpy as np
import pytest
import trimesh
from tests.deadlines import PASSED
from tests.planted import box, cut, cylinder, union

from imdim.deadline import NEVER
from imdim.geometry.solid import mesh_to_manifold, to_manifold, to_trimesh, volume_iou
from imdim.program.outline import Outline, circle
from imdim.program.tree import Primitive, leaves
from imdim.reconstruction.config import Settings
from imdim.reconstruction.pipeline import reconstruct_best
from imdim.reconstruction.toothed_rims import draw_teeth
from imdim.target.target import target_from

TOOTH = ((17.0, -2.6), (20.2, -2.0), (23.0, -0.9), (23.0, 0.9), (20.2, 2.0), (17.0, 2.6))


def gear(count, tooth=TOOTH, root=18.0, bore=4.0, turned=0.0):
    """A gear of a height of 10 on the xy plane, as exact as its facets."""
    teeth = []
    for k in range(count):
        angle = math.radians(turned + 360 * k / count)
        c, s = math.cos(angle), math.sin(angle)
        teeth.append(Primitive("extrude", (10.0,), outline=Outline((tuple((c * x - s * y, s * x + c * y, 0.0) for x, y in tooth),))))
    return cut(union(cylinder(root, 10), *teeth), cylinder(bore, 20))


@pytest.mark.parametrize("count", [8, 20, 31])
@pytest.mark.parametrize(
    "place", [((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), ((30.0, -7.0, 4.0), (90.0, 0.0, 0.0)), ((1.0, 2.0, 3.0), (20.0, 35.0, 50.0))]
)
def test_a_gear_is_a_disc_and_a_tooth(count, place):
    tooth = TOOTH if count < 24 else tuple((x, y / 2) for x, y in TOOTH)
    center, rotation = place
    solid = to_manifold(gear(count, tooth)).rotate(rotation).translate(center)
    stand_in = cut(Primitive("cylinder", (20.0, 10.0), center, rotation), Primitive("cylinder", (4.0, 20.0), center, rotation))
    (drawn,) = draw_teeth(stand_in, solid, NEVER)
    assert volume_iou(to_manifold(drawn), solid) > 1 - 2e-4
    kinds = [leaf.kind for leaf in leaves(drawn)]
    assert (kinds.count("extrude"), kinds.count("cylinder")) == (count, 2)
    assert len({leaf.outline for leaf in leaves(drawn) if leaf.outline}) == 1
    assert next(leaves(drawn)).size[0] == pytest.approx(18.0, abs=1e-5)


def test_loops_in_the_leaf_stay_and_the_first_tooth_is_at_a_round_angle():
    solid = to_manifold(gear(20, turned=4.5))
    drawn = Primitive("extrude", (10.0,), outline=Outline((circle(20.0, 0, 0), circle(4.0, 0, 0))))
    (found,) = draw_teeth(drawn, solid, NEVER)
    disc, first, *_ = leaves(found)
    assert disc.kind == "extrude"
    assert len(disc.outline.loops) == 2
    assert first.rotation[2] % 18 == pytest.approx(4.5, abs=1e-9)
    assert volume_iou(to_manifold(found), solid) > 1 - 2e-4


@pytest.mark.parametrize(
    "solid",
    [
        to_manifold(cylinder(20, 10), 24),  # whose facets are no teeth
        to_manifold(gear(7)),
        to_manifold(cut(gear(20), box(3, 3, 20, (22, 0, 0)))),  # a tooth is missing
        to_manifold(union(gear(20), box(60, 8, 10))),
    ],
)
def test_other_rims_are_left(solid):
    assert list(draw_teeth(cylinder(20, 10), solid, NEVER)) == []


def test_cuts_are_left_and_time_is_kept():
    solid = to_manifold(gear(20))
    assert list(draw_teeth(cylinder(20, 10), solid, PASSED)) == []
    assert list(draw_teeth(cut(box(60, 60, 10), cylinder(20, 10)), solid, NEVER)) == []


def test_a_gear_comes_back_with_one_tooth_to_edit():
    mesh = to_trimesh(to_manifold(union(gear(20), cut(cylinder(9, 8, (0, 0, 9)), cylinder(4, 20, (0, 0, 9))))))
    last = reconstruct_best(target_from(mesh), Settings(), np.random.default_rng(0))
    assert volume_iou(to_manifold(last.program), mesh_to_manifold(trimesh.Trimesh(mesh.vertices, mesh.faces))) > 0.999
    teeth = [leaf for leaf in leaves(last.program) if leaf.kind == "extrude" and len(leaf.outline.loops[0]) >= 6]
    assert len(teeth) == 20
    assert len({leaf.outline for leaf in teeth}) == 1
