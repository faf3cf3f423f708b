"""Noisy clouds through the pipeline: judged by how likely they are, whatever the cells say."""

import math
import os
import sys
from dataclasses import replace
from functools import cache
from itertools import count as count_up
from types import SimpleNamespace

import numpy as np
import pytest
from tests.deadlines import PASSED
from tests.drawn import NOZZLE
from tests.planted import PARTS, box, cut, cylinder, mesh_of, union

from imdim import side_process
from imdim.deadline import NEVER, Deadline
from imdim.detection.noise import ENOUGH_POINTS, EXACT
from imdim.geometry.sampling import surface_points
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.numbers.likelihood import Noise
from imdim.program.cost import count
from imdim.program.outline import Outline, circle, rectangle
from imdim.program.tree import Primitive, combine_all, leaves
from imdim.reconstruction import mdl, methods
from imdim.reconstruction.budget import Budget
from imdim.reconstruction.config import Settings
from imdim.reconstruction.likely_numbers import fit_numbers
from imdim.reconstruction.mdl import most_likely, reconstruct_unlabelled
from imdim.reconstruction.observation import UnitBody, UnseenError, observe
from imdim.reconstruction.pipeline import reconstruct
from imdim.reconstruction.policy_beam import PROPOSE_S
from imdim.target.target import InputError, in_unit_frame, sample_surface, target_from

LOOKS = 100  # at the clock, a sixth of a search
LOOK_S = 0.06  # of a budget of 60 s: after a thousand looks


def cloud(program, share=0.006, n=900, outliers=0.0, seed=0):
    rng = np.random.default_rng(seed)
    points = surface_points(program, n, rng)[0]
    points = points + rng.normal(0, share * np.linalg.norm(np.ptp(points, axis=0)), points.shape)
    wrong = rng.permutation(n)[: round(outliers * n)]
    points[wrong] = rng.uniform(points.min(0) - 5, points.max(0) + 5, (len(wrong), 3))
    return points


def seen_of(points):
    """What is seen of a cloud, and its frame."""
    unit, frame = in_unit_frame(target_from(points))
    rng = np.random.default_rng(0)
    return observe(UnitBody.of(unit, rng), Settings().size_weight, rng), frame


@cache
def seen_of_cloud(truth):
    """What is seen of `cloud(truth)`, which takes longer than most of what is done with it."""
    return seen_of(cloud(truth))


def told(starts, seen_in_frame, *times, drawn=False, anew=True):
    """`most_likely` for programs in the units of the points of what is seen, and there."""
    seen, frame = seen_in_frame
    return frame.undo(most_likely([frame.apply(p) for p in starts], seen, *times, drawn=drawn, anew=anew).program)


def both_after(looks):
    """Deadlines of the search and of its numbers, that pass when one of them was looked at so many times."""
    seconds = count_up()
    return (Deadline(looks, lambda: next(seconds)),) * 2


@pytest.mark.parametrize(("name", "share", "n"), [("L bracket", 0.006, 600), ("plate with four holes", 0.003, 600)])
def test_a_planted_part_comes_back_from_noise_and_strays(name, share, n):
    truth = PARTS[name]
    points, rng = cloud(truth, share, n, outliers=0.02), np.random.default_rng(0)
    # how far the searches come depends on the clock: one that only looks move is the same on every machine
    *_, last = reconstruct(target_from(points), Settings(checkpoint="none"), rng, count_up(step=LOOK_S).__next__)
    assert volume_iou(to_manifold(last.program), to_manifold(truth)) >= 0.96
    assert count(last.program).primitives <= 1.5 * count(truth).primitives
    assert not last.proof


def test_a_turned_part_in_noise_is_one_outline_unless_csg_is_asked_for():
    truth = Primitive("revolve", (360.0,), (3.0, -2.0, 5.0), (90.0, 0.0, 0.0), NOZZLE)
    seen, frame = seen_of(cloud(truth, 0.005, n=350, outliers=0.02))
    start = [Primitive("box", (0.1, 0.1, 0.1))]
    drawn = frame.undo(most_likely(start, seen, NEVER, drawn=True, anew=False).program)
    plain = most_likely(start, seen, *both_after(LOOKS), drawn=False).program
    early = most_likely(start, seen, *both_after(LOOKS), drawn=True).program
    assert [leaf.kind for leaf in leaves(drawn)] == ["revolve"]
    assert volume_iou(to_manifold(drawn), to_manifold(truth)) > 0.975
    assert all(leaf.outline is None for leaf in leaves(plain))
    assert [leaf.kind for leaf in leaves(early)] == ["revolve"], "where it may be drawn it is before that"


def test_what_is_drawn_is_searched_for_in_noise_too_and_a_feature_costs_more_there():
    """Only boxes and cylinders were looked for in the cells of noisy clouds."""
    truth = Primitive("extrude", (12.0,), outline=Outline((((0, 0, 0), (60, 0, 0), (60, 15, 0), (20, 15, 0), (8, 40, 0), (0, 40, 0)),)))
    unit, _ = in_unit_frame(target_from(cloud(truth, 0.004, n=4000)))
    rng, price = np.random.default_rng(0), Settings().size_weight
    seen = observe(UnitBody.of(unit, rng), price, rng, outlines=True)
    assert seen.noisy
    assert seen.size_weight > price
    settings = Settings(checkpoint="none", budget_s=30.0)
    step = next(methods.auto(methods.Run(seen, settings, lambda: None, Budget(30.0, lambda: 0.0), rng)))
    assert [leaf.kind for leaf in leaves(step.program)] == ["extrude"]


def test_strays_do_not_widen_the_body():
    seen, frame = seen_of(cloud(box(40, 30, 10), n=400, outliers=0.03))
    assert seen.noisy
    low, high = seen.families.arrangement.bounds
    assert (high - low) / frame.scale == pytest.approx((40, 30, 10), abs=3.5)
    assert not seen_of(cloud(box(40, 30, 10), share=0.0, n=400))[0].noisy


@pytest.mark.parametrize("wall", [0.5, 1.0, 1.5])  # of some 0.8 between points
def test_thin_walls_are_not_noise(wall):
    """Nor is a tube's curvature, where points are few: neither before nor after its surfaces are found."""
    points = cloud(cut(cylinder(10, 40), cylinder(10 - wall, 50)), share=0.0, n=4000)
    rng = np.random.default_rng(0)
    body = UnitBody.of(in_unit_frame(target_from(points))[0], rng)
    assert not body.noise.blurs
    assert not observe(body, Settings().size_weight, rng).noisy


def test_the_search_starts_from_the_likeliest_program():
    truth = union(box(40, 30, 8), cylinder(7, 16, (5.0, 2.0, 8.0)))
    found = told([truth, cut(truth, box(38, 28, 6)), box(9, 9, 9)], seen_of_cloud(truth), PASSED)
    assert volume_iou(to_manifold(found), to_manifold(truth)) > 0.97


def test_all_points_fit_the_numbers_and_weigh_them_even_where_time_is_out(monkeypatch):
    truth, fitted = box(40, 30, 8), []
    kept = mdl.fit_numbers
    monkeypatch.setattr(mdl, "fit_numbers", lambda program, points, *rest: fitted.append(len(points)) or kept(program, points, *rest))
    noisy = mdl._NoisyCloud.of(cloud(truth, n=6000), 0.3, drawn=False)
    noisy.find_shortest([truth], PASSED, NEVER)
    assert fitted == [6000]
    assert noisy._count == 6000


def test_what_detection_missed_is_seen_in_the_points():
    truth = cut(union(box(40, 30, 8), cylinder(7, 16, (5.0, 2.0, 8.0))), cylinder(4, 20, (-12.0, 5.0, 0.0)))
    found = told([box(40, 30, 8)], seen_of_cloud(truth), NEVER, anew=False)
    assert count(found).primitives == 3
    assert volume_iou(to_manifold(found), to_manifold(truth)) > 0.97


@pytest.mark.parametrize(("hidden", "begun"), [(False, [1, 3, 3]), (True, [1, 3, 3, 3])])
def test_searches_start_from_one_part_of_each_kind_and_from_a_program_and_the_shortest_is_told(hidden, begun, monkeypatch):
    truth = cut(union(box(40, 30, 8), cylinder(7, 16, (5.0, 2.0, 8.0))), cylinder(4, 20, (-12.0, 5.0, 0.0)))
    starts = []
    monkeypatch.setattr(mdl, "may_hide_skins", lambda *_: hidden)
    monkeypatch.setattr(mdl, "shorten", lambda likely, *_, **__: starts.append(likely.program) or iter(()))
    found = told([truth], seen_of_cloud(truth), NEVER, anew=False)
    # from the shortest with what the others found, and as if there was less noise where it may hide skins
    assert [count(p).primitives for p in starts] == begun
    assert volume_iou(to_manifold(found), to_manifold(truth)) > 0.97


def test_searches_start_from_the_best_drawing_of_each_kind_where_it_may_be_drawn(monkeypatch):
    truth = cut(union(box(40, 30, 8), cylinder(7, 16, (5.0, 2.0, 8.0))), cylinder(4, 20, (-12.0, 5.0, 0.0)))
    starts = []
    monkeypatch.setattr(mdl, "shorten", lambda likely, *_, **__: starts.append(likely.program) or iter(()))
    told([truth], seen_of_cloud(truth), NEVER, drawn=True, anew=False)
    assert [p.kind for p in starts if count(p).primitives == 1][1:] == ["revolve", "extrude"]


@pytest.mark.parametrize("evolution", [True, False])
def test_without_evolution_nothing_is_looked_for_anew(evolution, monkeypatch):
    asked = []
    monkeypatch.setattr(mdl._NoisyCloud, "_rebuild", lambda self, best, *_: asked.append(1) or best)
    monkeypatch.setattr(mdl, "shorten", lambda *_, **__: iter(()))
    settings = Settings(checkpoint="none", evolution=evolution, budget_s=60.0)
    *_, last = reconstruct(target_from(cloud(box(40, 30, 8), n=300)), settings, np.random.default_rng(0))
    assert asked == [1] * evolution
    assert count(last.program).primitives == 1


def test_what_two_wrong_parts_explain_together_is_taken_out_and_looked_for_anew(monkeypatch):
    """A search that adds one part to one finds the rib, and nothing where two posts stand for its ends."""
    plate, rib = box(60, 40, 4), box(60, 4, 18, (0.0, 8.0, 7.0))
    truth, wrong = union(plate, rib), union(union(plate, box(20, 6, 18, (-20.0, 8.0, 7.0))), box(20, 6, 18, (20.0, 8.0, 7.0)))
    noisy = mdl._NoisyCloud.of(cloud(truth, 0.004, n=1000), 0.29, np.eye(3), drawn=False)
    start, best = (fit_numbers(program, noisy.quick, noisy._noise, NEVER) for program in (wrong, truth))
    begun = []

    def add_a_rib(likely, *asked):
        assert asked[-2], "only what fills the hole is to be put in"
        begun.append(likely.program)
        return iter([(best, noisy._length(best))] if count(likely.program).primitives == 1 else [])

    monkeypatch.setattr(mdl, "shorten", add_a_rib)
    assert noisy._length(best) < noisy._length(start) - 0.05
    assert noisy._rebuild(start, [], NEVER) is best
    assert all(count(program).primitives < 3 for program in begun)
    assert len(begun) == len({*begun}) <= mdl.MOST_REBUILT
    assert noisy._rebuild(start, [], PASSED) is start


def test_leaves_are_looked_for_anew_until_neither_that_nor_a_single_change_shortens(monkeypatch):
    noisy = mdl._NoisyCloud.of(cloud(box(60, 40, 4), 0.004, n=1000), 0.29, np.eye(3), drawn=False)
    start = fit_numbers(box(60, 40, 4), noisy.quick, noisy._noise, NEVER)
    better, best = replace(start, nll=start.nll - 1), replace(start, nll=start.nll - 2)
    rebuilt, shortened = [], {start.nll: [better], better.nll: [], best.nll: []}

    def rebuild(_, likely, *__):
        rebuilt.append(likely)
        return best if likely is better else likely

    monkeypatch.setattr(mdl._NoisyCloud, "_rebuild", rebuild)
    monkeypatch.setattr(mdl, "shorten", lambda likely, *_, **__: iter([(p, p.nll) for p in shortened[likely.nll]]))
    assert noisy._rebuild_and_shorten(start, [], NEVER) is best
    assert rebuilt == [start, better]
    assert noisy._rebuild_and_shorten(start, [], PASSED) is start


def test_skins_that_were_taken_for_one_are_told_apart_in_less_noise():
    """All walls of a frame with a flange are 2.7 deviations of the noise thick, which seems larger by half where nothing else is."""
    frame = cut(union(box(54, 80, 16), box(59.4, 85.4, 2.7, (0.0, 0.0, -6.65))), box(48.6, 74.6, 40))
    points = cloud(frame, 1.0 / np.linalg.norm((59.4, 85.4, 16.0)), n=3000)
    noisy = mdl._NoisyCloud.of(points, 1.43, np.eye(3), drawn=False)
    wrong = fit_numbers(cut(box(56, 82, 15.4), box(49.4, 75, 40)), noisy.quick, noisy._noise, NEVER)
    assert wrong.noise.sigma > 1.3
    found = noisy._in_less_noise(wrong, [], NEVER)
    assert found.noise.sigma < 1.2
    assert noisy._length(found) < noisy._length(wrong) - 0.03
    block = mdl._NoisyCloud.of(cloud(box(60, 40, 20), 0.006, n=2000), 0.45, np.eye(3), drawn=False)
    told = fit_numbers(box(60, 40, 20), block.quick, block._noise, NEVER)
    assert block._in_less_noise(told, [], NEVER) is told


def test_what_a_search_in_less_noise_comes_to_is_kept_where_there_is_no_less():
    truth = union(box(60, 40, 8), box(20, 40, 20, (-20.0, 0.0, 10.0)))
    noisy = mdl._NoisyCloud.of(cloud(truth, 0.006, n=2500), 0.45, np.eye(3), drawn=False)
    half = fit_numbers(box(60, 40, 8), noisy.quick, noisy._noise, NEVER)
    found = noisy._in_less_noise(half, [*leaves(truth)], NEVER)
    assert count(found.program).primitives == 2
    assert noisy._length(found) < noisy._length(half) - 0.1
    assert found.noise.sigma > mdl.FALLEN * half.noise.sigma


@pytest.mark.parametrize(("most", "left_s", "left_out"), [(1, math.inf, True), (2, math.inf, False), (2, 5.0, True)])
def test_a_policy_is_loaded_last_and_only_where_there_is_time_for_it_and_what_is_left_out_is_told(most, left_s, left_out, monkeypatch):
    truth, asked = union(box(40, 30, 8), cylinder(7, 16, (5.0, 2.0, 8.0))), []
    monkeypatch.setattr(mdl, "may_hide_skins", lambda *_: True)
    monkeypatch.setattr(mdl, "shorten", lambda *_, **__: asked.append("search") or iter(()))
    monkeypatch.setattr(mdl, "count_with_time", lambda *_: most)
    monkeypatch.setattr(mdl, "beam_programs", lambda *_: asked.append("beam") or [truth, box(40, 30, 8)])
    monkeypatch.setattr(mdl, "next_parts", lambda *_: [])
    noisy = replace(
        mdl._NoisyCloud.of(cloud(truth), 0.3, np.eye(3), drawn=False), anew=False, policy=lambda: asked.append("load") or object()
    )
    assert noisy._search([truth], [*leaves(truth)], Deadline(left_s, lambda: 0.0))[1] == left_out
    # two searches that begin, the best with what both found, in less noise; then two from what was written, and what would be added
    assert asked[:4] == ["search"] * 4
    assert asked[4:] == (["load", "beam", *["search"] * 3] if left_s > PROPOSE_S else [])
    assert replace(noisy, policy=None)._search([truth], [*leaves(truth)], NEVER)[1] == (most == 1)


@pytest.mark.parametrize("hides", [False, True])
@pytest.mark.parametrize(("reached", "going_on"), [(5.0, [-5.0, -4.0]), (1.0, [-5.0])])
def test_where_time_cuts_the_first_searches_the_most_promising_goes_on_beside_the_shortest(monkeypatch, reached, going_on, hides):
    """Each of them again in less noise where it may hide skins."""
    truth, now, calls = union(box(40, 30, 8), cylinder(7, 16, (5.0, 2.0, 8.0))), [0.0], []

    def in_turn(lineages, deadline, *_):
        calls.append([lineage.length for lineage in lineages])
        if len(calls) == 1:
            (one, two), now[0] = lineages, reached
            one.length = one.promised = -5.0
            two.length, two.promised = -4.0, -9.0
        return lineages

    monkeypatch.setattr(mdl, "shorten", lambda *_, **__: iter(()))
    monkeypatch.setattr(mdl, "run_in_turn", in_turn)
    monkeypatch.setattr(mdl._NoisyCloud, "_hides_skins", lambda *_: hides)
    noisy = mdl._NoisyCloud.of(cloud(truth), 0.3, np.eye(3), drawn=False)
    noisy._search([truth], [*leaves(truth)], Deadline(10.0, lambda: now[0]))
    assert calls[1][: len(going_on)] == going_on
    assert len(calls[1]) == (1 + hides) * len(going_on)


def test_what_is_too_much_goes_and_relations_hold():
    truth = union(box(40, 30, 8), box(20, 30, 16, (10.0, 0.0, 12.0)))
    found = told([union(truth, box(3, 3, 8.4, (-14.0, 9.0, 0.0)))], seen_of(cloud(truth, n=350)), NEVER, anew=False)
    assert count(found).primitives == 2
    assert volume_iou(to_manifold(found), to_manifold(truth)) > 0.97


def test_where_detection_tells_no_inside_there_is_an_answer_still(monkeypatch):
    from imdim.reconstruction import one_body

    def blind(*_):
        raise UnseenError("part: no inside found, 0 of 4 sampled cells")

    truth = box(40, 30, 10)
    monkeypatch.setattr(one_body, "observe", blind)
    monkeypatch.setattr(mdl, "shorten", lambda *_, **__: iter(()))  # a start is an answer
    *_, last = reconstruct(target_from(cloud(truth, n=400)), Settings(checkpoint="none"), np.random.default_rng(0))
    assert volume_iou(to_manifold(last.program), to_manifold(truth)) > 0.8
    assert last.error == 1.0
    assert "shows no inside" in last.proof
    with pytest.raises(InputError, match="no inside"):
        list(reconstruct(target_from(cloud(truth, n=400)), Settings(method="tree"), np.random.default_rng(0)))
    with pytest.raises(InputError, match="no inside"):
        list(reconstruct(target_from(cloud(truth, share=0.0, n=400)), Settings(checkpoint="none"), np.random.default_rng(0)))


def test_a_calm_cloud_has_no_guess():
    body = UnitBody.of(in_unit_frame(target_from(cloud(box(4, 3, 1), share=0.0)))[0], np.random.default_rng(0))
    assert reconstruct_unlabelled(body, None, NEVER) is None


def test_without_time_the_likeliest_is_told_as_it_is():
    truth = union(box(40, 30, 8), cylinder(7, 16, (5.0, 2.0, 8.0)))
    found = told([box(9, 9, 9), truth], seen_of_cloud(truth), PASSED, PASSED)
    assert volume_iou(to_manifold(found), to_manifold(truth)) > 0.99


@pytest.mark.parametrize("noisy", [True, False])
def test_a_noisy_clouds_time_is_not_spent_on_the_decision_tree(noisy):
    asked = []  # and gives nothing
    evidence = SimpleNamespace(tree=lambda *_, **__: asked.append(seen), has_time_for_all_cells=lambda _: True)
    seen = SimpleNamespace(noisy=noisy, error=lambda _: 1.0, faceting=0.0, evidence=evidence)
    budget = Budget(60.0)
    run = SimpleNamespace(seen=seen, part_of=budget.end_of, budget=budget)
    found = methods.MethodStep("search", Primitive("sphere", (1.0,)))
    assert methods._grow_if_poor(run, found) == found
    assert asked == ([] if noisy else [seen])
    methods._grow_if_poor(run, None)  # but where there is nothing, it is
    assert asked[-1] is seen


@pytest.mark.parametrize("drawn", [True, False])
def test_what_is_drawn_is_not_evolved(drawn, monkeypatch):
    """Both leave a tenth of the volume, of which evolution would mend something."""
    asked = []
    monkeypatch.setattr(methods, "_generations", lambda *_: asked.append(1) or iter(()))
    scorer = SimpleNamespace(score=lambda _: [SimpleNamespace(fitness=0.1)])
    evidence = SimpleNamespace(exact=True, scorer=scorer)
    seen = SimpleNamespace(error=lambda _: 0.1, faceting=0.0, evidence=evidence, exact_price=lambda _: 1.0)
    run = SimpleNamespace(seen=seen, settings=Settings(), budget=Budget(60.0))
    plate = Primitive("extrude", (2.0,), outline=Outline((((0.0, 0.0, 0.0), (4.0, 0.0, 0.0), (0.0, 3.0, 0.0)),)))
    list(methods._touch_up(run, methods.MethodStep("search", plate if drawn else box(4, 3, 2))))
    assert asked == ([] if drawn else [1])


@pytest.mark.parametrize(
    ("budget_s", "late", "of_all", "long", "taken", "stop"),
    [
        (60.0, False, True, 3, True, "finished"),
        (60.0, False, False, 3, True, methods.CUT),
        (60.0, True, True, 3, True, methods.CUT),
        (20.0, False, True, 3, True, methods.CUT),
        (1.0, False, True, 200, False, methods.CUT),
    ],
    ids=["in time", "of some cells", "late", "as large as there is time for", "too long"],
)
def test_a_tree_is_taken_where_time_is_left_to_write_it_down(budget_s, late, of_all, long, taken, stop):
    """However late it is, since what it may have then is written in a moment; what time made smaller is said to be cut."""
    asked = []
    tree = combine_all("union", [box(1, 1, 1, (2.0 * i, 0.0, 0.0)) for i in range(long)])
    found = methods.MethodStep("search", box(9, 9, 9))
    price = {tree: 1.0, found.program: 2.0}

    def grow(_, config, of_some):
        asked.append(config.max_leaves)
        return tree

    evidence, budget = SimpleNamespace(tree=grow, has_time_for_all_cells=lambda _: of_all), Budget(budget_s)
    seen = SimpleNamespace(noisy=False, error=lambda _: 1.0, faceting=0.0, evidence=evidence, price=price.get)
    run = SimpleNamespace(seen=seen, part_of=lambda stage: PASSED if late else budget.end_of(stage), budget=budget)
    step = methods._grow_if_poor(run, found)
    assert (step.program is tree, step.stop) == (taken, stop)
    assert asked[0] >= methods.WRITABLE * methods.WRITTEN  # a box takes seven


@pytest.mark.parametrize("noisy", [True, False])
def test_only_where_the_cells_have_the_last_word_their_search_is_said_to_be_cut(noisy, monkeypatch):
    ball = Primitive("sphere", (1.0,))
    for name, value in (("search_structure", iter([SimpleNamespace(sequence=(ball,), families=None)])), ("to_program", ball)):
        monkeypatch.setattr(methods, name, lambda *_, value=value: value)
    for name in ("tidy", "transfer"):
        monkeypatch.setattr(methods, name, lambda sequence, _: sequence)
    evidence, cells = SimpleNamespace(exact=False), SimpleNamespace(volume=1.0)
    seen = SimpleNamespace(noisy=noisy, cells=cells, size_weight=1.0, evidence=evidence, copies_once=True, families=None)
    budget = SimpleNamespace(end_of=lambda _: PASSED)
    run = SimpleNamespace(seen=seen, settings=Settings(), part_of=lambda _: PASSED, budget=budget, rng=None)
    proofs = SimpleNamespace(early=lambda _: None)
    assert [*methods._search_structure(run, proofs)][-1].stop == ("finished" if noisy else methods.CUT)


def test_where_every_cell_is_outside_the_search_has_no_program(monkeypatch):
    """Of a part that is as thin as its noise all cells may be taken for outside, and a sequence of no steps is best."""
    empty = SimpleNamespace(sequence=(), families=None)
    monkeypatch.setattr(methods, "search_structure", lambda *_: iter([empty]))
    cells = SimpleNamespace(volume=1.0)
    seen = SimpleNamespace(noisy=True, cells=cells, size_weight=1.0, evidence=SimpleNamespace(exact=False), copies_once=True, families=None)
    run = SimpleNamespace(seen=seen, settings=Settings(), part_of=lambda _: NEVER, rng=None)
    assert not list(methods._search_structure(run, None))


def test_only_a_cloud_whose_neighbours_are_nearer_than_its_noise_is_thinned():
    mesh, rng = mesh_of(box(40, 30, 20)), np.random.default_rng(6)
    points, normals = sample_surface(mesh.vertices, mesh.faces, 40_000, rng)
    calm, _ = in_unit_frame(target_from(np.hstack([points, normals])))
    assert len(UnitBody.of(calm, rng).target.points) == len(points)
    noisy, _ = in_unit_frame(target_from(np.hstack([points + rng.normal(0, 1.0, points.shape), normals])))
    few = UnitBody.of(noisy, rng).target
    assert ENOUGH_POINTS <= len(few.points) < 20_000
    normal_of = dict(zip(map(tuple, noisy.points.tolist()), map(tuple, noisy.normals.tolist()), strict=True))
    kept = zip(map(tuple, few.points.tolist()), map(tuple, few.normals.tolist()), strict=True)
    assert all(normal_of[point] == normal for point, normal in kept)
    solid = target_from(mesh)
    assert UnitBody.of(solid, rng).noise is EXACT


def test_a_search_that_time_has_cut_leaves_nothing_spare():
    """Two cuts that do one work, each almost in the other, are no longer told after it."""
    truth = cut(box(40, 30, 20), cylinder(6, 30))
    doubled = cut(cut(cut(box(40, 30, 20), cylinder(6.0, 24)), cylinder(5.9, 30)), cylinder(4, 26))
    points = cloud(truth)
    noisy = mdl._NoisyCloud.of(points, 0.3, np.eye(3), drawn=False)
    likely = mdl.maximise_likelihood(doubled, noisy.quick, Noise(0.3), mdl.REFIT)
    assert count(noisy._without_spare(likely, NEVER).program).primitives == 2
    assert noisy._without_spare(likely, PASSED) is likely
    for program in (truth, box(40, 30, 20)):
        plain = mdl.maximise_likelihood(program, noisy.quick, Noise(0.3), mdl.REFIT)
        assert noisy._without_spare(plain, NEVER) is plain


def test_copies_that_hardly_differ_become_alike_where_that_is_shorter():
    holes = [cylinder(4, 20, (x, 0.0, 0.0)) for x in (-20.0, 0.0, 20.0)]
    truth = cut(box(60, 24, 6), union(*holes))
    noisy = mdl._NoisyCloud.of(cloud(truth, 0.004, n=2000), 0.26, np.eye(3), drawn=False)
    apart = cut(box(60, 24, 6), union(*(replace(h, size=(4 + 0.1 * k, 20.0)) for k, h in enumerate(holes))))
    best = fit_numbers(apart, noisy.quick, noisy._noise, NEVER)
    tied = noisy._tie(best, NEVER)
    assert len({round(p.size[0], 6) for p in leaves(tied.program) if p.kind == "cylinder"}) == 1
    assert noisy._length(tied) < noisy._length(best)
    other = cut(box(60, 24, 6), union(cylinder(6, 20, (-20.0, 0.0, 0.0)), cylinder(3, 20, (20.0, 0.0, 0.0))))
    far = mdl._NoisyCloud.of(cloud(other, 0.004, n=2000), 0.26, np.eye(3), drawn=False)
    fitted = fit_numbers(other, far.quick, far._noise, NEVER)
    assert far._tie(fitted, NEVER) is fitted


def test_holes_of_drawings_are_cuts_of_their_own_before_the_last_search():
    drawn = Primitive("extrude", (6.0,), outline=Outline((*rectangle(60.0, 24.0).loops, circle(4.0, -20.0, 0.0), circle(4.0, 20.0, 0.0))))
    apart = mdl._with_holes_apart(union(drawn, box(5, 5, 20)), 0.3)
    assert [p.kind for p in leaves(apart)] == ["box", "box", "cylinder", "cylinder"]
    assert volume_iou(to_manifold(apart), to_manifold(union(drawn, box(5, 5, 20)))) > 0.999
    assert mdl._with_holes_apart(box(5, 5, 20), 0.3) is None


@pytest.mark.skipif(sys.platform != "linux", reason="copies of a process are for Linux")
def test_two_cores_find_the_same(monkeypatch):
    truth = cut(box(40, 30, 20), cylinder(6, 30))
    noisy = mdl._NoisyCloud.of(cloud(truth, n=250), 0.3, np.eye(3), drawn=False, trifle=0.1)
    monkeypatch.setattr(side_process, "can_fork", lambda: False)
    alone = replace(noisy, anew=False).find_shortest([box(40, 30, 20)], NEVER, NEVER)
    made, fork = [], os.fork
    monkeypatch.setattr(side_process, "can_fork", lambda: True)
    monkeypatch.setattr(os, "fork", lambda: made.append(fork()) or made[-1])
    assert replace(noisy, anew=False).find_shortest([box(40, 30, 20)], NEVER, NEVER) == alone
    assert made
