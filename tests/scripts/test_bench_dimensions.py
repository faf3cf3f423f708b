"""The bench of dimensions changes each number of a design, and tells names that do the same from names that do not."""

import sys
from pathlib import Path

import numpy as np
import pytest

from imdim.delivery.finish import finish
from imdim.export.openscad import to_openscad
from imdim.program.codec import dumps
from imdim.program.tree import Combine, Primitive
from imdim.relations.discover import exact_relations

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts" / "bench"))
import dimensions as bench
from designs import KINDS, SEGMENTS, Design, design

FLAT = np.eye(3, 4)


@pytest.mark.parametrize("number", range(len(KINDS)))
def test_a_design_is_one_body_and_every_dimension_matters(number):
    made = design(np.random.default_rng([0, number]), number)
    solid = made.build(made.values)
    assert len(solid.decompose()) == 1
    for dimension, value in made.values.items():
        after = made.build(made.values | {dimension: value * (1 + bench.GROWN)})
        assert len(after.decompose()) == 1
        assert bench._apart(solid, after) > bench.LEAST * solid.volume(), dimension


def test_a_name_that_does_the_same_is_right(tmp_path):
    plate, hole = Primitive("box", (80.0, 50.0, 8.0), (0.0, 0.0, 4.0)), Primitive("cylinder", (5.0, 8.0), (0.0, 0.0, 4.0))
    exact = exact_relations(Combine("difference", plate, hole))
    found = finish(exact.program, exact.constraints)
    (tmp_path / "program.json").write_text(dumps(found.program, None, found.constraints))
    (tmp_path / "program.scad").write_text(to_openscad(found.program, SEGMENTS, found.parameters))

    def built(values):
        body = bench.Manifold.cube((values["length"], 50.0, 8.0)).translate((-values["length"] / 2, -25.0, 0.0))
        return body - bench.Manifold.cylinder(8.0, 5.0, 5.0, SEGMENTS).translate((values["offset"], 0.0, 0.0))

    rows = {row["dimension"]: row for row in bench.score(tmp_path, Design(built, {"length": 80.0, "offset": 1e-9}), FLAT)}
    assert rows["length"]["right"]
    assert rows["length"]["by"] == "plate_length +8"
    assert not rows["length"]["moved"]
    assert "offset" not in rows, "what moves nothing is left out"

    def grown(values):  # the hole grows with the plate, which no name of ours does
        return built({"length": values["length"], "offset": 2 * (values["length"] - 80.0)})

    (row,) = bench.score(tmp_path, Design(grown, {"length": 80.0}), FLAT)
    assert not row["right"]
    assert row["near"]
    assert "right 50.0 %" in bench.totals([row, rows["length"]])
