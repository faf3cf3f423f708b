"""What an ablation leaves out is not run; what it keeps still answers."""

from __future__ import annotations

import numpy as np
import pytest
from tests.planted import box, cut, cylinder, mesh_of

from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.cost import count
from imdim.program.tree import leaves
from imdim.reconstruction import methods
from imdim.reconstruction.config import Settings
from imdim.reconstruction.pipeline import Snapshot, reconstruct
from imdim.target.target import target_from

PART = cut(box(40, 30, 10), cylinder(6, 12))
STAGES = {
    "synthesis": {"tree", "simplify", "solve", "finished"},
    "solver": {"search", "proof", "simplify", "finished"},
    "evolution": {"search", "proof", "simplify", "solve", "finished"},
}


def snapshots(**settings) -> list[Snapshot]:
    return list(reconstruct(target_from(mesh_of(PART)), Settings(**settings), np.random.default_rng(0)))


@pytest.mark.parametrize("left_out", STAGES)
def test_a_stage_that_is_left_out_leaves_no_trace(left_out):
    run = snapshots(**{left_out: False})
    assert {s.stage for s in run} <= STAGES[left_out]
    assert volume_iou(to_manifold(run[-1].program), to_manifold(PART)) > 0.99


def test_without_the_solver_numbers_stay_as_detected():
    with_solver, without = (snapshots(solver=solver)[-1] for solver in (True, False))
    assert with_solver.constraints
    assert not without.constraints
    assert typed(with_solver)
    assert not typed(without)


def typed(last: Snapshot) -> bool:
    """Whether all sizes, and all vertices of outlines, are of at most three decimals."""
    numbers = [n for leaf in leaves(last.program) for n in leaf.size]
    outlines = [leaf.outline for leaf in leaves(last.program) if leaf.outline]
    numbers += [n for outline in outlines for loop in outline.loops for x, y, _ in loop for n in (x, y)]
    return all(n == round(n, 3) for n in numbers)


@pytest.mark.parametrize("evolution", [False, True])
@pytest.mark.parametrize("solver", [False, True])
def test_evolution_is_asked_only_where_it_is_wanted(monkeypatch, evolution, solver):
    asked = []
    monkeypatch.setattr(methods, "TOUCHED", -1.0)
    monkeypatch.setattr(methods, "evolve_observation", lambda *given: asked.append(given) or iter(()))
    snapshots(evolution=evolution, solver=solver, language="csg")  # what is drawn is not evolved
    assert [given[-1] for given in asked] == ([solver] if evolution else [])


@pytest.mark.parametrize("is_long", [True, False])
def test_evolution_is_asked_to_shorten_long_programs(monkeypatch, is_long):
    asked = []
    monkeypatch.setattr(methods, "evolve_observation", lambda *given: asked.append(given) or iter(()))
    found = count(snapshots(language="csg")[-1].program).primitives
    assert not asked
    monkeypatch.setattr(methods, "LONG", found if is_long else found + 1)
    snapshots(language="csg")
    assert len(asked) == is_long
