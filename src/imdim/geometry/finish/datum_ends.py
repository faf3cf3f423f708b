"""Bosses, pins and ribs that begin where a person lets them begin: at the outer face behind what carries them.

The end of a boss that lies in its plate is seen nowhere, and a search leaves it anywhere in there. People draw what stands on a plate from
the face that the whole part lies on, and a bar that crosses another one from side to side. So the hidden end of an added part goes on to
the part's lowest face, and of what reaches the part's side to the opposite side, where the solid stays what it is. What stands on another
boss that does not go there, or is hidden nearly all the way, is drawn from where it is seen: its end goes back to there. A rib between two
walls is left alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from manifold3d import Manifold

from imdim.deadline import NEVER, Deadline
from imdim.geometry import kernels
from imdim.geometry.finish.active_zone import probes, zone_within
from imdim.geometry.finish.extend import Face, between, length, plane_faces
from imdim.geometry.finish.posed import PosedPrimitive
from imdim.geometry.finish.section import CHECK_SEGMENTS
from imdim.geometry.finish.tolerances import ALIGNED, NOTHING, TOUCH
from imdim.geometry.lowering import lower
from imdim.geometry.solid import exact_rotation, primitive_to_manifold, to_manifold
from imdim.program.roles import signs
from imdim.program.tree import PRISMS, Primitive, Program, leaves, longest, replace_leaves

PROBE, PROBES = 1e-3, 7  # how far beyond an end material is looked for, of the largest size, and at how many points each way
RIM = 0.495  # of a width: from where to where; there may be thin walls alone
ROW = 1e-4  # of the largest size, within which parts are alike
SEEN_DOWN, SEEN = 0.22, 1 / 3  # of the length that the part would have: how much of it has to be seen, on a base and elsewhere
DOWN = (2, -1)  # the way that the base looks
STOREYS = 3  # of parts that stand on each other


@dataclass(frozen=True)
class _End:
    """A plane face of leaf number `leaf` that looks along the world's `axis` to `side`, and how far out that way it is."""

    leaf: int
    face: Face
    axis: int
    side: int
    place: float


def begin_at_datums(program: Program, deadline: Deadline = NEVER) -> Program:
    """The same solid, whose added boxes, cylinders and extrusions go on through the material to the part's outer face, or back to the face
    that they stand on.

    Those that are alike but for where they stand move together or not at all. Past the `deadline` (by default never) the others stay.
    """
    seen = _Visible(program, to_manifold(program, CHECK_SEGMENTS))
    for _ in range(STOREYS):
        back = _go_back(seen, deadline)
        if back is seen:
            break
        seen = back
    return _go_out(seen, deadline).program


class _Visible:
    """A program with its `solid`, and where that is there by one part alone, which the two ends of a part and both ways to go ask."""

    def __init__(self, program: Program, solid: Manifold) -> None:
        self.program, self.solid = program, solid
        self._boxes: dict[int, tuple[float, ...] | None] = {}

    def along(self, end: _End) -> tuple[float, float] | None:
        """From where to where, outward, the solid is there by the part of an `end` alone; None where it is nowhere."""
        if end.leaf not in self._boxes:
            self._boxes[end.leaf] = self._box(end.leaf)
        box = self._boxes[end.leaf]
        if box is None:
            return None
        low, high = box[end.axis], box[end.axis + 3]
        return (low, high) if end.side > 0 else (-high, -low)

    def _box(self, leaf: int) -> tuple[float, ...] | None:
        placed = [PosedPrimitive(part) for part in leaves(self.program)]
        least = NOTHING * self.solid.volume()
        shown = zone_within(self.program, placed, leaf, placed[leaf], placed[leaf].solid, least)
        return None if shown.volume() <= least else shown.bounding_box()


def _go_back(seen: _Visible, deadline: Deadline) -> _Visible:
    """With parts that begin in the outer face, and are hidden nearly all the way or stand on what does not begin there, beginning in the
    face from which they are seen."""
    program, solid = seen.program, seen.solid
    slack, bounds = TOUCH * longest(leaves(program)), solid.bounding_box()
    for row in _rows(program, slack):
        parts, ends, first = list(leaves(program)), list(_ends(program)), row[0]
        outer = bounds[first.axis + 3] if first.side > 0 else -bounds[first.axis]
        if deadline.has_passed():
            return seen
        # of parts that are alike one tells how much is seen
        shown = seen.along(first) if first.place >= outer - slack and _may_stand(first, ends, slack) else None
        hidden = 0.0 if shown is None else first.place - shown[1]
        if shown is None or hidden <= slack or not any(_is_at(e, first, shown[1], slack) for e in ends):
            continue
        if _is_enough(shown, parts[first.leaf], first) and _is_carried(ends, parts, first, hidden):
            continue
        shorter = {e.leaf: between(parts[e.leaf], e.face, -length(parts[e.leaf], e.face), -hidden) for e in row}
        trial = replace_leaves(program, shorter)
        lost = sum(primitive_to_manifold(between(parts[e.leaf], e.face, -hidden, 0.0), CHECK_SEGMENTS).volume() for e in row)
        # added parts that become shorter make the solid nowhere more
        if abs(to_manifold(trial, CHECK_SEGMENTS).volume() - solid.volume()) <= NOTHING * lost:
            program, seen = trial, _Visible(trial, solid)
    return seen


def _may_stand(end: _End, ends: Sequence[_End], slack: float) -> bool:
    """Whether another part has a face against an `end` farther in, where it may stand."""
    return any(e.leaf != end.leaf and (e.axis, e.side) == (end.axis, -end.side) and end.place + e.place > -slack for e in ends)


def _is_at(face: _End, end: _End, place: float, slack: float) -> bool:
    """Whether a face looks against an `end` at a `place` on its way, so that what has that end may stand on it."""
    return face.leaf != end.leaf and (face.axis, face.side) == (end.axis, -end.side) and abs(face.place + place) <= slack


def _go_out(seen: _Visible, deadline: Deadline) -> _Visible:
    """With parts that begin in the outer face, where what is hidden of them may go on to there."""
    program, solid = seen.program, seen.solid
    slack = TOUCH * longest(leaves(program))
    outermost = _outermost(list(_ends(program)))
    for row in _rows(program, slack):
        more = outermost[row[0].axis, row[0].side] - row[0].place
        if more <= slack or deadline.has_passed():
            continue
        parts = list(leaves(program))
        if (row[0].axis, row[0].side) != DOWN and not all(_begins_outside(parts[e.leaf], e, outermost, slack) for e in row):
            continue
        if not all(_is_buried(program, parts[e.leaf], e.face, PROBE * longest(parts)) for e in row):
            continue
        longer = {e.leaf: between(parts[e.leaf], e.face, -length(parts[e.leaf], e.face), more) for e in row}
        trial = replace_leaves(program, longer)
        # points are cheap, and most ends may not go on
        if any(_shows(program, trial, probes(between(parts[e.leaf], e.face, 0.0, more))) for e in row):
            continue
        # of parts that are alike one tells how much is seen
        shown = seen.along(row[0])
        if shown is None or not _is_enough(shown, longer[row[0].leaf], row[0]):
            continue
        if not _is_carried(list(_ends(program)), parts, row[0], row[0].place - shown[1]):
            continue
        added = sum(primitive_to_manifold(between(parts[e.leaf], e.face, 0.0, more), CHECK_SEGMENTS).volume() for e in row)
        # added parts that become longer make the solid nowhere less: its volume tells
        if abs(to_manifold(trial, CHECK_SEGMENTS).volume() - solid.volume()) <= NOTHING * added:
            program, seen = trial, _Visible(trial, solid)
    return seen


def _rows(program: Program, slack: float) -> list[list[_End]]:
    """Ends of parts that keep their section, those first that look down - what begins at the base may go on to the top - and of one way the
    farthest out, which carry the others."""
    parts = list(leaves(program))
    rows = _alike([e for e in _ends(program) if parts[e.leaf].kind in PRISMS], parts, slack)
    return sorted(rows, key=lambda row: ((row[0].axis, row[0].side) != DOWN, -row[0].place))


def _outermost(ends: Sequence[_End]) -> dict[tuple[int, int], float]:
    """How far out the farthest of some ends is, each way."""
    return {way: max(e.place for e in ends if (e.axis, e.side) == way) for way in {(e.axis, e.side) for e in ends}}


def _ends(program: Program) -> Iterator[_End]:
    for i, (part, sign) in enumerate(zip(leaves(program), signs(program), strict=True)):
        frame = exact_rotation(part)
        for face in plane_faces(part) if sign > 0 else ():
            direction = frame[:, face[0]] * face[1]
            axis = int(np.abs(direction).argmax())
            if abs(direction[axis]) > 1 - ALIGNED:
                side = 1 if direction[axis] > 0 else -1
                yield _End(i, face, axis, side, side * part.center[axis] + length(part, face) / 2)


def _alike(ends: Sequence[_End], parts: Sequence[Primitive], slack: float) -> list[list[_End]]:
    """Ends of parts of one kind and size that look one way from one level, as rows."""
    rows: dict[tuple[object, ...], list[_End]] = {}
    for e in ends:
        part = parts[e.leaf]
        numbers = (*part.size, e.place, *(() if part.outline is None else np.ravel(part.outline.bounds)))
        key = (part.kind, e.axis, e.side, e.face[0], *(round(v / (ROW / TOUCH * slack)) for v in numbers))
        rows.setdefault(key, []).append(e)
    return list(rows.values())


def _begins_outside(part: Primitive, end: _End, outermost: Mapping[tuple[int, int], float], slack: float) -> bool:
    """Whether the other end of a part lies in the outermost face already."""
    opposite = length(part, end.face) / 2 - end.side * part.center[end.axis]
    return abs(opposite - outermost.get((end.axis, -end.side), math.inf)) <= slack


def _is_buried(program: Program, part: Primitive, face: Face, out: float) -> bool:
    """Whether material goes on somewhere beyond an end, by a distance `out`."""
    flat = np.stack(np.meshgrid(*2 * [np.linspace(-RIM, RIM, PROBES)]), axis=-1).reshape(-1, 2)
    across = [axis for axis in range(3) if axis != face[0]]
    if part.outline is not None:
        low, high = np.array(part.outline.bounds)
        flat = (low + high) / 2 + flat * (high - low)
    else:
        flat = flat * ([part.size[axis] for axis in across] if part.kind == "box" else [2 * part.size[0]] * 2)
    local = np.empty((len(flat), 3))
    local[:, across] = flat
    local[:, face[0]] = face[1] * (length(part, face) / 2 + out)
    return bool(kernels.inside(lower(program), local @ exact_rotation(part).T + part.center).any())


def _shows(program: Program, trial: Program, points: np.ndarray) -> bool:
    """Whether two programs differ at some of points [n, 3]."""
    return bool((kernels.inside(lower(program), points) != kernels.inside(lower(trial), points)).any())


def _is_enough(shown: tuple[float, float], part: Primitive, end: _End) -> bool:
    """Whether enough shows of the length that a part has, to draw it from the outer face."""
    return shown[1] - shown[0] >= (SEEN_DOWN if (end.axis, end.side) == DOWN else SEEN) * length(part, end.face)


def _is_carried(ends: Sequence[_End], parts: Sequence[Primitive], end: _End, hidden: float) -> bool:
    """Whether what a part stands in, where it comes out `hidden` behind its end, begins in the outer face as well, or may not: a cone about
    its foot is no storey that it stands on."""
    slack = TOUCH * longest(parts)
    most = _outermost(ends)[end.axis, end.side]
    up = [e.leaf for e in ends if e.leaf != end.leaf and (e.axis, e.side) == (end.axis, end.side) and most - e.place > slack]
    skin = probes(between(parts[end.leaf], end.face, -hidden, PROBE * longest(parts) - hidden))
    return not any(parts[i].kind in PRISMS and kernels.inside(lower(parts[i]), skin).all() for i in up)
