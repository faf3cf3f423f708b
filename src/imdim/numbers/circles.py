"""Circles and slanting rows of equal primitives, rounded as such.

Places on one are round numbers at a few angles only, and rounding each place by itself parts them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from imdim.numbers.design_values import RARE, coarsest_widths, grids, round_to_grid
from imdim.numbers.inches import are_inches
from imdim.program.motions import is_round, move_leaf, turn
from imdim.program.patterns.detect import extent, fold_repeats
from imdim.program.repeats import Repeat, repeats
from imdim.program.rewrite.containment import axes
from imdim.program.tree import Primitive, Program, Vec3, leaves, longest, replace_leaves
from imdim.program.vectors import cross, dot, minus, plus, times

SAME = 1e-9  # of the part's size
MOST, FINEST = 1e-3, 1e-6  # of it: by how much a radius is rounded at most, and to what at least
STEPS_DEG, MOST_TURNED = (15.0, 5.0, 1.0, 0.5), 1e-4  # of it: by how far a circle's members turn about it at most to stand at such an angle
ON_AXIS = 1e-6  # of it, within which an axis is that of another leaf


def round_circles(before: Program, after: Program, bears: Callable[[Program], bool], precision: float = 0.0) -> Program:
    """`after`, which is `before` with rounder numbers, with the circles, slanting rows and slanting grids that this parted.

    The copies of one leaf on a circle have its sizes again and stand about one centre at one distance, the roundest that `bears`; those of
    a row or grid stand where they stood. What bears none stays parted. A distance that is typed, as far as the `precision` of a mesh says,
    stays: that of the members, or of the ends of boxes that reach along their arm.
    """
    folding = fold_repeats(before)
    size = extent(before)
    for number, repeat in () if folding is None else repeats(folding.folded):
        # a mesh's single precision is no slant
        slants = any(sum(abs(c) > FINEST * size for c in step) > 1 for step in repeat.steps)
        if not (repeat.kind == "circular" or slants) or not isinstance(repeat.part, Primitive):
            continue
        assert folding is not None
        members = folding.order[number : number + repeat.number]
        old, new = list(leaves(before)), list(leaves(after))
        if not slants and _stand_on_one(repeat, old, new, members, size):
            continue
        widths = grids(size, FINEST * size, are_inches(old))
        circles = () if slants else _circles(repeat, old, new, members, size, widths, precision)
        for trial in [_row(repeat, old, new, members)] if slants else circles:
            whole = replace_leaves(after, trial)
            if whole == after or bears(whole):
                after = whole
                break
    return after


def _circles(
    repeat: Repeat,
    old: list[Primitive],
    new: list[Primitive],
    members: tuple[int, ...],
    size: float,
    widths: Sequence[float],
    precision: float,
) -> Iterator[dict[int, Primitive]]:
    """The members by their numbers, at the roundest angle first, and of these with the roundest radius."""
    hub = _hub(repeat, old, new, members, size)
    # what is turned least is as round as it was
    first = min(range(len(members)), key=lambda k: sorted(map(abs, minus(old[members[k]].center, repeat.point))))
    was, now = old[members[first]], new[members[first]]
    # rounded as it stands it points nowhere else; what a coarse grid of degrees turned away from the hub does
    is_turned = not _is_as_turned(was, now, FINEST * size)
    leaf = _with_sizes(was, now) if is_turned else now
    lift = times(repeat.axis, dot(minus(new[members[first]].center, hub), repeat.axis))
    arm = minus(old[members[first]].center, repeat.point)
    arm = minus(arm, times(repeat.axis, dot(arm, repeat.axis)))
    radius = math.hypot(*arm)
    held = _typed_radius(was, leaf, times(arm, 1 / radius), radius, widths, precision) if precision and radius else None
    radii = [round_to_grid(radius, grid) for grid in widths] if held is None else [held]
    for turned in dict.fromkeys((_angle_to_step(arm, repeat.axis, radius, size), 0.0)):
        for rounded in (*radii, radius):
            if abs(rounded - radius) <= MOST * size:
                # copies that are turned about their own middle have no arm
                placed = replace(leaf, center=plus(plus(hub, lift), times(arm, rounded / radius if radius else 0.0)))
                there = move_leaf(placed, turn(hub, repeat.axis, turned))
                placed = there if is_turned else replace(placed, center=there.center)
                angles = (repeat.angle * (k - first) for k in range(len(members)))
                yield {i: move_leaf(placed, turn(hub, repeat.axis, angle)) for i, angle in zip(members, angles, strict=True)}


def _typed_radius(was: Primitive, now: Primitive, way: Vec3, radius: float, widths: Sequence[float], precision: float) -> float | None:
    """The radius on which copies of a leaf `now` stand, one `way` from their centre, if that is a number typed as it `was`, or that of an
    end of a box is; None where neither is on a grid far wider than the `precision`. The ends of a tab are seen, or one of them is."""
    typed = [width for width in widths if width >= RARE * precision]
    along = [a for a, axis in enumerate(axes(was)) if was.kind == "box" and abs(dot(axis, way)) > 1 - ON_AXIS]
    half = was.size[along[0]] / 2 if along and now.rotation == was.rotation else 0.0
    middle, *ends = coarsest_widths(np.array([radius, radius + half, radius - half]), typed, precision)
    if middle:
        return round_to_grid(radius, middle)
    if not any(ends):
        return None
    side = 1 if ends[0] >= ends[1] else -1
    return round_to_grid(radius + side * half, max(ends)) - side * now.size[along[0]] / 2


def _is_as_turned(a: Primitive, b: Primitive, slack: float) -> bool:
    """Whether a leaf is turned as another, or the other way about, but for what moves it by no more than `slack`."""
    columns = list(zip(axes(a), axes(b), strict=True))[2 if is_round(a) else 0 :]
    return max(math.hypot(*cross(one, two)) for one, two in columns) * longest([a]) <= slack


def _with_sizes(leaf: Primitive, other: Primitive) -> Primitive:
    """A leaf with the sizes of another, and with its drawing where that is turned likewise."""
    return replace(leaf, size=other.size, outline=other.outline if leaf.rotation == other.rotation else leaf.outline)


def _angle_to_step(arm: Vec3, axis: Vec3, radius: float, size: float) -> float:
    """Degrees by which an arm turns to a round angle about an axis of the world; 0 about others, and where that is far."""
    level = [a for a in range(3) if abs(axis[a]) > 1 - SAME]
    if not level or not radius:
        return 0.0
    first, second = ((1, 2), (2, 0), (0, 1))[level[0]]
    angle = math.degrees(math.atan2(arm[second], arm[first]))
    most = math.degrees(MOST_TURNED * size / radius)
    for step in STEPS_DEG:
        turned = round(angle / step) * step - angle
        if abs(turned) <= most:
            return turned * math.copysign(1.0, axis[level[0]])
    return 0.0


def _row(repeat: Repeat, old: list[Primitive], new: list[Primitive], members: tuple[int, ...]) -> dict[int, Primitive]:
    """The members where they stood, but for how far along the axes of the world that the row does not go."""
    first = new[members[0]]
    moves = [any(step[a] for step in repeat.steps) for a in range(3)]
    centers = [tuple(old[i].center[a] if moves[a] else first.center[a] for a in range(3)) for i in members]
    return {i: replace(_with_sizes(old[i], first), center=(x, y, z)) for i, (x, y, z) in zip(members, centers, strict=True)}


def _hub(repeat: Repeat, old: list[Primitive], new: list[Primitive], members: tuple[int, ...], size: float) -> Vec3:
    """Where the axis of a circle is after rounding: where that of a leaf that had the same one is."""
    for i, leaf in enumerate(old):
        off = minus(leaf.center, repeat.point)
        aside = minus(off, times(repeat.axis, dot(off, repeat.axis)))
        if i not in members and math.hypot(*aside) <= ON_AXIS * size and abs(dot(axes(leaf)[2], repeat.axis)) > 1 - SAME:
            return new[i].center
    return repeat.point


def _stand_on_one(repeat: Repeat, old: list[Primitive], new: list[Primitive], members: tuple[int, ...], size: float) -> bool:
    """Whether rounding has left a circle one."""
    hub, first = _hub(repeat, old, new, members, size), new[members[0]]
    copies = [move_leaf(first, turn(hub, repeat.axis, repeat.angle * k)) for k in range(len(members))]
    return all(_is_as(copy, new[i], SAME * size) for copy, i in zip(copies, members, strict=True))


def _is_as(a: Primitive, b: Primitive, slack: float) -> bool:
    sizes = max(abs(s - t) for s, t in zip(a.size, b.size, strict=True))
    return a.rotation == b.rotation and max(math.dist(a.center, b.center), sizes) <= slack
