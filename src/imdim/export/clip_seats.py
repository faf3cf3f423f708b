"""What an intersection cuts off: the ends of leaves that lie beyond a face of what clips them follow that face.

How far a blank sticks out of the outline that it is cut to is no dimension; it does so still when the outline grows.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import TYPE_CHECKING

from imdim.export.outline_joints import Row, sum_rows
from imdim.export.seats import TOUCH, End, ends_of, place_of, reach_of
from imdim.export.wall_seats import FlatWall, share_area
from imdim.geometry.lowering import lower
from imdim.program.roles import clips_of_each
from imdim.program.tree import Program, leaves, longest

if TYPE_CHECKING:
    from imdim.export.elimination import LinearSystem


def seats_at_clips(system: LinearSystem, program: Program, hidden: Collection[tuple[int, int, int]]) -> Iterator[tuple[End, Row]]:
    """Of ends that are `hidden`, by leaf, axis and side, how far they are from the face of a clip that they lie beyond: the outermost that
    looks that way and is not hidden itself, or the end of what is turned, where that alone clips."""
    clips = clips_of_each(program)
    if not any(clips):
        return
    parts, numbers = list(leaves(program)), lower(program)
    boxes = [reach_of(p, numbers.rotations[i]) for i, p in enumerate(parts)]
    ends = [e for i in range(len(parts)) for e in ends_of(i, parts[i], numbers) if e.column >= 0 or i in system.heights]
    flat = [FlatWall(e.leaf, e.axis, e.side, place_of(e, parts), system.place_of_end(e)) for e in ends]
    shown = [w for w in flat if (w.leaf, w.axis, w.side) not in hidden] + [w for w in system.walls if w.span is not None]
    turned = [w for w in flat if parts[w.leaf].kind == "revolve"]
    slack = TOUCH * longest(parts)
    # where a cone ends says how steep it is
    for end in (e for e in ends if (e.leaf, e.axis, e.side) in hidden and parts[e.leaf].kind != "cone"):
        place = end.side * place_of(end, parts)
        # what is turned may be round where it ends
        faces = _facing([*shown, *(turned if len(clips[end.leaf]) == 1 else ())], end, clips[end.leaf])
        passed = [w for w in faces if w.side * w.place < place - slack and share_area(boxes[w.leaf], boxes[end.leaf], end.axis)]
        last = max(passed, key=lambda w: w.side * w.place, default=None)
        if last is not None and not any(w.side * w.place >= place - slack for w in faces):
            yield end, sum_rows((system.place_of_end(end), 1.0), (dict(last.row), -1.0))


def _facing(walls: Sequence[FlatWall], end: End, clips: Collection[int]) -> list[FlatWall]:
    return [w for w in walls if w.leaf in clips and (w.axis, w.side) == (end.axis, end.side)]
