"""What a proof says beside the features that repeat."""

import numpy as np
import pytest
from tests.planted import box, cut, cylinder, mesh_of, union

from imdim.reconstruction.budget import Budget
from imdim.reconstruction.observation import UnitBody, observe
from imdim.reconstruction.proof import BESIDE, Proofs
from imdim.target.target import target_from

PLATE = box(0.8, 0.6, 0.1)
PINS = [cylinder(0.03, 0.2, (0.2 * i - 0.3, 0.0, 0.1)) for i in range(4)]


@pytest.fixture(scope="module")
def proofs() -> Proofs:
    body = UnitBody.of(target_from(mesh_of(union(PLATE, *PINS))), np.random.default_rng(0))
    return Proofs(observe(body, 2.5e-4, np.random.default_rng(0)), Budget(60.0))


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
