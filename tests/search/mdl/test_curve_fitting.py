"""Borders are split into the row of lines and arcs that is cheapest of all."""

import math
from unittest.mock import Mock

import numpy as np
import pytest

from imdim.search.mdl import curve_fitting
from imdim.search.mdl.curve_fitting import SAGITTA

SIGMA, PRICE, MOST_TURN = 0.05, 6.0, 5.5


def sums_of(points: np.ndarray, share: np.ndarray, places: int) -> np.ndarray:
    """Powers of x and y, summed for each place [places, 9]: 1, x, y, xx, xy, yy, xz, yz, zz with z = xx + yy."""
    x, y = points.T
    z = x * x + y * y
    powers = np.column_stack([np.ones(len(x)), x, y, x * x, x * y, y * y, x * z, y * z, z * z])
    out = np.zeros((places, 9))
    np.add.at(out, share, powers)
    return out


def noisy_border(rng: np.random.Generator, places: int, each: int) -> tuple[np.ndarray, np.ndarray]:
    """A slot whose ends are round, of one side bent a little, as places [places + 1, 2] and the sums of points beside them."""
    at = np.sort(rng.uniform(0.0, 1.0, each * places))
    turn = 2 * math.pi * at
    x, y = 3.0 * np.clip(1.4 * np.cos(turn), -1, 1), np.sin(turn) + 0.1 * np.cos(turn) ** 2
    x += np.sign(x) * np.sqrt(np.clip(1 - y * y, 0, None)) * (np.abs(x) >= 3.0)
    exact = np.column_stack([x, y])
    share = np.arange(len(at)) // each
    places_at = np.vstack([exact[::each], exact[:1]])
    return places_at, sums_of(exact + SIGMA * rng.standard_normal(exact.shape), share, places)


def split_plainly(places: np.ndarray, sums: np.ndarray) -> tuple[list[int], float]:
    """The cheapest row by trying every piece (Jackson 2005)."""
    m = len(sums)
    cost, before = [0.0, *[math.inf] * m], [0] * (m + 1)
    for j in range(1, m + 1):
        for i in range(j):
            total, chord = sums[i:j].sum(0), places[j] - places[i]
            c = cost[i] + curve_fitting._choose(total, chord[0], chord[1], PRICE, SIGMA, MOST_TURN, SAGITTA)[0]
            if c < cost[j]:
                cost[j], before[j] = c, i
    ends = [m]
    while before[ends[-1]] > 0:
        ends.append(before[ends[-1]])
    return ends[::-1], cost[m]


@pytest.mark.parametrize("each", [2, 12, 60])
def test_pieces_that_are_left_out_are_never_the_cheapest(each):
    rng = np.random.default_rng(each)
    for places in (8, 40, 70):
        border, sums = noisy_border(rng, places, each)
        ends, cost = curve_fitting._split(border, sums, SIGMA, PRICE, MOST_TURN, SAGITTA)
        plain, least = split_plainly(border, sums)
        assert ends.tolist() == plain
        assert cost == pytest.approx(least, rel=1e-9)


def test_a_long_border_is_split_in_little_time(monkeypatch):
    """As many pieces as the longest curve has places are looked at for each, not as many as there are."""
    border, sums = noisy_border(np.random.default_rng(0), 120, 20)
    choose = Mock(wraps=curve_fitting._choose)
    monkeypatch.setattr(curve_fitting, "_choose", choose)
    curve_fitting._split.py_func(border, sums, SIGMA, PRICE, MOST_TURN, SAGITTA)
    assert choose.call_count < 0.6 * 120 * 121 / 2
