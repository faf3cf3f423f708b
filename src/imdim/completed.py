"""What a program becomes when it is delivered: repeated parts written once, cutters that overshoot, rounded numbers, and names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from imdim.export.numbers import rounded
from imdim.export.parameters import Parameters, parametrise
from imdim.fitting import SNAP_CHANGE, relations_of
from imdim.geometry.constraints import rebased
from imdim.geometry.gathering import Gathering
from imdim.geometry.overshoot import overshoot
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.constraints import WORLD, Constraint, Ref
from imdim.program.cost import count
from imdim.program.folding import Folding, extent, fold_repeats, worth
from imdim.program.repeats import Folded, expand, instances, repeats, size, with_leaves
from imdim.program.tree import Program

NEAR = 2e-4  # of the part's size, by which what nearly repeats may move
GATHERED = (1, 6)  # primitives of a part that may move to where it repeats, at most
MOST_GATHERED = 150  # primitives of a program


@dataclass(frozen=True)
class Completed:
    """`folded`, which `program` is the expansion of, has the repeats, None if there are none. `constraints` hold for `program`."""

    program: Program
    constraints: tuple[Constraint, ...]
    parameters: Parameters
    folded: Folded | None


def completed(program: Program, constraints: Sequence[Constraint] = ()) -> Completed:
    """The program as it is delivered; `constraints` hold for the one given.

    Repeats change the order of primitives. What nearly repeats, or would if it stood together, is made to if that hardly changes the solid.
    """
    folding = fold_repeats(program)
    for other in _others(program):
        if worth(other.folded) <= (0 if folding is None else worth(folding.folded)):
            break
        meant = relations_of(other.program), (other.program, ())
        same = next((pair for pair in meant if _is_same(program, pair[0])), None)
        if same is not None:
            program, constraints = same
            folding = fold_repeats(program)
            break
    if folding is None:
        delivered = finished(program)
        return Completed(delivered, rebased(delivered, constraints), parametrise(program, constraints, delivered), None)
    given, constraints = folding.program, _without_rows(_renumbered(constraints, folding.order), folding.folded)
    folded = with_leaves(folding.folded, rounded(overshoot(given, folding.folded)))
    delivered = expand(folded)
    return Completed(delivered, rebased(delivered, constraints), parametrise(given, constraints, delivered, folded), folded)


def finished(program: Program) -> Program:
    """A program without repeats as it is delivered: cutters overshoot, numbers are rounded."""
    return rounded(overshoot(program))


def _is_same(a: Program, b: Program) -> bool:
    return volume_iou(to_manifold(a), to_manifold(b)) >= 1 - SNAP_CHANGE


def _others(program: Program) -> list[Folding]:
    """The repeats of what nearly repeats, and of what does once its parts are gathered; those that save most first."""
    tolerance = NEAR * extent(program)
    near = fold_repeats(program, tolerance)
    found, known = [near], _repeated(near)
    if count(program).primitives > MOST_GATHERED:
        return [] if near is None else [near]
    gathering = Gathering(program)
    for largest in GATHERED:
        every = gathering.gathered(largest)
        loose = None if every is None else fold_repeats(every.program, tolerance)
        if every is None or _repeated(loose, every.order) <= known:
            continue
        # what does not repeat then stays where it is
        few = gathering.gathered(largest, {i for numbers in _repeated(loose, every.order) for i in numbers})
        found += [loose, None if few is None else fold_repeats(few.program, tolerance)]
    return sorted(filter(None, found), key=lambda f: worth(f.folded), reverse=True)


def _repeated(folding: Folding | None, order: Sequence[int] | None = None) -> set[frozenset[int]]:
    """The leaves of each repeat, by their numbers before folding; `order` gives those before that."""
    if folding is None:
        return set()
    numbers = folding.order if order is None else [order[i] for i in folding.order]
    return {frozenset(numbers[first : first + size(r)]) for first, r in repeats(folding.folded)}


def _without_rows(constraints: Sequence[Constraint], folded: Folded) -> tuple[Constraint, ...]:
    """Without rows and circles of copies of one leaf, which the repeat says; of circles the middle stays, by an opposite pair."""
    sources = {i: source for i, (source, _) in enumerate(instances(folded))}
    out: list[Constraint] = []
    for c in constraints:
        members, half = [ref.leaf for ref in c.of], len(c.of) // 2
        if c.kind not in ("linear", "circular") or len(members) < 3 or len({sources[leaf] for leaf in members}) > 1:
            out.append(c)
        elif c.about is not None and c.about.leaf not in members and len(members) % 2 == 0:
            out.append(replace(c, of=(c.of[0], c.of[half])))
    return tuple(out)


def _renumbered(constraints: Sequence[Constraint], order: Sequence[int]) -> tuple[Constraint, ...]:
    """The constraints of a program whose leaf i was number ``order[i]`` before."""
    number = {old: new for new, old in enumerate(order)} | {WORLD: WORLD}

    def moved(ref: Ref) -> Ref:
        return ref._replace(leaf=number[ref.leaf])

    return tuple(replace(c, of=tuple(map(moved, c.of)), about=None if c.about is None else moved(c.about)) for c in constraints)
