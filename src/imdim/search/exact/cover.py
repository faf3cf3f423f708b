"""The fewest candidates that tell apart what a program must tell apart, by integer programming (HiGHS).

A relaxation of synthesis that holds for every program of every form: each pair of an inside and an outside cell is separated by one of the
program's primitives, or the program is wrong on one of the two and pays that cell's weight. Its linear relaxation is nearly tight, which is
why branch and bound over it ends in tenths of a second where a solver that learns clauses (CP-SAT) does not end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, OptimizeResult, linprog, milp
from scipy.sparse import csr_array, hstack, vstack

INFEASIBLE = 2  # scipy's status
MOST_NODES = 20_000
NEAR = 0.02  # relative gap of an answer among these
PROMISING = 400  # variables tried first, by their reduced costs
ENOUGH = 0.15  # relative gap: any answer below the price shows what counterexamples lack, it need not be the cheapest
SLACK = 1e-5  # what the solver's arithmetic may be off by


@dataclass(frozen=True)
class Cover:
    """`chosen` columns, None where no cover as cheap as asked for was found; `known` is whether that is certain.

    `binding` bool [pairs]: those that bear the bound of the linear relaxation.
    """

    chosen: list[int] | None
    known: bool
    binding: np.ndarray


@dataclass(frozen=True)
class Limits:
    """At most `most` columns at a price of at most `price`, found within `solver_s` seconds; not all of any set in `barred` at once."""

    most: int
    price: float
    solver_s: float
    barred: Sequence[Sequence[int]] = ()


def cover(separates: np.ndarray, left: np.ndarray, right: np.ndarray, weight: np.ndarray, limits: Limits) -> Cover:
    """Columns of `separates` bool [n, pairs] that separate all pairs.

    A column costs 1, giving a pair up the `weight` [m] of one of its cells `left`, `right` [pairs].
    """
    price = limits.price
    n = len(separates)
    cells = np.unique(np.concatenate([left, right]))
    cells = cells[weight[cells] < price]
    given_up = csr_array((left[:, None] == cells) | (right[:, None] == cells))
    rows = csr_array(hstack([csr_array(separates.T), given_up]), dtype=float)
    cost = np.concatenate([np.ones(n), weight[cells]])
    size = np.concatenate([np.ones(n), np.zeros(len(cells))])
    at_most = np.append(-np.ones(len(left)), limits.most)
    relaxed = linprog(cost, A_ub=vstack([-rows, size[None]]), b_ub=at_most, bounds=(0, 1), method="highs")
    if relaxed.status != 0:
        return Cover(None, relaxed.status == INFEASIBLE, np.ones(len(left), bool))
    binding = relaxed.ineqlin.marginals[:-1] < 0
    if relaxed.fun > price + SLACK:
        return Cover(None, True, binding)
    # a variable whose reduced cost lifts the bound over the price is 0 in every answer
    lifted = relaxed.fun + relaxed.lower.marginals
    kept = np.flatnonzero(lifted <= price + SLACK)
    promising = kept[np.sort(np.argsort(lifted[kept], kind="stable")[:PROMISING])]
    for some, gap in ((promising, NEAR), (kept, ENOUGH)) if len(promising) < len(kept) else ((kept, NEAR),):
        barred = [np.flatnonzero(np.isin(some, b)) for b in limits.barred]
        found = _solved(cost[some], rows[:, some], size[some], barred, limits, gap)
        if found.x is not None:
            chosen = some[found.x > 0.5]
            return Cover(chosen[chosen < n].tolist(), True, binding)
    return Cover(None, found.status == INFEASIBLE, binding)


def _solved(cost: np.ndarray, rows: csr_array, size: np.ndarray, barred: list[np.ndarray], limits: Limits, gap: float) -> OptimizeResult:
    bounds = [
        LinearConstraint(rows, lb=1.0),
        LinearConstraint(size[None], ub=float(limits.most)),
        LinearConstraint(cost[None], ub=limits.price),
    ]
    for columns, whole in zip(barred, limits.barred, strict=True):
        row = np.zeros(len(cost))
        row[columns] = 1.0
        bounds.append(LinearConstraint(row[None], ub=len(whole) - 1.0))
    options = {"time_limit": limits.solver_s, "node_limit": MOST_NODES, "mip_rel_gap": gap}
    return milp(cost, constraints=bounds, integrality=np.ones(len(cost)), bounds=Bounds(0, 1), options=options)
