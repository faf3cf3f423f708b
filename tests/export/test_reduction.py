"""Equations that are solved one by one, against solutions by hand and by numpy."""

import numpy as np
import pytest

from imdim.export.reduction import Reduced


def test_what_is_solved_is_taken_out_of_all_others():
    """x = y + 1 z and y = 2 z, so that x = 3 z."""
    system = Reduced.of([{0: 1.0, 1: -1.0, 2: -1.0}, {1: 1.0, 2: -2.0}], 3)
    system.solve_for(0, 0)
    system.solve_for(1, 1)
    assert system.read() == {0: {2: 3.0}, 1: {2: 2.0}}


def test_an_equation_more_leaves_those_before_as_they_were():
    system = Reduced.of([{0: 1.0, 1: -1.0}], 2)
    system.solve_for(0, 0)
    more = system.add([{0: 2.0, 1: 1.0, 2: -6.0}], 3)
    more.solve_for(1, 1)
    assert more.read() == {0: {2: 2.0}, 1: {2: 2.0}}
    assert system.read() == {0: {1: 1.0}}


@pytest.mark.parametrize("split", [0, 3, 6])
def test_whenever_equations_come_the_solution_is_the_same(split):
    rng = np.random.default_rng(0)
    rows = [{int(v): float(rng.integers(-3, 4)) for v in rng.choice(8, 4, replace=False)} for _ in range(6)]
    system = Reduced.of(rows[:split], 8)
    for i in range(split):
        system.solve_for(int(np.abs(system.matrix[i]).argmax()), i)
    system = system.add(rows[split:], 8)
    for i in range(split, 6):
        system.solve_for(int(np.abs(system.matrix[i]).argmax()), i)
    known = np.array([[row.get(v, 0.0) for v in range(8)] for row in rows])
    assert np.linalg.matrix_rank(np.vstack([known, system.matrix])) == np.linalg.matrix_rank(known) == 6
