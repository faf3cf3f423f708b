"""The JSON of a theory: the design's own example, round trips, and one line for each thing that is wrong."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from imdim.sketch import named
from imdim.sketch.theory import SketchConstraint, Theory, TheoryError, Weights, dumps, from_json, load, loads, save, to_json

EXAMPLE = {
    "controlPoints": 8,
    "constraints": [
        {"type": "distance", "indices": [0, 1], "value": 10.0},
        {"type": "angle", "indices": [0, 1, 2], "value": 1.5707},
        {"type": "coplanar", "indices": [0, 1, 2, 3], "value": 0.0},
    ],
}


def test_the_example_of_the_design_reads_and_writes():
    theory = from_json(EXAMPLE)
    assert theory.constraints[2] == SketchConstraint("plane_distance", (0, 1, 2, 3), 0.0)
    assert to_json(theory) == EXAMPLE


def test_files_round_trip_to_the_last_bit(tmp_path):
    w = np.array([[0.1, 0, 0.9, 0], [0, 1 / 3, 0, 2 / 3]])
    rectangle = named.rectangle(math.pi, 1 / 3)
    theory = Theory(4, rectangle.constraints, 2, Weights.of(w))
    save(theory, tmp_path / "t.json")
    again = load(tmp_path / "t.json")
    assert again == theory
    assert again.weights is not None
    dense = np.zeros_like(w)
    dense[list(again.weights.rows), list(again.weights.columns)] = again.weights.values
    assert (dense == w).all()
    assert dumps(again) == (tmp_path / "t.json").read_text()
    assert loads(dumps(named.cube())) == named.cube()


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        (
            {"type": "distance", "indices": [0, 8], "value": 1},
            r"constraint 0 \(distance 0-8 = 1\): index 8 is out of range for 8 control points",
        ),
        ({"type": "distance", "indices": [0, -1], "value": 1}, "index -1 is out of range"),
        ({"type": "distance", "indices": [1, 1], "value": 1}, "an index repeats"),
        ({"type": "equal_length", "indices": [0, 0, 1, 2]}, "no length"),
        ({"type": "equal_length", "indices": [0, 1, 1, 0]}, "compares a length with itself"),
        ({"type": "distance", "indices": [0, 1], "value": math.nan}, "the value nan is not a number"),
        ({"type": "distance", "indices": [0, 1], "value": -2}, "not negative, got -2"),
        ({"type": "angle", "indices": [0, 1, 2], "value": 90}, "0 to pi radians, got 90"),
        ({"type": "torsion", "indices": [0, 1, 2, 3], "value": 4}, "-pi to pi radians"),
        ({"type": "distanse", "indices": [0, 1], "value": 1}, "did you mean 'distance'"),
        ({"type": "distance", "indices": [0, 1, 2], "value": 1}, "needs 2 indices, got 3"),
        ({"type": "distance", "indices": [0, 1.0], "value": 1}, "whole number, got 1.0"),
        ({"type": "distance", "indices": "01", "value": 1}, "indices are a list"),
        ({"type": "distance", "indices": [0, 1]}, "the value is missing"),
        ({"type": "coplanar", "indices": [0, 1, 2, 3], "value": 1}, "use plane_distance"),
        ({"type": "distance", "indices": [0, 1], "value": "1"}, "the value is a number"),
        ({"type": "distance", "indices": [0, 1], "val": 1}, "unknown field 'val'"),
        (7, "constraint 0: a constraint is an object, got int"),
    ],
)
def test_a_bad_constraint_is_named_in_one_line(entry, message):
    with pytest.raises(TheoryError, match=message) as caught:
        from_json({"controlPoints": 8, "constraints": [entry]})
    assert "\n" not in str(caught.value)
    assert "constraint 0" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "not JSON"),
        ("[]", "a theory is an object, got list"),
        ("{}", "controlPoints is a whole number, got None"),
        ('{"controlPoints": 0}', "1 to 2000 control points, got 0"),
        ('{"controlPoints": 1000000000}', "got 1000000000"),
        ('{"controlPoints": 3, "dimension": 4}', "dimension is 2 or 3, got 4"),
        ('{"controlPoints": 3, "points": 3}', "unknown field 'points'"),
        ('{"controlPoints": 3, "weights": "sparse"}', "weights need shape"),
        (
            '{"controlPoints": 4, "dimension": 2, "constraints": [{"type": "coplanar", "indices": [0, 1, 2, 3]}]}',
            "no meaning in dimension 2",
        ),
    ],
)
def test_a_bad_theory_is_one_line(text, message):
    with pytest.raises(TheoryError, match=message) as caught:
        loads(text)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(TheoryError, match=r"no\.json: "):
        load(tmp_path / "no.json")
    assert json.loads(dumps(Theory(1))) == {"controlPoints": 1, "constraints": []}
