"""What a proof says beside the features that repeat."""

import numpy as np
import pytest
from tests.planted import box, cut, cylinder, mesh_of, union

from imdim.program.cost import CURVE
from imdim.reconstruction import methods
from imdim.reconstruction.budget import Budget
from imdim.reconstruction.methods import MethodStep
from imdim.reconstruction.observation import UnitBody, observe
from imdim.reconstruction.proof import BESIDE, DEARER, Proofs
from imdim.search.exact.prove import Proof
from imdim.target.target import target_from

PLATE = box(0.8, 0.6, 0.1)
PINS = [cylinder(0.03, 0.2, (0.2 * i - 0.3, 0.0, 0.1)) for i in range(4)]


def proofs_at(curve: float) -> Proofs:
    body = UnitBody.of(target_from(mesh_of(union(PLATE, *PINS))), np.random.default_rng(0))
    return Proofs(observe(body, 2.5e-4, np.random.default_rng(0), curve=curve), Budget(60.0))


@pytest.fixture(scope="module")
def proofs() -> Proofs:
    return proofs_at(CURVE)


def test_beside_a_row_one_plate_is_the_fewest(proofs):
    assert proofs.beside_repeats(union(PLATE, *PINS)) == BESIDE


def test_what_is_too_long_beside_it_is_not_proved(proofs):
    halves = box(0.4, 0.6, 0.1, (-0.2, 0.0, 0.0)), box(0.4, 0.5, 0.1, (0.2, 0.05, 0.0)), box(0.4, 0.1, 0.1, (0.2, -0.25, 0.0))
    assert proofs.beside_repeats(union(*halves, *PINS)) == "not proved: fewer primitives do beside what repeats"


def test_without_repeats_there_is_nothing_to_say(proofs):
    assert proofs.beside_repeats(cut(PLATE, cylinder(0.03, 0.2))) is None


def test_where_the_copies_hold_the_whole_body_there_is_nothing_to_say(proofs):
    slabs = [box(0.3, 3.0, 3.0, (0.3 * i - 0.6, 0.0, 0.0)) for i in range(5)]
    assert proofs.beside_repeats(union(*slabs)) is None


def test_where_each_copy_counts_nothing_is_said_beside_them():
    assert proofs_at(0.0).beside_repeats(union(PLATE, *PINS)) is None


@pytest.mark.parametrize(("pins", "said"), [(4, BESIDE), (1, DEARER)])
def test_what_is_shorter_and_dearer_is_not_taken_and_its_proof_is_not_ours(proofs, monkeypatch, pins, said):
    """The proof of the plate alone says nothing of the plate with its pins."""
    monkeypatch.setattr(proofs, "of", lambda program: (PLATE, Proof(True, 1, 9, program=PLATE)))
    best = union(PLATE, *PINS[:pins])
    step = methods._prove(MethodStep("search", best), proofs)
    assert (step.program, step.proof) == (best, said)


def test_what_is_shorter_and_cheaper_is_taken_with_its_proof(proofs, monkeypatch):
    shorter = union(PLATE, *PINS)
    monkeypatch.setattr(proofs, "of", lambda program: (shorter, Proof(True, 5, 9, program=shorter)))
    step = methods._prove(MethodStep("search", union(shorter, box(0.01, 0.01, 0.05, (0.0, 0.2, 0.0)))), proofs)
    assert (step.program, step.proof) == (shorter, "proved minimal over these candidates")
