import math

import numpy as np
import pytest
import trimesh
from tests.known_programs import KNOWN

from imdim.delivery.evaluate import DeliveryLoss, evaluate, evaluate_file
from imdim.export.meshes import write_meshes
from imdim.export.openscad import to_openscad
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.program.tree import Combine, Primitive
from imdim.target.target import target_from

CUBE = Primitive("box", (1.0, 1.0, 1.0))


def shifted(by: float) -> Primitive:
    return Primitive("box", (1.0, 1.0, 1.0), (by, 0.0, 0.0))


def test_a_shifted_cube_has_the_closed_form_scores():
    scores = evaluate(shifted(0.25), target_from(trimesh.creation.box()))
    assert scores.volume_iou == pytest.approx(0.75 / 1.25)
    assert scores.to_result.max == pytest.approx(0.25)
    assert scores.to_target.max == pytest.approx(0.25)
    # two of six faces lie 0.25 off, of the other four a quarter is off by 0 to 0.25
    mean = 2 / 6 * 0.25 + 4 / 6 * 0.25 * 0.125
    assert scores.to_result.mean == pytest.approx(mean - 1 / 6 * _shortcut(), rel=0.02)
    assert scores.relative(scores.to_result).max == pytest.approx(0.25 / math.sqrt(3))
    assert (scores.primitives, scores.operations) == (1, 0)


def _shortcut() -> float:
    """How much nearer the end face that lies inside the shifted cube has its rim to that cube's sides, on average over the face."""
    grid = (np.arange(2000) + 0.5) / 2000
    rim = np.minimum(grid, 1 - grid)
    return 0.25 - float(np.minimum(np.minimum(rim[:, None], rim[None]), 0.25).mean())


@pytest.mark.parametrize("name", ["cross drilled", "torus", "plate with boss and holes"])
def test_a_perfect_result_is_perfect(name):
    program = KNOWN[name][0]
    target = target_from(trimesh.Trimesh(**_arrays(to_manifold(program)), process=False))
    scores = evaluate(program, target)
    assert scores.volume_iou == pytest.approx(1, abs=1e-9)
    assert max(scores.to_result.max, scores.to_target.max) < 1e-8


def _arrays(solid):
    mesh = solid.to_mesh64()
    return {"vertices": np.array(mesh.vert_properties)[:, :3], "faces": np.array(mesh.tri_verts, np.int64)}


def test_a_cloud_has_distances_and_no_iou():
    points = trimesh.sample.sample_surface(trimesh.creation.box(), 8000, seed=0)[0]
    scores = evaluate(shifted(0.1), target_from(points))
    assert scores.volume_iou is None
    assert scores.iou_missing == "the target is a cloud"
    assert scores.to_result.max == pytest.approx(0.1, abs=1e-6)
    assert 0.1 < scores.to_target.max < 0.15


def test_an_open_mesh_has_no_iou():
    box = trimesh.creation.box()
    plates = trimesh.Trimesh(box.vertices, box.faces[:4], process=False)
    scores = evaluate(CUBE, target_from(plates))
    assert (scores.volume_iou, scores.iou_missing) == (None, "the target's mesh is not closed")
    assert scores.to_result.max == pytest.approx(0)
    assert scores.to_target.max > 0.4


def test_an_empty_result_is_a_failure_not_a_gap():
    scores = evaluate(Combine("difference", CUBE, Primitive("box", (2.0, 2.0, 2.0))), target_from(trimesh.creation.box()))
    assert scores.volume_iou == 0
    assert scores.to_result.mean == scores.to_target.max == math.inf


def test_delivered_files_score_as_the_program(tmp_path):
    program = KNOWN["cross drilled"][0]
    target = target_from(trimesh.creation.box())
    (tmp_path / "program.scad").write_text(to_openscad(program))
    write_meshes(to_manifold(program), tmp_path)
    direct = evaluate(program, target)
    assert direct.volume_iou == pytest.approx(KNOWN["cross drilled"][1], rel=1e-3)
    scad = evaluate_file(tmp_path / "program.scad", target)
    assert (scad.primitives, scad.operations) == (3, 2)
    for name in ("program.scad", "mesh.stl", "mesh.glb", "mesh.3mf"):
        scores = evaluate_file(tmp_path / name, target)
        assert scores.volume_iou == pytest.approx(direct.volume_iou, rel=1e-6)
        assert scores.to_target.max == pytest.approx(direct.to_target.max, rel=1e-2)


def test_the_mesh_is_asked_once_of_one_solid():
    """A program that was delivered as it was found has the delivered one's IoU; another one's is measured."""
    half, whole = Primitive("box", (1.0, 1.0, 0.5)), Primitive("box", (1.0, 1.0, 1.0))
    target = target_from(to_trimesh(to_manifold(whole)))
    assert DeliveryLoss.of(half, to_manifold(half), target, scored=0.75) == DeliveryLoss(0.75, 1.0)
    other = DeliveryLoss.of(half, to_manifold(whole), target, scored=0.75)
    assert (other.found, other.delivered) == (pytest.approx(0.5), pytest.approx(0.5))
    assert DeliveryLoss.of(half, to_manifold(half), target).found == pytest.approx(0.5)
