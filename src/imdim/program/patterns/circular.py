"""Repeats on circles, and of parts that all have their middle on the axis."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, islice

from imdim.program.patterns.candidate import Bench, RepeatCandidate, first_leaf
from imdim.program.patterns.congruence import Node
from imdim.program.patterns.linear import Ring, rings
from imdim.program.repeats import Repeat
from imdim.program.rewrite.containment import axes, dot
from imdim.program.tree import Vec3
from imdim.program.vectors import cross, is_forward, minus, unit

AT_BODY = 6  # a circle round the axis of a body that is round needs no centre
MOST_PLANES = 10  # through three parts of one shape, across which copies may turn
SAME_AXIS = 1e-12  # of a cosine


@dataclass(frozen=True)
class Circling:
    """`body` is the centre and axis of a body that is round, `hubs` are points that circles may have their centre at."""

    bench: Bench
    body: tuple[Vec3, Vec3] | None
    hubs: list[Vec3]

    def circles(self, parts: list[Node], group: list[int]) -> Iterator[RepeatCandidate]:
        """All circles among parts of one shape."""
        for axis in _directions(parts[group[0]], [parts[i].anchor for i in group]):
            yield from self._circles(parts, group, axis)

    def _circles(self, parts: list[Node], group: list[int], axis: Vec3) -> Iterator[RepeatCandidate]:
        u, v = _across(axis)
        for level in _levels(parts, group, axis, 2 * self.bench.tolerance):
            height = dot(parts[level[0]].anchor, axis)
            points = [(dot(parts[i].anchor, u), dot(parts[i].anchor, v)) for i in level]
            hubs = list(dict.fromkeys((round(dot(h, u), 9), round(dot(h, v), 9)) for h in self.hubs))
            for ring in rings(points, hubs, 2 * self.bench.tolerance) if len(level) > 2 else ():
                yield from self._ring(parts, tuple(level[i] for i in ring.members), ring, (u, v, axis), height)
            yield from self._spokes(parts, level, points, axis)

    def _ring(
        self, parts: list[Node], members: tuple[int, ...], ring: Ring, frame: tuple[Vec3, Vec3, Vec3], height: float
    ) -> Iterator[RepeatCandidate]:
        u, v, axis = frame
        x, y, z = (ring.center[0] * u[a] + ring.center[1] * v[a] + height * axis[a] for a in range(3))
        point = self.bench.tidy((x, y, z))
        repeat = Repeat(
            "circular", first_leaf(parts[members[0]]), (len(members),), point=point, axis=axis, angle=_tidy_angle(ring.angle, len(members))
        )
        yield from self.bench.verify(parts, members, repeat, AT_BODY * self._is_at_body(point, axis) + 0.25 * repeat.is_full)

    def _spokes(self, parts: list[Node], level: list[int], points: list[tuple[float, float]], axis: Vec3) -> Iterator[RepeatCandidate]:
        """Parts that all have their middle on the axis, such as the bars of a star."""
        for i in level:
            same = [j for j in level if math.dist(points[level.index(i)], points[level.index(j)]) <= 2 * self.bench.tolerance]
            if same[0] != i or len(same) < 3:
                continue
            for angle in dict.fromkeys(whole / n for n in range(len(same), 2, -1) for whole in (360.0, 180.0)):
                repeat = Repeat(
                    "circular", first_leaf(parts[i]), (len(same),), point=self.bench.tidy(parts[i].anchor), axis=axis, angle=angle
                )
                yield from self.bench.verify(parts, tuple(same), repeat, 0.0)

    def _is_at_body(self, point: Vec3, axis: Vec3) -> bool:
        if self.body is None:
            return False
        off = minus(point, self.body[0])
        along = dot(off, axis)
        away = math.dist(off, (along * axis[0], along * axis[1], along * axis[2]))
        return abs(dot(axis, self.body[1])) > 1 - 1e-9 and away <= 4 * self.bench.tolerance


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
    u = unit((helper[0] - along * axis[0], helper[1] - along * axis[1], helper[2] - along * axis[2]))
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
