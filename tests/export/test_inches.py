"""Fractions of an inch are called so, where the part is in inches."""

from tests.export.test_outlines import opened
from tests.export.test_parameters import MOUNT
from tests.numbers.test_inches import plate

from imdim.export.delivered import read_values
from imdim.export.inches import inch_fractions
from imdim.export.parameters import Parameters


def test_a_part_in_inches_says_its_fractions():
    text = opened(plate()).texts["program.scad"]
    lines = text.splitlines()
    said = {lines[i + 1].split(" = ")[0]: line for i, line in enumerate(lines) if line.endswith(" in")}
    assert said["plate_length"] == "// 3 in"
    assert said["plate_thickness"] == "// 1/2 in"
    assert {"// 3/8 in", "// 1/4 in", "// 5/64 in"} <= set(said.values())
    assert read_values(text)["plate_length"] == 76.2


def test_a_metric_part_says_none():
    assert " in\n" not in opened(MOUNT).texts["program.scad"].partition("module")[0]
    values = {"a": 12.7, "b": 10.0, "c": 33.0, "d": 4.5, "e": 7.0}
    assert inch_fractions(Parameters(values)) == {}


def test_wholes_signs_and_what_is_no_64th():
    values = {"a": 34.925, "b": -6.35, "c": 50.8, "d": 5.0, "sides": 6.0, "e": 3.175, "f": 22.225}
    assert inch_fractions(Parameters(values)) == {"a": "1 3/8 in", "b": "-1/4 in", "c": "2 in", "e": "1/8 in", "f": "7/8 in"}
