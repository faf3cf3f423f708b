"""Ends of which nothing is seen lie far out in the air: an edit that moves what they are about does not bring them in sight.

A cutter, or what bounds a part from outside, may end a hair beyond what it meets, where that is round or slanted and gives the end no face
to follow. Change a diameter by a tenth, and the end is seen. How far out it lies is of no matter to the solid, so it lies as far out as the
solid lets it, up to a fifth of the part.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from itertools import groupby

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.geometry.finish.active_zone import matters
from imdim.geometry.finish.extend import Face, between, beyond, flip_face, length, plane_faces, within
from imdim.geometry.finish.overshoot import SKIN
from imdim.geometry.finish.posed import PosedPrimitive, diagonal
from imdim.geometry.finish.tolerances import ALIGNED
from imdim.program.repeats import Folded, copies_of
from imdim.program.roles import signs
from imdim.program.tree import Program, fold, leaves, map_leaves

REACH = 0.2  # of the diagonal: further out no end has to lie
ROUND = (5, 2, 1)  # an end lies so many times a power of ten further out
TRIES = 3  # such numbers, the largest first

_Faces = Sequence[tuple[int, Face]]  # of leaves


def reach_far(
    program: Program,
    folded: Folded | None = None,
    kept: Collection[tuple[int, Face | None]] = (),
    deadline: Deadline = NEVER,
    masks: bool = False,
) -> Program:
    """The same solid whose cutters, or (`masks`) the leaves to whose inside an intersection keeps a part, end far out where nothing is
    seen of their ends, but for the faces of leaves that are `kept`, and those of their copies.

    `folded`, which `program` is the expansion of, says which leaves are copies. Past the `deadline` (by default never) the others stay.
    """
    placed, sign, around = [PosedPrimitive(leaf) for leaf in leaves(program)], signs(program), _find_masks(program)
    size = diagonal([part for part, s in zip(placed, sign, strict=True) if s > 0])
    copies = {i: [(i, False)] for i in range(len(placed))} if folded is None else copies_of(folded)
    for index in (i for i in copies if (i in around if masks else sign[i] < 0) and placed[i].leaf.kind != "cone"):
        for _, pair in groupby(() if deadline.has_passed() else plane_faces(placed[index].leaf), lambda face: face[0]):
            ends = [[(i, flip_face(face) if mirrored else face) for i, mirrored in copies[index]] for face in pair]
            hidden = [faces for faces in ends if not any(own in kept for own in faces) and _is_hidden(program, placed, faces, size)]
            placed = _move_out(program, placed, hidden, size)
    return map_leaves(program, lambda i, _: placed[i].leaf)


def _find_masks(program: Program) -> set[int]:
    """The leaves that are the operands of an intersection."""
    masks = set[int]()

    def both(a: list[int], b: list[int]) -> list[int]:
        masks.update(operand[0] for operand in (a, b) if len(operand) == 1)
        return a + b

    fold(program, lambda i, _: [i], {"union": list.__add__, "difference": list.__add__, "intersection": both})
    return masks


def _skin(part: PosedPrimitive, face: Face, size: float) -> float:
    return min(SKIN * size, length(part.leaf, face) / 8)


def _is_hidden(program: Program, placed: list[PosedPrimitive], faces: _Faces, size: float) -> bool:
    """Whether the solid does not depend on what lies right behind the faces."""
    return not any(matters(program, placed, i, within(placed[i].leaf, face, _skin(placed[i], face, size))) for i, face in faces)


def _move_out(program: Program, placed: list[PosedPrimitive], ends: Sequence[_Faces], size: float) -> list[PosedPrimitive]:
    """The primitives with the ends further out: both by the same, so that the middle stays where it is, or else each as it may; of what
    lies aslant both or none, since the size between them is about the middle."""
    both = [own for faces in ends for own in faces]
    if both and len(ends) < 2 and not _is_level(placed, *both[0]):
        return placed
    for faces in [both, *ends] if len(ends) > 1 and _is_level(placed, *both[0]) else [both]:
        found = next(_moved(program, placed, faces, size), None) if faces else None
        if found is not None:
            placed = found
            if faces is both:
                break
    return placed


def _is_level(placed: list[PosedPrimitive], i: int, face: Face) -> bool:
    """Whether a face looks along one of the world's axes."""
    return bool(np.abs(placed[i].rotation[:, face[0]]).max() > 1 - ALIGNED)


def _moved(program: Program, placed: list[PosedPrimitive], faces: _Faces, size: float) -> Iterator[list[PosedPrimitive]]:
    """The primitives with the faces further out, furthest first; as they are where they already lie so far out."""
    for step in round_numbers(REACH * size):
        if not any(_ends_within(program, placed, i, face, step, size) for i, face in faces):
            yield placed
        parts = list(placed)
        for i, face in faces:
            leaf = parts[i].leaf
            if matters(program, parts, i, beyond(leaf, face, _skin(parts[i], face, size), step)):
                break
            parts[i] = PosedPrimitive(between(leaf, face, -length(leaf, face), step))
        else:
            yield parts


def _ends_within(program: Program, placed: list[PosedPrimitive], i: int, face: Face, step: float, size: float) -> bool:
    """Whether the solid depends on what lies behind a face no further than a `step`."""
    leaf = placed[i].leaf
    return matters(program, placed, i, between(leaf, face, -min(step, length(leaf, face)), -_skin(placed[i], face, size)))


def round_numbers(most: float) -> list[float]:
    """A few round numbers up to `most`, the largest first."""
    power = math.floor(math.log10(most))
    return [n for n in (digit * 10.0**p for p in (power, power - 1) for digit in ROUND) if n <= most][:TRIES]
