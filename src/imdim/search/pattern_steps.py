"""Patterns as single steps: all copies of a candidate along a row, grid or circle or in a mirror, at the price of one and its counts.

A hole of a grid may win less than a step costs, and all of them much more. So the best of each curved surface, and what is inserted at a
small part of a step's price, is looked through for copies (`program.patterns`); what does not repeat is dropped again. Where bars and slots
make up for a grid of holes, those steps that win little are left out first: a pattern in their place may cost less.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from operator import itemgetter

import numpy as np

from imdim.deadline import Deadline
from imdim.program.patterns.detect import find_repeats
from imdim.program.patterns.weigh import NEAR
from imdim.program.sequence import Step
from imdim.program.tree import Op
from imdim.search.candidate_families import Candidate, Families
from imdim.search.cells import TRUE
from imdim.search.lazy_bounds import insert_all
from imdim.search.lns import LocalConfig, RatedSequence, complete, prune, rate_sequence
from imdim.search.minimal_ranges import leave_air
from imdim.search.sequence import Covered, Insertion, Pattern, Price, Sequence, cost, error, error_of, expense, field_of, gaps, without_one

LEAST = 0.04  # of a step's price, which each copy wins at least: more copies than its inverse are rare
FEWEST = 2  # copies
MOST = 150  # curved surfaces that are looked through
COPIES = 64  # steps that are inserted for their copies, at most
ALIKE = 0.3  # of the best gain, from which several of them are inserted at once
SMALL = 12.0  # steps' prices: what wins less alone may be one of many that stand for a pattern


def insert_patterns(found: RatedSequence, config: LocalConfig, price: Price, deadline: Deadline) -> RatedSequence:
    """With patterns at the end as long as they pay, or in place of steps that win little alone."""
    best = _append_patterns(found, config, price, deadline)
    bare = _without_small(found, price)
    if cost(bare.sequence) + FEWEST > cost(found.sequence) or deadline.has_passed():
        return best
    patterned = _append_patterns(bare, config, price, deadline)
    if patterned.sequence != bare.sequence:
        patterned = prune(complete(patterned, config, price, deadline, best.objective), price)
    return min(best, patterned, key=lambda rated: rated.objective)


def _append_patterns(found: RatedSequence, config: LocalConfig, price: Price, deadline: Deadline) -> RatedSequence:
    while error(found.sequence, found.families) > price.step and not deadline.has_passed():
        best = max(_find_patterns(found, config, price, deadline), key=lambda i: _net(i, found.families, price), default=None)
        if best is None or _net(best, found.families, price) <= 0:
            break
        longer = insert_all(found.sequence, [(best, Covered.of(best.shape, found.families).mask)])
        found = rate_sequence(longer, found.families, price)
    return found


def _net(insertion: Insertion, families: Families, price: Price) -> float:
    return insertion.gain - expense((Step(insertion.op, Covered.of(insertion.shape, families)),), families, price)


def _find_patterns(found: RatedSequence, config: LocalConfig, price: Price, deadline: Deadline) -> Iterator[Insertion]:
    """Patterns at the end of a sequence."""
    sequence, families, low = found.sequence, found.families, replace(price, step=LEAST * price.step)
    fields = dict(_fields(sequence, families))
    for op, field in fields.items():
        # few samples fall into what is small, and boxes win as much there as the surface that it has
        curved = sorted(families.best(field, 0, low.step), key=itemgetter(0), reverse=True)[:MOST]
        yield from _insert_repeats(op, field, [candidate for _, candidate in curved], sequence, families)
    if len(families.cells.points) * families.groups > config.large:
        return  # there are drawings then, which have what repeats in one plane
    added = _insert_cheaply(found, config, low, deadline)
    for op, field in fields.items():
        yield from _insert_repeats(op, field, [shape for o, shape in added if o == op], sequence, families)


def _fields(sequence: Sequence, families: Families) -> Iterator[tuple[Op, np.ndarray]]:
    """What each cell [m] wins that is united or cut at the end of a sequence."""
    _, state, free = next(gaps(sequence, len(families.cells.points)))
    ops: tuple[Op, ...] = ("union", "difference")
    for op in ops if sequence else ():
        yield op, field_of(op, free, state, families.cells.gain_under(TRUE))[0]


def _insert_cheaply(found: RatedSequence, config: LocalConfig, low: Price, deadline: Deadline) -> list[tuple[Op, Candidate]]:
    """The single candidates that pay at a low price."""
    limits = replace(config, max_primitives=int(cost(found.sequence)) + COPIES, pair_limit=0, large=0.0, alike=ALIKE)
    longer = complete(rate_sequence(found.sequence, found.families, low), limits, low, deadline).sequence
    known = {id(step) for step in found.sequence}
    return [(s.op, s.term.shape) for s in longer if id(s) not in known and isinstance(s.term.shape, Candidate)]


def _insert_repeats(op: Op, field: np.ndarray, single: list[Candidate], sequence: Sequence, families: Families) -> Iterator[Insertion]:
    """The patterns among candidates, at the end of a sequence."""
    single = list(dict.fromkeys(leave_air(candidate, field, families) for candidate in single))
    if len(single) < FEWEST:
        return
    size = float(np.linalg.norm(np.subtract(*families.arrangement.bounds)))
    for members, ways in find_repeats([families.primitive(candidate) for candidate in single], NEAR * size):
        shape = Pattern(tuple(single[i] for i in members), ways)
        yield Insertion(float(field[Covered.of(shape, families).mask].sum()), len(sequence), op, shape)


def _without_small(found: RatedSequence, price: Price) -> RatedSequence:
    """Without all steps but the first that alone win little, and what is idle without them."""
    sequence, families = found.sequence, found.families
    had = error(sequence, families)
    small = {
        i
        for i, filled in without_one(sequence, len(families.cells.points))
        if i and not isinstance(sequence[i].term.shape, Pattern) and error_of(filled, families) - had < SMALL * price.step
    }
    return prune(rate_sequence(tuple(step for i, step in enumerate(sequence) if i not in small), families, price), price)
