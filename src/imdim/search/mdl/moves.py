"""Changes of a choice among parts: which there are, and which of them are worth a fit."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from imdim.geometry.rotations import matrix_from_euler
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Loop, ring_curves
from imdim.program.rewrite.containment import bounding_radius
from imdim.program.sequence import Step
from imdim.program.tree import Combine, Op, Primitive, Program
from imdim.search.mdl.batched_likelihood import BatchedLikelihood
from imdim.search.mdl.local_search import Choice, own_moves, uses

MOST_USES = 2  # of one new part among the changes
TWIN = 3.0  # deviations of the noise by which parts hardly differ whose numbers had their first step
PAIRED = 4  # steps of which an outline may take the place of two


def single_moves(mixture: BatchedLikelihood, start: Choice, meet: Sequence[set[int]]) -> tuple[list[Choice], dict[int, range]]:
    """Changes of the `start` alone and by one part more, in the place of those that it is there to `meet` or beside them; and where among
    them those by each part are."""
    parts = mixture.parts
    # a wall is no cut: what is left of it in its middle would stand alone
    walls = {i for i, part in enumerate(parts) if isinstance(part, Combine) and part.op == "difference"}
    moves, own = [*own_moves(start), *holes_for_posts(start, meet)], dict[int, range]()
    for i in range(len(start), len(parts)):
        first = len(moves)
        moves += (c for c in uses(i, start, meet[i]) if i not in walls or all(s.positive or s.term != i for s in c))
        own[i] = range(first, len(moves))
    return moves, own


def holes_for_posts(start: Choice, meet: Sequence[set[int]]) -> Iterator[Choice]:
    """Without a cut, and what is united in it later on cut out: their surfaces alone do not tell posts in a pocket from holes in a block,
    but those of the pocket are missing."""
    for i, (op, pocket) in enumerate(start):
        posts = {step.term for step in start[i + 1 :] if step.positive and step.term in meet[pocket]}
        if op == "difference" and posts:
            yield tuple(Step("difference" if step.term in posts else step.op, step.term) for step in start if step.term != pocket)


def best_in_place(moves: Sequence[Choice], own: range, lengths: np.ndarray, start: Choice) -> Choice | None:
    """The one of a part's `own` moves in which it does best in the place of another, by the `lengths` of the start and of the moves."""
    in_place = [k for k in own if len(moves[k]) == len(start)]
    return moves[min(in_place, key=lambda k: lengths[k + 1])] if in_place else None


def in_place_of_two(
    term: int, parts: Sequence[Program], moves: Sequence[Choice], own: range, lengths: np.ndarray, start: Choice
) -> Iterator[Choice]:
    """An outline in the place of two of those steps in the place of which it does best alone, by the `lengths` of the start and of the
    moves: to look at all pairs of a long sequence took most of a round."""
    part = parts[term]
    if not isinstance(part, Primitive) or part.outline is None:
        return
    in_place = sorted((k for k in own if len(moves[k]) == len(start)), key=lambda k: lengths[k + 1])
    places = sorted(next(at for at, step in enumerate(moves[k]) if step.term == term) for k in in_place[:PAIRED])
    yield from in_place_of(itertools.permutations(places, 2), term, start)


def in_place_of(some: Iterable[tuple[int, ...]], term: int, start: Choice) -> Iterator[Choice]:
    """The term in the place of the first of some steps, without the others, unless a cut would come first."""
    for i, *gone in some:
        choice = tuple(Step(op, term if at == i else old) for at, (op, old) in enumerate(start) if at not in gone)
        if choice[0].positive:
            yield choice


def few_of_each(choices: Iterable[Choice], settled: int) -> Iterator[Choice]:
    """The choices without those whose new part, of an index from `settled` on, MOST_USES before them have: what else is missing elsewhere
    can be won in the same round."""
    used = Counter[int]()
    for choice in choices:
        new = [step.term for step in choice if step.term >= settled]
        if all(used[term] < MOST_USES for term in new):
            used.update(new)
            yield choice


def leave_twins(choices: Iterable[Choice], parts: Sequence[Program], start: Choice, sigma: float) -> Iterator[Choice]:
    """The choices without those that put a part in the place of one that it hardly differs from, and without those that do what one before
    them did with a part that hardly differs: their numbers would be fitted to the same end."""
    settled = {step.term: step for step in start}
    kept: dict[tuple[Op, frozenset[int], int], list[Primitive]] = {}
    for choice in choices:
        new = [(at, step) for at, step in enumerate(choice) if step.term not in settled]
        gone = settled.keys() - {step.term for step in choice}
        part = parts[new[0][1].term] if len(new) == 1 and len(gone) < 2 else None
        if isinstance(part, Primitive):
            (at, (op, _)) = new[0]
            old = [parts[term] for term in gone if settled[term].op == op]
            twins = kept.setdefault((op, frozenset(gone), at), [])
            if any(isinstance(p, Primitive) and is_near(part, p, TWIN * sigma) for p in old) or any(is_near(part, p, sigma) for p in twins):
                continue
            twins.append(part)
        yield choice


def order_by_length(lengths: np.ndarray) -> np.ndarray:
    """Indices from the shortest to the longest, of those that come to the same the first, and none of those that come to what the first
    of all does: in another order the same solid comes about."""
    first = np.unique(np.round(lengths, 9), return_index=True)[1]
    return first[first > 0]


def is_near(a: Primitive, b: Primitive, reach: float) -> bool:
    """Whether the numbers of two parts of one kind differ by no more than `reach`, and their directions by no more than moves an end so
    far."""
    if a.kind != b.kind or not np.allclose((*a.size, *a.center), (*b.size, *b.center), rtol=0.0, atol=reach):
        return False
    turned = np.abs(matrix_from_euler(a.rotation) - matrix_from_euler(b.rotation)).max() * bounding_radius(b)
    if turned > reach or a.outline is None or b.outline is None:
        return bool(turned <= reach)
    mine, its = a.outline.loops, b.outline.loops
    if [(type(loop), len(loop)) for loop in mine] != [(type(loop), len(loop)) for loop in its]:
        return False
    return all(np.allclose(_lengths_of(one), _lengths_of(other), rtol=0.0, atol=reach) for one, other in zip(mine, its, strict=True))


def _lengths_of(loop: Loop) -> list[float]:
    """What says where a loop runs, in units of length: corners and by how much arcs leave their chords, or the middle of an ellipse and the
    ends of its first axis, and the second one."""
    if isinstance(loop, Ellipse):
        along = (loop.rx * np.array(loop.along)).tolist()
        return [loop.x, loop.y, *along, loop.ry]
    corners = [number for x, y, _ in loop for number in (x, y)]
    return corners + [b * math.dist((x, y), (u, v)) / 2 for x, y, u, v, b in ring_curves(loop)]
