"""Halves of a loop that are images but for a hair are exact images."""

import math

import numpy as np
import pytest

from imdim.numbers.mirrored_loops import mirror_halves
from imdim.program.outline import Ring

# a clevis: flat at one side, a round end at the other, whose halves were rounded one by one
CLEVIS: Ring = (
    (12.1613361, -4.385, 0.0),
    (12.1613361, 4.385, 0.0),
    (6.1613361, 4.385, -0.405303034),
    (5.1918494, 3.3854656, 0.0530625),
    (4.5617388, 2.5352323, 0.0),
    (-5.269515, 1.9980241, 0.946848752),
    (-5.2695157, -1.9980145, 0.0),
    (4.5617388, -2.5352261, 0.053062751),
    (5.1918494, -3.3854656, -0.405303034),
    (6.1613361, -4.385, 0.0),
)


def is_symmetric(ring: Ring, across: int = 1) -> bool:
    """Whether the loop run the other way round, mirrored about the middle, is the loop."""
    low, high = min(v[across] for v in ring), max(v[across] for v in ring)
    flipped = [tuple(low + high - c if a == across else c for a, c in enumerate(v[:2])) for v in ring[::-1]]
    bulges = [ring[k][2] for k in range(len(ring) - 2, -1, -1)] + [ring[-1][2]]
    turned = [(x, y, b) for (x, y), b in zip(flipped, bulges, strict=True)]
    return any(np.allclose(ring, turned[k:] + turned[:k], 0.0, 1e-10) for k in range(len(ring)))


@pytest.mark.parametrize("start", range(0, 10, 3))
def test_halves_a_hair_apart_become_images(start: int) -> None:
    ring = (*CLEVIS[start:], *CLEVIS[:start])
    out = mirror_halves(ring, 1e-3)
    assert is_symmetric(out)
    assert not is_symmetric(ring)
    for before, after in zip(ring, out, strict=True):
        assert math.dist(before[:2], after[:2]) < 2e-5
        assert after[2] == pytest.approx(before[2], abs=1e-6)


def test_across_both_axes() -> None:
    slot: Ring = ((-4.0, -2.0, 0.0), (4.0, -2.0, 1.0), (4.00001, 2.0, 0.0), (-4.0, 2.00001, 1.0))
    out = mirror_halves(slot, 1e-3)
    assert is_symmetric(out)
    assert is_symmetric(out, 0)


def test_what_is_apart_by_more_than_the_tolerance_stays() -> None:
    assert mirror_halves(CLEVIS, 1e-7) == CLEVIS


def test_what_is_apart_by_more_than_a_hair_stays() -> None:
    moved = tuple((x, y + (0.005 if k == 4 else 0.0), b) for k, (x, y, b) in enumerate(CLEVIS))
    assert mirror_halves(moved, 1e-1) == moved


def test_a_loop_that_is_no_image_of_itself_stays() -> None:
    ring: Ring = ((0.0, 0.0, 0.0), (10.0, 0.0, 0.0), (10.0, 5.0, 0.3), (2.0, 7.0, 0.0))
    assert mirror_halves(ring, 1.0) == ring


def test_exact_images_keep_their_numbers() -> None:
    typed: Ring = ((-0.3, -0.1, 0.0), (0.3, -0.1, 0.0), (0.3, 0.2, 0.5), (-0.3, 0.2, 0.0))
    assert mirror_halves(typed, 1e-3) == typed
