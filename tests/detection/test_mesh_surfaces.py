"""The carriers that a part was drawn with, and no others, must be read off its tessellation."""

import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from manifold3d import CrossSection, Manifold
from scipy.spatial.transform import Rotation
from tests.deadlines import PASSED
from tests.occ_mesh import occ_mesh
from tests.planted import (
    ALONG_X,
    PARTS,
    box,
    carriers,
    common,
    cone,
    cut,
    cylinder,
    ellipsoid,
    mesh_of,
    polar_ball,
    same,
    sphere,
    torus,
    union,
)

from imdim.deadline import NEVER
from imdim.detection.facets import facets_of
from imdim.detection.mesh_support import believable
from imdim.detection.mesh_surfaces import detect_patches
from imdim.geometry.solid import to_trimesh
from imdim.geometry.surface import Surface, normals, signed_distance, vec
from imdim.program.outline import Outline
from imdim.program.tree import Primitive

HEXAGON = union(*(box(20, 20 / math.sqrt(3), 8, rotation=(0.0, 0.0, a)) for a in (0.0, 60.0, 120.0)))
BAR = union(box(30, 20, 8), cylinder(10, 8, (15.0, 0.0, 0.0)), cylinder(10, 8, (-15.0, 0.0, 0.0)))
SLOT = union(box(30, 20, 12), cylinder(10, 12, (15.0, 0.0, 0.0)), cylinder(10, 12, (-15.0, 0.0, 0.0)))

CASES = {
    **PARTS,
    "frustum": cone(12, 7, 9),
    "pointed cone": cone(12, 0, 9),
    "nozzle": union(cone(12, 7, 9, (0.0, 0.0, 4.5)), cylinder(12, 6, (0.0, 0.0, -3.0)), cylinder(7, 10, (0.0, 0.0, 14.0))),
    "double cone": union(cone(12, 7, 9, (0.0, 0.0, 4.5)), cone(7, 12, 4, (0.0, 0.0, -2.0))),
    "bar with round ends": BAR,
    "plate with a slot": cut(box(80, 50, 10), SLOT),
    "D shaft": cut(cylinder(6, 40), box(12, 4, 50, (0.0, 6.5, 0.0))),
    "hexagon nut": cut(HEXAGON, cylinder(5, 10)),
    "ball": sphere(20),
    "dome on a post": union(cylinder(10, 20), sphere(10, (0.0, 0.0, 10.0))),
    "ball with a skew bore": cut(sphere(20), cylinder(6, 50, (4.0, 3.0, 0.0), (25.0, 30.0, 0.0))),
    "lens": common(sphere(20, (0.0, 0.0, 15.0)), sphere(20, (0.0, 0.0, -15.0))),
    "ring": torus(20, 5),
    "half ring": common(torus(20, 5), box(60, 30, 20, (0.0, 15.0, 0.0))),
    "grooved post": cut(cylinder(15, 30), torus(15, 3)),
    "wheel with a round rim": union(cylinder(20, 10), torus(20, 5)),
    "puck with filleted edges": union(cylinder(20, 14), cylinder(23, 8), torus(20, 3, (0.0, 0.0, 4.0)), torus(20, 3, (0.0, 0.0, -4.0))),
    "plate with an ellipsoidal dent": cut(box(60, 40, 20), ellipsoid(18, 12, 6, (4.0, -2.0, 10.0))),
    "plate with a turned dent": cut(box(60, 40, 20), ellipsoid(18, 9, 7, (4.0, -2.0, 10.0), (20.0, 15.0, 30.0))),
    "egg on a plate": union(box(60, 40, 6), ellipsoid(12, 12, 18, (5.0, 0.0, 15.0))),
    "half an ellipsoid": common(ellipsoid(30, 20, 15), box(80, 80, 40, (0.0, 0.0, 20.0))),
    "ellipsoid with a bore": cut(ellipsoid(30, 20, 15), cylinder(6, 60)),
    "crossing bores": cut(box(40, 40, 40), cylinder(8, 50), cylinder(8, 50, rotation=ALONG_X)),
}


def visible(surface: Surface, mesh: trimesh.Trimesh) -> bool:
    """Whether a triangle lies on the carrier with all its corners and faces along it."""
    on = (np.abs(signed_distance(surface, mesh.vertices)) < 1e-6 * mesh.scale)[mesh.faces].all(1)
    middles = mesh.vertices[mesh.faces[on]].mean(1)
    return bool((np.abs((normals(surface, middles) * mesh.face_normals[on]).sum(1)) > 0.98).any())


def check(mesh: trimesh.Trimesh, expected: list[Surface]) -> None:
    patches = detect_patches(mesh)
    tolerance = 1e-4 * mesh.scale
    for truth in expected:
        assert sum(same(p.surface, truth, tolerance) for p in patches) == 1, f"{truth} in {[p.surface for p in patches]}"
    assert len(patches) == len(expected), [p.surface for p in patches]
    assert sum(p.area for p in patches) == pytest.approx(mesh.area, rel=1e-6)


@pytest.mark.parametrize("segments", [64, 96])
@pytest.mark.parametrize("name", CASES)
def test_a_part_gives_back_the_carriers_it_was_drawn_with(name, segments):
    mesh = mesh_of(CASES[name], segments)
    check(mesh, [s for s in carriers(CASES[name]) if visible(s, mesh)])


ROUND_TOP = Primitive(
    "revolve",
    (360.0,),
    outline=Outline((((0.0, 0.0, 0.0), (12.0, 0.0, 0.0), (12.0, 6.5, math.tan(math.pi / 8)), (10.5, 8.0, 0.0), (0.0, 8.0, 0.0)),)),
)
DOME = Primitive(
    "revolve",
    (360.0,),
    outline=Outline((((0.0, 0.0, 0.0), (15.0, 0.0, 0.0), (15.0, 11.0, math.tan(math.pi / 8)), (12.0, 14.0, 0.0), (0.0, 14.0, 0.0)),)),
)
TURNS = [(17 * math.cos(a), 17 * math.sin(a), 7.0) for a in np.radians(np.arange(0, 360, 45))]
IN_RINGS = {
    "countersunk plate": (
        cut(box(60, 30, 3), cylinder(2.2, 5), cone(2.2, 4.2, 2, (0.0, 0.0, 0.5))),
        {"cylinder": 1, "cone": 1, "plane": 6},
    ),
    "boss with a rounded top": (cut(ROUND_TOP, cylinder(6, 30)), {"cylinder": 2, "torus": 1, "plane": 2}),
    "knob with finger notches": (cut(DOME, *(cylinder(4, 20, at) for at in TURNS)), {"cylinder": 9, "torus": 1, "plane": 2}),
}


@pytest.mark.parametrize("name", IN_RINGS)
def test_a_round_face_in_rings_of_triangles_is_one_carrier(name, tmp_path):
    program, expected = IN_RINGS[name]
    patches = detect_patches(occ_mesh(program, tmp_path))
    areas = Counter()
    for patch in patches:
        areas[patch.surface.kind] += patch.area
    large = Counter(patch.surface.kind for patch in patches if patch.area > 1e-3 * areas.total())
    assert large == expected, [(patch.surface, patch.area) for patch in patches]


@pytest.mark.parametrize("name", ["tube on a flange", "bored ball", "countersink", "hexagon nut", "ring", "half an ellipsoid"])
def test_placement_and_size_do_not_matter(name):
    mesh = mesh_of(CASES[name])
    turn, shift, scale = Rotation.from_euler("xyz", [0.3, -0.8, 1.9]).as_matrix(), np.array([3.0, -70.0, 11.0]), 1e-3
    truths = [s for s in carriers(CASES[name]) if visible(s, mesh)]
    moved = trimesh.Trimesh(scale * (mesh.vertices @ turn.T + shift), mesh.faces, process=False)
    check(moved, [_moved(s, turn, shift, scale) for s in truths])


def _moved(s: Surface, turn: np.ndarray, shift: np.ndarray, scale: float) -> Surface:
    sizes = s.sizes if s.kind == "cone" else tuple(scale * x for x in s.sizes)
    return Surface(s.kind, vec(scale * (turn @ s.point + shift)), vec(turn @ s.axis), sizes, vec(turn @ s.across))


@pytest.mark.parametrize("segments", [64, 96])
def test_a_flat_between_two_round_ends_is_no_sphere(segments):
    """A rectangle with a narrow strip on either side has its corners on a sphere."""
    slot = union(box(16, 6, 12), cylinder(3, 12, (8.0, 0.0, 0.0)), cylinder(3, 12, (-8.0, 0.0, 0.0)))
    found = [patch.surface for patch in detect_patches(mesh_of(cut(box(60, 40, 6), slot), segments))]
    assert {surface.kind for surface in found} == {"plane", "cylinder"}
    heights = sorted(s.point[1] for s in found if s.kind == "plane" and abs(s.axis[1]) > 0.99)
    assert heights == pytest.approx([-20, -3, 3, 20])


def test_three_circles_are_a_cylinder_and_a_cone_though_an_ellipsoid_goes_through_them():
    low, middle, high = 12.0, 12.0, 10.5
    post = union(cylinder(low, 3, (0.0, 0.0, -1.5)), cone(middle, high, 1.5, (0.0, 0.0, 0.75)))
    assert {p.surface.kind for p in detect_patches(mesh_of(post, 64))} == {"plane", "cylinder", "cone"}


@pytest.mark.parametrize("segments", [32, 64, 128])
def test_a_ball_is_a_sphere_however_coarse(segments):
    assert [p.surface.kind for p in detect_patches(mesh_of(sphere(20, (1.0, 2.0, 3.0)), segments))] == ["sphere"]


def test_an_ellipsoid_of_revolution_has_equal_semi_axes_and_no_spin():
    egg = CASES["egg on a plate"]
    (found,) = (p.surface for p in detect_patches(mesh_of(egg)) if p.surface.kind == "ellipsoid")
    assert found.sizes[0] == found.sizes[1] == pytest.approx(12, abs=1e-5)
    assert abs(found.axis[2]) == pytest.approx(1, abs=1e-9)


def test_a_patch_knows_its_side_its_area_and_its_points():
    mesh = mesh_of(PARTS["tube on a flange"])
    by_radius = {p.surface.sizes[0]: p for p in detect_patches(mesh) if p.surface.kind == "cylinder"}
    sides = {round(r): p.outward for r, p in by_radius.items()}
    assert sides == {7: -1, 10: 1, 20: 1}
    for r, height in {7: 30, 10: 25, 20: 5}.items():
        p = next(p for fitted, p in by_radius.items() if round(fitted) == r)
        assert p.area == pytest.approx(2 * 96 * r * math.sin(math.pi / 96) * height, rel=1e-6)
        assert np.hypot(p.points[:, 0], p.points[:, 1]) == pytest.approx(r, abs=5e-3)


def test_coplanar_faces_are_one_plane():
    posts = cut(box(60, 20, 10), box(20, 30, 10, (0.0, 0.0, 4.0)))
    planes = detect_patches(mesh_of(posts))
    top = [p for p in planes if abs(p.surface.axis[2]) > 0.9 and abs(p.surface.point[2] - 5) < 1e-9]
    assert [p.area for p in top] == pytest.approx([800])
    assert len(planes) == 9


def test_past_the_deadline_no_curved_surface_is_looked_for():
    mesh = mesh_of(CASES["egg on a plate"], 64)
    patches = detect_patches(mesh, PASSED)
    assert {patch.surface.kind for patch in patches} == {"plane"}


def test_expected_carriers_are_found_where_they_are_and_nowhere_else():
    """Also past the deadline; of two where a part has a third as well the third is found as ever."""
    program = union(cylinder(20, 10), cylinder(8, 20, (0.0, 0.0, 12.0)), sphere(8, (0.0, 0.0, 22.0)))
    round_ones = [c for c in carriers(program) if c.kind != "plane"]
    assert len(round_ones) == 3
    elsewhere = Surface("sphere", (90.0, 0.0, 0.0), (0.0, 0.0, 1.0), (8.0,))
    near = [replace(c, sizes=(c.sizes[0] + 1e-3,)) for c in round_ones[:2]]
    for deadline, wanted in ((PASSED, round_ones[:2]), (NEVER, round_ones)):
        found = [p.surface for p in detect_patches(mesh_of(program), deadline, expected=[elsewhere, *near])]
        curved = [s for s in found if s.kind != "plane"]
        assert len(curved) == len(wanted)
        assert all(any(same(a, b, 1e-4) for b in curved) for a in wanted)


@pytest.mark.parametrize("straight", [1.0, 4.0, 12.0])
def test_the_sides_of_a_small_slot_are_flat(straight):
    """With a strip of the round end on either side each lies on a wide cylinder, which on a large part misses its middle by little."""
    half = straight / 2
    ends = [cylinder(1.7, 10, (12.0, y, 0.0)) for y in (-half, half)]
    mesh = mesh_of(cut(box(80, 60, 5), union(*ends, box(3.4, straight, 10, (12.0, 0.0, 0.0)))))
    patches = detect_patches(mesh)
    round_ones = [patch.surface for patch in patches if patch.surface.kind != "plane"]
    assert [surface.sizes[0] for surface in round_ones] == pytest.approx([1.7] * 2, abs=1e-4)
    sides = [patch.surface for patch in patches if patch.surface.kind == "plane" and abs(patch.surface.axis[0]) > 0.999]
    assert sorted(float(np.asarray(side.point)[0]) for side in sides) == pytest.approx([-40.0, 10.3, 13.7, 40.0], abs=1e-4)


@pytest.mark.parametrize("facets", [20, 30, 48])
def test_a_coarse_ball_that_cuts_have_gone_through_is_one_sphere(facets):
    """Corners of cuts lie off the ball by as much as its facets; those in which facets of its own meet lie on it."""
    mesh = to_trimesh(Manifold.cube([30.0, 30.0, 30.0], True) - polar_ball(20.0, facets))
    (found, *_) = sorted(detect_patches(mesh), key=lambda patch: -patch.area)
    assert found.surface.kind == "sphere"
    assert found.surface.sizes[0] == pytest.approx(20.0, abs=5e-3)
    assert found.surface.point == pytest.approx((0.0, 0.0, 0.0), abs=5e-3)


def turned_post(radius: float, height: float, facets: int, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Manifold:
    return Manifold.cylinder(height, radius, radius, facets).translate([x, y, z])


@pytest.mark.parametrize("facets", [16, 24, 48])
def test_a_coarse_bore_is_round_though_its_edges_were_split(facets):
    """Corners in the middle of a strip's ends, where something beside it was cut, lie on chords and are none of the strip's."""
    block = Manifold.cube([40.0, 30.0, 10.0], True) - turned_post(4.0, 20.0, facets, z=-10.0)
    patches = detect_patches(to_trimesh(block.refine(2)))
    assert [p.surface.sizes[0] for p in patches if p.surface.kind == "cylinder"] == pytest.approx([4.0], abs=1e-4)
    assert sum(p.surface.kind == "plane" for p in patches) == 6


def test_two_whole_rings_of_a_coarse_dome_are_a_ball_s():
    """They lie beside its equator, where three circles are on no ball but for its own."""
    dome = polar_ball(15.0, 16) ^ Manifold.cube([40.0, 40.0, 20.0]).translate([-20.0, -20.0, 0.0])
    patches = detect_patches(to_trimesh(dome - turned_post(4.0, 40.0, 16, z=-10.0)))
    curved = {(p.surface.kind, round(p.surface.sizes[0], 3)) for p in patches if p.surface.kind != "plane"}
    assert curved == {("sphere", 15.0), ("cylinder", 4.0)}


@pytest.mark.parametrize(("radius", "is_round"), [(2.0, True), (16.0, False)])
def test_ten_sides_are_a_polygon_where_a_circle_would_be_another_part(radius, is_round):
    block = Manifold.cube([80.0, 40.0, 20.0], True) - turned_post(radius, 30.0, 10, z=-15.0)
    patches = detect_patches(to_trimesh(block))
    assert any(p.surface.kind == "cylinder" for p in patches) == is_round
    assert sum(p.surface.kind == "plane" for p in patches) == (6 if is_round else 16)


def test_a_coarse_ball_is_one_sphere_where_gentle_cuts_meet_it():
    """A cube's faces and three bores leave a 30-sided ball eight corners, and corners of cuts in which three gentle facets meet."""
    bores = [turned_post(6.5, 50.0, 30, z=-25.0).rotate(way) for way in ([0.0, 0.0, 0.0], [90.0, 0.0, 0.0], [0.0, 90.0, 0.0])]
    solid = Manifold.cube([20.0, 20.0, 20.0], True) ^ polar_ball(13.3, 30)
    for bore in bores:
        solid = solid - bore
    curved = [patch for patch in detect_patches(to_trimesh(solid)) if patch.surface.kind != "plane"]
    assert Counter(patch.surface.kind for patch in curved) == {"sphere": 1, "cylinder": 3}
    (ball,) = (patch.surface for patch in curved if patch.surface.kind == "sphere")
    assert ball.sizes == pytest.approx((13.3,), abs=2e-3)
    assert ball.point == pytest.approx((0.0, 0.0, 0.0), abs=2e-3)


def test_a_fluted_knob_is_round_between_its_flutes():
    """Each rest of its flank has one whole strip, and one on either side that a flute has cut."""
    solid = turned_post(10.0, 8.0, 30)
    for turn in range(0, 360, 60):
        solid = solid - turned_post(3.5, 10.0, 30, 12.0 * math.cos(math.radians(turn)), 12.0 * math.sin(math.radians(turn)), -1.0)
    patches = detect_patches(to_trimesh(solid))
    flanks = [p for p in patches if p.surface.kind == "cylinder" and p.outward > 0]
    assert [p.surface.sizes[0] for p in flanks] == pytest.approx([10.0], abs=1e-4)
    assert sum(p.surface.kind == "plane" for p in patches) == 2


@pytest.mark.parametrize(("sides", "flats"), [(8, 8), (10, 10), (24, 0)])
def test_sides_far_within_their_circle_are_a_polygons(sides, flats):
    """An octagon as large as the part is no round plate: no tessellation is as coarse. A small hole with as few sides is round."""
    plate = Manifold.cylinder(6.0, 20.0, 20.0, sides) - Manifold.cylinder(6.0, 1.5, 1.5, 8).translate([5.0, 0.0, 0.0])
    patches = detect_patches(to_trimesh(plate))
    round_ones = [patch.surface.sizes[0] for patch in patches if patch.surface.kind == "cylinder"]
    assert round_ones == pytest.approx([1.5] if flats else [20.0, 1.5], abs=1e-3)
    assert sum(patch.surface.kind == "plane" for patch in patches) == 2 + flats


@pytest.mark.parametrize(("height", "is_round"), [(10.0, True), (0.005, False)])
def test_a_needle_that_a_cut_leaves_makes_no_two_strips_a_cylinder(height, is_round):
    """A strip of a coarse funnel, that of the bore below it and a needle between the two lie on a wide cylinder across."""
    angles = np.radians([0.0, 12.0, 24.0, 36.0])
    rim = np.column_stack([48.0 * np.cos(angles), 48.0 * np.sin(angles)])
    strips = [[(*rim[k], 0.0), (*rim[k + 1], 0.0), (*rim[k + 1], high), (*rim[k], high)] for k, high in enumerate((10.0, 10.0, height))]
    faces = [face for k in (0, 4, 8) for face in ((k, k + 1, k + 2), (k, k + 2, k + 3))]
    facets = facets_of(trimesh.Trimesh(np.vstack(strips), faces, process=False))
    assert believable(Surface("cylinder", (0.0, 0.0, 5.0), (0.0, 0.0, 1.0), (48.0,)), np.arange(3), facets) == is_round


def test_a_coarse_bent_rod_is_a_torus_of_four_steps():
    """An elbow of sixteen sides goes round its quarter in four, and each of these is an elliptic cylinder too."""
    section = CrossSection.circle(6.0, 16).translate((25.0, 0.0))
    post = turned_post(6.0, 30.0, 16).rotate((90.0, 0.0, 0.0)).translate((25.0, -15.0, 0.0))
    found = Counter(p.surface.kind for p in detect_patches(to_trimesh(section.revolve(4, 90.0) + post)))
    assert (found["torus"], found["elliptic"]) == (1, 0)
