"""What a depth camera saw of planted parts from one side: off by long waves, from its own place, with nothing behind."""

import numpy as np
import pytest
from tests.planted import box, cut, cylinder, mesh_of

from imdim.delivery.verdict import judge
from imdim.geometry.shadows import Shadows
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.program.tree import Program, leaves
from imdim.reconstruction import one_body
from imdim.reconstruction.config import Settings
from imdim.reconstruction.observation import UnitBody, UnseenError
from imdim.reconstruction.pipeline import reconstruct_best
from imdim.reconstruction.trifles import without_trifles
from imdim.target.scan import VIEWS, Condition, parse_condition, scan
from imdim.target.target import Target, in_unit_frame, target_from

BLOCK = box(40, 30, 20)
CAMERA = 90.0 * VIEWS[0]


def seen_by_camera(part: Program, height: float, count: int = 12_000) -> Target:
    """One side of a part, in the coordinates of a camera; waves of this deviation, a seventh of the part long, along the line of sight."""
    wanted = parse_condition("views=1")
    assert wanted is not None
    points = scan(mesh_of(part), wanted, np.random.default_rng(5), count)[0] - CAMERA
    sight = points / np.linalg.norm(points, axis=1, keepdims=True)
    phases, ways = np.random.default_rng(6).uniform(0, 2 * np.pi, 6), np.random.default_rng(7).normal(size=(6, 3))
    waves = np.sin(points @ ways.T / np.linalg.norm(ways, axis=1) * (2 * np.pi / 8) + phases).sum(1) / np.sqrt(3)
    return target_from(points + height * waves[:, None] * sight)


def test_a_block_seen_from_a_corner_is_one_box_and_its_waves_are_noise():
    target = seen_by_camera(BLOCK, 0.5)
    assert target.scanners is not None
    found = reconstruct_best(target, Settings(budget_s=30.0))
    (leaf,) = leaves(found.program)
    assert leaf.kind == "box"
    assert sorted(leaf.size) == pytest.approx([20, 30, 40], abs=1.5)
    assert found.noisy
    assert found.noise is not None
    assert found.noise.model.bulges
    verdict = judge(target, to_trimesh(to_manifold(found.program)), program=found.program, scanned=True, noise=found.noise)
    assert verdict.overall == "partial"  # half of it is a guess
    assert verdict.borne_out is not None
    assert verdict.borne_out > 0.9
    assert verdict.explanation is not None
    assert verdict.explanation.gain is None
    assert verdict.shares["exact"] > 0.9


@pytest.mark.parametrize(("height", "bulges"), [(0.5, True), (0.0, False)])
def test_only_what_is_off_by_waves_bulges(height, bulges):
    unit, _ = in_unit_frame(seen_by_camera(BLOCK, height))
    assert UnitBody.of(unit, np.random.default_rng(0)).noise.bulges == bulges


def test_what_a_cut_changes_behind_is_a_trifle_and_before_it_is_none():
    points, wanted = seen_by_camera(BLOCK, 0.0).points, cylinder(4, 12)
    shadows = Shadows.of(points, np.zeros((1, 3)), 0.05)
    moved = box(40, 30, 20, tuple((-CAMERA).tolist()))
    for side, kept in ((1, True), (-1, False)):
        bored = cut(moved, cylinder(wanted.size[0], wanted.size[1], tuple((-CAMERA + [0, 0, side * 10]).tolist())))
        assert (without_trifles(bored, 1.0, shadows=shadows) == bored) == kept
        assert without_trifles(bored, 1.0) == bored


def is_guessed_block(found):
    (leaf,) = leaves(found.program)
    assert sorted(leaf.size) == pytest.approx([20, 30, 40], abs=1.5)
    assert "what lies behind is a guess" in found.proof
    return True


@pytest.mark.parametrize("height", [0.3, 0.0])
@pytest.mark.parametrize("moved", [True, False])
def test_one_side_is_that_with_and_without_waves_wherever_the_coordinates_begin(height, moved):
    seen = seen_by_camera(BLOCK, height)
    target = target_from(seen.points + CAMERA) if moved else seen
    assert (target.scanners is None) == moved
    found = reconstruct_best(target, Settings(budget_s=30.0))
    assert is_guessed_block(found)
    assert any("seen from one side" in note for note in found.notes) == moved


def test_a_cloud_that_shows_no_inside_is_taken_for_what_was_seen_from_one_side(monkeypatch):
    """Even if it is not certain, as of thin sheet."""

    def refuse(body, *_):
        raise UnseenError(f"{body.target.name}: no inside found")

    monkeypatch.setattr(one_body, "observe", refuse)
    monkeypatch.setattr(one_body, "certainly_one_side", lambda *_: False)
    target = target_from(seen_by_camera(BLOCK, 0.5).points + CAMERA)
    assert target.scanners is None
    found = reconstruct_best(target, Settings(budget_s=30.0))
    assert is_guessed_block(found)
    assert any("seen from one side" in note for note in found.notes)
    with pytest.raises(UnseenError, match="no inside found"):
        reconstruct_best(target_from(scan(mesh_of(BLOCK), Condition(), np.random.default_rng(0), 4000)[0]), Settings(budget_s=30.0))
