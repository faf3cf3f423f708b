"""Evolution that goes on from a program that a person has edited."""

from dataclasses import asdict, replace
from itertools import count

import numpy as np
import pytest
from tests.planted import box, mesh_of

from imdim.app.lab import resume, work
from imdim.app.lab.edits import ConstrainedProgram, with_number, without_leaf
from imdim.app.lab.examples import PROGRAMS, example
from imdim.app.lab.resume import Rates
from imdim.geometry.kernels import program_sdf
from imdim.geometry.solid import mesh_to_manifold, to_manifold, volume_iou
from imdim.program.tree import Combine, leaves
from imdim.reconstruction import one_body
from imdim.reconstruction.config import Settings
from imdim.target.target import sample_surface, target_from

TARGET = example("Bracket")
SETTINGS = Settings(budget_s=2.0, seed=3)
RATES = Rates(population=16)


def iou(program, truth=None):
    return volume_iou(to_manifold(program), mesh_to_manifold(TARGET.mesh) if truth is None else to_manifold(truth))


def go_on(program, rates=RATES):
    """All snapshots, by a clock that passes 2 ms at each look, so that the machine's pace decides nothing."""
    ticks = count()
    return list(resume.resume_evolution(TARGET, program, SETTINGS, rates, lambda: next(ticks) * 0.002))


@pytest.fixture(scope="module")
def spoilt():
    """The bracket with a hole that is far too large and another that is missing."""
    return without_leaf(with_number(ConstrainedProgram(PROGRAMS["Bracket"]()), 3, "r", 6.0), 2).program


def test_it_starts_from_the_edited_program_and_ends_nearer_to_the_part(spoilt):
    told = go_on(spoilt)
    assert told[0].stage == "evolve"
    assert iou(told[0].program) >= iou(spoilt) - 1e-9, "the first generation holds the person's program"
    assert not any(s.stop for s in told[:-1])
    last = told[-1]
    assert last.stage == "finished"
    assert last.stop
    assert iou(last.program) > iou(spoilt) + 0.01
    sizes = [len(list(leaves(c.program))) for c in last.front]
    assert sizes == sorted(sizes), "from crude to exact"
    assert any(c.program == last.program for c in last.front)
    assert [s.seconds for s in told] == sorted(s.seconds for s in told)


def test_the_same_seed_gives_the_same_programs_and_the_rates_matter(spoilt):
    first, again = go_on(spoilt), go_on(spoilt)
    assert [s.program for s in first] == [s.program for s in again]
    others = go_on(spoilt, replace(RATES, mutation=0.0))
    assert [s.program for s in others] != [s.program for s in first]


def test_a_clouds_numbers_are_fitted_to_points_in_the_programs_own_frame(monkeypatch):
    truth, apart = box(40, 30, 10, (500.0, 0.0, 0.0)), []

    def solved(program, seen, *_):
        apart.append(float(np.abs(program_sdf(program, seen.target.points)).mean()))
        return program

    monkeypatch.setattr(one_body, "fit_numbers", solved)
    points = sample_surface(mesh_of(truth).vertices, mesh_of(truth).faces, 3000, np.random.default_rng(0))[0]
    *_, last = resume.resume_evolution(target_from(points), truth, SETTINGS, RATES, lambda: 0.0)
    assert apart[0] < 1e-3
    assert iou(last.program, truth) > 0.999


def test_a_process_goes_on_from_a_document(spoilt):
    from imdim.app.lab.requests import request

    asked = request("continue", TARGET, SETTINGS, ConstrainedProgram(spoilt), rates=asdict(RATES))
    told = list(work.perform(asked, iter(np.arange(0.0, 1e4, 0.1)).__next__))
    assert [m.kind for m in told[-2:]] == ["snapshot", "done"]
    assert told[-2].values["stage"] == "finished"
    assert told[-2].values["front"]


def test_a_program_that_is_simplified_after_its_evolution_is_on_no_older_front(monkeypatch, spoilt):
    """The front that evolution showed holds the program as it was before."""

    def split(program, **_):
        return Combine("union", program, next(leaves(program)))

    monkeypatch.setattr(one_body, "reduce_program", split)
    told = go_on(spoilt)
    assert [s.stage for s in told if s.front and s.stage == "evolve"]
    assert next(s for s in told if s.stage == "simplify").front == ()
    assert any(c.program == told[-1].program for c in told[-1].front)
