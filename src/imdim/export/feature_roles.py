"""Ribs, slots, bores and teeth: roles that only what is around a primitive tells, beside those of holes and of `program.roles`.

A rib is a thin wall that stands on something and has nothing at its sides or above it. A slot is a narrow cut with walls about it that goes
through, or one with round ends. A bore is the one large hole through a turned part or a boss, about its axis. A scoop is a round cut that
is wider than anything it cuts: one wall of it shows.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from imdim.export.hole_names import hole_groups, hole_roles
from imdim.export.slot_sizes import has_round_ends
from imdim.export.surroundings import Surroundings
from imdim.geometry.lowering import Lowered, lower
from imdim.program.holes import Hole
from imdim.program.outline import circle_of
from imdim.program.repeats import Folded, instances, repeats, size
from imdim.program.rewrite.containment import bounding_radius
from imdim.program.roles import FLAT, signs
from imdim.program.tree import Primitive, Program, leaves, longest

MOST_NAMED = 1000  # primitives, copies counted, of a program with names: equations are dense, and so many take 0.4 GB
BRACED = 0.5  # of its longest edge: a thicker wall is no rib, and one that is not held on two sides has to be a plate's share of the next
ROUND_ENDS = 1.2  # times as long as wide, with round ends: a slot; with others it has to be as narrow as a plate is thin
LARGE = 1 / 3  # of a boss's diameter: a smaller hole is no bore
TEETH = 8  # drawn parts on a circle, of which each is a tooth
DRAWN = ("profile", "plate", "body")  # what a drawn part that adds is called
COAXIAL = 1e-4  # of the largest size


class Role(NamedTuple):
    """What a leaf is, and what its sizes are called, of a box one word for each edge."""

    word: str
    sizes: tuple[str, ...] = ()


def feature_roles(program: Program, folded: Folded | None = None) -> list[str]:
    """As `hole_roles`, with ribs, slots, bores and teeth; copies are what they are copies of."""
    found, roles = find_roles(program), hole_roles(program)
    roles = [found[i].word if i in found and role in ("block", "pocket", "cutout", "hole") else role for i, role in enumerate(roles)]
    if folded is None:
        return roles
    teeth = _teeth(folded)
    roles = ["tooth" if i in teeth and role in DRAWN else role for i, role in enumerate(roles)]
    return [roles[source] for source, _ in instances(folded)]


def _teeth(folded: Folded) -> set[int]:
    """The leaves that are repeated on a circle, so often that they are teeth where they are drawn and add."""
    return {
        first for first, repeat in repeats(folded) if repeat.kind == "circular" and repeat.counts[0] >= TEETH and size(repeat.part) == 1
    }


def size_words(program: Program) -> dict[tuple[int, int], str]:
    """What sizes of ribs and slots are called, by leaf and column."""
    return {(leaf, column): word for leaf, role in find_roles(program).items() for column, word in enumerate(role.sizes)}


@lru_cache(maxsize=16)
def find_roles(program: Program) -> Mapping[int, Role]:
    """The ribs, slots and bores of a program by their leaves; none of one that is too long for names, in which to look for them takes the
    square of its length."""
    parts, sign, solid = list(leaves(program)), signs(program), lower(program)
    if len(parts) > MOST_NAMED:
        return {}
    found = {leaf: role for leaf, role in _by_surroundings(parts, sign, solid) if role} | _bores(program, parts, sign, solid)
    return found | {leaf: Role("scoop") for leaf in _scoops(parts, sign)}


def _by_surroundings(parts: Sequence[Primitive], sign: Sequence[int], solid: Lowered) -> Iterator[tuple[int, Role | None]]:
    for leaf, (p, s) in enumerate(zip(parts, sign, strict=True)):
        around = Surroundings.of(solid, leaf, p)
        if around is not None and p.kind == "box" and s > 0 and leaf:
            yield leaf, _rib(around)
        elif around is not None and p.kind in ("box", "extrude") and s < 0:
            yield leaf, _slot(around, p)


def _rib(around: Surroundings) -> Role | None:
    size = 2 * around.half
    thin = int(size.argmin())
    others = [a for a in range(3) if a != thin]
    if size[thin] > BRACED * size[others].max():
        return None
    stands = [a for a in others if any(_stands(around, a, side, thin) for side in (-1, 1))]
    if not stands or size[thin] > (1.0 if len(stands) > 1 else FLAT) * size[others].min():
        return None
    up = max(stands, key=lambda a: abs(around.axes[2, a]))
    return Role("rib", tuple("thickness" if a == thin else "height" if a == up else "length" for a in range(3)))


def _stands(around: Surroundings, axis: int, foot: int, thin: int) -> bool:
    """Whether a wall has its foot at one end along an axis: material on both its sides there, and air at its head."""
    sides = [around.is_beside(thin, side, axis)[::-foot] for side in (-1, 1)]  # from the foot on
    at_foot = all(side[0] or _goes_on(around, axis, foot, thin, way) for side, way in zip(sides, (-1, 1), strict=True))
    return at_foot and not any(side[-1] for side in sides) and not around.is_beyond(axis, -foot).any()


def _goes_on(around: Surroundings, axis: int, foot: int, thin: int, way: int) -> bool:
    """Whether there is material beside a wall just beyond its foot, which stands on a face then."""
    local = np.zeros((1, 3))
    local[0, axis], local[0, thin] = foot * (around.half[axis] + around.step), way * (around.half[thin] + around.step)
    return bool(around.is_material(local)[0])


def _slot(around: Surroundings, p: Primitive) -> Role | None:
    size = 2 * around.half
    for axis in (2,) if p.kind == "extrude" else np.argsort(size).tolist():
        short, long = sorted((a for a in range(3) if a != axis), key=lambda a: size[a])
        if _is_narrow(p, float(size[short] / size[long])) and around.ends_in_air(axis) and _has_walls(around, axis, short, long):
            words = {axis: "depth", short: "width", long: "length"}
            return Role("slot", tuple(words[a] for a in range(3)) if p.kind == "box" else ())
    return None


def _is_narrow(p: Primitive, ratio: float) -> bool:
    """Whether a cut is so much longer than wide, `ratio` of the two, that it is a slot."""
    if p.outline is None:
        return ratio <= FLAT
    return len(p.outline.loops) == 1 and ratio <= (1 / ROUND_ENDS if has_round_ends(p.outline) else FLAT)


def _has_walls(around: Surroundings, axis: int, short: int, long: int) -> bool:
    """Whether both long walls and both ends are there at one depth; one end may be open where the cut is no channel along its axis."""
    sides = [around.is_beside(short, side, axis) for side in (-1, 1)]
    ends = [around.is_beside(long, side, axis) for side in (-1, 1)]
    closed = ends[0] & ends[1] if around.half[axis] > around.half[long] else ends[0] | ends[1]
    return bool((sides[0] & sides[1] & closed).any())


def _bores(program: Program, parts: Sequence[Primitive], sign: Sequence[int], solid: Lowered) -> dict[int, Role]:
    """The largest hole that stands alone, where it is through, round, a cut, and about the axis of a round part that it is large for."""
    alone = [group.holes[0] for group in hole_groups(program) if len(group.holes) == 1]
    largest = max((hole.bore.diameter for group in hole_groups(program) for hole in group.holes), default=0.0)
    found = [hole for hole in alone if hole.through and hole.bore.diameter >= largest and not hole.bore.corners]
    own = {leaf: hole for hole in found for leaf in hole.bore.leaves if sign[leaf] < 0 and parts[leaf].kind == "cylinder"}
    return {leaf: Role("bore") for leaf, hole in own.items() if any(_is_about(hole, i, parts, sign, solid) for i in range(len(parts)))}


def _scoops(parts: Sequence[Primitive], sign: Sequence[int]) -> Iterator[int]:
    """Cylinders that cut and are wider than the longest of what adds is from corner to corner."""
    farthest = max((bounding_radius(p) for p, s in zip(parts, sign, strict=True) if s > 0), default=math.inf)
    yield from (i for i, (p, s) in enumerate(zip(parts, sign, strict=True)) if s < 0 and p.kind == "cylinder" and p.size[0] > farthest)


def _is_about(hole: Hole, leaf: int, parts: Sequence[Primitive], sign: Sequence[int], solid: Lowered) -> bool:
    """Whether a leaf is a round part with the axis of a hole, and no more than a few times as wide."""
    wide, axis = _diameter(parts[leaf]), solid.rotations[leaf][:, 2]
    if sign[leaf] < 0 or not wide or hole.bore.diameter < LARGE * wide:
        return False
    off = np.cross(np.subtract(hole.point, parts[leaf].center), axis)
    return float(np.linalg.norm(np.cross(hole.direction, axis))) <= COAXIAL and math.hypot(*off) <= COAXIAL * longest(parts)


def _diameter(p: Primitive) -> float:
    """Of a round part whose axis is that of its frame, else 0."""
    if p.kind in ("cylinder", "cone"):
        return 2 * max(p.size[:-1])
    if p.outline is None:
        return 0.0
    if p.kind == "revolve":
        return 2 * p.outline.bounds[1][0]
    ring = circle_of(p.outline.loops[0]) if len(p.outline.loops) == 1 else None
    return 0.0 if ring is None or any(ring[:2]) else 2 * ring[2]
