"""Candidates for relations between sizes and places: all pairs and triples of features that lie close enough to be looked at.

Directions are settled before, so that places compare as numbers along them. `alike` leaves, of one kind and of sizes that may be equal,
are the ones that stand in symmetric pairs, rows and circles.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from imdim.program.constraints import FACES_OF, WORLD, Constraint, Ref
from imdim.program.tree import SIZE_NAMES
from imdim.relations.directions import KIND_BITS
from imdim.relations.features import LOOK, NEIGHBOURS, KnownFeatures, Places, centers_of, near_pairs, without_slope
from imdim.relations.patterns import circles, rows
from imdim.relations.select import RelationCandidate

MOST_ALIKE = 200  # leaves of one group that are compared in triples
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
        yield from rows(places, group)
        for members in places.directions.used:
            yield from circles(places, group, members)


def _sizes(places: Places) -> list[KnownFeatures]:
    """The shown radii, and the shown lengths."""
    refs = [Ref(leaf, name) for leaf in places.leaves() for name in SIZE_NAMES[places.kind(leaf)]]
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


def _along(places: Places, members: list[Ref], alike: list[list[int]], naming: float) -> Iterator[RelationCandidate]:
    """Coplanar faces, centres level with each other or with a face, and symmetric pairs, along one direction, whose `naming` takes bits."""
    pose, direction = places.pose, without_slope(places.pose.axis(members[0]))
    across = [m for m in members if m.leaf >= 0 and m.feature in FACES_OF.get(places.kind(m.leaf), ())]
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
    axial = [m.leaf for m in members if m.leaf >= 0 and places.kind(m.leaf) in ("cylinder", "cone", "torus")]
    balls = [leaf for leaf in places.leaves() if places.kind(leaf) == "sphere"]
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
