"""The noise of meshes: none of a drawn part, however fine its facets, and that of one whose corners were shaken."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from tests.planted import PARTS, box, cut, cylinder, mesh_of, union

from imdim.deadline import NEVER
from imdim.detection.mesh_noise import DEVIATION, SHAKEN, measure_mesh_noise
from imdim.detection.mesh_surfaces import detect_patches
from imdim.detection.noise import EXACT
from imdim.program.cost import count
from imdim.program.tree import leaves
from imdim.reconstruction.mdl import reconstruct_scan, without_trifles
from imdim.reconstruction.observation import UnitBody
from imdim.target.target import in_unit_frame, target_from


def shaken_block(sigma):
    """A block of 60 x 40 x 30 in some 1,500 triangles, with corners moved by `sigma`."""
    mesh = trimesh.creation.box((60.0, 40.0, 30.0))
    while len(mesh.faces) < 1500:
        mesh = mesh.subdivide()
    moved = mesh.vertices + np.random.default_rng(0).normal(0, sigma, mesh.vertices.shape)
    return trimesh.Trimesh(moved, mesh.faces)


def body_of(mesh):
    unit, frame = in_unit_frame(target_from(mesh))
    return UnitBody.of(unit, np.random.default_rng(0)), frame


@pytest.mark.parametrize("name", ["L bracket", "plate with four holes"])
def test_a_drawn_part_has_no_noise(name):
    body, _ = body_of(mesh_of(PARTS[name]))
    assert body.noise is EXACT
    assert not body.scanned


def test_a_fine_mesh_of_a_drawn_part_has_no_noise():
    fine = shaken_block(0.0)
    assert measure_mesh_noise(fine, detect_patches(fine)) is EXACT
    assert measure_mesh_noise(fine, []) is EXACT


def test_corners_on_chords_are_no_noise():
    """Where tessellations cut each other corners lie off their carriers, and yet these explain all of the surface."""
    mesh = in_unit_frame(target_from(mesh_of(PARTS["L bracket"])))[0].mesh
    off = [replace(p, points=p.points + 3 * SHAKEN * np.asarray(p.surface.axis)) for p in detect_patches(mesh)]
    assert measure_mesh_noise(mesh, off) is EXACT
    noise = measure_mesh_noise(mesh, [replace(p, area=0.8 * p.area) for p in off])
    assert noise.sigma == pytest.approx(3 * SHAKEN)


def test_a_shaken_block_is_a_scan_and_comes_back_as_one():
    body, frame = body_of(shaken_block(0.15))
    assert body.scanned
    told = reconstruct_scan(body, np.random.default_rng(0), NEVER, NEVER, drawn=True)
    assert told is not None
    program = frame.undo(told.program)
    assert count(program).primitives == 1
    (leaf,) = leaves(program)
    assert sorted(leaf.size) == pytest.approx([30, 40, 60], abs=0.4)


def test_a_shallow_dish_of_a_scanned_block_is_no_feature():
    """A quarter of a millimetre deep and 30 wide: a real block's top is no flatter, though the scanner sees the dish."""
    fine = shaken_block(0.0).subdivide()
    vertices = fine.vertices.copy()
    vertices[(vertices[:, 2] > 14.9) & (np.hypot(vertices[:, 0], vertices[:, 1]) < 15), 2] -= 0.25
    shaken = trimesh.Trimesh(vertices + np.random.default_rng(0).normal(0, 0.03, vertices.shape), fine.faces)
    assert DEVIATION * np.linalg.norm((60, 40, 30)) > 0.25
    body, frame = body_of(shaken)
    assert body.scanned
    told = reconstruct_scan(body, np.random.default_rng(0), NEVER, NEVER, drawn=True)
    assert told is not None
    (leaf,) = leaves(frame.undo(told.program))
    assert sorted(leaf.size) == pytest.approx([30, 40, 60], abs=0.4)


@pytest.mark.parametrize(("depth", "kept"), [(0.29, False), (0.31, True), (3.0, True)])
def test_what_moves_the_surface_less_than_real_things_do_is_a_trifle(depth, kept):
    block = box(60, 40, 30)
    dished = cut(block, cylinder(12, 2 * depth, (0, 0, 15)))
    assert without_trifles(dished, 0.3) == (dished if kept else block)
    raised = union(block, cylinder(12, 2 * depth, (0, 0, 15)))
    assert without_trifles(raised, 0.3) == (raised if kept else block)


def test_a_shallow_dish_that_runs_across_a_lip_is_a_trifle():
    can = cut(cylinder(50, 138), cylinder(48, 4, (0, 0, -69)))
    assert without_trifles(cut(can, cylinder(45, 5.2, (5, 0, -69))), 0.8) == can
    assert without_trifles(union(can, cylinder(51, 6, (0, 0, 66))), 0.8) == union(can, cylinder(51, 6, (0, 0, 66)))


def test_trifles_go_until_what_is_left_matters():
    """Each of two rings in a stack may go, both may not."""
    stack = union(cylinder(20, 10), cylinder(20.2, 12), cylinder(20.4, 14))
    left = without_trifles(stack, 1.5)
    assert count(left).primitives == 1
    assert without_trifles(stack, 0.0) == stack
