"""Repeats that are borne out by the parts themselves; pairs, as mirror images or a step apart, and circles."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, islice

from imdim.program.motions import mirror
from imdim.program.patterns.congruence import Node, group_by_fit, match, same_shape
from imdim.program.patterns.linear import Ring, rings
from imdim.program.repeats import Repeat
from imdim.program.rewrite.containment import axes
from imdim.program.tree import Primitive, Vec3
from imdim.program.vectors import cross, dot, is_forward, minus, round_vector, times, unit

NUMBERS = 9  # of a primitive: sizes, place, and what it is
COSTS = {"linear": 5, "grid": 9, "circular": 11, "mirror": 7}
ASTRAY = 8.0  # tolerances that the middle of a part may be off at most where none of its points is off by more than one
AT_BODY = 6  # a circle round the axis of a body that is round needs no centre
MOST_PLANES = 10  # through three parts of one shape, across which copies may turn
SAME_AXIS = 1e-12  # of a cosine


@dataclass(frozen=True)
class RepeatCandidate:
    """A repeat of the parts `members[0]`, each with its copies; `orders` has the leaf numbers of each copy of each, as the first's are."""

    repeat: Repeat
    members: tuple[tuple[int, ...], ...]
    orders: tuple[tuple[list[int], ...], ...]
    saved: float


@dataclass(frozen=True)
class RepeatLimits:
    """What parts are measured by: lengths agree within `tolerance`, and within `exact` they are the same."""

    tolerance: float
    exact: float

    def verify(self, parts: list[Node], members: tuple[int, ...], repeat: Repeat, bonus: float) -> Iterator[RepeatCandidate]:
        """The repeat, if each of its copies is one of the members."""
        first, left = parts[members[0]], list(members)
        taken: list[int] = []
        orders: list[list[int]] = []
        for motion in repeat.motions():
            at = motion.point(first.anchor)
            near = (i for i in left if math.dist(at, parts[i].anchor) <= ASTRAY * self.tolerance)  # others are not asked vertex by vertex
            found = next(((i, o) for i in near if (o := match(first, parts[i], motion, self.tolerance)) is not None), None)
            if found is None:
                return
            left.remove(found[0])
            taken.append(found[0])
            orders.append(found[1])
        saved = (len(taken) - 1) * first.size * NUMBERS - COSTS[repeat.kind] + bonus
        yield RepeatCandidate(repeat, (tuple(taken),), (tuple(orders),), saved)

    def same_motions(self, a: Repeat, b: Repeat) -> bool:
        """Whether both repeats make copies in the same places."""
        if (a.kind, a.counts, a.axis, a.angle) != (b.kind, b.counts, b.axis, b.angle):
            return False
        off = minus(a.point, b.point)
        along = dot(off, a.axis) if a.kind == "circular" else 0.0
        gaps = [math.dist(off, times(a.axis, along))]
        return max(gaps + [math.dist(s, t) for s, t in zip(a.steps, b.steps, strict=True)]) <= self.exact

    def tidy(self, v: Vec3) -> Vec3:
        """Without what is far below the tolerance."""
        return round_vector(v, 2 - math.floor(math.log10(self.exact)))


def classes(parts: list[Node], among: Sequence[int], tolerance: float) -> list[list[int]]:
    """Parts of one shape, two or more."""
    groups = group_by_fit(among, lambda group, i: same_shape(parts[group[0]], parts[i], tolerance))
    return [group for group in groups if len(group) > 1]


def first_leaf(node: Node) -> Primitive:
    """Stands for the part until that is folded itself."""
    return node.leaves[0][1]


# --- pairs -----------------------------------------------------------------------------------------------------------


def pairs(limits: RepeatLimits, parts: list[Node], left: list[int]) -> list[RepeatCandidate]:
    """Pairs of parts that one plane or one step takes to each other, as long as two primitives or more, or a drawing, are saved."""
    found: list[RepeatCandidate] = []
    for group in classes(parts, left, limits.tolerance):
        for i, j in combinations(group, 2):
            shift = minus(parts[j].anchor, parts[i].anchor)
            length = math.hypot(*shift)
            if length > 8 * limits.tolerance:
                found += [f for r in _pair_repeats(limits, parts[i], parts[j], shift, length) for f in limits.verify(parts, (i, j), r, 0.0)]
    out: list[RepeatCandidate] = []
    while True:
        best = max((_largest(limits, parts, found, p.repeat) for p in found), key=lambda c: c.saved, default=None)
        if best is None or sum(parts[row[0]].writing for row in best.members) < 2:
            return out
        out.append(best)
        used = {i for row in best.members for i in row}
        found = [p for p in found if not used & set(p.members[0])]


def pair_mirror_images(limits: RepeatLimits, parts: list[Node], group: Sequence[int]) -> Iterator[RepeatCandidate]:
    """Pairs among parts of one shape that a plane takes to each other."""
    for i, j in combinations(group, 2):
        shift = minus(parts[j].anchor, parts[i].anchor)
        length = math.hypot(*shift)
        if length > 8 * limits.tolerance:
            mirrors = (r for r in _pair_repeats(limits, parts[i], parts[j], shift, length) if r.kind == "mirror")
            yield from (found for r in mirrors for found in limits.verify(parts, (i, j), r, 0.0))


def _pair_repeats(limits: RepeatLimits, a: Node, b: Node, shift: Vec3, length: float) -> Iterator[Repeat]:
    x, y, z = (round(s / length, 12) + 0.0 for s in shift)
    middle = tuple((p + q) / 2 for p, q in zip(a.anchor, b.anchor, strict=True))
    normal, sign = (x, y, z), 1.0 if is_forward((x, y, z)) else -1.0
    if match(a, b, mirror(middle, normal), limits.tolerance) is not None:  # type: ignore[arg-type]
        normal = (sign * x + 0.0, sign * y + 0.0, sign * z + 0.0)
        along = dot(middle, normal)  # type: ignore[arg-type]
        point = limits.tidy(times(normal, along))
        yield Repeat("mirror", first_leaf(a), (2,), point=point, axis=normal)
    if sign > 0:
        yield Repeat("linear", first_leaf(a), (2,), (limits.tidy(shift),))


def _largest(limits: RepeatLimits, parts: list[Node], pairs: list[RepeatCandidate], like: Repeat) -> RepeatCandidate:
    """All pairs with the motion of one, none twice."""
    used: set[int] = set()
    rows: list[RepeatCandidate] = []
    for pair in pairs:
        if not used & set(pair.members[0]) and limits.same_motions(pair.repeat, like):
            used |= set(pair.members[0])
            rows.append(_facing(parts, pair, rows[0].members[0][0]) if rows and like.kind == "mirror" else pair)
    saved = sum(parts[r.members[0][0]].writing for r in rows) * NUMBERS - COSTS[like.kind]
    return RepeatCandidate(like, tuple(r.members[0] for r in rows), tuple(r.orders[0] for r in rows), saved + (like.kind == "mirror") * 2.5)


def _facing(parts: list[Node], pair: RepeatCandidate, first: int) -> RepeatCandidate:
    """A pair of mirror images with that one first which is on the side of part `first`, so that firsts may repeat in turn."""
    sides = [dot(minus(parts[i].anchor, pair.repeat.point), pair.repeat.axis) for i in (first, pair.members[0][0])]
    if sides[0] * sides[1] > 0:
        return pair
    (a, b), (of_a, of_b) = pair.members[0], pair.orders[0]
    return replace(pair, members=((b, a),), orders=((of_b, of_a),))


# --- circles, and parts that all have their middle on the axis -------------------------------------------------------


@dataclass(frozen=True)
class Circling:
    """`body` is the centre and axis of a body that is round, `hubs` are points that circles may have their centre at."""

    limits: RepeatLimits
    body: tuple[Vec3, Vec3] | None
    hubs: list[Vec3]

    def circles(self, parts: list[Node], group: list[int]) -> Iterator[RepeatCandidate]:
        """All circles among parts of one shape."""
        for axis in _directions(parts[group[0]], [parts[i].anchor for i in group]):
            yield from self._circles(parts, group, axis)

    def _circles(self, parts: list[Node], group: list[int], axis: Vec3) -> Iterator[RepeatCandidate]:
        u, v = _across(axis)
        for level in _levels(parts, group, axis, 2 * self.limits.tolerance):
            height = dot(parts[level[0]].anchor, axis)
            points = [(dot(parts[i].anchor, u), dot(parts[i].anchor, v)) for i in level]
            hubs = list(dict.fromkeys((round(dot(h, u), 9), round(dot(h, v), 9)) for h in self.hubs))
            for ring in rings(points, hubs, 2 * self.limits.tolerance) if len(level) > 2 else ():
                yield from self._ring(parts, tuple(level[i] for i in ring.members), ring, (u, v, axis), height)
            yield from self._spokes(parts, level, points, axis)

    def _ring(
        self, parts: list[Node], members: tuple[int, ...], ring: Ring, frame: tuple[Vec3, Vec3, Vec3], height: float
    ) -> Iterator[RepeatCandidate]:
        u, v, axis = frame
        x, y, z = (ring.center[0] * u[a] + ring.center[1] * v[a] + height * axis[a] for a in range(3))
        point = self.limits.tidy((x, y, z))
        repeat = Repeat(
            "circular", first_leaf(parts[members[0]]), (len(members),), point=point, axis=axis, angle=_tidy_angle(ring.angle, len(members))
        )
        yield from self.limits.verify(parts, members, repeat, AT_BODY * self._is_at_body(point, axis) + 0.25 * repeat.is_full)

    def _spokes(self, parts: list[Node], level: list[int], points: list[tuple[float, float]], axis: Vec3) -> Iterator[RepeatCandidate]:
        """Parts that all have their middle on the axis, such as the bars of a star."""
        for i in level:
            same = [j for j in level if math.dist(points[level.index(i)], points[level.index(j)]) <= 2 * self.limits.tolerance]
            if same[0] != i or len(same) < 3:
                continue
            for angle in dict.fromkeys(whole / n for n in range(len(same), 2, -1) for whole in (360.0, 180.0)):
                repeat = Repeat(
                    "circular", first_leaf(parts[i]), (len(same),), point=self.limits.tidy(parts[i].anchor), axis=axis, angle=angle
                )
                yield from self.limits.verify(parts, tuple(same), repeat, 0.0)

    def _is_at_body(self, point: Vec3, axis: Vec3) -> bool:
        if self.body is None:
            return False
        off = minus(point, self.body[0])
        along = dot(off, axis)
        away = math.dist(off, times(axis, along))
        return abs(dot(axis, self.body[1])) > 1 - 1e-9 and away <= 4 * self.limits.tolerance


def _directions(node: Node, anchors: list[Vec3]) -> list[Vec3]:
    """Axes that copies may turn about: the world's, those of the leaves, and those across planes that the copies lie in."""
    offered: list[Vec3] = [(0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)]
    for _, leaf in node.leaves[:4]:
        offered += axes(leaf) if leaf.kind in ("box", "ellipsoid") else axes(leaf)[2:] if leaf.kind != "sphere" else ()
    for a, b, c in islice(combinations(anchors, 3), MOST_PLANES):
        u, v = minus(b, a), minus(c, a)
        normal = cross(u, v)
        if math.hypot(*normal) > 1e-3 * math.hypot(*u) * math.hypot(*v):
            offered.append(unit(normal))
    out: list[Vec3] = []
    for d in offered:
        if all(abs(dot(d, e)) < 1 - SAME_AXIS for e in out):
            out.append(d if is_forward(d) else (-d[0], -d[1], -d[2]))
    return out


def _across(axis: Vec3) -> tuple[Vec3, Vec3]:
    """Unit vectors u, v with u x v = axis."""
    helper = (1.0, 0.0, 0.0) if abs(axis[0]) < 0.9 else (0.0, 1.0, 0.0)
    along = dot(helper, axis)
    u = unit(minus(helper, times(axis, along)))
    return u, cross(axis, u)


def _levels(parts: list[Node], group: list[int], axis: Vec3, tolerance: float) -> list[list[int]]:
    """Members at one height along the axis."""
    out: list[list[int]] = []
    for i in sorted(group, key=lambda i: dot(parts[i].anchor, axis)):
        if out and dot(minus(parts[i].anchor, parts[out[-1][0]].anchor), axis) <= tolerance:
            out[-1].append(i)
        else:
            out.append([i])
    return out


def _tidy_angle(angle: float, count: int) -> float:
    full = 360 / count
    return full if abs(angle - full) < 1e-6 else round(angle, 6)
