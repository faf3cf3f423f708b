"""The noise of meshes: none of a drawn part, however fine its facets, and that of one whose corners were shaken."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from tests.planted import PARTS, mesh_of

from imdim.deadline import NEVER
from imdim.detection.mesh_noise import DEVIATION, SHAKEN, measure_mesh_noise
from imdim.detection.mesh_surfaces import detect_patches
from imdim.detection.noise import EXACT
from imdim.program.cost import count
from imdim.program.tree import leaves
from imdim.reconstruction import mdl
from imdim.reconstruction.mdl import reconstruct_scan
from imdim.reconstruction.observation import UnitBody
from imdim.target.target import in_unit_frame, target_from


def shaken_block(sigma):
    """A block of 60 x 40 x 30 in some 1,500 triangles, with corners moved by `sigma`."""
    mesh = trimesh.creation.box((60.0, 40.0, 30.0))
    while len(mesh.faces) < 1500:
        mesh = mesh.subdivide()
    moved = mesh.vertices + np.random.default_rng(0).normal(0, sigma, mesh.vertices.shape)
    return trimesh.Trimesh(moved, mesh.faces)


@pytest.fixture
def _few_points(monkeypatch):
    """Of a scan's surface: these tell one block as well as all of them do."""
    monkeypatch.setattr(mdl, "SCANNED", 400)


def body_of(mesh):
    unit, frame = in_unit_frame(target_from(mesh))
    return UnitBody.of(unit, np.random.default_rng(0)), frame


@pytest.mark.parametrize("name", ["L bracket", "plate with four holes"])
def test_a_drawn_part_has_no_noise(name):
    body, _ = body_of(mesh_of(PARTS[name]))
    assert body.noise is EXACT
    assert not body.noise.bulges


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


@pytest.mark.usefixtures("_few_points")
def test_a_shaken_block_is_a_scan_and_comes_back_as_one():
    body, frame = body_of(shaken_block(0.15))
    assert body.noise.bulges
    told = reconstruct_scan(body, np.random.default_rng(0), NEVER, NEVER, drawn=True)
    assert told is not None
    program = frame.undo(told.program)
    assert count(program).primitives == 1
    (leaf,) = leaves(program)
    assert sorted(leaf.size) == pytest.approx([30, 40, 60], abs=0.4)


@pytest.mark.usefixtures("_few_points")
def test_a_shallow_dish_of_a_scanned_block_is_no_feature():
    """A quarter of a millimetre deep and 30 wide: a real block's top is no flatter, though the scanner sees the dish."""
    fine = shaken_block(0.0)
    vertices = fine.vertices.copy()
    vertices[(vertices[:, 2] > 14.9) & (np.hypot(vertices[:, 0], vertices[:, 1]) < 15), 2] -= 0.25
    shaken = trimesh.Trimesh(vertices + np.random.default_rng(0).normal(0, 0.03, vertices.shape), fine.faces)
    assert DEVIATION * np.linalg.norm((60, 40, 30)) > 0.25
    body, frame = body_of(shaken)
    assert body.noise.bulges
    told = reconstruct_scan(body, np.random.default_rng(0), NEVER, NEVER, drawn=True)
    assert told is not None
    (leaf,) = leaves(frame.undo(told.program))
    assert sorted(leaf.size) == pytest.approx([30, 40, 60], abs=0.4)
