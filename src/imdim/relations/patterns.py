"""Candidates for rows and circles of equal steps among alike leaves."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from imdim.program.constraints import Constraint, Ref
from imdim.relations.directions import KIND_BITS
from imdim.relations.features import LOOK, Centers, Places, centers_of
from imdim.relations.select import RelationCandidate


def rows(places: Places, group: list[int]) -> Iterator[RelationCandidate]:
    """Longest runs of equal steps among alike leaves."""
    first = group[0]
    axes = range(2) if places.kind(first) in ("cylinder", "cone", "torus") else range(3)
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


def circles(places: Places, group: list[int], members: list[Ref]) -> Iterator[RelationCandidate]:
    """Alike leaves evenly round the axis of another, or round their own middle, seen along one direction."""
    # the axis of a leaf turns a leaf, that of the frame does not
    axes = [m for m in members if m.leaf >= 0]
    inside = {m.leaf for m in axes}
    group = [leaf for leaf in group if leaf in inside or places.kind(leaf) == "sphere"]
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
        for count in _divisors(len(near), least):
            for start in range(len(near) // count):
                chosen = near[start :: len(near) // count]
                gaps = np.diff([*angle[chosen], angle[chosen[0]] + 2 * math.pi]) - 2 * math.pi / count
                if np.abs(gaps).max() * radius[near[0]] <= slack:
                    refs = _turning(places, [int(ring.leaves[i]) for i in chosen], about, 2 * math.pi / count)
                    bits = KIND_BITS + math.log2(max(hubs, 1)) + len(near)
                    # the sense of the angle is that of the frame `across` the axis that stands for the direction
                    yield RelationCandidate(Constraint("circular", refs, about), bits)
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
