"""Verdicts on clouds whose points lie near a surface that is not the part's: the truth is planted, and never shown to the verdict."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import trimesh
from tests.planted import box, cut, cylinder, mesh_of, union

from imdim.delivery.explanation import explain, share_borne_out
from imdim.delivery.verdict import SurfaceVerdict, judge
from imdim.detection.noise import measure_noise
from imdim.program.tree import Program
from imdim.target.scan import parse_condition, place_scanners, scan
from imdim.target.target import target_from

BRACKET = cut(union(box(60, 40, 8), box(60, 8, 30, (0, 16, 15))), *(cylinder(4, 40, (x, -6, 0)) for x in (-18, 18)))
KNOB = cut(union(cylinder(20, 12), cylinder(9, 30, (0, 0, 12))), cylinder(4, 60))
BLOCK = box(40, 30, 20)
SKIN = cut(box(40.2, 30.2, 20.2), box(39.8, 29.8, 19.8))  # of a solid block
CAGE = union(*(box(3, 3, 24, (x, y, 0)) for x in (-10, 0, 10) for y in (-10, 0, 10)))
LUMP = box(23, 23, 24)  # whose walls are the cage's outer ones


def cloud_of(part: Program, condition: str, count: int = 8192) -> np.ndarray:
    wanted = parse_condition(condition)
    assert wanted is not None
    return scan(mesh_of(part), wanted, np.random.default_rng(4), count)[0]


def verdict_on(part: Program, condition: str, answer: Program, count: int = 8192) -> SurfaceVerdict:
    return judge(target_from(cloud_of(part, condition, count)), mesh_of(answer), program=answer)


@pytest.mark.parametrize("part", [BRACKET, KNOB, BLOCK, CAGE], ids=["bracket", "knob", "block", "cage"])
@pytest.mark.parametrize("condition", ["cloud", "noise=0.3%", "noise=0.5%+outliers=2%"])
def test_the_truth_raises_no_doubt(part, condition):
    found = verdict_on(part, condition, part)
    assert found.doubts == ()
    assert found.overall == "exact"


def test_fewer_points_on_one_side_raise_no_doubt():
    """A seventh as many on the right as on the left."""
    points = cloud_of(BRACKET, "noise=0.3%", 30_000)
    kept = np.random.default_rng(5).random(len(points)) < np.interp(points[:, 0], (-30, 30), (0.35, 0.05))
    found = judge(target_from(points[kept]), mesh_of(BRACKET), program=BRACKET)
    assert found.overall == "exact"


def test_a_skin_of_a_solid_is_not_exact():
    """All points lie on it, and none shows that it is hollow."""
    found = verdict_on(BLOCK, "noise=0.5%+outliers=2%", SKIN)
    assert judge(target_from(cloud_of(BLOCK, "noise=0.5%+outliers=2%")), mesh_of(SKIN)).shares["exact"] > 0.97
    assert found.overall == "partial"
    assert found.shares["exact"] < 0.1
    assert "walls thinner than the noise" in found.doubts[-1]


def test_a_solid_for_a_cage_is_not_explained():
    """Near the lump's walls lie the outer bars, and the rest of the cage within it is what it has no word for."""
    assert verdict_on(CAGE, "noise=0.5%", LUMP).overall in ("left out", "not explained")


def test_a_plate_for_a_fence_is_not_explained():
    """Each point lies near the plate, and yet they lie in rows."""
    bars = [box(4, 40, 3, (x, 0, 0)) for x in np.arange(-28, 29, 8.0).tolist()]
    fence, plate = union(*bars), box(60, 40, 3)
    points = cloud_of(fence, "noise=0.7%")
    assert judge(target_from(points), mesh_of(plate)).overall == "exact"  # by distances alone
    found = judge(target_from(points), mesh_of(plate), program=plate)
    assert found.overall == "not explained"
    assert found.shares["exact"] < 0.2
    assert "does not explain the points" in found.doubts[0]


def test_surface_that_nobody_saw_is_told_with_its_share():
    """The faces of a block that turn away from the one side that it is seen from; the answer is right, and half of it is a guess."""
    found = verdict_on(BLOCK, "noise=0.2%+views=1", BLOCK)
    x, y, z = 30 * 20, 40 * 20, 40 * 30  # all three faces that are seen, of twice as many
    assert found.explanation is not None
    assert found.explanation.bare == pytest.approx((x + y + z) / (2 * (x + y + z)), abs=0.05)
    assert found.overall == "partial"
    assert found.explanation.gain < 0 < found.explanation.shown_gain
    assert any("nobody saw it" in said for said in found.doubts)


def test_what_no_scanner_could_see_is_told():
    """Of a block, one scanner sees three faces of six; the others close it."""
    mesh, condition = mesh_of(BLOCK), parse_condition("noise=0.3%+views=1+scanners")
    assert condition is not None
    points, _ = scan(mesh, condition, np.random.default_rng(4))
    blind = target_from(points)
    found, unknown = (judge(t, mesh, program=BLOCK) for t in (replace(blind, scanners=place_scanners(mesh, 1)), blind))
    assert found.explanation is not None
    assert found.explanation.unseen == pytest.approx(0.5, abs=0.05)
    assert found.explanation.bare < 0.05 < unknown.explanation.bare  # type: ignore[union-attr]
    assert "no scanner could see" in found.doubts[-1]
    assert found.overall in ("approximated", "partial")


def test_a_boss_in_the_air_is_told():
    answer = union(BRACKET, cylinder(9, 16, (0, -6, 12)))
    found = verdict_on(BRACKET, "noise=0.3%", answer)
    assert found.overall in ("partial", "approximated")
    whole = trimesh.Trimesh(mesh_of(answer).vertices, mesh_of(answer).faces).area
    assert found.explanation is not None
    assert found.explanation.bare == pytest.approx((2 * np.pi * 9 * 16 + np.pi * 81) / whole, abs=0.05)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_the_scale_does_not_matter(scale):
    points = cloud_of(KNOB, "noise=0.4%") * scale
    answer = cut(
        union(cylinder(20 * scale, 12 * scale), cylinder(9 * scale, 30 * scale, (0, 0, 12 * scale))), cylinder(4 * scale, 60 * scale)
    )
    noise, kept = measure_noise(points, np.random.default_rng(0))
    told = explain(answer, points[kept], noise)
    assert told is not None
    assert told.shown_gain == pytest.approx(explain_at_one().shown_gain, abs=0.02)


@cache
def explain_at_one():
    points = cloud_of(KNOB, "noise=0.4%")
    noise, kept = measure_noise(points, np.random.default_rng(0))
    told = explain(KNOB, points[kept], noise)
    assert told is not None
    return told


def test_few_points_are_not_asked():
    assert verdict_on(BLOCK, "noise=0.3%", BLOCK, 200).explanation is None


def test_a_scan_may_bulge_and_no_more():
    """A block bulged by two deviations of real things is borne out; a ball for it is not."""
    mesh = trimesh.creation.box((40, 30, 20)).subdivide_to_size(2.0)
    bulge = 0.4 * np.prod(np.cos(np.pi * mesh.vertices / (2 * np.array([20, 15, 10.001]))), axis=1)
    vertices = mesh.vertices * (1 + bulge[:, None] / 20)
    mesh = trimesh.Trimesh(vertices, mesh.faces)
    deviation = 0.004 * float(np.linalg.norm(mesh.extents))

    def borne_out(program: Program) -> float:
        return share_borne_out(program, mesh.triangles_center, mesh.face_normals, mesh.area_faces, deviation)

    assert borne_out(BLOCK) > 0.95
    assert borne_out(cylinder(18, 20)) < 0.75
    assert judge(target_from(mesh), mesh_of(BLOCK), program=BLOCK, scanned=True).overall in ("exact", "approximated")
    assert judge(target_from(mesh), mesh_of(cylinder(18, 20)), program=cylinder(18, 20), scanned=True).overall in ("partial", "left out")
