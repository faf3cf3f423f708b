"""Programs to start from: greedy insertion over the detected surfaces under several prices, and the steps of found sequences."""

from __future__ import annotations

from collections.abc import Iterator

from imdim.deadline import Deadline
from imdim.program.tree import Program
from imdim.search.candidate_families import Families
from imdim.search.cells import HULLS, TRUE, Weights
from imdim.search.lns import LocalConfig, complete, prune, rate_sequence
from imdim.search.sequence import Price, Sequence, to_program

# true, hulls first, pure pieces first, pure cuts after a hull
PHASES: tuple[tuple[Weights, ...], ...] = ((TRUE,), (HULLS, (1.0, 5.0)), ((20.0, 1.0), TRUE), ((0.01, 1.0), (1.0, 20.0)))


def surface_seeds(families: Families, size_weight: float, deadline: Deadline) -> list[Program]:
    """Greedy insertions of the best candidate under four prices, with every program on the way."""
    return [p for sequence in greedy(families, size_weight, deadline) for p in steps(sequence, families)]


def greedy(families: Families, size_weight: float, deadline: Deadline) -> Iterator[Sequence]:
    """The pruned sequence of greedy insertions of the best candidate, under each of four prices; one at least."""
    exact = Price(size_weight * families.cells.volume)
    for phases in PHASES:
        found = rate_sequence((), families, exact)
        # a phase under other weights is short: what it adds must pay forty times the price
        for price in (*(Price(exact.step * (1.0 if w == TRUE else 40.0), w) for w in phases), exact):
            found = complete(rate_sequence(found.sequence, families, price), LocalConfig(), price, deadline)
        yield prune(found, exact).sequence
        if deadline.has_passed():
            return


def steps(sequence: Sequence, families: Families) -> list[Program]:
    """The programs of the first one, two, ... steps of a sequence, the longest first."""
    return [to_program(sequence[:n], families) for n in range(len(sequence), 0, -1)]
