"""The bench of holes plants what it says, and counts what comes back."""

import sys
from pathlib import Path

import numpy as np
import pytest
from manifold3d import Manifold

from imdim.program.codec import dumps
from imdim.program.tree import Combine, Primitive

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts" / "bench"))
import holes as bench

ROD = 0.05


def is_open(solid: Manifold, hole: bench.PlantedHole, reach: float) -> bool:
    """Whether a thin rod along the axis, from above the opening to so far below it, meets no material."""
    start, way = np.array(hole.point) - 0.5 * np.array(hole.direction), np.array(hole.direction)
    rod = Manifold.cylinder(reach, ROD, ROD, 8).transform(np.column_stack([bench._turn_to(tuple(-way)), start]))
    return (rod ^ solid).volume() < 1e-9


@pytest.mark.parametrize("number", range(0, 40, 3))
def test_planted_holes_are_open_as_far_as_they_say(number):
    solid, holes, _ = bench.plant(np.random.default_rng([0, number]), number)
    assert len(solid.decompose()) == 1
    assert {h.kind for h in holes} <= set(bench.KINDS)
    for hole in holes:
        assert is_open(solid, hole, 1.5)
        assert is_open(solid, hole, 200.0) == hole.through


def test_what_comes_back_is_counted(tmp_path):
    plate = Primitive("box", (40.0, 30.0, 8.0))
    program = Combine("difference", plate, Primitive("cylinder", (1.7, 20.0), (10.0, 0.0, 0.0)))
    (tmp_path / "program.json").write_text(dumps(program))
    at = [bench.PlantedHole("through", True, (x, 0.0, 4.0), (0.0, 0.0, -1.0), (3.4,)) for x in (10.0, -10.0)]
    row = bench.score(tmp_path, at, 8.0)
    counted = {"holes": 2, "found": 1, "kind": 1, "sizes": 1, "wrong": ["through not found"], "strange": 0}
    assert row.items() >= counted.items()
    assert (row["through"], row["stayed"]) == (2, 1)
    blind = [bench.PlantedHole("blind", False, (10.0, 0.0, 4.0), (0.0, 0.0, -1.0), (3.5,))]
    assert bench.score(tmp_path, blind, 8.0)["wrong"] == ["blind is through through"]
