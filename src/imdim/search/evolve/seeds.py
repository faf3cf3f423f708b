"""Programs to start from: greedy insertion over the detected surfaces under several prices, and the steps of found sequences."""

from __future__ import annotations

from imdim.deadline import Deadline
from imdim.program.tree import Program
from imdim.search.families import Families
from imdim.search.local import LocalConfig, complete, found_of, pruned
from imdim.search.sequence import Price, Sequence, to_program

# (weight of excess, weight of lack): true, hulls first, pure pieces first, pure cuts after a hull
PRICES = (((1.0, 1.0),), ((0.1, 1.0), (1.0, 5.0)), ((20.0, 1.0), (1.0, 1.0)), ((0.01, 1.0), (1.0, 20.0)))


def surface_seeds(families: Families, size_weight: float, deadline: Deadline) -> list[Program]:
    """Greedy insertions of the best candidate under four prices, with every program on the way."""
    out: list[Program] = []
    for phases in PRICES:
        exact = Price(size_weight * families.cells.volume)
        found = found_of((), families, exact)
        for weights in phases:
            # a phase under other weights is short: what it adds must pay forty times the price
            price = Price(exact.step * (1.0 if weights == (1.0, 1.0) else 40.0), weights)
            found = complete(found_of(found.sequence, families, price), families, LocalConfig(), price, deadline)
        found = complete(found_of(found.sequence, families, exact), families, LocalConfig(), exact, deadline)
        out += steps(pruned(found, families, exact).sequence, families)
        if deadline.passed():
            break
    return out


def steps(sequence: Sequence, families: Families) -> list[Program]:
    """The programs of the first one, two, ... steps of a sequence, the longest first."""
    return [to_program(sequence[:n], families) for n in range(len(sequence), 0, -1)]
