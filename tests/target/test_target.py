"""Targets, frames and bodies against closed-form volumes and boxes."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh

from imdim.program.tree import Combine, Primitive, leaves
from imdim.target.target import Frame, load_target, split_bodies, target_from, voxel_subsample

BOX = trimesh.creation.box


def moved(mesh: trimesh.Trimesh, *by: float) -> trimesh.Trimesh:
    return mesh.copy().apply_translation(by)


def turned(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    out = mesh.copy()
    out.invert()
    return out


def together(*meshes: trimesh.Trimesh) -> trimesh.Trimesh:
    return trimesh.util.concatenate(list(meshes))


def test_a_mesh_is_sampled_on_its_surface_with_outward_normals():
    target = target_from(BOX((2.0, 4.0, 6.0)))
    gap = np.abs(target.points) - [1, 2, 3]
    assert target.is_solid
    assert len(target.points) == 20_000
    assert np.abs(gap.max(axis=1)).max() < 1e-12
    assert np.einsum("ij,ij->i", target.points, target.normals) == pytest.approx(np.abs(target.points * target.normals).sum(axis=1))
    # the two faces of 4 x 6 hold 48 of 88 square units
    share = (np.abs(gap[:, 0]) < 1e-9).mean()
    assert share == pytest.approx(48 / 88, abs=0.005)


def test_loading_twice_gives_the_same_samples():
    assert (target_from(BOX()).points == target_from(BOX()).points).all()


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_the_frame_is_the_unit_frame_at_every_scale(scale):
    target = target_from(moved(BOX((3.0, 4.0, 12.0)), 5, 6, 7).apply_scale(scale))
    frame = Frame.of(target)
    unit = frame.normalise(target)
    assert frame.scale == pytest.approx(1 / (13 * scale))
    assert unit.mesh is not None
    assert np.ptp(unit.mesh.vertices, axis=0) == pytest.approx(np.array([3, 4, 12]) / 13)
    assert np.abs(unit.points).max(axis=0) == pytest.approx(np.array([1.5, 2, 6]) / 13)
    assert unit.mesh.volume == pytest.approx(144 / 13**3)


def test_undo_puts_a_program_back():
    frame = Frame((1.0, 2.0, 3.0), 0.25)
    unit = Combine(
        "difference", Primitive("box", (0.5, 0.25, 0.125), (0.1, 0.0, 0.0), (0.0, 0.0, 30.0)), Primitive("cone", (0.1, 0.0, 0.2))
    )
    box, cone = leaves(frame.undo(unit))
    assert box == Primitive("box", (2.0, 1.0, 0.5), (1.4, 2.0, 3.0), (0.0, 0.0, 30.0))
    assert cone.size == pytest.approx((0.4, 0.0, 0.8))


def test_an_inverted_mesh_is_turned_with_a_note():
    target = target_from(turned(BOX()))
    assert target.is_solid
    assert target.mesh is not None
    assert target.mesh.volume == pytest.approx(1.0)
    assert "inside out" in target.notes[0]


def test_faces_that_disagree_are_turned():
    mesh = BOX().subdivide()
    faces = mesh.faces.copy()
    faces[5:20] = faces[5:20, ::-1]
    target = target_from(trimesh.Trimesh(mesh.vertices, faces, process=False))
    assert target.is_solid
    assert target.mesh.volume == pytest.approx(1.0)  # type: ignore[union-attr]
    assert "15 of 48 faces" in target.notes[0]


def test_bodies_that_hold_nothing_are_left_out_of_a_solid():
    """A triangle walked both ways, and a folded strip: exporters leave such scraps beside a part, which is a solid all the same."""
    scraps = [
        trimesh.Trimesh([[2, 0, 0], [3, 0, 0], [2, 1, 0]], [[0, 1, 2], [2, 1, 0]], process=False),
        trimesh.Trimesh([[0, 2, 0], [1, 2, 0], [1, 3, 0], [0, 3, 0]], [[0, 1, 2], [0, 2, 3], [2, 1, 0], [3, 2, 0]], process=False),
    ]
    target = target_from(trimesh.util.concatenate([BOX(), *scraps]))
    assert target.is_solid
    assert target.notes == ("2 bodies that hold nothing left out.",)
    assert target.mesh is not None
    assert target.mesh.bounds == pytest.approx(BOX().bounds), "nothing is sampled on them"


def test_open_scraps_beside_a_part_are_left_out_of_a_solid():
    """One loose facet cost a part its fillets, and its IoU."""
    loose = trimesh.Trimesh([[2, 0, 0], [2.1, 0, 0], [2, 0.1, 0]], [[0, 1, 2]], process=False)
    target = target_from(trimesh.util.concatenate([BOX(), loose]))
    assert target.is_solid
    assert target.notes == ("1 facet of open pieces beside what is closed left out.",)
    assert target.mesh is not None
    assert target.mesh.bounds == pytest.approx(BOX().bounds)
    sheet = trimesh.Trimesh(5.0 * loose.vertices, loose.faces, process=False)  # an eighth of an area: more than a scrap
    assert not target_from(trimesh.util.concatenate([BOX(), sheet])).is_solid


def test_a_hole_leaves_an_open_mesh_with_a_note():
    mesh = BOX().subdivide()
    target = target_from(trimesh.Trimesh(mesh.vertices, mesh.faces[1:], process=False))
    assert not target.is_solid
    assert target.mesh is not None
    assert "open (3 vertices" in target.notes[0]


def test_seams_narrower_than_a_millionth_are_closed():
    mesh = BOX()
    soup = np.asarray(mesh.triangles) + np.random.default_rng(0).uniform(-1e-8, 1e-8, (12, 3, 3))
    target = target_from(trimesh.Trimesh(soup.reshape(-1, 3), np.arange(36).reshape(-1, 3), process=False))
    assert target.is_solid
    assert target.mesh.volume == pytest.approx(1.0, abs=1e-6)  # type: ignore[union-attr]


def test_a_cavity_stays_with_its_body():
    hollow = together(BOX((4.0, 4.0, 4.0)), turned(BOX((2.0, 2.0, 2.0))))
    target = target_from(together(hollow, moved(BOX(), 10, 0, 0), BOX((0.5, 0.5, 0.5))))
    volumes = [body.mesh.volume for body in split_bodies(target)]  # type: ignore[union-attr]
    assert volumes == pytest.approx([64 - 8, 1.0, 0.125])
    assert target.is_solid


def test_one_body_and_clouds_are_not_split():
    cloud = target_from(np.random.default_rng(0).random((60, 3)))
    box = target_from(BOX())
    assert split_bodies(cloud) == [cloud]
    assert split_bodies(box) == [box]


@pytest.mark.parametrize(("inner", "volume"), [(moved(BOX(), 0.5, 0.25, 0.1), 2 - 0.5 * 0.75 * 0.9), (BOX((0.5, 0.5, 0.5)), 1.0)])
def test_overlapping_bodies_are_united(inner, volume):
    target = target_from(together(BOX(), inner))
    assert target.mesh.volume == pytest.approx(volume)  # type: ignore[union-attr]
    assert "united" in target.notes[0]


@pytest.mark.parametrize(("shift", "area"), [((1, 0, 0), 10.0), ((1, 0.5, 0.25), 12 - 2 * 0.5 * 0.75)])
def test_bodies_that_touch_lose_the_wall_between_them(shift, area):
    target = target_from(together(BOX(), moved(BOX(), *shift)))
    assert target.is_solid
    assert target.mesh.area == pytest.approx(area)  # type: ignore[union-attr]
    assert target.mesh.volume == pytest.approx(2.0)  # type: ignore[union-attr]
    assert len(split_bodies(target)) == 1


def test_bodies_apart_stay_as_they_are():
    target = target_from(together(BOX(), moved(BOX(), 2, 0, 0)))
    assert target.notes == ()
    assert len(split_bodies(target)) == 2


def test_too_many_faces_become_fewer_and_keep_the_volume():
    target = target_from(trimesh.creation.torus(2.0, 0.5, major_sections=400, minor_sections=300))
    assert len(target.mesh.faces) < 200_000  # type: ignore[union-attr]
    assert target.mesh.volume == pytest.approx(2 * math.pi**2 * 2 * 0.25, rel=2e-3)  # type: ignore[union-attr]
    assert "240000 faces thinned" in target.notes[0]


def test_subsampling_keeps_one_point_per_voxel_and_all_of_the_shape():
    points = np.random.default_rng(1).random((300_000, 3))
    keep = voxel_subsample(points, 5_000)
    assert 4_000 < len(keep) <= 5_000
    assert (np.diff(keep) > 0).all()
    # uniform in the cube: the mean of the kept is the cube's centre, and no eighth of it is left out
    assert points[keep].mean(axis=0) == pytest.approx([0.5] * 3, abs=0.02)
    assert np.histogramdd(points[keep], bins=2)[0].min() > 500


def test_a_cloud_file_keeps_unit_normals(tmp_path):
    rng = np.random.default_rng(2)
    points = rng.normal(size=(100, 3))
    np.save(tmp_path / "a.npy", np.hstack([points, points / np.linalg.norm(points, axis=1, keepdims=True)]))
    target = load_target(tmp_path / "a.npy")
    assert target.mesh is None
    assert np.linalg.norm(target.normals, axis=1) == pytest.approx(1)  # type: ignore[arg-type]
