"""Where a part's origin was, by the places of its faces."""

import math

import pytest

from imdim.numbers.origin import find_offset
from imdim.program.tree import Primitive

OFF = 0.0173


def rows(places: list[float], offset: float) -> list[Primitive]:
    """Boxes from one place along x to the next."""
    at = [place + offset for place in places]
    return [Primitive("box", (b - a, 20.0, 10.0), ((a + b) / 2, 0.0, 5.0)) for a, b in zip(at[::2], at[1::2], strict=True)]


def residue(offset: float) -> float:
    """How far an offset is from a multiple of 0.1 beside OFF."""
    return abs(math.remainder(offset - OFF, 0.1))


ROUND = [0.0, 4.5, 7.0, 12.5, 20.0, 31.5]


def test_all_places_off_by_the_same_tell_the_origin() -> None:
    x, y, z = find_offset(rows(ROUND, OFF), math.inf)
    assert residue(x) < 1e-6
    assert (y, z) == (0.0, 0.0)


def test_corners_that_lean_and_are_odd_from_anywhere_hide_it_no_more() -> None:
    odd = [33.1373, 35.8719, 41.2361, 47.7773]
    x, _, _ = find_offset(rows([*ROUND, *odd], OFF), math.inf)
    assert residue(x) < 1e-6


@pytest.mark.parametrize("apart", [[0.0, 7.1373], [0.0, 4.5, 11.1373, 19.8719, 27.2361, 40.7773]])
def test_what_is_odd_throughout_tells_of_none(apart: list[float]) -> None:
    assert residue(find_offset(rows(apart, OFF), math.inf)[0] + OFF) < 1e-6


def test_half_of_the_places_on_the_grid_keep_their_origin() -> None:
    half = [0.0, 5.0, 12.0, 20.0]
    moved = [place + OFF for place in (25.0, 29.5, 33.0, 41.5)]
    assert find_offset(rows([*half, *moved], 0.0), math.inf)[0] == 0.0


def test_thirds_of_a_round_length_are_round() -> None:
    """Balls and thin ribs spread over a plate of 80 have places of 6.67 and so on from an origin 0.0033 beside the plate's end."""
    balls = [Primitive("sphere", (2.0,), (20 * k / 3, 0.0, 5.0)) for k in (1, 2, 4, 7, 8, 10)]
    ribs = [Primitive("box", (1 / 3, 1.0, 1.0), (10.0 + 20 * k + side, 0.0, 5.0)) for k in range(4) for side in (-6.5, 6.5)]
    assert find_offset([Primitive("box", (80.0, 20.0, 10.0), (40.0, 0.0, 5.0)), *balls, *ribs], 0.01)[0] == 0.0
