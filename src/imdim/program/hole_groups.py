"""Equal holes as groups, with how they stand: in a row, in a grid, on a circle; and what a drawing would say of them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from imdim.program.holes import Hole
from imdim.program.metric import screw_of
from imdim.program.patterns.linear import Lattice, Ring, lattices, rings
from imdim.program.tree import Vec3
from imdim.program.vectors import cross, dot, is_forward, minus, times, unit

EQUAL = 5e-3  # of a hole's diameter, within which the numbers of two holes are the same
PARALLEL = 1e-6
MOST_PLACED = 60  # holes of a group whose arrangement is looked for
DIGITS = 5


@dataclass(frozen=True, slots=True)
class HoleGroup:
    """Equal holes along one direction. `arrangement` is "row", "grid", "circle", "arc" or, of one hole or of no pattern, "".

    `counts` has the numbers along a grid, `spacing` the steps, or the diameter of the circle that they stand on and, of an arc, degrees.
    """

    holes: tuple[Hole, ...]
    arrangement: str = ""
    counts: tuple[int, ...] = ()
    spacing: tuple[float, ...] = ()

    @property
    def leaves(self) -> tuple[int, ...]:
        """The primitives that make them, in order."""
        return tuple(sorted({leaf for hole in self.holes for leaf in hole.leaves}))

    def __str__(self) -> str:
        """As "4 x M3 clearance hole, diameter 3.4, through, on a 31 x 31 grid"."""
        count = len(self.holes)
        number = f"{count} x " if count > 1 else ""
        return number + ", ".join([describe_hole(self.holes[0]), *_arranged(self)])


def describe_pattern(group: HoleGroup) -> str:
    """How the holes of a group stand, as "on a 31 x 31 grid"; empty for one, or no pattern."""
    return ", ".join(_arranged(group))


def group_holes(holes: Sequence[Hole]) -> tuple[HoleGroup, ...]:
    """Groups in the order of their first holes; each hole is in one."""
    classes: list[list[Hole]] = []
    for hole in holes:
        same = next((c for c in classes if _is_equal(c[0], hole)), None)
        if same is None:
            classes.append([hole])
        else:
            same.append(hole)
    return tuple(group for members in classes for group in _arrange(members))


def describe_hole(hole: Hole) -> str:
    """What a drawing says of one hole."""
    screw, bore = screw_of(hole), hole.bore
    what = "" if screw is None else f"{screw.size} {screw.use} "
    how_deep = "through" if hole.through else f"{write_size(hole.depth)} deep"
    if hole.kind == "tapered":
        return f"tapered hole, diameter {write_size(bore.diameter)} to {write_size(bore.narrow)}, {how_deep}"
    if hole.kind == "stepped":
        straight = [write_size(s.diameter) for s in hole.sections if not s.is_cone and not s.corners]
        return f"stepped hole, diameter {' / '.join(straight[:4])}{' ...' if len(straight) > 4 else ''}, {how_deep}"
    if bore.corners:
        return f"hexagonal {'hole' if hole.through else 'pocket'}, {write_size(bore.diameter)} across flats, {how_deep}"
    said = [f"{what}hole, diameter {write_size(bore.diameter)}", how_deep, *_head(hole)]
    if hole.point_section is not None:
        said.append(f"{hole.point_section.angle_deg:.0f} degree point")
    return ", ".join(said)


def _head(hole: Hole) -> Iterator[str]:
    head = hole.head
    if head is None:
        return
    if head.corners:
        yield f"hexagonal pocket {write_size(head.diameter)} across flats, {write_size(head.end)} deep"
    elif head.is_cone:
        yield f"countersink diameter {write_size(head.diameter)}, {head.angle_deg:.0f} degrees"
    else:
        yield f"counterbore diameter {write_size(head.diameter)}, {write_size(head.end)} deep"


def _arranged(group: HoleGroup) -> Iterator[str]:
    lengths = [write_size(s) for s in group.spacing]
    if group.arrangement == "row":
        yield f"{lengths[0]} apart" if len(group.holes) == 2 else f"in a row, {lengths[0]} apart"
    elif group.arrangement == "grid" and group.counts == (2, 2):
        yield f"on a {lengths[0]} x {lengths[1]} grid"
    elif group.arrangement == "grid":
        yield f"in a grid of {group.counts[0]} x {group.counts[1]}, {lengths[0]} x {lengths[1]} apart"
    elif group.arrangement == "circle":
        yield f"on a circle of diameter {lengths[0]}"
    elif group.arrangement == "arc":
        yield f"on a circle of diameter {lengths[0]}, {lengths[1]} degrees apart"


def write_size(value: float) -> str:
    """A length as comments say it."""
    return f"{value:.{DIGITS}g}"


# --- equal holes --------------------------------------------------------------------------------------------------------


def _is_equal(a: Hole, b: Hole) -> bool:
    """Whether two holes are of one kind, with the same numbers, along one direction; those that go through may differ in length."""
    if (a.kind, a.through, len(a.sections)) != (b.kind, b.through, len(b.sections)):
        return False
    along = dot(a.direction, b.direction)
    if along < 1 - PARALLEL and not (a.kind == "through" and along < PARALLEL - 1):
        return False
    slack = EQUAL * a.bore.diameter
    for i, (s, t) in enumerate(zip(a.sections, b.sections, strict=True)):
        ends = [] if a.through and i == len(a.sections) - 1 else [(s.end, t.end)]
        if s.corners != t.corners or any(abs(u - v) > slack for u, v in [(s.diameter, t.diameter), (s.narrow, t.narrow), *ends]):
            return False
    return True


def _arrange(holes: Sequence[Hole]) -> Iterator[HoleGroup]:
    """The largest pattern among equal holes, then that of the rest; what makes none is one group."""
    left = list(holes)
    while len(left) > 2 and (best := _largest(left)) is not None:
        members, group = best
        yield group
        left = [hole for i, hole in enumerate(left) if i not in members]
    if len(left) == 2:
        points = _across(left)
        apart = math.dist(*points)
        yield HoleGroup(tuple(left), "row", (2,), (apart,)) if apart > EQUAL * left[0].bore.diameter else HoleGroup(tuple(left))
    elif left:
        yield HoleGroup(tuple(left))


def _largest(holes: Sequence[Hole]) -> tuple[set[int], HoleGroup] | None:
    """The pattern with most members; of equal ones a grid along the world's axes comes before a circle, that before others."""
    if len(holes) > MOST_PLACED:
        return None
    tolerance = EQUAL * holes[0].bore.diameter
    points, plane = _across(holes), _axes_across(holes[0].direction)
    flat = [(dot(p, plane[0]), dot(p, plane[1])) for p in points]
    found = [_lattice_group(holes, points, lattice, tolerance) for lattice in lattices(points, tolerance)]
    found += [_ring_group(holes, flat, ring) for ring in rings(flat, (), tolerance) if ring.angle * (len(ring.members) - 1) < 360]
    ranked = max(found, key=lambda f: (len(f[1]), f[0]), default=None)
    return None if ranked is None else (set(ranked[1]), ranked[2])


def _lattice_group(
    holes: Sequence[Hole], points: Sequence[Vec3], lattice: Lattice, tolerance: float
) -> tuple[int, tuple[int, ...], HoleGroup]:
    """Rank, members and group of a row or a grid."""
    members, counts = lattice
    inner = minus(points[members[1]], points[members[0]])
    if len(counts) == 1:
        return 0, members, HoleGroup(tuple(holes[i] for i in members), "row", counts, (math.hypot(*inner),))
    outer = minus(points[members[counts[1]]], points[members[0]])
    steps = sorted(zip((outer, inner), counts, strict=True), key=lambda s: max(range(3), key=lambda a: abs(s[0][a])))
    straight = all(sum(abs(c) > tolerance for c in step) == 1 for step, _ in steps)
    spacing = tuple(math.hypot(*step) for step, _ in steps)
    return 2 if straight else 0, members, HoleGroup(tuple(holes[i] for i in members), "grid", tuple(n for _, n in steps), spacing)


def _ring_group(holes: Sequence[Hole], flat: Sequence[tuple[float, float]], ring: Ring) -> tuple[int, tuple[int, ...], HoleGroup]:
    """Rank, members and group of a circle, all the way round or not."""
    diameter = 2 * math.dist(flat[ring.members[0]], ring.center)
    is_full = abs(ring.angle * len(ring.members) - 360) < 1e-6
    spacing = (diameter,) if is_full else (diameter, ring.angle)
    group = HoleGroup(tuple(holes[i] for i in ring.members), "circle" if is_full else "arc", (len(ring.members),), spacing)
    return 1 if is_full else -1, ring.members, group


def _across(holes: Sequence[Hole]) -> list[Vec3]:
    """Where the holes are as seen along their direction."""
    axis = holes[0].direction
    return [minus(h.point, times(axis, dot(minus(h.point, holes[0].point), axis))) for h in holes]


def _axes_across(axis: Vec3) -> tuple[Vec3, Vec3]:
    """Two unit vectors across a unit vector, which do not depend on its sense."""
    forward = axis if is_forward(axis, PARALLEL) else times(axis, -1.0)
    least = min(range(3), key=lambda a: abs(forward[a]))
    start: Vec3 = (float(least == 0), float(least == 1), float(least == 2))
    first = minus(start, times(forward, dot(start, forward)))
    return unit(first), cross(forward, unit(first))
