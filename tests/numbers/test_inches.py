"""Parts that were drawn in inches and saved in millimetres: their fractions come back, and metric parts get none."""

import numpy as np
import pytest
from tests.numbers.test_snap import BRACKET, Distance, disturbed

from imdim.numbers.inches import are_inches, tell_inches
from imdim.numbers.outline_values import snap_outline
from imdim.numbers.snap import SnapConfig, snap
from imdim.program.outline import Outline, circle, rectangle
from imdim.program.tree import Primitive, Program, combine_all, leaves

INCH = 25.4
LOOSE = SnapConfig(rel_tolerance=0.2, abs_tolerance=2e-4)  # no 0.001 is told from its neighbour by it


def plate(x: float = 0.0, y: float = 0.0) -> Program:
    """1/2 x 3 x 2 inch, a hole of 3/8 inch, two of 1/4, one of 5/64."""
    places = [(1.5, 1.0, 3 / 8), (0.5, 0.5, 1 / 4), (2.5, 0.5, 1 / 4), (0.75, 1.5, 5 / 64)]
    holes = [Primitive("cylinder", (d * INCH / 2, 0.75 * INCH), (u * INCH + x, v * INCH + y, INCH / 4)) for u, v, d in places]
    body = Primitive("box", (3 * INCH, 2 * INCH, INCH / 2), (1.5 * INCH + x, INCH + y, INCH / 4))
    return combine_all("difference", [body, *holes])


@pytest.mark.parametrize("corner", [(0.0, 0.0), (-38.1, -25.4)])
def test_fractions_of_an_inch_come_back(corner):
    part = plate(*corner)
    found = list(leaves(snap(disturbed(part, 1e-3, 0.0), Distance(part), config=LOOSE)))
    for got, typed in zip(found, leaves(part), strict=True):
        radii = 2 if got.kind == "box" else 1
        assert got.size[:radii] == pytest.approx(typed.size[:radii], abs=1e-9)
        assert got.center[:2] == pytest.approx(typed.center[:2], abs=1e-9)
    assert found[0].size[2] == pytest.approx(12.7, abs=1e-9)


def test_where_the_part_lies_says_nothing_of_its_unit():
    assert are_inches(list(leaves(plate(3.21, -7.77))))


@pytest.mark.parametrize("rough", [0.0, 1e-3])
def test_a_metric_part_gets_no_inches(rough):
    """One of its numbers is 12.7, another is as near to 5/64 inch as it is to 1.985."""
    tube = Primitive("cylinder", (12.7, 20.0), (40.0, 25.0, 8.0))
    pin = Primitive("cylinder", (1.985, 10.0), (60.0, 25.0, 3.0))
    part = combine_all("difference", [combine_all("union", [BRACKET, tube]), pin])
    parts = list(leaves(disturbed(part, rough, 0.0)))
    assert not are_inches(parts)


def test_numbers_from_anywhere_are_no_inches():
    rng = np.random.default_rng(4)
    said = [tell_inches(rng.uniform(0, 1, count) * size) for size in (5.0, 60.0, 900.0) for count in (3, 8, 30) for _ in range(40)]
    assert sum(said) == 0
    metric = [tell_inches(np.round(rng.uniform(0, 80, 10), 1)) for _ in range(100)]
    assert sum(metric) == 0


def test_a_drawing_in_inches_is_one():
    drawn = Outline((*rectangle(3 * INCH, 2 * INCH).loops, circle(3 / 16 * INCH, 0.5 * INCH, 0.25 * INCH)))
    rough = drawn.map_lengths(lambda v: v * (1 + 2e-5))
    leaf = Primitive("extrude", (INCH / 2,), outline=rough)
    assert are_inches([leaf])
    assert snap_outline(rough, 2e-3, inches=True).loops[1] == circle(3 / 16 * INCH, 0.5 * INCH, 0.25 * INCH)
    found = next(iter(leaves(snap(leaf, lambda _: 0.0, config=SnapConfig(max_move=3e-4)))))
    assert found.outline.bounds[1] == pytest.approx((38.1, 25.4), abs=1e-9)
