"""Cuts that end in the air inside the part end where what they cut does; those that stick out of it are `free_ends`.

Where a cutter ends in the air is of no matter to the solid, and a search leaves it anywhere there: at the level of another feature, or of
its outermost planes. Who reads the program takes 21 for the depth of a hole through a floor of 3, and an edit of what lies at 21 moves it.
So an end in the air is put to where all that is cut ends; delivery lets it stand out from there (`overshoot`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from manifold3d import Manifold, OpType

from imdim.deadline import NEVER, Deadline
from imdim.geometry.finish.cutter_extent import direction_of, ends_of, stretch
from imdim.geometry.finish.section import CHECK_SEGMENTS
from imdim.geometry.finish.tolerances import ALIGNED, NOTHING
from imdim.geometry.solid import bounds_of, exact_rotation, primitive_to_manifold, to_manifold
from imdim.program.nary import fold_nary
from imdim.program.roles import cuts_of_each, signs
from imdim.program.tree import FLAT_ENDS, Primitive, Program, combine_all, leaves, replace_leaves
from imdim.program.vectors import round_vector

MOST = 150  # primitives: every cutter is held against every other
ROUND = 12  # decimals, of the largest number as 1, to which sums of decimals are what they should be


@dataclass(frozen=True)
class _Solids:
    """The leaves of a program with their signs, what is cut from each and their solids, and the whole."""

    parts: Sequence[Primitive]
    sign: Sequence[int]
    cuts: Sequence[Sequence[int]]
    solids: Sequence[Manifold]
    whole: Manifold

    @staticmethod
    def of(program: Program) -> _Solids:
        parts = list(leaves(program))
        solids = [primitive_to_manifold(part, CHECK_SEGMENTS) for part in parts]
        return _Solids(parts, signs(program), cuts_of_each(program), solids, to_manifold(program, CHECK_SEGMENTS))

    def carriers(self, cut: int) -> list[Primitive]:
        """The added leaves of which a cut takes what no other one does."""
        least = NOTHING * self.solids[cut].volume()
        may = (i for i, own in enumerate(self.cuts) if self.sign[i] > 0 and cut in own)
        return [self.parts[i] for i in may if self._take(cut, i).volume() > least]

    def _take(self, cut: int, leaf: int) -> Manifold:
        """What a cut takes of a leaf, and no other one does."""
        taken = self.solids[cut] ^ self.solids[leaf]
        others = [self.solids[i] for i in self.cuts[leaf] if i != cut and _boxes_meet(self.solids[i], taken)]
        return taken - Manifold.batch_boolean(others, OpType.Add) if others else taken


def _boxes_meet(a: Manifold, b: Manifold) -> bool:
    """Whether the boxes of two solids have anything in common; an empty solid has none."""
    if a.is_empty() or b.is_empty():
        return False
    (a_low, a_high), (b_low, b_high) = map(bounds_of, (a, b))
    return bool(((a_low <= b_high) & (b_low <= a_high)).all())


def end_cuts_in_faces(program: Program, deadline: Deadline = NEVER) -> Program:
    """The program whose boxes, cylinders, cones and extrusions that are cut end no farther out than what they cut, and all but cones as far
    out where nothing is in the way. Cuts that are one then, as the halves of a hole through a plate and the boss on it, are written once.

    Whoever takes it has to compare the solids. Past the `deadline` (by default never) the other cutters stay.
    """
    sign = signs(program)
    if not 1 < len(sign) <= MOST or min(sign) > 0 or deadline.has_passed():
        return program
    made = _Solids.of(program)
    cutters = [i for i, part in enumerate(made.parts) if sign[i] < 0 and part.kind in FLAT_ENDS]
    ended = {i: _end(made, i) for i in cutters if not deadline.has_passed()}
    return _without_twins(replace_leaves(program, ended)) if ended else program


def _without_twins(program: Program) -> Program:
    """The program without what stands beside its equal in one union, or is cut again."""
    if len(set(leaves(program))) == len(list(leaves(program))):
        return program
    return fold_nary(
        program,
        lambda _, leaf: leaf,
        {
            "union": lambda terms: combine_all("union", list(dict.fromkeys(terms))),
            "intersection": lambda terms: combine_all("intersection", terms),
            "difference": lambda terms: combine_all("difference", [terms[0], *dict.fromkeys(terms[1:])]),
        },
    )


def _end(made: _Solids, cut: int) -> Primitive:
    """A cutter with ends in the faces of what it cuts, wherever it leaves that."""
    leaf, carriers = made.parts[cut], made.carriers(cut)
    for axis in FLAT_ENDS[leaf.kind] if carriers else ():
        spans = list(_spans(carriers, direction_of(leaf, axis)))
        if len(spans) < len(carriers):
            continue
        ends = _ends_within(made, leaf, axis, (min(low for low, _ in spans), max(high for _, high in spans)))
        leaf = leaf if ends == ends_of(leaf, axis) else _round(stretch(leaf, axis, ends))
    return leaf


def _spans(carriers: Sequence[Primitive], direction: np.ndarray) -> Iterator[tuple[float, float]]:
    """From where to where carriers go along a direction, of those that have plane ends across it."""
    for part in carriers:
        turn = exact_rotation(part)
        ways = [column for axis, column in FLAT_ENDS.get(part.kind, {}).items() if abs(float(turn[:, axis] @ direction)) > 1 - ALIGNED]
        if ways:
            along, half = float(direction @ part.center), part.size[ways[0]] / 2
            yield along - half, along + half


def _ends_within(made: _Solids, leaf: Primitive, axis: int, span: tuple[float, float]) -> tuple[float, float]:
    """The ends of a cutter along an axis, at those of a span where they lie beyond it, or in the air that reaches there."""
    now = ends_of(leaf, axis)
    slack = NOTHING * (span[1] - span[0])
    out = list(now)
    for k, (end, face) in enumerate(zip(now, span, strict=True)):
        beyond = (end - face) * (1 if k else -1)
        if abs(beyond) <= slack:
            continue
        is_prism = leaf.kind != "cone"  # which grows where it goes on
        if beyond > 0 or (is_prism and _is_free(made.whole, stretch(leaf, axis, (min(end, face), max(end, face))))):
            out[k] = face
    return (out[0], out[1]) if out[0] < out[1] else now


def _is_free(solid: Manifold, region: Primitive) -> bool:
    wanted = primitive_to_manifold(region, CHECK_SEGMENTS)
    return (wanted ^ solid).volume() <= NOTHING * wanted.volume()


def _round(leaf: Primitive) -> Primitive:
    """The leaf without what sums of decimals leave beyond theirs."""
    decimals = ROUND - math.ceil(math.log10(max(map(abs, (*leaf.size, *leaf.center)))))
    return replace(leaf, size=tuple(round(v, decimals) for v in leaf.size), center=round_vector(leaf.center, decimals))
