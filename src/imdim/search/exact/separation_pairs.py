"""Pairs of cells, one inside and one outside the target, that a set of candidates does not tell apart: the counterexamples.

A program over the set gives both cells of such a pair the same label, so it is wrong on one of them, whatever its form. Each pair carries
a flow out of the weights of its cells; the flow through all pairs is a lower bound of the error of every such program, for no cell is
charged for more than its weight.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.spatial.distance import cdist

SEEN = 900  # cells of either side that are matched in one group


@dataclass(frozen=True)
class CellLabels:
    """Cells by majority: `codes` [m, c] (steps of 1 for each carrier crossed), `filled` bool [m], `weight` [m] of a wrong label."""

    codes: np.ndarray
    filled: np.ndarray
    weight: np.ndarray


@dataclass(frozen=True)
class Pairs:
    """Cells inside [k], cells outside [k], and the flow [k] between them."""

    inside: np.ndarray
    outside: np.ndarray
    flow: np.ndarray


def least_error(labels: CellLabels, masks: np.ndarray) -> float:
    """Error of the best of all functions of the sets `masks` [k, m]."""
    group = groups(masks, len(labels.weight))
    return float(np.minimum(*_by_group(labels, group)).sum())


def groups(masks: np.ndarray, m: int) -> np.ndarray:
    """Group number [m] of each cell: cells that all of `masks` [k, m] treat alike."""
    if not len(masks):
        return np.zeros(m, np.int64)
    return np.unique(np.packbits(masks, axis=0), axis=1, return_inverse=True)[1].reshape(-1)


def _by_group(labels: CellLabels, group: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weight inside and outside per group."""
    n = int(group.max()) + 1
    return np.bincount(group, labels.weight * labels.filled, n), np.bincount(group, labels.weight * ~labels.filled, n)


def counterexamples(labels: CellLabels, masks: np.ndarray, most: int) -> Pairs:
    """Up to `most` pairs that no set in `masks` [k, m] separates: the nearest by codes, in all groups in turn."""
    group = groups(masks, len(labels.weight))
    mixed = np.minimum(*_by_group(labels, group))
    found = [_match_cells(labels, np.flatnonzero(group == g)) for g in np.argsort(-mixed, kind="stable")[: 2 * most] if mixed[g] > 0]
    if not found:
        return Pairs(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0))
    rank = np.concatenate([np.arange(len(f.flow)) for f in found])
    flow = np.concatenate([f.flow for f in found])
    top = np.lexsort((-flow, rank))[:most]
    inside, outside = (np.concatenate([getattr(f, side) for f in found])[top] for side in ("inside", "outside"))
    return Pairs(inside, outside, flow[top])


def _match_cells(labels: CellLabels, members: np.ndarray) -> Pairs:
    """Flow between the heaviest cells inside and outside of one group, nearest pairs first, heavy flows first in the result."""
    heavy = members[np.argsort(-labels.weight[members], kind="stable")]
    inside, outside = (heavy[labels.filled[heavy] == side][:SEEN] for side in (True, False))
    apart = cdist(labels.codes[inside], labels.codes[outside], "cityblock").astype(np.int32)
    order = np.argsort(apart, axis=None, kind="stable")
    at, flow = _flows(order, labels.weight[inside].copy(), labels.weight[outside].copy())
    heaviest = np.argsort(-flow, kind="stable")
    a, b = np.unravel_index(at[heaviest], apart.shape)
    return Pairs(inside[a], outside[b], flow[heaviest])


@njit(nogil=True, cache=True)
def _flows(order: np.ndarray, supply: np.ndarray, demand: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """As much as still fits between each pair in turn: the pairs with any, and how much."""
    at, flow = np.empty(len(order), np.int64), np.empty(len(order))
    n = 0
    width = len(demand)
    for o in order:
        i, j = o // width, o % width
        amount = min(supply[i], demand[j])
        if amount > 0.0:
            supply[i] -= amount
            demand[j] -= amount
            at[n], flow[n] = o, amount
            n += 1
    return at[:n], flow[:n]
