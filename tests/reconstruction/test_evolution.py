"""method=evolve through the pipeline, and the front that every method leaves."""

import time

import numpy as np
import pytest
from tests.planted import PARTS, box, cut, cylinder, mesh_of, sphere, union
from tests.search.evolve.scenes import planted_scene

from imdim.deadline import NEVER
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.cost import count
from imdim.program.front import Choice
from imdim.program.tree import leaves
from imdim.reconstruction.choices import thin_front, unite_fronts
from imdim.reconstruction.config import Settings
from imdim.reconstruction.evolution import log_generations
from imdim.reconstruction.pipeline import Snapshot, reconstruct
from imdim.search.evolve.population import EvolutionConfig, evolve
from imdim.target.target import target_from

PLATE = PARTS["plate with four holes"]


def snapshots(mesh, **settings) -> list[Snapshot]:
    """By the processor's clock: where other work took the machine, what was found in the time of the wall was less."""
    return list(reconstruct(target_from(mesh), Settings(**settings), np.random.default_rng(0), time.process_time))


def check_front(last: Snapshot) -> None:
    sizes, errors = [count(c.program).primitives for c in last.front], [c.error or 0.0 for c in last.front]
    assert sizes == sorted(set(sizes))
    assert [e for e in errors if e > 1e-3] == sorted((e for e in errors if e > 1e-3), reverse=True)
    assert len(last.front) <= 7
    assert [c.program for c in last.front].count(last.program) == 1


@pytest.mark.parametrize(("language", "most", "choices"), [("csg", 5, 3), ("cad", 1, 1)])
def test_evolution_finds_a_planted_part(language, most, choices):
    *_, last = snapshots(mesh_of(PLATE), method="evolve", budget_s=15.0, language=language)
    assert volume_iou(to_manifold(last.program), to_manifold(PLATE)) > 0.998
    assert count(last.program).primitives <= most
    assert last.stop in ("exact", "stagnation", "budget_spent")
    check_front(last)
    assert len(last.front) >= choices


@pytest.mark.parametrize("name", ["tube on a flange", "rounded plate"])
def test_the_search_leaves_a_front_whose_errors_are_true(name):
    mesh = mesh_of(PARTS[name])
    *_, last = snapshots(mesh)
    check_front(last)
    truth = to_manifold(PARTS[name])
    for choice in last.front:
        solid = to_manifold(choice.program)
        apart = (solid.volume() + truth.volume() - 2 * (solid ^ truth).volume()) / truth.volume()
        assert choice.error == pytest.approx(apart, abs=0.02)


def test_a_budget_of_one_second_still_returns_a_program():
    *_, last = snapshots(mesh_of(PARTS["L bracket"]), method="evolve", budget_s=1.0)
    assert volume_iou(to_manifold(last.program), to_manifold(PARTS["L bracket"])) > 0.5
    assert last.stop == "budget_spent"
    assert last.front


def test_two_bodies_share_the_time():
    apart = union(box(20, 20, 20), cylinder(8, 20, (40.0, 0.0, 0.0)))
    *_, last = snapshots(mesh_of(apart), method="evolve", budget_s=10.0)
    assert volume_iou(to_manifold(last.program), to_manifold(apart)) > 0.995
    assert count(last.program).primitives == 2
    assert last.program in [c.program for c in last.front]


A = [Choice(box(1, 1, 1), 0.4), Choice(cut(box(2, 2, 2), sphere(1)), 0.1), Choice(cut(box(3, 3, 3), sphere(1), sphere(2)), 0.05)]
B = [Choice(cylinder(1, 1), 0.9), Choice(union(cylinder(2, 2), sphere(3)), 0.0)]


def test_fronts_of_bodies_unite_step_by_step():
    front = unite_fronts([A, B], [A[1].program, B[1].program], [3.0, 1.0])
    assert [count(c.program).primitives for c in front] == [2, 3, 4, 5]
    # the second body wins 0.9 of 1 by its step, the first 0.3 of 3, which is as much: the first of equals goes first
    assert [c.error for c in front] == pytest.approx([0.525, 0.3, 0.075, 0.0375])
    assert front[2].program == union(A[1].program, B[1].program)


def test_a_few_keep_the_delivered_one():
    long = [Choice(union(*[sphere(1 + i, (float(i), 0.0, 0.0)) for i in range(n)]), 0.7**n) for n in range(1, 20)]
    chosen = thin_front(long, long[12].program)
    assert len(chosen) == 7
    assert {c.program for c in chosen} >= {long[0].program, long[12].program, long[-1].program}


def test_generations_are_logged(tmp_path):
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    scene = planted_scene("L bracket")
    config = EvolutionConfig(population=8, offspring=8, generations=3)
    run = evolve({"given": [box(60, 40, 5)]}, scene, np.random.default_rng(0), NEVER, config)
    passed = list(log_generations(run, str(tmp_path), "part"))
    events = EventAccumulator(str(tmp_path / "part"))
    events.Reload()
    assert [e.step for e in events.Scalars("best/fitness")] == [0, 1, 2, 3]
    assert [e.value for e in events.Scalars("best/fitness")] == pytest.approx([g.best.score.fitness for g in passed])
    assert events.Scalars("best/primitives")[-1].value == len(list(leaves(passed[-1].best.program)))
