"""Sums that are carried over from earlier looks must be those of all cells, to the last digit."""

import numpy as np
import pytest
from tests.planted import box, cut, cylinder
from tests.search.planted_families import arrangement_of, cells_of, planted
from tests.search.test_sequence import WEIGHTS

from imdim.search import group_sums
from imdim.search.bits import pack_words
from imdim.search.candidate_families import Families
from imdim.search.group_sums import make_tables
from imdim.search.look_kernels import find_look, sums_of
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
    tables, changeable = make_tables([slots.size for slots in found.slots], len(gain)), rng.random(len(gain)) < 0.7
    for again in range(100):
        look = find_look(pack_words(changeable), tables)
        for group in rng.choice(found.groups, 2, replace=False).tolist():
            cells = rng.permutation(np.flatnonzero(changeable))
            carried, whole = sums_of(group, found.packed, tables, look, gain), found.slots[group].sum_values(cells, gain[cells])
            assert np.array_equal(carried, whole)
        changeable = changeable.copy() if again % 5 else rng.random(len(gain)) < 0.5
        changeable[rng.choice(len(gain), 9)] ^= True


def test_a_look_at_the_same_cells_is_one_and_the_oldest_is_forgotten():
    rng = np.random.default_rng(1)
    tables, looks = make_tables([4, 5], 100), [pack_words(flags) for flags in rng.random((group_sums.MOST_LOOKS + 1, 100)) < 0.5]
    rows = [find_look(bits, tables) for bits in looks[:-1]]
    assert sorted(rows) == list(range(group_sums.MOST_LOOKS))
    assert find_look(looks[0], tables) == rows[0]
    assert tables.apart[rows[1]] == sum(int(a ^ b).bit_count() for a, b in zip(looks[0], looks[1], strict=True))
    assert find_look(looks[-1], tables) == rows[1]


@pytest.mark.parametrize("weights", WEIGHTS)
def test_gains_are_what_they_are_to_eleven_digits_and_sum_the_same_in_any_order(weights):
    cells, rng = planted("countersink").cells, np.random.default_rng(2)
    gain = cells.gain_under(weights)
    raw = weights[1] * cells.w_in - weights[0] * cells.w_out
    assert gain == pytest.approx(raw, abs=1e-15 * np.abs(raw).sum())
    for _ in range(20):
        order = rng.permutation(len(gain))
        assert np.cumsum(gain[order])[-1] == gain.sum()
