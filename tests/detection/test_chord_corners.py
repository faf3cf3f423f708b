"""Corners on chords do not draw a surface inwards, and nothing else is taken for exact."""

import numpy as np
import pytest
import trimesh
from manifold3d import CrossSection, Manifold

from imdim.detection.chord_corners import onto_corners
from imdim.detection.faceting import volume_between
from imdim.detection.mesh_surfaces import detect_patches
from imdim.geometry.rotations import frame_from_axis
from imdim.geometry.surface import Patch, Surface


def to_mesh(solid: Manifold) -> trimesh.Trimesh:
    mesh = solid.to_mesh()
    return trimesh.Trimesh(mesh.vert_properties[:, :3], mesh.tri_verts)


def radii_of(mesh: trimesh.Trimesh, kind: str) -> list[float]:
    return sorted(p.surface.sizes[0] for p in detect_patches(mesh) if p.surface.kind == kind)


def test_a_ball_cut_by_a_cone_keeps_its_radius():
    cone, ball = Manifold.cylinder(14, 10, 6.5, 64), Manifold.sphere(10, 64).translate([0, 0, 22.4])
    assert radii_of(to_mesh(cone - ball), "sphere") == pytest.approx([10.0], abs=1e-4)


def test_crossing_cylinders_keep_their_radii():
    shaft, hole = Manifold.cylinder(40, 12, 12, 32), Manifold.cylinder(40, 5.3, 5.3, 24).translate([0, 0, -20]).rotate([90, 0, 0])
    assert radii_of(to_mesh(shaft - hole.translate([0, 0, 20])), "cylinder") == pytest.approx([5.3, 12.0], abs=1e-5)


def test_a_wall_that_is_no_cylinder_stays_as_it_was_fitted():
    angles = np.linspace(0, 2 * np.pi, 72, endpoint=False)
    oval = CrossSection([np.stack([10.0 * np.cos(angles), 9.995 * np.sin(angles)], axis=1)])
    (radius,) = radii_of(to_mesh(Manifold.extrude(oval, 8)), "cylinder")
    assert 9.995 < radius < 10.0


def test_facets_leave_the_volume_that_polygons_leave_of_circles():
    shaft = to_mesh(Manifold.cylinder(10, 5, 5, 16))
    between = np.pi * 25 * 10 - shaft.volume
    assert volume_between(shaft, detect_patches(shaft)) == pytest.approx(between, rel=0.03)


def test_flat_ends_of_a_shallow_cone_are_no_facets_of_it():
    rim = to_mesh(Manifold.cylinder(2, 20, 17, 48))
    smooth = np.pi * 2 / 3 * (400 + 340 + 289)
    assert volume_between(rim, detect_patches(rim)) == pytest.approx(smooth - rim.volume, rel=0.05)


def test_a_knob_with_grooves_keeps_its_taper():
    """Most corners of its cone are those of grooves, on chords."""
    knob = Manifold.cylinder(16, 18, 16, 72)
    for turn in range(0, 360, 40):
        knob -= Manifold.cylinder(20, 4, 4, 72).translate([19.5, 0, -1]).rotate([0, 0, turn])
    (cone,) = [patch.surface for patch in detect_patches(to_mesh(knob)) if patch.surface.kind == "cone"]
    assert cone.sizes[0] == pytest.approx(np.arctan(2 / 16), abs=1e-6)
    assert abs(cone.point[2]) == pytest.approx(144.0, abs=1e-3)


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (0.48, 0.6, 0.64)])
def test_the_widest_ring_of_a_fillet_is_no_cylinder(axis):
    """A mesh's cylinder goes on in the first facets of the fillet at its foot, whose corners lie a hair further out, all at one level."""
    turns = np.linspace(0, 2 * np.pi, 126, endpoint=False)
    around = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    levels = [(20.5, -36.0), (20.5, 36.0), (20.499, 0.0), (20.498, 5.0), (20.5193, 37.0)]
    points = np.concatenate([np.column_stack([radius * around, np.full(len(turns), z)]) for radius, z in levels])
    found = Patch(Surface("cylinder", (0.0, 0.0, 0.0), axis, (20.5003,)), points @ frame_from_axis(np.array(axis)).T, 8975.0, 1)
    assert onto_corners(found, 184.0).surface == found.surface
