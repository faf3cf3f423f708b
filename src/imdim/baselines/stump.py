"""CSG-Stump without a network: detected primitives, the matrices by binary programming, the program that they say."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from imdim.deadline import Deadline
from imdim.program.rewrite.simplify import reduce_program
from imdim.program.stump import to_program
from imdim.program.tree import Program
from imdim.reconstruction.observation import Observation
from imdim.search.candidate_families import Candidate, Families
from imdim.search.evolve.seeds import greedy
from imdim.search.exact.stump import connections, matrices

MOST = 40  # primitives


def stumps(seen: Observation, deadline: Deadline) -> Iterator[Program]:
    """Programs, each cheaper than the one before; one at least where the body shows any candidate."""
    families, best = seen.families, np.inf
    for pool in _pools(families, seen.size_weight, deadline):
        program = _program(pool, families, seen.size_weight)
        price = seen.price(program)
        if price < best:
            best = price
            yield program
        if deadline.has_passed():
            return


def _program(pool: list[Candidate], families: Families, size_weight: float) -> Program:
    cells = families.cells
    masks = np.stack([families.mask(c) for c in pool])
    chosen = connections(masks, cells.w_in, cells.w_out, size_weight * cells.volume)
    return reduce_program(to_program(matrices(chosen.terms, [families.primitive(c) for c in pool])))


def _pools(families: Families, size_weight: float, deadline: Deadline) -> Iterator[list[Candidate]]:
    """Sets of primitives to connect: those that greedy insertion takes under each of several prices, then the best of all of them."""
    every: list[Candidate] = []
    for sequence in greedy(families, size_weight, deadline):
        pool = list(dict.fromkeys(half for step in sequence for half in step.term.halves))[:MOST]
        if pool:
            every += pool
            yield pool
    together = list(dict.fromkeys(every))
    if not together:
        together = [c for _, c in sorted(families.best(families.cells.gain, 1, -np.inf), key=lambda f: -f[0])[:1]]
    if together:
        yield together[:MOST]
