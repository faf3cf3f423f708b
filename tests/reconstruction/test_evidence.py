"""The decision tree of a body whose cells are too many for the time that is left."""

import numpy as np
import pytest
from tests.planted import box, cut, cylinder, mesh_of

from imdim.deadline import NEVER, Deadline
from imdim.reconstruction import evidence as module
from imdim.reconstruction.observation import UnitBody, observe
from imdim.target.target import target_from


def test_where_time_is_short_some_cells_stand_for_all(monkeypatch):
    plate = cut(box(0.8, 0.6, 0.1), cylinder(0.1, 0.2))
    seen = observe(UnitBody.of(target_from(mesh_of(plate)), np.random.default_rng(0)), 2.5e-4, np.random.default_rng(0))
    cells, grown, grow = seen.cells, [], module.grow
    monkeypatch.setattr(module, "grow", lambda points, *given: grown.append(points) or grow(points, *given))
    monkeypatch.setattr(module, "SIDE_S", 1.0 / (len(cells.points) * len(seen.evidence.surfaces)))  # a second for all cells
    in_a_second = Deadline(1.0, lambda: 0.0)
    programs = [
        seen.evidence.tree(deadline, of_some=of_some) for deadline, of_some in ((NEVER, True), (in_a_second, True), (in_a_second, False))
    ]
    assert [len(points) for points in grown] == [len(cells.points), pytest.approx(len(cells.points) / 2, abs=1), len(cells.points)]
    assert [seen.evidence.has_time_for_all_cells(deadline) for deadline in (NEVER, in_a_second)] == [True, False]
    assert all(program is not None and seen.error(program) < 0.2 for program in programs)
