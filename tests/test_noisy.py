"""Noisy clouds through the pipeline: judged by how likely they are, whatever the cells say."""

from types import SimpleNamespace

import numpy as np
import pytest
from tests.planted import PARTS, box, cut, cylinder, mesh_of, union

from imdim import methods, noisy
from imdim.body import ENOUGH_POINTS, look, uncrowded
from imdim.config import Settings
from imdim.geometry.cloud import InputError, sample_surface, target_from
from imdim.geometry.sampling import surface_points
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.noisy import most_likely, unlabelled
from imdim.pipeline import reconstruct
from imdim.program.cost import count
from imdim.program.tree import Primitive


def cloud(program, share=0.006, n=6000, outliers=0.0, seed=0):
    rng = np.random.default_rng(seed)
    points = surface_points(program, n, rng)[0]
    points = points + rng.normal(0, share * np.linalg.norm(np.ptp(points, axis=0)), points.shape)
    wrong = rng.permutation(n)[: round(outliers * n)]
    points[wrong] = rng.uniform(points.min(0) - 5, points.max(0) + 5, (len(wrong), 3))
    return points


def seen_of(points):
    return look(target_from(points), Settings().size_weight, np.random.default_rng(0))


@pytest.mark.parametrize(("name", "share"), [("L bracket", 0.006), ("plate with four holes", 0.003)])
def test_a_planted_part_comes_back_from_noise_and_strays(name, share):
    truth = PARTS[name]
    *_, last = reconstruct(target_from(cloud(truth, share, outliers=0.02)), Settings(checkpoint="none"), np.random.default_rng(0))
    assert volume_iou(to_manifold(last.program), to_manifold(truth)) >= 0.96
    assert count(last.program).primitives <= 1.5 * count(truth).primitives
    assert not last.proof


def test_strays_do_not_widen_the_body():
    seen = seen_of(cloud(box(40, 30, 10), outliers=0.03))
    assert seen.noisy
    low, high = seen.families.arrangement.bounds
    assert (high - low) / seen.frame.scale == pytest.approx((40, 30, 10), abs=3.5)
    assert not seen_of(cloud(box(40, 30, 10), share=0.0)).noisy


def test_the_search_starts_from_the_likeliest_program():
    truth = union(box(40, 30, 8), cylinder(7, 16, (5.0, 2.0, 8.0)))
    seen = seen_of(cloud(truth))
    found, _ = most_likely([truth, cut(truth, box(38, 28, 6)), box(9, 9, 9)], seen, lambda: True)
    assert volume_iou(to_manifold(found), to_manifold(truth)) > 0.97


def test_what_detection_missed_is_seen_in_the_points():
    truth = cut(union(box(40, 30, 8), cylinder(7, 16, (5.0, 2.0, 8.0))), cylinder(4, 20, (-12.0, 5.0, 0.0)))
    seen = seen_of(cloud(truth))
    found, _ = most_likely([box(40, 30, 8)], seen, lambda: False)
    assert count(found).primitives == 3
    assert volume_iou(to_manifold(found), to_manifold(truth)) > 0.97


def test_a_search_from_one_primitive_comes_first_and_the_likelier_program_is_told(monkeypatch):
    truth = cut(union(box(40, 30, 8), cylinder(7, 16, (5.0, 2.0, 8.0))), cylinder(4, 20, (-12.0, 5.0, 0.0)))
    seen, starts = seen_of(cloud(truth)), []

    def unchanged(likely, *_):
        starts.append(count(likely.program).primitives)
        return likely

    monkeypatch.setattr(noisy, "restructured", unchanged)
    found, _ = most_likely([truth], seen, lambda: len(starts) > 0)
    assert starts[:2] == [1, 3]  # the second is too late to be changed, yet not forgotten
    assert volume_iou(to_manifold(found), to_manifold(truth)) > 0.97


def test_what_is_too_much_goes_and_relations_hold():
    truth = union(box(40, 30, 8), box(20, 30, 16, (10.0, 0.0, 12.0)))
    seen = seen_of(cloud(truth))
    found, _ = most_likely([union(truth, box(3, 3, 8.4, (-14.0, 9.0, 0.0)))], seen, lambda: False)
    assert count(found).primitives == 2
    assert volume_iou(to_manifold(found), to_manifold(truth)) > 0.97


def test_where_detection_tells_no_inside_there_is_an_answer_still(monkeypatch):
    import imdim.pipeline as pipeline

    def blind(*_):
        raise InputError("part: no inside found, 0 of 4 sampled cells")

    truth = box(40, 30, 10)
    monkeypatch.setattr(pipeline, "look", blind)
    *_, last = reconstruct(target_from(cloud(truth)), Settings(checkpoint="none"), np.random.default_rng(0))
    assert volume_iou(to_manifold(last.program), to_manifold(truth)) > 0.8
    assert last.error == 1.0
    assert "shows no inside" in last.proof
    with pytest.raises(InputError, match="no inside"):
        list(reconstruct(target_from(cloud(truth)), Settings(method="tree"), np.random.default_rng(0)))
    with pytest.raises(InputError, match="no inside"):
        list(reconstruct(target_from(cloud(truth, share=0.0)), Settings(checkpoint="none"), np.random.default_rng(0)))


def test_a_calm_cloud_has_no_guess():
    assert unlabelled(target_from(cloud(box(4, 3, 1), share=0.0)), None, lambda: False) is None


def test_without_time_the_likeliest_is_told_as_it_is():
    truth = union(box(40, 30, 8), cylinder(7, 16, (5.0, 2.0, 8.0)))
    found, _ = most_likely([box(9, 9, 9), truth], seen_of(cloud(truth, n=3000)), lambda: True, lambda: True)
    assert volume_iou(to_manifold(found), to_manifold(truth)) > 0.99


@pytest.mark.parametrize("noisy", [True, False])
def test_a_noisy_clouds_time_is_not_spent_on_the_decision_tree(noisy, monkeypatch):
    asked = []
    monkeypatch.setattr(methods, "grown", lambda run: asked.append(run.seen))  # and gives nothing
    seen = SimpleNamespace(noisy=noisy, error=lambda _: 1.0)
    run = SimpleNamespace(seen=seen, clock=SimpleNamespace(cut=False))
    assert methods._grown_if_poor(run, methods.Step("search", Primitive("sphere", (1.0,)))) is None
    assert asked == ([] if noisy else [seen])
    methods._grown_if_poor(run, None)  # but where there is nothing, it is
    assert asked[-1] is seen


def test_only_a_cloud_whose_neighbours_are_nearer_than_its_noise_is_thinned():
    mesh, rng = mesh_of(box(40, 30, 20)), np.random.default_rng(6)
    points, normals = sample_surface(mesh.vertices, mesh.faces, 40_000, rng)
    calm = target_from(np.hstack([points, normals]))
    assert uncrowded(calm) is calm
    noisy = target_from(np.hstack([points + rng.normal(0, 1.0, points.shape), normals]))
    few = uncrowded(noisy)
    assert ENOUGH_POINTS <= len(few.points) < 20_000
    normal_of = dict(zip(map(tuple, noisy.points.tolist()), map(tuple, noisy.normals.tolist()), strict=True))
    kept = zip(map(tuple, few.points.tolist()), map(tuple, few.normals.tolist()), strict=True)
    assert all(normal_of[point] == normal for point, normal in kept)
    solid = target_from(mesh)
    assert uncrowded(solid) is solid
