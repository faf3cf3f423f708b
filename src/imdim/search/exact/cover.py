"""The fewest candidates that tell apart what a program must tell apart, by integer programming (HiGHS).

A relaxation of synthesis that holds for every program of every form: each pair of an inside and an outside cell is separated by one of the
program's primitives, or the program is wrong on one of the two and pays that cell's weight. Its linear relaxation is nearly tight, which is
why branch and bound over it ends in tenths of a second where a solver that learns clauses (CP-SAT) does not end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, linprog, milp
from scipy.sparse import csr_array, hstack

from imdim.deadline import NEVER, Deadline

INFEASIBLE = 2  # scipy's status
MOST_NODES = 20_000
NEAR = 0.9  # primitives' prices, by which an answer among these may be dearer than the cheapest
STARTING = 300  # columns of the first relaxation, and of those that join it at a time
PROMISING = 400  # columns tried first, by their reduced costs
ENOUGH = 0.15  # relative gap: any answer below the price shows what counterexamples lack, it need not be the cheapest
COLUMNS_PER_S = 2_500  # of the solver's time; it simplifies a problem first without a look at the clock, 6,000 columns in 2.6 s
SLACK = 1e-5  # what the solver's arithmetic may be off by


@dataclass(frozen=True)
class Cover:
    """`chosen` columns, None where no cover as cheap as asked for was found; `known` is whether that is certain.

    `binding` bool [pairs]: those that bear the bound of the linear relaxation. `price` of the chosen ones and of what they give up.
    """

    chosen: list[int] | None
    known: bool
    binding: np.ndarray
    price: float = np.inf


@dataclass(frozen=True)
class CoverLimits:
    """At most `most` columns at a price of at most `price`; not all of any set in `barred` at once.

    Each call of the solver takes `solver_s` seconds at most, and none past the `deadline` (by default never).
    """

    most: int
    price: float
    solver_s: float
    barred: Sequence[Sequence[int]] = ()
    deadline: Deadline = NEVER

    def seconds(self) -> float:
        """For the next call of the solver; 0 once none may be made."""
        return min(self.solver_s, self.deadline.left())


def cover(separates: np.ndarray, left: np.ndarray, right: np.ndarray, weight: np.ndarray, limits: CoverLimits) -> Cover:
    """Columns of `separates` bool [n, pairs] that separate all pairs.

    A column costs 1, giving a pair up the `weight` [m] of one of its cells `left`, `right` [pairs].
    """
    cells = np.unique(np.concatenate([left, right]))
    cells = cells[weight[cells] < limits.price]
    given_up = ((left[:, None] == cells) | (right[:, None] == cells)).astype(float)
    relaxed = _relax(separates, given_up, weight[cells], limits)
    if relaxed is None:
        return Cover(None, False, np.ones(len(left), bool))
    if relaxed.bound > limits.price + SLACK:
        return Cover(None, True, relaxed.dual > 0)
    # a column whose reduced cost lifts the bound over the price is in no answer
    kept = np.flatnonzero(relaxed.bound + relaxed.reduced <= limits.price + SLACK)
    first = np.sort(kept[np.lexsort((relaxed.reduced[kept], -relaxed.value[kept]))[:PROMISING]])
    problem = _Problem(separates, given_up, weight[cells], relaxed.bound)
    chosen, price = problem.solve(first, limits, bounded=False)
    known = False
    if chosen is None and len(kept) <= COLUMNS_PER_S * limits.seconds():
        chosen, price = problem.solve(kept, limits, bounded=True)
        known = price == np.inf
    return Cover(chosen, chosen is not None or known, relaxed.dual > 0, price)


@dataclass(frozen=True)
class _Relaxed:
    """The linear relaxation: its value, that of each column [n] and its reduced cost [n], the duals [pairs] of the pairs."""

    bound: float
    value: np.ndarray
    reduced: np.ndarray
    dual: np.ndarray


def _relax(separates: np.ndarray, given_up: np.ndarray, weight: np.ndarray, limits: CoverLimits) -> _Relaxed | None:
    """The linear relaxation by column generation; None where the solver gives no answer, an infinite value where there is none."""
    n, pairs = separates.shape
    order = np.argsort(-separates.sum(1), kind="stable")
    active = np.zeros(n, bool)
    active[order[:STARTING]] = True
    # a column for each pair, without which the first relaxation may have no answer
    active[order[np.argmax(separates[order], axis=0)]] = True
    while limits.seconds() > 0:
        columns = np.flatnonzero(active)
        rows = hstack([csr_array(separates[columns].T.astype(float)), csr_array(given_up)])
        cost = np.concatenate([np.ones(len(columns)), weight])
        options = {"time_limit": limits.seconds()}
        solved = linprog(cost, A_ub=-rows, b_ub=-np.ones(pairs), bounds=(0, None), method="highs", options=options)
        if solved.status == INFEASIBLE:
            return _Relaxed(np.inf, np.zeros(n), np.zeros(n), np.ones(pairs))
        if solved.status != 0:
            return None
        dual = -solved.ineqlin.marginals
        reduced = 1 - separates @ dual
        wanted = np.flatnonzero((reduced < -SLACK) & ~active)
        if not len(wanted):
            value = np.zeros(n)
            value[columns] = solved.x[: len(columns)]
            return _Relaxed(float(solved.fun), value, np.maximum(reduced, 0.0), dual)
        active[wanted[np.argsort(reduced[wanted], kind="stable")[:STARTING]]] = True
    return None


@dataclass(frozen=True)
class _Problem:
    """Which columns [n, pairs] separate which pairs, which cells [pairs, cells] give them up, at what weight [cells]; the least price."""

    separates: np.ndarray
    given_up: np.ndarray
    weight: np.ndarray
    bound: float

    def solve(self, some: np.ndarray, limits: CoverLimits, bounded: bool) -> tuple[list[int] | None, float]:
        """An answer out of `some` columns within the limits and its price; or None, and an infinite price where there surely is none.

        With `bounded` the solver knows price and size, which proves more; without it comes to some answer sooner.
        """
        n = len(some)
        if not limits.seconds():
            return None, np.nan
        rows = csr_array(hstack([csr_array(self.separates[some].T.astype(float)), csr_array(self.given_up)]))
        cost = np.concatenate([np.ones(n), self.weight])
        none = np.zeros(len(self.weight))
        size = np.concatenate([np.ones(n), none])
        # not all of any barred set at once
        bars = [LinearConstraint(np.append(np.isin(some, barred), none)[None], ub=len(barred) - 1.0) for barred in limits.barred]
        bounds = [LinearConstraint(rows, lb=1.0), *bars]
        if bounded:
            bounds += [LinearConstraint(size[None], ub=float(limits.most)), LinearConstraint(cost[None], ub=limits.price)]
        gap = ENOUGH if bounded else min(ENOUGH, NEAR / max(self.bound, 1.0))
        options = {"time_limit": limits.seconds(), "node_limit": MOST_NODES, "mip_rel_gap": gap}
        found = milp(cost, constraints=bounds, integrality=np.ones(len(cost)), bounds=Bounds(0, 1), options=options)
        if found.x is None:
            return None, np.inf if found.status == INFEASIBLE else np.nan
        chosen = np.round(found.x)
        fits = chosen @ size <= limits.most and chosen @ cost <= limits.price
        return (some[chosen[:n] > 0].tolist(), float(chosen @ cost)) if fits else (None, np.nan)
