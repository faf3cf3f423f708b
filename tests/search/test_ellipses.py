"""Elliptic walls: read off exact meshes, and said as extruded ellipses with the numbers that were typed."""

import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from imdim.detection.fit_elliptic import turn_elliptic
from imdim.detection.fit_surface import fit_surface
from imdim.detection.mesh_surfaces import detect_patches
from imdim.detection.regularise import regularise
from imdim.geometry.conic import fit_conic
from imdim.geometry.kernels import program_sdf
from imdim.geometry.solid import to_manifold, to_trimesh, volume_iou
from imdim.geometry.surface import Patch, Surface, make_elliptic, normals, signed_distance, unit, vec
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Loop, Outline, circle, ellipse
from imdim.program.tree import OUTLINED, Combine, Primitive, Program, leaves
from imdim.reconstruction.config import Settings
from imdim.reconstruction.pipeline import reconstruct
from imdim.search.arrangement import ArrangementConfig, arrange
from imdim.search.candidate_families import elliptic_solid
from imdim.target.target import target_from


def extrude(height: float, *loops: Loop, z: float = 0.0) -> Primitive:
    return Primitive("extrude", (height,), (0.0, 0.0, z), outline=Outline(loops))


TUBE = Combine("difference", extrude(40.0, ellipse(16.5, 13.2)), extrude(60.0, ellipse(15.0, 12.0)))
BORE = Primitive("cylinder", (3.0, 40.0))
KNOB = Combine(
    "difference", Combine("union", extrude(12.0, ellipse(20.0, 12.0)), Primitive("cylinder", (8.0, 16.0), (0.0, 0.0, 8.0))), BORE
)
SLANTED = Combine("difference", Primitive("box", (60.0, 40.0, 8.0)), extrude(60.0, ellipse(10.0, 5.0, angle=25.0)))


def mesh_of(program: Program, segments: int = 64, seed: int | None = None) -> trimesh.Trimesh:
    mesh = to_trimesh(to_manifold(program, segments))
    if seed is not None:
        mesh.apply_transform(trimesh.transformations.random_rotation_matrix(np.random.default_rng(seed).random(3)))
    return mesh


def sizes_of(mesh: trimesh.Trimesh) -> dict[str, list[tuple[float, ...]]]:
    found: dict[str, list[tuple[float, ...]]] = {}
    for patch in detect_patches(mesh):
        sizes = patch.surface.sizes
        found.setdefault(patch.surface.kind, []).append(tuple(sorted(sizes)))
    return {kind: sorted(sizes) for kind, sizes in found.items() if kind != "plane"}


ELLIPTIC = make_elliptic(np.array([1.0, 2.0, 3.0]), np.array([0.0, 0.6, 0.8]), np.array([1.0, 0.0, 0.0]), np.array([3.0, 1.5]))


def test_its_field_is_a_distance_near_the_surface():
    solid = elliptic_solid(ELLIPTIC, np.array([0.0, 0.6, 0.8]), -50.0, 50.0)
    on = np.random.default_rng(1).uniform(0, 2 * np.pi, 200)
    frame = ELLIPTIC.frame
    flat = np.column_stack([3 * np.cos(on), 1.5 * np.sin(on), np.linspace(-5, 5, 200)])
    points = flat @ frame.T + ELLIPTIC.point
    facing = normals(ELLIPTIC, points)
    np.testing.assert_allclose(facing @ frame[:, 2], 0.0, atol=1e-12)
    for step in (-0.01, 0.0, 0.01):
        moved = points + step * facing
        np.testing.assert_allclose(signed_distance(ELLIPTIC, moved), step, atol=2e-4)
        np.testing.assert_allclose(program_sdf(solid, moved), step, atol=1e-9)


@pytest.mark.parametrize("hold", ["", "axis", "line"])
def test_a_fit_finds_the_ellipse_from_nearby(hold):
    rng = np.random.default_rng(3)
    turns, along = rng.uniform(0, 2 * np.pi, 80), rng.uniform(-4, 4, 80)
    points = np.column_stack([3 * np.cos(turns), 1.5 * np.sin(turns), along]) @ ELLIPTIC.frame.T + ELLIPTIC.point
    start = replace(ELLIPTIC, sizes=(3.3, 1.3), across=vec(ELLIPTIC.frame @ (math.cos(0.1), math.sin(0.1), 0.0)))
    if hold == "":
        start = turn_elliptic(start, np.array([0.02, 0.6, 0.8]) / np.linalg.norm([0.02, 0.6, 0.8]))
    if hold != "line":
        start = replace(start, point=vec(np.add(start.point, (0.1, -0.1, 0.1))))
    found, rms = fit_surface("elliptic", points, start=start, hold=hold)
    assert rms < 1e-9
    assert sorted(found.sizes) == pytest.approx([1.5, 3.0], abs=1e-8)
    np.testing.assert_allclose(signed_distance(found, points), 0.0, atol=1e-9)
    with pytest.raises(ValueError, match="an elliptic cylinder is fitted from a start"):
        fit_surface("elliptic", points)


def test_a_conic_through_exact_points():
    turns = np.linspace(0.3, 2.0, 9)
    center, axes, semi_axes = fit_conic(np.column_stack([100 + 5 * np.cos(turns), -30 + 2 * np.sin(turns)])) or pytest.fail("none")
    np.testing.assert_allclose(center, [100, -30], atol=1e-6)
    assert sorted(semi_axes) == pytest.approx([2.0, 5.0], abs=1e-6)
    np.testing.assert_allclose(np.abs(axes), np.abs(np.round(axes)), atol=1e-6)
    assert fit_conic(np.column_stack([turns, 1 / turns])) is None  # a hyperbola


@pytest.mark.parametrize("segments", [24, 64, 200])
@pytest.mark.parametrize("seed", [None, 4])
def test_elliptic_walls_are_read_off_a_mesh(segments, seed):
    found = sizes_of(mesh_of(TUBE, segments, seed))
    assert list(found) == ["elliptic"]
    np.testing.assert_allclose(found["elliptic"], [(12.0, 15.0), (13.2, 16.5)], rtol=1e-5)


def test_slim_tips_are_no_flats():
    found = sizes_of(mesh_of(extrude(10.0, ellipse(30.0, 4.0)), 64))
    np.testing.assert_allclose(found["elliptic"], [(4.0, 30.0)], rtol=1e-5)


def stitched(below: int, above: int) -> trimesh.Trimesh:
    """An elliptic disc whose upper rim has another number of corners than the lower one, as modellers write them."""
    low, high = (2 * np.pi * np.arange(n) / n for n in (below, above))
    rims = [np.column_stack([15 * np.cos(t), 8 * np.sin(t), np.full(len(t), z)]) for t, z in ((low, 0.0), (high, 10.0))]
    faces, i, j = [], 0, 0
    while i < below or j < above:
        a, b = i % below, below + j % above
        if j == above or (i < below and (i + 1) / below <= (j + 1) / above):
            faces.append((a, (i + 1) % below, b))
            i += 1
        else:
            faces.append((a, below + (j + 1) % above, b))
            j += 1
    middles = below + above, below + above + 1
    faces += [((k + 1) % below, k, middles[0]) for k in range(below)]
    faces += [(below + k, below + (k + 1) % above, middles[1]) for k in range(above)]
    return trimesh.Trimesh(np.concatenate([*rims, [(0.0, 0.0, 0.0), (0.0, 0.0, 10.0)]]), faces, process=False)


def test_rims_of_other_corners_are_one_ellipse():
    mesh = stitched(82, 79)
    assert mesh.is_volume
    for turn in (np.eye(4), trimesh.transformations.random_rotation_matrix(np.random.default_rng(2).random(3))):
        found = sizes_of(mesh.copy().apply_transform(turn))
        assert list(found) == ["elliptic"]
        np.testing.assert_allclose(found["elliptic"], [(8.0, 15.0)], rtol=1e-5)


def test_a_circle_stays_one_and_other_smooth_walls_are_no_ellipses():
    assert sizes_of(mesh_of(extrude(10.0, circle(20.0)))).keys() == {"cylinder"}
    assert sizes_of(mesh_of(extrude(10.0, ellipse(20.0, 19.995)))).keys() == {"cylinder"}
    turns = np.linspace(0, 2 * np.pi, 96, endpoint=False)
    reach = 20 + 2 * np.cos(3 * turns)
    cam = tuple((float(r * math.cos(t)), float(r * math.sin(t)), 0.0) for r, t in zip(reach, turns, strict=True))
    assert "elliptic" not in sizes_of(mesh_of(extrude(10.0, cam)))
    assert "elliptic" not in {p.surface.kind for p in detect_patches(mesh_of(TUBE), elliptic=False)}


def test_directions_and_axes_are_made_exact():
    turns = np.linspace(0, 2 * np.pi, 40)
    points = np.column_stack([5 * np.cos(turns), 3 * np.sin(turns), np.tile([0.0, 8.0], 20)])
    leaning = Rotation.from_euler("xyz", [0.3, -0.2, 0.0], degrees=True).apply(points)
    turned = turn_elliptic(Surface("elliptic", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (5.0, 3.0)), unit(np.array([0.0035, 0.0052, 1.0])))
    (patch,) = regularise([Patch(turned, leaning, 100.0, 1)], 0.1)
    assert abs(patch.surface.axis[2]) == pytest.approx(1.0, abs=1e-12)
    assert np.abs(np.dot(patch.surface.axis, patch.surface.across)) < 1e-12


def test_an_arrangement_reaches_around_it():
    bounds = np.array([[-1.0, -1, -1], [1, 1, 1]])
    found = arrange([replace(ELLIPTIC, point=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0))], [1.0], bounds, ArrangementConfig())
    assert (found.outer[1][:2] >= (3.0, 1.5)).all()
    along_x = next(d for d in found.directions if abs(d.vector[0]) > 0.99)
    assert np.abs(along_x.offsets[:, None] - [-3.0, 3.0]).min(0).max() < 1.7  # its tangents lie beyond the bounds


def result(mesh: trimesh.Trimesh, settings: Settings) -> Program:
    return list(reconstruct(target_from(mesh), settings, np.random.default_rng(0)))[-1].program


CASES = {
    "tube": (TUBE, 2, [(12.0, 15.0), (13.2, 16.5)]),
    "knob": (KNOB, 3, [(12.0, 20.0)]),
    "slanted": (SLANTED, 2, [(5.0, 10.0)]),
}


@pytest.mark.parametrize("name", CASES)
def test_planted_ellipses_come_back(name):
    program, most, semi_axes = CASES[name]
    found = result(mesh_of(program, 96), Settings(budget_s=30))
    drawn = [leaf.outline for leaf in leaves(found) if leaf.outline]
    loops = [loop for outline in drawn for loop in outline.loops if isinstance(loop, Ellipse)]
    assert sum(1 for _ in leaves(found)) <= most
    np.testing.assert_allclose(sorted(sorted((e.rx, e.ry)) for e in loops), semi_axes, rtol=1e-9)
    assert {e.angle for e in loops} <= {0.0, 25.0}
    assert volume_iou(to_manifold(found), to_manifold(program)) > 0.9999


def test_primitives_alone_say_no_ellipse():
    found = result(mesh_of(SLANTED, 32), Settings(budget_s=4, language="csg"))
    assert not {leaf.kind for leaf in leaves(found)} & set(OUTLINED)
