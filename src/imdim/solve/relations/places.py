"""Candidates for relations between sizes and places: all pairs and triples of features that lie close enough to be looked at.

Directions are settled before, so that places compare as numbers along them. `alike` leaves, of one kind and of sizes that may be equal,
are the ones that stand in symmetric pairs, rows and circles.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from imdim.geometry.constraints import Pose, Vector
from imdim.program.constraints import FACES_OF, WORLD, Constraint, Ref
from imdim.program.tree import KINDS, SIZE_NAMES
from imdim.solve.relations.belief import Shown
from imdim.solve.relations.directions import KIND_BITS, Directions
from imdim.solve.relations.select import Candidate

LOOK = 4.5  # deviations within which a pair is a candidate
NEIGHBOURS = 4  # with which a feature is paired
MOST_ALIKE = 200  # leaves of one group that are compared in triples
RADIUS_NAMES = {"r", "r_bottom", "r_top", "r_major", "r_minor", "rx", "ry", "rz"}


@dataclass(frozen=True)
class Known:
    """Features [n] as numbers with their variances and rows [n, 9 k]; hidden ones are left out."""

    refs: list[Ref]
    values: np.ndarray
    rows: np.ndarray
    variances: np.ndarray

    def pairs(self) -> Iterator[tuple[int, int]]:
        """Those that may be equal."""
        return near_pairs(self.values[:, None], self.variances)


def near_pairs(points: np.ndarray, variances: np.ndarray) -> Iterator[tuple[int, int]]:
    """Pairs of `points` [n, d] that may be equal, each point with its nearest few: what equals them equals the others too."""
    apart = np.abs(points[:, None] - points).max(2, initial=0.0) / np.sqrt(variances[:, None] + variances + 1e-300)
    np.fill_diagonal(apart, np.inf)
    nearest = np.argsort(apart, axis=1, kind="stable")[:, :NEIGHBOURS]
    found = {(min(i, j), max(i, j)) for i in range(len(points)) for j in nearest[i].tolist() if apart[i, j] <= LOOK}
    yield from sorted(found)


@dataclass(frozen=True)
class Places:
    """What the proposals read: the pose, the covariance [9 k, 9 k], what the cloud shows, the directions."""

    pose: Pose
    covariance: np.ndarray
    shown: Shown
    directions: Directions

    def known(self, refs: list[Ref], rows: list[tuple[float, np.ndarray]]) -> Known:
        if not rows:
            return Known([], np.zeros(0), np.zeros((0, len(self.covariance))), np.zeros(0))
        values, slopes = np.array([r[0] for r in rows]), np.array([r[1] for r in rows])
        index = np.flatnonzero(self.shown.rows(slopes))
        return Known([refs[i] for i in index], values[index], slopes[index], self.variances(slopes[index]))

    def variances(self, slopes: np.ndarray) -> np.ndarray:
        """Those [n] of functions with the derivatives `slopes` [n, 9 k]."""
        return ((slopes @ self.covariance) * slopes).sum(1)

    def leaves(self) -> range:
        return range(len(self.pose.numbers.kinds))

    def kind(self, leaf: int) -> str:
        return KINDS[self.pose.numbers.kinds[leaf]]


def fixed(direction: Vector) -> Vector:
    """A direction that stands, however uncertain: places along it are compared with each other, not with the origin."""
    return Vector(direction.value, np.zeros_like(direction.slope))


def proposals(places: Places) -> Iterator[Candidate]:
    """All candidates; the same relation may come in several forms, of which the choice takes the one that saves most."""
    sizes = _sizes(places)
    for known in sizes:
        yield from _equal(known)
    alike = _alike(places, sizes)
    for members in places.directions.used:
        yield from _along(places, members, alike)
        yield from _coaxial(places, members)
    yield from _concentric(places)
    for group in alike:
        yield from _rows(places, group)
        for members in places.directions.used:
            yield from _circles(places, group, members)


def _sizes(places: Places) -> list[Known]:
    """The shown radii, and the shown lengths."""
    refs = [Ref(leaf, name) for leaf in places.leaves() for name in SIZE_NAMES[places.kind(leaf)]]
    groups = [[r for r in refs if (r.feature in RADIUS_NAMES) == radius] for radius in (True, False)]
    return [places.known(group, [places.pose.size(ref) for ref in group]) for group in groups]


def _equal(known: Known) -> Iterator[Candidate]:
    bits = KIND_BITS + math.log2(max(len(known.refs), 2))
    for i, j in known.pairs():
        if known.values[i] > 0 and known.values[j] > 0:
            yield Candidate(Constraint("equal", (known.refs[i], known.refs[j])), bits)


def _alike(places: Places, sizes: list[Known]) -> list[list[int]]:
    """Groups of two or more leaves of one kind whose shown sizes may be equal."""
    apart: set[tuple[int, int]] = set()
    for known in sizes:
        deviation = np.sqrt(known.variances)
        for i, a in enumerate(known.refs):
            for j, b in enumerate(known.refs):
                differ = a.feature == b.feature and abs(known.values[i] - known.values[j]) > LOOK * math.hypot(deviation[i], deviation[j])
                if differ:
                    apart.add((a.leaf, b.leaf))
    groups: list[list[int]] = []
    for leaf in places.leaves():
        home = next((g for g in groups if places.kind(g[0]) == places.kind(leaf) and not any((leaf, m) in apart for m in g)), None)
        if home is None:
            groups.append([leaf])
        else:
            home.append(leaf)
    return [g[:MOST_ALIKE] for g in groups if len(g) > 1]


def _along(places: Places, members: list[Ref], alike: list[list[int]]) -> Iterator[Candidate]:
    """Coplanar faces, centres level with each other or with a face, and symmetric pairs, along one direction."""
    pose, direction = places.pose, fixed(places.pose.axis(members[0]))
    across = [m for m in members if m.leaf >= 0 and m.feature in FACES_OF.get(places.kind(m.leaf), ())]
    faces = [Ref(m.leaf, sign + m.feature) for m in across for sign in "+-"]
    refs = faces + [Ref(leaf) for leaf in places.leaves()]
    known = places.known(refs, [pose.position(ref).dot(direction) for ref in refs])
    bits = KIND_BITS + math.log2(max(len(known.refs), 2))
    for i, j in known.pairs():
        first, second = known.refs[i], known.refs[j]
        if first.leaf != second.leaf:
            both = bool(first.side and second.side)
            yield Candidate(Constraint("coplanar" if both else "aligned", (first, second), None if both else members[0]), bits)
    yield from _symmetric(known, members[0], alike)


def _symmetric(known: Known, about: Ref, alike: list[list[int]]) -> Iterator[Candidate]:
    centers = {ref.leaf: i for i, ref in enumerate(known.refs) if not ref.side}
    hubs = np.array(list(centers.values()), int)
    for group in alike:
        shown = [leaf for leaf in group if leaf in centers]
        bits = KIND_BITS + math.log2(max(len(hubs) * len(shown), 2))
        for a, first in enumerate(shown):
            for second in shown[a + 1 :]:
                i, j = centers[first], centers[second]
                pair = known.variances[i] + known.variances[j]
                if abs(known.values[i] - known.values[j]) <= LOOK * math.sqrt(pair):
                    continue
                rows = known.rows[i] + known.rows[j] - 2 * known.rows[hubs]
                off = known.values[i] + known.values[j] - 2 * known.values[hubs]
                variance = pair + 4 * known.variances[hubs]
                apart = np.where(np.abs(rows).max(1) > 0, np.abs(off) / np.sqrt(variance + 1e-300), np.inf)
                nearest = np.argsort(apart, kind="stable")[:NEIGHBOURS]
                for hub in hubs[nearest[apart[nearest] <= LOOK]]:
                    middle = known.refs[hub]
                    if middle.leaf not in (first, second):
                        yield Candidate(Constraint("symmetric", (Ref(first), Ref(second), middle), about), bits)


def _coaxial(places: Places, members: list[Ref]) -> Iterator[Candidate]:
    """Leaves of revolution about one line, and balls on it."""
    pose = places.pose
    axial = [m.leaf for m in members if m.leaf >= 0 and places.kind(m.leaf) in ("cylinder", "cone", "torus")]
    balls = [leaf for leaf in places.leaves() if places.kind(leaf) == "sphere"]
    if not axial:
        return
    both = _centers(places, axial + balls, list(places.pose.across(members[0])))
    bits = KIND_BITS + math.log2(max(len(axial) + len(balls), 2))
    for i, j in near_pairs(both.points, both.deviation**2):
        a, b = int(both.leaves[i]), int(both.leaves[j])
        if a in axial:
            yield Candidate(Constraint("coaxial", (Ref(a, "z"), Ref(b, "z" if b in axial else ""))), bits)


def _concentric(places: Places) -> Iterator[Candidate]:
    every = _centers(places, list(places.leaves()), [places.pose.direction(WORLD, axis) for axis in range(3)])
    bits = KIND_BITS + math.log2(max(len(every.leaves), 2))
    for i, j in near_pairs(every.points, every.deviation**2):
        yield Candidate(Constraint("concentric", (Ref(int(every.leaves[i])), Ref(int(every.leaves[j])))), bits)


@dataclass(frozen=True)
class _Centers:
    """Centres [n, d] of a group of leaves in the directions shown, and the deviation of each."""

    leaves: np.ndarray
    points: np.ndarray
    deviation: np.ndarray

    def without(self, leaf: int) -> _Centers:
        others = self.leaves != leaf
        return _Centers(self.leaves[others], self.points[others], self.deviation[others])


def _centers(places: Places, group: list[int], sides: list) -> _Centers:
    """Those of `group` that are shown in all `sides`."""
    columns = [[places.pose.center(leaf).dot(fixed(side)) for leaf in group] for side in sides]
    points = np.array([[row[0] for row in column] for column in columns]).T
    slopes = [np.array([row[1] for row in column]) for column in columns]
    deviation = np.sqrt(np.max([places.variances(s) for s in slopes], axis=0))
    shown = np.all([places.shown.rows(s) for s in slopes], axis=0)
    return _Centers(np.array(group)[shown], points[shown], deviation[shown])


def _rows(places: Places, group: list[int]) -> Iterator[Candidate]:
    """Longest runs of equal steps among alike leaves."""
    first = group[0]
    axes = range(2) if places.kind(first) in ("cylinder", "cone", "torus") else range(3)
    centers = _centers(places, group, [places.pose.direction(first, axis) for axis in axes])
    n = len(centers.leaves)
    reach = 3 * LOOK * float(centers.deviation.max(initial=0.0))
    for i in range(n):
        for j in range(n):
            step = centers.points[j] - centers.points[i]
            if i == j or np.linalg.norm(step) <= reach or _at(centers, centers.points[i] - step, reach) is not None:
                continue
            run = [i, j]
            while (following := _at(centers, 2 * centers.points[run[-1]] - centers.points[run[-2]], reach)) is not None:
                run.append(following)
            if len(run) > 2 and run[0] < run[-1]:
                bits = KIND_BITS + 2 * math.log2(n) + len(run) - 2
                yield Candidate(Constraint("linear", tuple(Ref(int(centers.leaves[m])) for m in run)), bits)


def _at(centers: _Centers, point: np.ndarray, reach: float) -> int | None:
    """The leaf next to `point`, if one is within reach."""
    gaps = np.linalg.norm(centers.points - point, axis=1)
    nearest = int(np.argmin(gaps))
    return nearest if gaps[nearest] <= reach else None


def _circles(places: Places, group: list[int], members: list[Ref]) -> Iterator[Candidate]:
    """Alike leaves evenly round the axis of another, or round their own middle, seen along one direction."""
    # the axis of a leaf turns a leaf, that of the frame does not
    axes = [m for m in members if m.leaf >= 0]
    inside = {m.leaf for m in axes}
    group = [leaf for leaf in group if leaf in inside or places.kind(leaf) == "sphere"]
    if len(group) < 2 or not axes:
        return
    sides = list(places.pose.across(axes[0]))
    ring = _centers(places, group, sides)
    hubs = _centers(places, sorted(inside), sides)
    for hub, at, deviation in zip(hubs.leaves.tolist(), hubs.points, hubs.deviation, strict=True):
        about = next(m for m in axes if m.leaf == hub)
        yield from _rings(places, ring.without(hub), at, deviation, about, len(hubs.leaves), 2)
    if len(ring.leaves) > 2:
        own = next((m for m in axes if m.leaf in ring.leaves), None)
        if own is not None:
            yield from _rings(places, ring, ring.points.mean(0), float(ring.deviation.max()), own, 1, 3)


def _rings(places: Places, ring: _Centers, at: np.ndarray, deviation: float, about: Ref, hubs: int, least: int) -> Iterator[Candidate]:
    """Full circles about the point `at` with one radius and equal angles."""
    offsets = ring.points - at
    radius, angle = np.linalg.norm(offsets, axis=1), np.arctan2(offsets[:, 1], offsets[:, 0])
    slack = 2 * LOOK * (float(ring.deviation.max(initial=0.0)) + deviation)
    todo = list(np.argsort(radius, kind="stable"))
    while todo:
        near = [i for i in todo if radius[i] <= radius[todo[0]] + slack]
        todo = [i for i in todo if i not in near]
        if len(near) < least or radius[near[0]] <= slack:
            continue
        near.sort(key=lambda i: angle[i])
        for count in _divisors(len(near), least):
            for start in range(len(near) // count):
                chosen = near[start :: len(near) // count]
                gaps = np.diff([*angle[chosen], angle[chosen[0]] + 2 * math.pi]) - 2 * math.pi / count
                if np.abs(gaps).max() * radius[near[0]] <= slack:
                    refs = _turning(places, [int(ring.leaves[i]) for i in chosen], about, 2 * math.pi / count)
                    bits = KIND_BITS + math.log2(max(hubs, 1)) + len(near)
                    # the sense of the angle is that of the frame `across` the axis that stands for the direction
                    yield Candidate(Constraint("circular", refs, about), bits)
                    break
            else:
                continue
            break


def _divisors(n: int, least: int) -> list[int]:
    return [d for d in range(n, least - 1, -1) if n % d == 0]


def _turning(places: Places, leaves: list[int], about: Ref, angle: float) -> tuple[Ref, ...]:
    """The members; of boxes also the axis that turns with the circle, whichever of the two that is nearest to the turned one before."""
    if places.kind(leaves[0]) != "box":
        return tuple(Ref(leaf) for leaf in leaves)
    pose = places.pose
    axis = pose.axis(about).value
    frames = [pose.numbers.rotations[leaf] for leaf in leaves]
    flat = [[a for a in range(3) if abs(frame[:, a] @ axis) < 0.5] for frame in frames]
    current = flat[0][0]
    refs = [Ref(leaves[0], "xyz"[current])]
    for i in range(1, len(leaves)):
        before = frames[i - 1][:, current]
        turned = math.cos(angle) * before + math.sin(angle) * np.cross(axis, before)
        current = max(flat[i], key=lambda a: abs(frames[i][:, a] @ turned))
        refs.append(Ref(leaves[i], "xyz"[current]))
    return tuple(refs)
