"""The fewest candidates that tell apart what a program must tell apart, by integer programming (HiGHS).

A relaxation of synthesis that holds for every program of every form: each pair of an inside and an outside cell is separated by one of the
program's primitives, or the program is wrong on one of the two and pays that cell's weight. Its linear relaxation is nearly tight, which is
why branch and bound over it ends in tenths of a second where a solver that learns clauses (CP-SAT) does not end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import csr_array, hstack

INFEASIBLE = 2  # scipy's status
MOST_NODES = 20_000


@dataclass(frozen=True)
class Cover:
    """`chosen` columns, None where no cover as cheap as asked for was found; `known` is whether that is certain."""

    chosen: list[int] | None
    known: bool


def cover(
    separates: np.ndarray, left: np.ndarray, right: np.ndarray, weight: np.ndarray, most: int, price: float, limit_s: float
) -> Cover:
    """At most `most` columns of `separates` bool [n, pairs] with the least price, if it is at most `price`.

    A column costs 1, giving a pair up the `weight` [m] of one of its cells `left`, `right` [pairs].
    """
    n, pairs = separates.shape
    cells = np.unique(np.concatenate([left, right]))
    cells = cells[weight[cells] < price]
    given_up = csr_array((left[:, None] == cells) | (right[:, None] == cells))
    rows = hstack([csr_array(separates.T), given_up]).astype(float)
    cost = np.concatenate([np.ones(n), weight[cells]])
    limits = [
        LinearConstraint(rows, lb=1.0),
        LinearConstraint(np.concatenate([np.ones(n), np.zeros(len(cells))])[None], ub=float(most)),
        LinearConstraint(cost[None], ub=price),
    ]
    options = {"time_limit": limit_s, "node_limit": MOST_NODES}
    found = milp(cost, constraints=limits, integrality=np.ones(len(cost)), bounds=Bounds(0, 1), options=options)
    if found.x is not None:
        return Cover(np.flatnonzero(found.x[:n] > 0.5).tolist(), True)
    return Cover(None, found.status == INFEASIBLE)
