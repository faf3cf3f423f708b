"""Candidates for relations between sizes and places: all pairs and triples of features that lie close enough to be looked at.

Directions are settled before, so that places compare as numbers along them. `alike` leaves, of one kind and of sizes that may be equal,
are the ones that stand in symmetric pairs, rows and circles.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product

import numpy as np

from imdim.program.constraints import AXES_OF, FACES_OF, LENGTHS_OF, WORLD, Constraint, Ref
from imdim.program.patterns.congruence import group_by_fit
from imdim.relations.directions import KIND_BITS
from imdim.relations.features import LOOK, NEIGHBOURS, Centers, KnownFeatures, Places, centers_of, near_pairs, without_slope
from imdim.relations.select import RelationCandidate

MOST_ALIKE = 200  # leaves of one group that are compared in triples
ALIKE = 1e-3  # of an outline's longest chord, by which those of alike outlines differ
RADIUS_NAMES = {"r", "r_bottom", "r_top", "r_major", "r_minor", "rx", "ry", "rz"}


def proposals(places: Places) -> Iterator[RelationCandidate]:
    """All candidates; the same relation may come in several forms, of which the choice takes the one that saves most."""
    sizes = _sizes(places)
    for known in sizes:
        yield from _equal(known)
    alike = _alike(places, sizes)
    # what is level along the world's axes, which many share, and along an odd direction is told along the former
    axes = sum(len(members) for members in places.directions.used)
    for members in places.directions.used:
        yield from _along(places, members, alike, math.log2(axes / len(members)))
        yield from _coaxial(places, members)
    yield from _concentric(places)
    for group in alike:
        yield from _rows(places, group)
        for members in places.directions.used:
            yield from _circles(places, group, members)


def _sizes(places: Places) -> list[KnownFeatures]:
    """The shown radii, and the shown lengths."""
    refs = [Ref(leaf, name) for leaf in places.leaves() for name in LENGTHS_OF[places.pose.kind(leaf)]]
    groups = [[r for r in refs if (r.feature in RADIUS_NAMES) == radius] for radius in (True, False)]
    return [places.collect_known(group, [places.pose.size(ref) for ref in group]) for group in groups]


def _equal(known: KnownFeatures) -> Iterator[RelationCandidate]:
    bits = KIND_BITS + math.log2(max(len(known.refs), 2))
    for i, j in known.pairs():
        if known.values[i] > 0 and known.values[j] > 0:
            yield RelationCandidate(Constraint("equal", (known.refs[i], known.refs[j])), bits)


def _alike(places: Places, sizes: list[KnownFeatures]) -> list[list[int]]:
    """Groups of two or more leaves of one kind whose shown sizes may be equal."""
    apart: set[tuple[int, int]] = set()
    for known in sizes:
        deviation = np.sqrt(known.variances)
        for (i, a), (j, b) in product(enumerate(known.refs), repeat=2):
            if a.feature == b.feature and abs(known.values[i] - known.values[j]) > LOOK * math.hypot(deviation[i], deviation[j]):
                apart.add((a.leaf, b.leaf))

    def fits(group: list[int], leaf: int) -> bool:
        same_kind = places.pose.kind(group[0]) == places.pose.kind(leaf)
        return same_kind and not any((leaf, m) in apart for m in group) and may_be_congruent(places, group[0], leaf)

    return [g[:MOST_ALIKE] for g in group_by_fit(places.leaves(), fits) if len(g) > 1]


def may_be_congruent(places: Places, a: int, b: int) -> bool:
    """Whether two leaves of one kind may have congruent outlines: chords and bulges that are the same but for their order."""
    first, second = (_chords(places, leaf) for leaf in (a, b))
    return first.shape == second.shape and bool(np.allclose(first, second, rtol=ALIKE, atol=ALIKE * float(np.max(first, initial=0.0))))


def _chords(places: Places, leaf: int) -> np.ndarray:
    """Sorted lengths of the chords and of the heights of the arcs above them [2, c]; nothing for a leaf without an outline."""
    outlines = places.pose.numbers.outlines
    start, end = outlines.spans[leaf] if len(outlines.spans) else (0, 0)
    curves = outlines.curves[start:end]
    chords = np.hypot(curves[:, 2] - curves[:, 0], curves[:, 3] - curves[:, 1])
    return np.sort(np.stack([chords, np.abs(curves[:, 4]) * chords / 2]), axis=1)


def _along(places: Places, members: list[Ref], alike: list[list[int]], naming: float) -> Iterator[RelationCandidate]:
    """Coplanar faces, centres level with each other or with a face, and symmetric pairs, along one direction, whose `naming` takes bits."""
    pose, direction = places.pose, without_slope(places.pose.axis(members[0]))
    across = [m for m in members if m.leaf >= 0 and m.feature in FACES_OF.get(places.pose.kind(m.leaf), ())]
    faces = [Ref(m.leaf, sign + m.feature) for m in across for sign in "+-"]
    refs = faces + [Ref(leaf) for leaf in places.leaves()]
    known = places.collect_known(refs, [pose.position(ref).dot(direction) for ref in refs])
    bits = KIND_BITS + naming + math.log2(max(len(known.refs), 2))
    for i, j in known.pairs():
        first, second = known.refs[i], known.refs[j]
        if first.leaf != second.leaf:
            both = bool(first.side and second.side)
            yield RelationCandidate(Constraint("coplanar" if both else "aligned", (first, second), None if both else members[0]), bits)
    yield from _symmetric(known, members[0], alike, naming)


def _symmetric(known: KnownFeatures, about: Ref, alike: list[list[int]], naming: float) -> Iterator[RelationCandidate]:
    centers = {ref.leaf: i for i, ref in enumerate(known.refs) if not ref.side}
    hubs = np.array(list(centers.values()), int)
    for group in alike:
        shown = [leaf for leaf in group if leaf in centers]
        bits = KIND_BITS + naming + math.log2(max(len(hubs) * len(shown), 2))
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
                        yield RelationCandidate(Constraint("symmetric", (Ref(first), Ref(second), middle), about), bits)


def _coaxial(places: Places, members: list[Ref]) -> Iterator[RelationCandidate]:
    """Leaves of revolution about one line, and balls on it."""
    axial = [m.leaf for m in members if m.leaf >= 0 and AXES_OF[places.pose.kind(m.leaf)] == ("z",)]
    balls = [leaf for leaf in places.leaves() if places.pose.kind(leaf) == "sphere"]
    if not axial:
        return
    both = centers_of(places, axial + balls, list(places.pose.across(members[0])))
    bits = KIND_BITS + math.log2(max(len(axial) + len(balls), 2))
    for i, j in near_pairs(both.points, both.deviation**2):
        a, b = int(both.leaves[i]), int(both.leaves[j])
        if a in axial:
            yield RelationCandidate(Constraint("coaxial", (Ref(a, "z"), Ref(b, "z" if b in axial else ""))), bits)


def _concentric(places: Places) -> Iterator[RelationCandidate]:
    every = centers_of(places, list(places.leaves()), [places.pose.direction(WORLD, axis) for axis in range(3)])
    bits = KIND_BITS + math.log2(max(len(every.leaves), 2))
    for i, j in near_pairs(every.points, every.deviation**2):
        yield RelationCandidate(Constraint("concentric", (Ref(int(every.leaves[i])), Ref(int(every.leaves[j])))), bits)


# --- rows and circles of equal steps among alike leaves ---------------------------------------------------------------


def _rows(places: Places, group: list[int]) -> Iterator[RelationCandidate]:
    """Longest runs of equal steps among alike leaves."""
    first = group[0]
    axes = range(2) if AXES_OF[places.pose.kind(first)] == ("z",) else range(3)
    centers = centers_of(places, group, [places.pose.direction(first, axis) for axis in axes])
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
                yield RelationCandidate(Constraint("linear", tuple(Ref(int(centers.leaves[m])) for m in run)), bits)


def _at(centers: Centers, point: np.ndarray, reach: float) -> int | None:
    """The leaf next to `point`, if one is within reach."""
    gaps = np.linalg.norm(centers.points - point, axis=1)
    nearest = int(np.argmin(gaps))
    return nearest if gaps[nearest] <= reach else None


def _circles(places: Places, group: list[int], members: list[Ref]) -> Iterator[RelationCandidate]:
    """Alike leaves evenly round the axis of another, or round their own middle, seen along one direction."""
    # the axis of a leaf turns a leaf, that of the frame does not
    axes = [m for m in members if m.leaf >= 0]
    inside = {m.leaf for m in axes}
    group = [leaf for leaf in group if leaf in inside or places.pose.kind(leaf) == "sphere"]
    if len(group) < 2 or not axes:
        return
    sides = list(places.pose.across(axes[0]))
    ring = centers_of(places, group, sides)
    hubs = centers_of(places, sorted(inside), sides)
    for hub, at, deviation in zip(hubs.leaves.tolist(), hubs.points, hubs.deviation, strict=True):
        about = next(m for m in axes if m.leaf == hub)
        yield from _rings(places, ring.without(hub), at, deviation, about, len(hubs.leaves), 2)
    if len(ring.leaves) > 2:
        own = next((m for m in axes if m.leaf in ring.leaves), None)
        if own is not None:
            yield from _rings(places, ring, ring.points.mean(0), float(ring.deviation.max()), own, 1, 3)


def _rings(
    places: Places, ring: Centers, at: np.ndarray, deviation: float, about: Ref, hubs: int, least: int
) -> Iterator[RelationCandidate]:
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
        counts = [n for n in range(len(near), least - 1, -1) if len(near) % n == 0]
        for chosen in (near[start :: len(near) // n] for n in counts for start in range(len(near) // n)):
            step = 2 * math.pi / len(chosen)
            gaps = np.diff([*angle[chosen], angle[chosen[0]] + 2 * math.pi]) - step
            if np.abs(gaps).max() * radius[near[0]] <= slack:
                refs = _turning(places, [int(ring.leaves[i]) for i in chosen], about, step)
                bits = KIND_BITS + math.log2(max(hubs, 1)) + len(near)
                # the sense of the angle is that of the frame `across` the axis that stands for the direction
                yield RelationCandidate(Constraint("circular", refs, about), bits)
                break


def _turning(places: Places, leaves: list[int], about: Ref, angle: float) -> tuple[Ref, ...]:
    """The members; of boxes also the axis that turns with the circle, whichever of the two that is nearest to the turned one before."""
    if places.pose.kind(leaves[0]) != "box":
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
