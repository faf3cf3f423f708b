"""The matrices of CSG-Stump by binary programming, given primitives (Ren et al. 2021, "CSG-Stump Structure").

Cells with equal signs are one group, and an intersection is a set of literals: a primitive, or its complement. The program chooses
intersections so that wrong volume plus the price of the literals is least. Over few primitives every intersection that could matter is
listed, so the answer is exact; over many, only those that grow out of a group by leaving out literals while nothing outside comes in.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import csr_array, hstack, identity

from imdim.program.stump import CsgStump
from imdim.program.tree import Primitive

EXACT = 7  # primitives; 3 ** 7 intersections
GROWN = 200  # groups that intersections grow out of
ORDERS = 3  # in which literals are left out
ORDER_SEED = 0  # they are no matter of chance from run to run
SOLVER_S = 5.0
SOLVER_NODES = 5_000

Term = tuple[tuple[int, bool], ...]  # (primitive, whether complemented), ...


@dataclass(frozen=True)
class Chosen:
    """The intersections, their error in volume and price with it, and whether no others are cheaper."""

    terms: tuple[Term, ...]
    error: float
    price: float
    optimal: bool


@dataclass(frozen=True)
class _Groups:
    """Cells of equal signs [k, g] with what is inside and outside [g]."""

    signs: np.ndarray
    w_in: np.ndarray
    w_out: np.ndarray


def connections(masks: np.ndarray, w_in: np.ndarray, w_out: np.ndarray, literal: float) -> Chosen:
    """Intersections of the primitives that cover `masks` bool [k, m], of cells with volumes inside and outside [m]; one at least.

    `literal` is the price of a literal in volume. Every intersection has a plain literal, without which it would be unbounded.
    """
    _, first, member = np.unique(np.packbits(masks, axis=0), axis=1, return_index=True, return_inverse=True)
    groups = _Groups(masks[:, first], *(np.bincount(member.reshape(-1), w, len(first)) for w in (w_in, w_out)))
    exact = len(masks) <= EXACT
    terms = _all_terms(len(masks)) if exact else list(dict.fromkeys(_grow_terms(groups, literal)))
    covers = np.stack([_cover(groups.signs, term) for term in terms])
    kept = _drop_dominated(covers, np.array([len(t) for t in terms]))
    chosen, optimal = _cheapest(covers[kept], [len(terms[i]) for i in kept], groups, literal)
    if not chosen:
        # nothing pays for itself; the best there is, for a program is never empty
        gain = covers[kept] @ (groups.w_in - groups.w_out) - literal * np.array([len(terms[i]) for i in kept])
        chosen = [int(np.argmax(gain))]
    covered = covers[kept][chosen].any(0)
    error = float(np.where(covered, groups.w_out, groups.w_in).sum())
    picked = tuple(terms[kept[i]] for i in chosen)
    return Chosen(picked, error, error + literal * sum(map(len, picked)), exact and optimal)


def matrices(terms: Sequence[Term], primitives: Sequence[Primitive]) -> CsgStump:
    """The three matrices of chosen intersections; primitives that none of them names are left out."""
    literals = sorted({literal for term in terms for literal in term})
    return CsgStump(
        tuple(primitives[k] for k, _ in literals),
        tuple(int(flip) for _, flip in literals),
        tuple(tuple(int(literal in term) for term in terms) for literal in literals),
        (1,) * len(terms),
    )


def _all_terms(k: int) -> list[Term]:
    """All intersections of `k` primitives with at least one plain literal."""
    choices = product((None, False, True), repeat=k)
    terms = (tuple((i, flip) for i, flip in enumerate(c) if flip is not None) for c in choices)
    return [t for t in terms if any(not flip for _, flip in t)]


def _cover(signs: np.ndarray, term: Term) -> np.ndarray:
    """The groups [g] in an intersection."""
    return np.logical_and.reduce([signs[k] != flip for k, flip in term])


def _grow_terms(groups: _Groups, literal: float) -> Iterator[Term]:
    """Maximal intersections: literals left out one by one while less comes in from outside than a literal costs."""
    rng = np.random.default_rng(ORDER_SEED)
    gain = groups.w_in - groups.w_out
    for g in np.argsort(-gain, kind="stable")[:GROWN]:
        if gain[g] <= 0:
            return
        for _ in range(ORDERS):
            term = _grow(groups, int(g), rng.permutation(len(groups.signs)), literal)
            if term:
                yield term


def _grow(groups: _Groups, g: int, order: np.ndarray, literal: float) -> Term | None:
    """One maximal intersection around a group."""
    loss = np.maximum(groups.w_out - groups.w_in, 0.0)
    agree = groups.signs == groups.signs[:, g : g + 1]
    missing = (~agree).sum(0)  # literals that keep each group out
    outside, plain = float(loss[missing == 0].sum()), int(groups.signs[:, g].sum())
    held = np.ones(len(agree), bool)
    # complements first: what is left then is a solid rather than a hole in everything
    for k in sorted(order, key=lambda k: bool(groups.signs[k, g])):
        if groups.signs[k, g] and plain == 1:
            continue
        fewer = missing - ~agree[k]
        cost = float(loss[fewer == 0].sum())
        if cost - outside < literal:
            held[k], missing, outside = False, fewer, cost
            plain -= int(groups.signs[k, g])
    term = tuple((int(k), not groups.signs[k, g]) for k in np.flatnonzero(held))
    return term if any(not flip for _, flip in term) else None


def _drop_dominated(covers: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Indices of intersections that differ in what they cover, each with the fewest literals that cover it."""
    order = np.argsort(sizes, kind="stable")
    _, first = np.unique(np.packbits(covers[order], axis=1), axis=0, return_index=True)
    return np.sort(order[first])


def _cheapest(covers: np.ndarray, sizes: list[int], groups: _Groups, literal: float) -> tuple[list[int], bool]:
    """The intersections with the least wrong volume and price, and whether that is certain."""
    gain = groups.w_in - groups.w_out
    wins, costs = np.flatnonzero(gain > 0), np.flatnonzero((gain < 0) & covers.any(0))
    n, a, b = len(covers), len(wins), len(costs)
    # variables: intersections, wrong groups inside, wrong groups outside
    price = np.concatenate([literal * np.array(sizes, float), gain[wins], -gain[costs]]) / max(float(groups.w_in.sum()), 1e-300)
    inside = hstack([csr_array(covers[:, wins].T.astype(float)), identity(a), csr_array((a, b))])
    term, place = np.nonzero(covers[:, costs])
    rows = np.arange(len(term))
    ones = np.ones(len(term))
    outside = csr_array((np.append(ones, -ones), (np.append(rows, rows), np.append(term, n + a + place))), shape=(len(term), n + a + b))
    limits = [LinearConstraint(csr_array(inside), lb=1.0)] + ([LinearConstraint(outside, ub=0.0)] if len(term) else [])
    kind = np.concatenate([np.ones(n), np.zeros(a + b)])  # what is wrong follows from the intersections
    options = {"time_limit": SOLVER_S, "node_limit": SOLVER_NODES}
    found = milp(price, constraints=limits, integrality=kind, bounds=Bounds(0, 1), options=options)
    if found.x is None:
        return _greedy(covers, sizes, gain, literal), False
    return np.flatnonzero(found.x[:n] > 0.5).tolist(), found.status == 0


def _greedy(covers: np.ndarray, sizes: list[int], gain: np.ndarray, literal: float) -> list[int]:
    """Intersections one by one, the one that wins most first."""
    left, chosen = gain.copy(), []
    while True:
        wins = covers @ left - literal * np.array(sizes)
        best = int(np.argmax(wins))
        if wins[best] <= 0:
            return chosen
        chosen.append(best)
        left[covers[best]] = 0.0
