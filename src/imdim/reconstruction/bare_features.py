"""Drawings taken apart into features that stand on their own: cuts behind the body, and nothing drawn that other parts hide.

A tab that runs into a flaring rim is drawn with a notch where the rim is, and shows three sides of a box. What a feature has more where it
is a box, a circle or a frame may be filled by other parts, or be the target's, which the drawing need not follow everywhere.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from manifold3d import Manifold

from imdim.deadline import Deadline
from imdim.geometry.finish.active_zone import find_change
from imdim.geometry.solid import SEGMENTS, to_manifold
from imdim.program.rewrite.hidden_arcs import without_hidden_arcs
from imdim.program.rewrite.separation import hoist_cuts, separate_holes, separate_loops
from imdim.program.rewrite.simplify import reduce_program
from imdim.program.rewrite.widening import list_boxes_around, list_with_circles, widen
from imdim.program.roles import signs
from imdim.program.tree import Primitive, Program

NOTHING = 1e-7  # of the volume, of which a cut that takes no more takes nothing
HIDDEN = 1e-5  # of it, by which solids of two forms of one program may differ
TAB_CURVES = 8  # of a drawing that may be a box, or circles, by what the target has beyond it: of others too many ways would be asked


def lay_bare(apart: Program, drawn: Program, target: Manifold | None, deadline: Deadline) -> Program:
    """A program that was taken `apart` with each loop as a feature, cuts behind the body, and without what is hidden in the solid that is
    `drawn`: arcs where lines run into round parts, chords of circles, and walls of what looks like a box from outside. What it has more
    then may also be the `target`'s, where that is known."""
    space = _Space.of(to_manifold(drawn), target, deadline)
    cut_last = hoist_cuts(separate_holes(apart), _is_free_of(space.solid, deadline))
    whole = cut_last if deadline.has_passed() else without_hidden_arcs(cut_last, space.spoil, space.hidden)
    program = tidy_cuts(separate_loops(whole), space.solid, deadline)
    for propose in (list_with_circles, list_boxes_around):
        program = widen(program, propose, space.may_hide, space.spoil, space.hidden)
    return program


class _Space(NamedTuple):
    """Where features may be wider than they are drawn until a `deadline`: within a `solid`, beside it, or as the `target` is, but for the
    volume `hidden`. The solid `lacks` so much of the target, and `has` so much beyond it: no larger change is the target's, and few are
    compared with it, which has many facets."""

    solid: Manifold
    target: Manifold
    hidden: float
    lacks: float
    has: float
    deadline: Deadline

    @classmethod
    def of(cls, solid: Manifold, target: Manifold | None, deadline: Deadline) -> _Space:
        hidden = HIDDEN * solid.volume()
        if target is None:
            return cls(solid, solid, hidden, 0.0, 0.0, deadline)
        return cls(solid, target, hidden, (target - solid).volume(), (solid - target).volume(), deadline)

    def may_hide(self, leaf: Primitive, wider: Primitive) -> bool:
        """Whether what a wider leaf has more is all within the solid or all beside it, but for what is the target's."""
        if self.deadline.has_passed():
            return False
        more = to_manifold(wider) - to_manifold(leaf)
        inside = (more ^ self.solid).volume()
        outside = more.volume() - inside
        if min(inside, outside) < self.hidden:
            return True
        if leaf.outline is None or leaf.outline.curve_count > TAB_CURVES:
            return False
        fills = outside < self.lacks + self.hidden and ((more - self.solid) - self.target).volume() < self.hidden
        return fills or (inside < self.has + self.hidden and ((more ^ self.solid) ^ self.target).volume() < self.hidden)

    def spoil(self, program: Program, index: int, larger: Primitive) -> float:
        """The volume in which the solid of a program is no longer the target's where `larger` takes the place of a leaf."""
        changed, adds = find_change(program, index, larger, SEGMENTS), signs(program)[index] > 0
        volume = changed.volume()
        if volume <= self.hidden:
            return 0.0
        if volume > (self.lacks if adds else self.has) + self.hidden:
            return volume
        return (changed - self.target if adds else changed ^ self.target).volume()


def tidy_cuts(program: Program, solid: Manifold, deadline: Deadline) -> Program:
    """A program of a solid with its cuts behind the body."""
    return reduce_program(hoist_cuts(program, _is_free_of(solid, deadline)), deadline)


def _is_free_of(solid: Manifold, deadline: Deadline) -> Callable[[Program], bool]:
    """Whether a cut takes nothing from a solid; past the `deadline` none is known to."""
    nothing = NOTHING * solid.volume()
    return lambda cut: not deadline.has_passed() and (to_manifold(cut) ^ solid).volume() < nothing
