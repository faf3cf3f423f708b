"""How far cutters reach: past faces that only just meet, and as far out as what they cut off.

Where a subtracted primitive ends exactly at a face of what it cuts, rounding leaves a skin of no thickness. Modellers therefore let the
cutter stick out, and let joined parts sink into each other. Here every planar face of a primitive is moved outward if two things hold:

- the primitive matters right up to that face: just inside it, the program's solid changes when the primitive is taken away;
- it does not matter beyond it: from a skin's thickness outward, the solid is the same with and without it.

Both are decided in the thin region concerned (see `active_zone`), so the solid stays the same up to skins and gaps thinner than `SKIN`.
Copies of one part stay alike: a face of all of them moves if one of them has to and all of them may, one beside the other.

Ends of a solid may also lie beyond its target, where no sample of the search ever was. A search looks at a box around the part. A slanted
bar that is added may reach beyond that box, and a cutter that takes its end off within the box ends with the box: the rest of the bar stays
outside, unseen. Such cutters are prolonged here until the stray end is gone (`without_strays`).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import numpy as np
from manifold3d import Manifold

from imdim.deadline import NEVER, Deadline
from imdim.geometry.finish.active_zone import matters
from imdim.geometry.finish.extend import Face, apex, between, beyond, flip_face, length, plane_faces, within
from imdim.geometry.finish.posed import PosedPrimitive, diagonal
from imdim.geometry.finish.section import CHECK_SEGMENTS
from imdim.geometry.finish.tolerances import NOTHING
from imdim.geometry.solid import COMBINE, bounds_of, primitive_to_manifold, to_manifold, volume_iou
from imdim.program.nary import fold_nary
from imdim.program.repeats import Folded, copies_of
from imdim.program.roles import signs
from imdim.program.tree import Program, leaves, map_leaves, replace_leaves

SKIN = 1e-4  # fraction of the diagonal: what is thinner is no feature
REACH = 2e-2  # fraction of the diagonal: the overshoot is the power of ten below it
MARGIN = 1e-3  # of the diagonal; what lies less far outside the target's box is no stray
REACHES = (0.1, 0.3, 1.0)  # of the diagonal, by which a cutter is prolonged to end a stray


def overshoot(
    program: Program,
    folded: Folded | None = None,
    reach: float | None = None,
    deadline: Deadline = NEVER,
    kept: Collection[tuple[int, Face | None]] = (),
) -> Program:
    """The same solid with cutters that stick out of what they cut, and joined parts that sink into each other.

    `folded`, which `program` is the expansion of, says which leaves are copies. Cutters go first, and what already sticks out stays, as do
    the faces of leaves that are `kept`, and those of their copies.
    Overshoots are `reach`, else halves of it; by default round numbers: a power of ten, at most REACH of the diagonal.
    Past the `deadline` (by default never) the other faces stay where they are.
    """
    placed = [PosedPrimitive(leaf) for leaf in leaves(program)]
    sign = signs(program)
    size = diagonal([part for part, s in zip(placed, sign, strict=True) if s > 0])
    rounded = [10.0 ** (math.floor(math.log10(REACH * size)) - k) for k in range(2)]
    steps = rounded if reach is None else [reach / 2**k for k in range(3)]
    copies = {i: [(i, False)] for i in range(len(placed))} if folded is None else copies_of(folded)
    for index in sorted(copies, key=lambda i: sign[i]):
        for face in () if deadline.has_passed() else plane_faces(placed[index].leaf):
            faces = [(i, flip_face(face) if mirrored else face) for i, mirrored in copies[index]]
            if any(own in kept for own in faces):
                continue
            extended = (_extend(program, placed, faces, step, SKIN * size) for step in steps)
            placed = next((parts for parts in extended if parts is not None), placed)
    return map_leaves(program, lambda i, _: placed[i].leaf)


def _extend(
    program: Program, placed: list[PosedPrimitive], faces: list[tuple[int, Face]], step: float, skin: float
) -> list[PosedPrimitive] | None:
    """The primitives with a face of each copy further out by `step`, if one ends within `skin` of where it stops to matter.

    None if a copy matters from there to `step`, beside those before it that reach there already: copies that end at one place may each
    leave it to the others, but not all of them.
    """
    index, face = faces[0]
    leaf, parts = placed[index].leaf, list(placed)
    skin = min(skin, length(leaf, face) / 8)
    high = min(step, apex(leaf, face))
    if high <= 2 * skin:
        return None
    for i, own in faces:
        leaf = parts[i].leaf
        if matters(program, parts, i, beyond(leaf, own, skin, high)):
            return None
        parts[i] = PosedPrimitive(between(leaf, own, -length(leaf, own), step))
    return parts if any(matters(program, placed, i, within(placed[i].leaf, own, skin)) for i, own in faces) else None


def without_strays(program: Program, solid: Manifold, deadline: Deadline = NEVER) -> Program:
    """`program` whose cutters reach as far out as what they cut off, where that leaves less beyond the box of the target `solid`.

    The program itself where nothing strays, or no cutter can end it; its IoU with the target never falls. Past the `deadline` (by default
    never) the other cutters stay.
    """
    corners = bounds_of(solid)
    diagonal = float(np.linalg.norm(corners[1] - corners[0]))
    home = Manifold.cube(tuple(corners[1] - corners[0] + 2 * MARGIN * diagonal)).translate(tuple(corners[0] - MARGIN * diagonal))

    out = to_manifold(program, CHECK_SEGMENTS) - home if _may_reach_beyond(program, bounds_of(home)) else Manifold()
    inside = _parts_within(program, out)
    for i, sign in enumerate(signs(program)):
        for face in plane_faces(list(leaves(program))[i]) if sign < 0 else ():
            leaf = list(leaves(program))[i]
            if out.volume() <= NOTHING * solid.volume() or deadline.has_passed():
                return program
            further = primitive_to_manifold(between(leaf, face, 0.0, diagonal))
            if (further ^ out).volume() <= NOTHING * solid.volume():
                continue
            longer = [between(leaf, face, -length(leaf, face), reach * diagonal) for reach in REACHES]
            # cutters take away: of each program nothing is outside that was not before
            left = [_combine(program, [*inside[:i], *_parts_within(cutter, out), *inside[i + 1 :]]) for cutter in longer]
            # the shortest of those that leave least
            least = min(rest.volume() for rest in left) + NOTHING * solid.volume()
            best = next(k for k, rest in enumerate(left) if rest.volume() <= least)
            if left[best].volume() >= out.volume() - NOTHING * solid.volume():
                continue
            trial = replace_leaves(program, {i: longer[best]})
            if volume_iou(to_manifold(trial), solid) >= volume_iou(to_manifold(program), solid):
                program, out = trial, left[best]
                inside = _parts_within(program, out)
    return program


def _parts_within(program: Program, region: Manifold) -> list[Manifold]:
    """What of each leaf is within a region."""
    return [primitive_to_manifold(leaf, CHECK_SEGMENTS) ^ region for leaf in leaves(program)]


def _combine(program: Program, solids: Sequence[Manifold]) -> Manifold:
    """The booleans of a program, of other solids than its leaves'."""
    return fold_nary(program, lambda i, _: solids[i], COMBINE)


def _may_reach_beyond(program: Program, box: np.ndarray) -> bool:
    """Whether the box of an added primitive leaves a `box` [2, 3]: the solid is within those boxes."""
    added = [PosedPrimitive(leaf).bounds for leaf, sign in zip(leaves(program), signs(program), strict=True) if sign > 0]
    return any((low < box[0]).any() or (high > box[1]).any() for low, high in added)
