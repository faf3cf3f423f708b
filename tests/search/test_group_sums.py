"""Sums that are carried over from earlier looks must be those of all cells, to the last digit."""

import numpy as np
import pytest
from tests.planted import box, cut, cylinder
from tests.search.planted_families import arrangement_of, cells_of, planted
from tests.search.test_sequence import WEIGHTS

from imdim.search import group_sums
from imdim.search.candidate_families import Families
from imdim.search.group_sums import GroupSums
from imdim.search.kernels import list_changes
from imdim.search.outline_families import PricedPlanes, find_planes


def families():
    """Of a drilled bar, with a plane of outlines."""
    program = cut(box(16, 6, 4), cylinder(1, 9, (5.0, 0.0, 0.0)))
    arrangement = arrangement_of(program)
    planes = PricedPlanes(find_planes(arrangement), 1e-3)
    assert planes.planes
    return Families(arrangement, cells_of(arrangement, program, 5000), planes)


@pytest.mark.parametrize("most_bytes", [group_sums.MOST_BYTES, 1])
@pytest.mark.parametrize("weights", WEIGHTS)
def test_sums_carried_over_are_those_of_all_cells(weights, most_bytes, monkeypatch):
    monkeypatch.setattr(group_sums, "MOST_BYTES", most_bytes)
    found, rng = families(), np.random.default_rng(0)
    gain = found.cells.gain_under(weights)
    sums, changeable = GroupSums(gain), rng.random(len(gain)) < 0.7
    for again in range(20):
        look = sums.look(changeable)
        for group in rng.choice(found.groups, 2, replace=False).tolist():
            slots = found.slots[group]
            cells = rng.permutation(np.flatnonzero(changeable))
            carried, whole = look.of(group, slots), slots.sum_values(cells, gain[cells])
            assert np.array_equal(carried, whole)
        changeable = changeable.copy() if again % 5 else rng.random(len(gain)) < 0.5
        changeable[rng.choice(len(gain), 9)] ^= True


def test_a_look_at_the_same_cells_is_one():
    found, rng = planted("countersink"), np.random.default_rng(1)
    sums, flags = GroupSums(found.cells.gain), rng.random(len(found.cells.gain)) < 0.5
    assert sums.look(flags).of(0, found.slots[0]) is sums.look(flags.copy()).of(0, found.slots[0])


@pytest.mark.parametrize("weights", WEIGHTS)
def test_gains_are_what_they_are_to_eleven_digits_and_sum_the_same_in_any_order(weights):
    cells, rng = planted("countersink").cells, np.random.default_rng(2)
    gain = cells.gain_under(weights)
    raw = weights[1] * cells.w_in - weights[0] * cells.w_out
    assert gain == pytest.approx(raw, abs=1e-15 * np.abs(raw).sum())
    for _ in range(20):
        order = rng.permutation(len(gain))
        assert np.cumsum(gain[order])[-1] == gain.sum()


def test_changes_are_listed():
    rng = np.random.default_rng(3)
    a, b = rng.random((2, 6400)) < 0.4
    b[:3200] = a[:3200]
    cells, values = list_changes(a, b, np.arange(6400.0))
    assert np.array_equal(cells, np.flatnonzero(a != b))
    assert np.array_equal(values, np.where(b[cells], cells, -cells))
