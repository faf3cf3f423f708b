from dataclasses import replace

import numpy as np
import pytest

from imdim.app.lab import edits
from imdim.app.lab.edits import ConstrainedProgram
from imdim.app.lab.examples import NAMES, PROGRAMS, example
from imdim.app.lab.solving import TURN, Lock, finish, follow_constraints, lock_constraints, misfit, violations
from imdim.program.constraints import Constraint, ConstraintError, Ref
from imdim.program.tree import leaves
from imdim.reconstruction.fitting import relations_of


@pytest.fixture(scope="module")
def bracket():
    return ConstrainedProgram(*relations_of(PROGRAMS["Bracket"]())), example("Bracket")


def sizes(program):
    return np.concatenate([p.size for p in leaves(program)])


def solved(theory, target, locks=()):
    *_, last = finish(theory.program, theory.constraints, list(locks), target)
    return last


def test_the_solver_finds_the_part_again_although_facets_cut_it_short(bracket):
    theory, target = bracket
    wrong = edits.with_number(edits.with_number(theory, 1, "r", 15.5), 2, "r", 3.7)
    found = solved(wrong, target)
    assert sizes(found) == pytest.approx(sizes(theory.program), abs=1e-5)
    assert misfit(found, target) < misfit(wrong.program, target) / 50
    assert max(violations(found, theory.constraints)) < 1e-8


def test_a_noisy_cloud_is_fitted_within_its_noise(bracket):
    theory, _ = bracket
    cloud = example("Bracket, scanned")
    found = solved(edits.with_number(theory, 1, "r", 15.0), cloud)
    assert sizes(found) == pytest.approx(sizes(theory.program), abs=0.08)


def test_locked_numbers_stay_to_the_last_digit(bracket):
    theory, target = bracket
    wrong = edits.with_number(edits.with_number(theory, 1, "r", 15.5), 1, "z", 8.5)
    locks = [Lock(1, "r"), Lock(1, "z"), Lock(0, TURN)]
    part = list(leaves(solved(wrong, target, locks)))[1]
    assert part.size[0] == pytest.approx(15.5, abs=1e-9)
    assert part.center[2] == pytest.approx(8.5, abs=1e-9)


def test_what_contradicts_a_lock_is_named(bracket):
    theory, target = bracket
    rounder = replace(theory, constraints=(*theory.constraints, Constraint("value", (Ref(1, "r"),), value=20.0)))
    with pytest.raises(ConstraintError, match=r"cannot hold together"):
        solved(rounder, target, [Lock(1, "r")])


def test_numbers_that_already_hold_do_not_move(bracket):
    theory, _ = bracket
    assert follow_constraints(theory.program, theory.constraints, []) == theory.program
    assert len(lock_constraints(theory.program, [Lock(0, TURN), Lock(0, "sx"), Lock(0, "x")])) == 5


@pytest.mark.parametrize("name", NAMES)
def test_examples_are_targets(name):
    target = example(name)
    assert target.is_solid == (not name.endswith("scanned"))
    assert target.mesh is None or target.mesh.volume > 1000
