"""Threads are told by pitch and diameters wherever they lie, and come off as plain cylinders; what is none stays."""

import math
from itertools import pairwise

import numpy as np
import pytest
import trimesh
from manifold3d import CrossSection, Manifold, OpType
from tests.threaded import MINOR, PITCH, bolt, ringed_rod, tapped_block, threaded_rod

from imdim.detection.facets import facets_of
from imdim.detection.mesh_surfaces import detect_patches
from imdim.detection.threads import Thread, describe_thread, find_threads
from imdim.detection.unthread import take_off_threads
from imdim.geometry.solid import mesh_to_manifold, to_trimesh, volume_iou
from imdim.program.metric import metric_thread
from imdim.target.target import target_from

ASLANT = np.array(trimesh.transformations.rotation_matrix(0.7, [1, 2, 3]), float)
ASLANT[:3, 3] = [30, -20, 50]
PLACES: dict[str, np.ndarray] = {"as it is": np.eye(4), "aslant": ASLANT}


def prepared(mesh: trimesh.Trimesh, place: str = "as it is") -> trimesh.Trimesh:
    found = target_from(mesh.copy().apply_transform(PLACES[place])).mesh
    assert found is not None
    return found


def threads_of(mesh: trimesh.Trimesh) -> list[Thread]:
    return find_threads(facets_of(mesh))


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize(
    ("mesh", "lead", "internal"),
    [
        (bolt(), PITCH, False),
        (bolt(chamfered=True), PITCH, False),
        (bolt().apply_transform(np.diag([-1.0, 1.0, 1.0, 1.0])), -PITCH, False),
        (bolt(rounded=True), PITCH, False),
        (tapped_block(), PITCH, True),
        (tapped_block(countersunk=True), PITCH, True),
    ],
    ids=["bolt", "chamfered", "left-handed", "rounded", "nut", "countersunk"],
)
def test_a_helix_is_measured(mesh: trimesh.Trimesh, lead: float, internal: bool, place: str) -> None:
    (thread,) = threads_of(prepared(mesh, place))
    assert thread.internal == internal
    assert thread.lead == pytest.approx(lead, rel=5e-3)
    assert thread.pitch == pytest.approx(PITCH, rel=5e-3)
    assert thread.crest == pytest.approx(MINOR[True] if internal else 8, rel=1e-6)
    assert (thread.major if internal else thread.minor) == pytest.approx(8 if internal else MINOR[False], rel=0.01)  # corners on chords
    assert abs(float(thread.axis @ PLACES[place][:3, 2])) == pytest.approx(1, abs=1e-6)
    assert metric_thread(thread.major, thread.pitch, internal) == "M8 x 1.25"


@pytest.mark.parametrize(("starts", "sides"), [(2, 32), (3, 48), (1, 12)])
def test_starts_are_counted(starts: int, sides: int) -> None:
    (thread,) = threads_of(prepared(to_trimesh(threaded_rod(6.5, 8, 1.25, 6 * starts, sides=sides, starts=starts))))
    assert thread.lead == pytest.approx(1.25 * starts, rel=0.01)
    assert thread.pitch == pytest.approx(1.25, rel=0.01)


@pytest.mark.parametrize("scale", [0.001, 1.0, 1000.0])
def test_rings_are_a_thread_at_any_size(scale: float) -> None:
    (thread,) = threads_of(prepared(to_trimesh(ringed_rod(6.647, 8, 1.25, 10)).apply_scale(scale)))
    assert thread.lead == 0
    assert (thread.pitch, thread.minor, thread.major) == pytest.approx((1.25 * scale, 6.647 * scale, 8 * scale), rel=1e-6)


def spring() -> Manifold:
    """A wire of 1.5 wound about the axis six times: a row of its sections, joined two by two."""
    at = np.linspace(0, 12 * math.pi, 6 * 24 + 1)
    places = np.column_stack([5 * np.cos(at), 5 * np.sin(at), 2.5 * at / (2 * math.pi)])
    balls = [Manifold.sphere(0.75, 16).translate(tuple(p)) for p in places]
    return Manifold.batch_boolean([Manifold.batch_hull([a, b]) for a, b in pairwise(balls)], OpType.Add)


def twisted_gear() -> Manifold:
    turn = 2 * np.pi * np.arange(120) / 120
    reach = 10 + 0.8 * np.sign(np.sin(12 * turn + 0.01))
    return CrossSection([np.column_stack([reach * np.cos(turn), reach * np.sin(turn)])]).extrude(8, 16, 30)


@pytest.mark.parametrize(
    "solid",
    [
        ringed_rod(16, 20, 3.5, 10.5, half_angle_deg=20),  # a pulley of three belts
        ringed_rod(6.647, 8, 1.25, 2.5),  # two grooves
        threaded_rod(38, 40, 4, 5),  # the neck of a bottle
        spring(),
        twisted_gear(),
    ],
    ids=["belts", "two grooves", "bottle", "spring", "twisted gear"],
)
def test_what_is_no_thread(solid: Manifold) -> None:
    assert not threads_of(prepared(to_trimesh(solid)))


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("chamfered", [False, True])
def test_a_bolt_comes_off_as_its_crests(chamfered: bool, place: str) -> None:
    mesh = prepared(bolt(chamfered=chamfered), place)
    plain = take_off_threads(mesh, facets_of(mesh), threads_of(mesh))
    assert len(plain.threads) == 1
    rod = Manifold.cylinder(15, 4, 4, 256) + Manifold.cylinder(1, 4, 3, 256).translate((0, 0, 15))
    wanted = (rod if chamfered else Manifold.cylinder(16, 4, 4, 256)) + Manifold.cylinder(5, 6.5, 6.5, 256).translate((0, 0, -5))
    assert volume_iou(wanted.transform(PLACES[place][:3]), mesh_to_manifold(plain.mesh)) > 0.995
    kinds = sorted(patch.surface.kind for patch in detect_patches(plain.mesh))
    assert kinds == ["cone"] * chamfered + ["cylinder"] * 2 + ["plane"] * 3


@pytest.mark.parametrize("countersunk", [False, True])
def test_a_nut_comes_off_as_its_hole(countersunk: bool) -> None:
    mesh = prepared(tapped_block(countersunk), "aslant")
    plain = take_off_threads(mesh, facets_of(mesh), threads_of(mesh))
    assert len(plain.threads) == 1
    hole = Manifold.cylinder(14, MINOR[True] / 2, MINOR[True] / 2, 256).translate((5, 0, -7))
    hole += Manifold.cylinder(2, 3, 5, 256).translate((5, 0, 4.5)) if countersunk else Manifold()
    wanted = (Manifold.cube((30, 20, 12), True) - hole).transform(ASLANT[:3])
    assert volume_iou(wanted, mesh_to_manifold(plain.mesh)) > 0.999


def test_a_thread_that_a_slot_parts_stays() -> None:
    slotted = mesh_to_manifold(bolt()) - Manifold.cube((2, 20, 30), True).translate((0, 0, 10))
    mesh = prepared(to_trimesh(slotted))
    threads = threads_of(mesh)
    plain = take_off_threads(mesh, facets_of(mesh), threads)
    assert plain.mesh is mesh
    assert plain.kept == tuple(threads)


@pytest.mark.parametrize(
    ("major", "pitch", "internal", "size"),
    [
        (8, 1.25, False, "M8 x 1.25"),
        (7.85, 1.25, False, "M8 x 1.25"),
        (8, 1.0, True, "M8 x 1"),
        (4.1, 0.7, True, "M4 x 0.7"),
        (8.2, 1.25, False, None),
        (8, 1.1, False, None),
        (6.35, 1.27, False, None),
    ],
)
def test_metric_sizes(major: float, pitch: float, internal: bool, size: str | None) -> None:
    assert metric_thread(major, pitch, internal) == size


def test_a_thread_in_words() -> None:
    thread = threads_of(prepared(bolt()))[0]
    assert describe_thread(thread).startswith("thread M8 x 1.25, pitch 1.25, diameters ")
    left = threads_of(prepared(bolt().apply_transform(np.diag([-1.0, 1.0, 1.0, 1.0]))))[0]
    assert describe_thread(left).endswith("left-handed")
