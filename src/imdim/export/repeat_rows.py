"""What repeats say about the numbers of copies, as equations: the same sizes, places a spacing or an angle apart."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from itertools import product
from typing import TYPE_CHECKING

from imdim.program.repeats import Folded, Repeat, repeats, size
from imdim.program.rewrite.containment import axes
from imdim.program.tree import FULL_TURN, Primitive, Vec3
from imdim.program.vectors import dot

if TYPE_CHECKING:
    from imdim.export.elimination import LinearSystem

ALIGNED = 1e-9  # of a unit vector
ZERO = 1e-9  # of the largest size


def add_repeats(system: LinearSystem, folded: Folded, parts: Sequence[Primitive], sign: Sequence[int], fixed: Collection[int]) -> None:
    """The equations of all repeats among leaves, whose `sign` is -1 where they cut.

    Those with numbers in `fixed`, and those along no axis of the world, have places that stay.
    """
    for number, (first, repeat) in enumerate(repeats(folded)):
        own = size(repeat.part)
        for leaf in range(first + own, first + own * repeat.number):
            source = first + (leaf - first) % own
            if parts[leaf].kind != "revolve" or parts[leaf].size[0] < FULL_TURN:  # a whole turn is no number to follow
                system.rows += [{6 * leaf + c: 1.0, 6 * source + c: -1.0} for c in range(len(parts[leaf].size))]
        if number in fixed or (repeat.kind in ("circular", "mirror") and world_axis(repeat.axis) is None):
            system.rows += [{6 * leaf + 3 + a: 1.0} for leaf in range(first, first + own * repeat.number) for a in range(3)]
        elif repeat.kind in ("linear", "grid"):
            _add_steps(system, repeat, first, own)
        elif repeat.kind == "mirror":
            _add_mirror(system, repeat, first, own, parts, sign)
        else:
            _add_circle(system, repeat, first, own, parts)


def world_axis(direction: Vec3) -> int | None:
    """The axis of the world that a unit vector points along, either way."""
    return next((a for a in range(3) if abs(direction[a]) > 1 - ALIGNED), None)


def _add_steps(system: LinearSystem, repeat: Repeat, first: int, own: int) -> None:
    spacing = [
        {a: system.new(first, _word(repeat, a), step[a]) for a in range(3) if abs(step[a]) > ZERO * system.length} for step in repeat.steps
    ]
    for copy, numbers in enumerate(product(*map(range, repeat.counts))):
        for j, a in product(range(own) if copy else (), range(3)):
            moves = {s[a]: -float(n) for n, s in zip(numbers, spacing, strict=True) if n and a in s}
            system.rows.append({6 * (first + copy * own + j) + 3 + a: 1.0, 6 * (first + j) + 3 + a: -1.0} | moves)


def _word(repeat: Repeat, axis: int) -> str:
    plain = repeat.kind == "linear" and sum(map(bool, repeat.steps[0])) == 1
    return "spacing" if plain else f"spacing_{'xyz'[axis]}"


def _add_mirror(system: LinearSystem, repeat: Repeat, first: int, own: int, parts: Sequence[Primitive], sign: Sequence[int]) -> None:
    """Each leaf as far from the plane as its image; what is equally far apart has one spacing.

    A plane through the middle of another leaf that adds goes with that: a longer plate keeps its ears at its ends. One through the origin
    stays, and any other is midway between the first leaf and its image, wherever these are.
    """
    axis = world_axis(repeat.axis)
    assert axis is not None
    others = (i for i in range(len(parts)) if sign[i] > 0 and not first <= i < first + own * repeat.number)
    hub = next((i for i in others if abs(parts[i].center[axis] - repeat.point[axis]) <= ZERO * system.length), None)
    at_origin = abs(repeat.point[axis]) <= ZERO * system.length
    spacings: dict[float, int] = {}
    for j, a in product(range(own), range(3)):
        image, source = 6 * (first + own + j) + 3 + a, 6 * (first + j) + 3 + a
        if a != axis:
            system.rows.append({image: 1.0, source: -1.0})
        elif hub is not None:
            system.rows.append({image: 1.0, source: 1.0, 6 * hub + 3 + axis: -2.0})
        elif at_origin:
            system.rows.append({image: 1.0, source: 1.0})
        elif j:
            system.rows.append({image: 1.0, source: 1.0, 6 * (first + own) + 3 + a: -1.0, 6 * first + 3 + a: -1.0})
        apart = system.start[image] - system.start[source]
        leaf = parts[first + j]
        # how deep two bores are that meet head on is measured, and not how far apart their middles are
        is_bore = sign[first + j] < 0 and leaf.kind == "cylinder" and world_axis(axes(leaf)[2]) == axis
        if a == axis and abs(apart) > ZERO * system.length and not is_bore:
            key = round(abs(apart) / system.length, 9)
            spacing = spacings[key] if key in spacings else spacings.setdefault(key, system.new(first + j, "spacing", abs(apart)))
            system.rows.append({image: 1.0, source: -1.0, spacing: -math.copysign(1.0, apart)})


def _add_circle(system: LinearSystem, repeat: Repeat, first: int, own: int, parts: Sequence[Primitive]) -> None:
    """Each leaf on a circle of its own about one centre, at angles that are numbers."""
    axis = world_axis(repeat.axis)
    assert axis is not None
    plane = [(axis + 1) % 3, (axis + 2) % 3]
    hub = next((i for i in _hubs(parts, first, own * repeat.number) if _is_at(parts[i], repeat, plane, system.length)), None)
    centers = [system.new(first, f"center_{'xyz'[a]}", repeat.point[a]) if hub is None else 6 * hub + 3 + a for a in plane]
    diameters: dict[float, int] = {}
    for j in range(own):
        source = parts[first + j].center
        radius = math.hypot(*(source[a] - repeat.point[a] for a in plane))
        circle = diameters.get(round(radius / system.length, 9))
        if circle is None and radius > ZERO * system.length:
            circle = diameters[round(radius / system.length, 9)] = system.new(first + j, "circle", 2 * radius)
        for copy, motion in enumerate(repeat.motions()):
            leaf, at = first + copy * own + j, motion.point(source)
            system.rows += [{6 * leaf + 3 + axis: 1.0, 6 * (first + j) + 3 + axis: -1.0}] if copy else []
            for a, center in zip(plane, centers, strict=True):
                share = (at[a] - repeat.point[a]) / (2 * radius) if circle is not None else 0.0
                out = {circle: -share} if circle is not None and abs(share) > ZERO else {}
                system.on_circles.add(6 * leaf + 3 + a)
                system.rows.append({6 * leaf + 3 + a: 1.0, center: -1.0} | out)


def _hubs(parts: Sequence[Primitive], first: int, count: int) -> Iterator[int]:
    """Leaves that a circle may be centred on: the body, and round ones."""
    yield from (
        i for i, p in enumerate(parts) if not first <= i < first + count and (i == 0 or p.kind in ("cylinder", "cone", "torus", "revolve"))
    )


def _is_at(p: Primitive, repeat: Repeat, plane: Sequence[int], length: float) -> bool:
    along = any(abs(dot(axis, repeat.axis)) > 1 - ALIGNED for axis in (axes(p) if p.kind == "box" else axes(p)[2:]))
    return along and all(abs(p.center[a] - repeat.point[a]) <= ZERO * length for a in plane)
