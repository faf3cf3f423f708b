"""Notches, teeth and lobes of a rim become features: what is alike along a loop is cut from, or joined to, the loop that closes without it.

A knob with twenty finger notches is drawn as one loop of forty arcs. To whom it is a part it is a cylinder from which twenty smaller ones
are cut on a circle. The same holds for combs, castellations and splines (boxes), rows of half-round notches, and for ears and tabs that
stand out. Where all that is left of a loop lies on one circle, that circle is the rim, though what the drawing has of it may be chords.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from imdim.program.ellipse import Ellipse
from imdim.program.outline import (
    Curve,
    Outline,
    Point,
    Ring,
    arc_center,
    arc_middle,
    arc_radius,
    check_crossings,
    circle,
    is_in_loop,
    regions,
    reverse_ring,
    ring_curves,
)
from imdim.program.plain_outlines import to_simple
from imdim.program.rewrite.containment import axes
from imdim.program.rewrite.joints import CurveJoint, angle_at, close_ring, direction, dot, join, minus, turn_left
from imdim.program.tree import OPS, Combine, Primitive, Program, combine_all, fold, leaves

LEAST = 3  # pieces that are alike
SLACK = 1e-3  # of a loop's extent, by which what is alike, or lies on one line or circle, may differ: facets are chords of round walls
EVEN = 3e-4  # of it, by which pieces may be off that are then placed evenly
ROUND = 4e-3  # of it, by which some of a circle may be off that is drawn as chords: a search is not particular about where a short one ends
SAME = 2e-5  # of it, within which corners of a mesh are equally far away
SQUARE = 1e-3  # of a cosine
ROUND_DEG = 0.1  # of which angles of the first of evenly placed pieces are multiples
SUNK = 0.25  # of a box's depth, by which it goes on at least past where its corners are on a round rim


@dataclass(frozen=True)
class _RimPiece:
    """`count` curves of a loop from number `first` on, which go into what the loop holds if `inward`, and else stand out of it.

    Round: an arc about `at` of a `radius`. A box: two walls square to the curve between them, its middle `at`, `width` apart; `out` is the
    direction in which it is open. Both: two walls that go on tangentially from half an arc.
    """

    first: int
    count: int
    inward: bool
    at: Point
    radius: float = 0.0
    width: float = 0.0
    depth: float = 0.0
    out: Point = (0.0, 0.0)


@dataclass(frozen=True)
class _StraightRim:
    """What goes on from `point` in a unit `direction`, what the loop holds on its left."""

    point: Point
    direction: Point


@dataclass(frozen=True)
class _RoundRim:
    center: Point
    radius: float


_Carrier = _StraightRim | _RoundRim | None  # of a gap; None where its neighbours meet in a corner


@dataclass(frozen=True)
class _Base:
    """A loop closed without some pieces; `carriers` has, by the first curve of each of these, what goes on through where it was."""

    ring: Ring
    carriers: dict[int, _Carrier]


@dataclass(frozen=True)
class _Feature:
    """Loops whose areas together are added, or cut if `inward`."""

    inward: bool
    rings: tuple[Ring, ...]


def separate_rims(program: Program, misfit: Callable[[Program], float], slack: float, corners: np.ndarray) -> Program:
    """The program with alike notches, teeth or lobes of extruded loops as features of their own, three or more of a kind, wherever its
    `misfit` grows by no more than `slack`. The shortest of several ways is taken, and of those the one that fits best.

    `corners` [n, 3] are those of the mesh, which lie on round walls where the middles of their facets do not; there may be none.
    """
    tried: set[Primitive] = set()
    while (leaf := next((leaf for leaf in leaves(program) if leaf.kind == "extrude" and leaf not in tried), None)) is not None:
        tried.add(leaf)
        trials = [_replace_leaf(program, leaf, form) for form in _forms(leaf, _in_plane(leaf, corners))]
        if not trials:
            continue
        most = misfit(program) + slack
        fitting = [(_length(trial), off, i) for i, trial in enumerate(trials) if (off := misfit(trial)) <= most]
        if fitting:
            program = trials[min(fitting)[2]]
    return program


def _replace_leaf(program: Program, leaf: Primitive, part: Program) -> Program:
    return fold(program, lambda _, old: part if old == leaf else old, {op: partial(Combine, op) for op in OPS})


def _length(program: Program) -> int:
    return sum(1 if leaf.outline is None else 1 + leaf.outline.curve_count for leaf in leaves(program))


def _in_plane(leaf: Primitive, points: np.ndarray) -> np.ndarray:
    """Where points [n, 3] beside an extrusion are in the plane of its outline, [m, 2]."""
    local = (points - np.array(leaf.center)) @ np.array(axes(leaf)).T
    return local[np.abs(local[:, 2]) <= (0.5 + SLACK) * leaf.size[0], :2]


def _forms(leaf: Primitive, corners: np.ndarray) -> Iterator[Program]:
    """The leaf with the features of one of its loops taken off."""
    assert leaf.outline is not None
    if len(areas := regions(leaf.outline)) > 1:
        return
    outer, *holes = areas[0]

    def solid(*loops: Ring | Ellipse) -> Primitive:
        drawn = replace(leaf, outline=Outline(loops))
        return to_simple(drawn) or drawn

    for i, loop in enumerate((outer, *holes)):
        if isinstance(loop, Ellipse):
            continue
        others = [hole for k, hole in enumerate(holes) if k != i - 1]
        for base, features in _ways(loop if i == 0 else reverse_ring(loop), corners):
            added, cut = ([solid(ring) for f in features if f.inward is inward for ring in f.rings] for inward in (False, True))
            if i == 0:
                yield combine_all("difference", [combine_all("union", [solid(base, *others), *added]), *cut])
            elif cut:
                yield Combine(
                    "difference", solid(outer, *others), combine_all("difference", [combine_all("union", [solid(base), *added]), *cut])
                )
            else:
                yield combine_all("difference", [solid(outer, *others), solid(base), *added])


def _ways(ring: Ring, corners: np.ndarray) -> Iterator[tuple[Ring, list[_Feature]]]:
    """A loop, counter-clockwise, as simpler ones and their features."""
    extent = max(max(axis) - min(axis) for axis in zip(*((x, y) for x, y, _ in ring), strict=True))
    slack, curves = SLACK * extent, ring_curves(ring)
    for groups in _choices(_alike(list(_pieces(ring, slack)), slack), len(ring)):
        pieces = [piece for group in groups for piece in group]
        for base in _bases(ring, pieces, corners, slack):
            tips = [arc_middle(curves[(p.first + p.count // 2) % len(ring)]) for p in pieces]
            # what only rounds a corner is no feature
            if all(is_in_loop(base.ring, *tip) is p.inward for p, tip in zip(pieces, tips, strict=True)) and not _crosses(base.ring):
                yield base.ring, [f for group in groups for f in _features(group, base.carriers, EVEN * extent)]


def _crosses(ring: Ring) -> bool:
    try:
        check_crossings(Outline((ring,)))
    except ValueError:
        return True
    return False


# --- pieces ----------------------------------------------------------------------------------------------------------


def _pieces(ring: Ring, slack: float) -> Iterator[_RimPiece]:
    curves = ring_curves(ring)
    for i, curve in enumerate(curves):
        if curve[4]:
            yield _RimPiece(i, 1, curve[4] < 0, arc_center(curve), arc_radius(curve))
        box = _box(curves[i - 1], curve, curves[(i + 1) % len(curves)], slack) if len(curves) > 4 else None
        if box is not None:
            yield replace(box, first=(i - 1) % len(curves))


def _box(before: Curve, floor: Curve, after: Curve, slack: float) -> _RimPiece | None:
    """Two walls and what is between them, a line square to both or half an arc that touches them."""
    if before[4] or after[4]:
        return None
    width, along, out = math.dist(floor[:2], floor[2:4]), direction(floor), direction(after)
    if max(abs(dot(along, out)), abs(dot(along, direction(before))), 1 + dot(direction(before), out)) > SQUARE:
        return None
    inward = dot(turn_left(along), out) < 0
    depth = max(math.dist(wall[:2], wall[2:4]) for wall in (before, after))
    if not floor[4]:
        return _RimPiece(0, 3, inward, arc_middle(floor), 0.0, width, depth, out)
    if abs(abs(floor[4]) - 1) * width > slack or (floor[4] < 0) is not inward:
        return None
    return _RimPiece(0, 3, inward, arc_center(floor), width / 2, width, depth, out)


def _alike(pieces: Sequence[_RimPiece], slack: float) -> list[list[_RimPiece]]:
    """Groups of pieces that are alike; arcs of one circle, which are a rim, are none."""
    groups: list[list[_RimPiece]] = []
    for piece in pieces:
        group = next((group for group in groups if _are_alike(group[0], piece, slack)), None)
        if group is None:
            groups.append([piece])
        else:
            group.append(piece)
    return [group for group in groups if len(group) >= LEAST and any(math.dist(p.at, group[0].at) > slack for p in group)]


def _are_alike(a: _RimPiece, b: _RimPiece, slack: float) -> bool:
    sizes = zip((a.radius, a.width, a.depth), (b.radius, b.width, b.depth), strict=True)
    return (a.count, a.inward) == (b.count, b.inward) and all(abs(s - t) <= slack for s, t in sizes)


def _choices(groups: list[list[_RimPiece]], n: int) -> Iterator[list[list[_RimPiece]]]:
    """Each group alone whose pieces share no curve, and as many of them together as do not."""
    taken: set[int] = set()
    chosen: list[list[_RimPiece]] = []
    for group in sorted(groups, key=lambda group: -len(group) * group[0].count):
        curves = [i for piece in group for i in _curves_of(piece, n)]
        if len(set(curves)) < len(curves):
            continue
        yield [group]
        if not taken & set(curves):
            taken |= set(curves)
            chosen.append(group)
    if len(chosen) > 1:
        yield chosen


def _curves_of(piece: _RimPiece, n: int) -> list[int]:
    return [(piece.first + k) % n for k in range(piece.count)]


# --- what is left ----------------------------------------------------------------------------------------------------


def _bases(ring: Ring, pieces: Sequence[_RimPiece], corners: np.ndarray, slack: float) -> Iterator[_Base]:
    """Loops without the pieces: a circle that all of the rest lies on, or the rest's lines and arcs, which go on until they meet."""
    curves = ring_curves(ring)
    gone = {i: piece.first for piece in pieces for i in _curves_of(piece, len(curves))}
    kept = [i for i in range(len(curves)) if i not in gone]
    joints = {curves[i][:2] for i in range(len(curves)) if gone.get(i) is None or gone.get(i) != gone.get(i - 1 if i else len(curves) - 1)}
    for rim in _circles(sorted(joints), [arc_middle(curves[i]) for i in kept], [piece.at for piece in pieces], corners, slack):
        yield _Base(circle(rim.radius, *rim.center), {piece.first: rim for piece in pieces})
    closed = _close(curves, kept, slack) if len(kept) > 1 else None
    if closed is not None:
        ends, runs = closed
        before = {piece.first: max((k for k in kept if k < piece.first), default=kept[-1]) for piece in pieces}
        yield _Base(_square(ends, slack), {first: runs.get(k) for first, k in before.items()})


def _circles(
    points: Sequence[Point], middles: Sequence[Point], hubs: Sequence[Point], corners: np.ndarray, slack: float
) -> Iterator[_RoundRim]:
    """The circles on which points lie, and the `middles` of what is between some of them: that on which corners lie, or those through the
    points on average, through most, and around them. Their centre is that of the circle on which the `hubs` lie, if they do."""
    if len(points) < LEAST:
        return
    center, reach = _center(hubs)
    if np.ptp(reach) > EVEN / SLACK * slack:
        center, _ = _center(points)
    reach, between = _distances(points, center), _distances(middles, center)
    off = np.abs(np.concatenate([reach, between]) - np.median(reach))
    if np.median(off) <= slack and off.max() <= ROUND / SLACK * slack:
        near = np.sort(_distances(corners, center))
        near = near[np.abs(near - np.median(reach)) <= ROUND / SLACK * slack]
        ends = np.searchsorted(near, near + SAME / SLACK * slack, side="right")
        most = int(np.argmax(ends - np.arange(len(near)))) if len(near) else 0
        shared = near[most : ends[most]] if len(near) else near
        known = shared if len(shared) >= 2 * LEAST else reach
        radii = (known.mean(),) if np.ptp(known) <= SAME / SLACK * slack else (known.mean(), np.median(known), known.max())
        yield from (_RoundRim(center, float(radius)) for radius in radii)


def _center(points: Sequence[Point]) -> tuple[Point, np.ndarray]:
    """The centre of the circle on which three or more points lie, by least squares, and how far each is from it."""
    at = np.array(points)
    (x, y, _), *_ = np.linalg.lstsq(np.column_stack([2 * at, np.ones(len(at))]), (at**2).sum(axis=1), rcond=None)
    return (float(x), float(y)), _distances(points, (float(x), float(y)))


def _distances(points: Sequence[Point] | np.ndarray, center: Point) -> np.ndarray:
    return np.linalg.norm(np.reshape(points, (-1, 2)) - center, axis=1)


def _close(curves: Sequence[Curve], kept: Sequence[int], slack: float) -> tuple[Ring, dict[int, _Carrier]] | None:
    """A ring of the curves that are kept, and of each of these behind which there is a gap what goes on through that; None where those
    beside a gap neither go on in each other nor meet."""
    n = len(curves)
    joints: list[CurveJoint] = []
    for i, k in zip(kept, (*kept[1:], kept[0]), strict=True):
        joint = CurveJoint(curves[k][:2]) if k == (i + 1) % n else join(curves[i], curves[k], slack)
        if joint is None:
            return None
        joints.append(joint)
    closed = close_ring([curves[i] for i in kept], joints)
    if closed is None:
        return None
    ring, runs = closed
    return ring, {kept[j]: _carrier(curves[kept[run[0]]], curves[kept[run[-1]]]) for run in runs for j in run[:-1]}


def _carrier(first: Curve, last: Curve) -> _Carrier:
    if first[4]:
        return _RoundRim(arc_center(first), arc_radius(first))
    return _StraightRim(first[:2], direction((*first[:2], *last[2:4], 0.0)))


def _square(ring: Ring, slack: float) -> Ring:
    """A ring that is nearly a rectangle as one."""
    if len(ring) != 4 or any(bulge for _, _, bulge in ring):
        return ring
    ux, uy = direction(max(ring_curves(ring), key=lambda c: math.dist(c[:2], c[2:4])))
    local = sorted((ux * x + uy * y, ux * y - uy * x) for x, y, _ in ring)
    (left, right), (low, high) = ((sum(v[:2]) / 2, sum(v[2:]) / 2) for v in ([a for a, _ in local], sorted(b for _, b in local)))
    corners = [(a, b) for a, b in ((left, low), (right, low), (right, high), (left, high))]
    if any(min(math.dist(corner, p) for p in local) > slack for corner in corners):
        return ring
    return tuple((ux * a - uy * b, uy * a + ux * b, 0.0) for a, b in corners)


# --- features --------------------------------------------------------------------------------------------------------


def _features(group: Sequence[_RimPiece], carriers: dict[int, _Carrier], even: float) -> Iterator[_Feature]:
    """Pieces that are alike, as circles and rectangles, evenly placed where they are within `even`."""
    radius, width = (sum(size) / len(group) for size in zip(*((p.radius, p.width) for p in group), strict=True))
    for carrier in dict.fromkeys(carriers[p.first] for p in group):
        own = [replace(p, radius=radius, width=width) for p in group if carriers[p.first] == carrier]
        if isinstance(carrier, _RoundRim):
            own = _around(own, carrier, even)
        elif carrier is not None:
            own = _along(own, carrier, even)
        for piece in own:
            rings = [] if not radius else [circle(radius, *piece.at)]
            rings += [] if not width else [_rectangle(piece, _reach(piece, carrier))]
            yield _Feature(piece.inward, tuple(rings))


def _around(pieces: list[_RimPiece], rim: _RoundRim, even: float) -> list[_RimPiece]:
    """Pieces about a circle's centre, at one distance from it and at multiples of one angle."""
    far, angles = [math.dist(p.at, rim.center) for p in pieces], [angle_at(p.at, rim.center) for p in pieces]
    if max(far) - min(far) <= 2 * even:
        far = [sum(far) / len(far)] * len(far)
    turns = sorted(a % (2 * math.pi) for a in angles)
    gap = min((b - a) % (2 * math.pi) for a, b in zip(turns, (*turns[1:], turns[0]), strict=True))
    count = round(2 * math.pi / gap) if gap > 0 else 0
    if count:
        phase = angle_at((sum(math.cos(count * a) for a in angles), sum(math.sin(count * a) for a in angles)), (0.0, 0.0))
        first = math.radians(ROUND_DEG * round(math.degrees(phase / count) / ROUND_DEG))
        phase = count * first if abs(count * first - phase) * far[0] <= SAME / EVEN * even * count else phase
        at_even = [(phase + 2 * math.pi * round((count * a - phase) / (2 * math.pi))) / count for a in angles]
        if all(abs(a - b) * far[0] <= even for a, b in zip(angles, at_even, strict=True)):
            angles = at_even
    out: list[_RimPiece] = []
    for piece, r, a in zip(pieces, far, angles, strict=True):
        ray = math.cos(a), math.sin(a)
        at, way = (rim.center[0] + r * ray[0], rim.center[1] + r * ray[1]), dot(piece.out, ray)
        radial = 1 - abs(way) <= SQUARE
        out.append(replace(piece, at=at, out=(math.copysign(1.0, way) * ray[0], math.copysign(1.0, way) * ray[1]) if radial else piece.out))
    return out


def _along(pieces: list[_RimPiece], rim: _StraightRim, even: float) -> list[_RimPiece]:
    """Pieces beside a line, at one distance from it and at equal steps along it."""
    (ux, uy), normal = rim.direction, turn_left(rim.direction)
    pieces = sorted(pieces, key=lambda p: dot(rim.direction, p.at))
    along, off = ([dot(v, minus(p.at, rim.point)) for p in pieces] for v in (rim.direction, normal))
    if max(off) - min(off) <= 2 * even:
        off = [sum(off) / len(off)] * len(off)
    steps = np.linspace(along[0], along[-1], len(along))
    if np.abs(steps - along).max() <= even:
        along = steps.tolist()
    out: list[_RimPiece] = []
    for piece, a, b in zip(pieces, along, off, strict=True):
        at, way = (rim.point[0] + a * ux - b * uy, rim.point[1] + a * uy + b * ux), dot(piece.out, normal)
        square = 1 - abs(way) <= SQUARE
        out.append(
            replace(piece, at=at, out=(math.copysign(1.0, way) * normal[0], math.copysign(1.0, way) * normal[1]) if square else piece.out)
        )
    return out


def _reach(piece: _RimPiece, carrier: _Carrier) -> float:
    """How far a box goes from its floor: to a straight rim, which whoever delivers it lets it pass; to as far behind a round one, so that
    its middle is on that, or past where its corners are on it if that is farther."""
    if carrier is None:
        return piece.depth
    if isinstance(carrier, _StraightRim):
        normal = turn_left(carrier.direction)
        return dot(normal, minus(carrier.point, piece.at)) / dot(normal, piece.out)
    x, y = minus(piece.at, carrier.center)
    ahead, aside = dot(piece.out, (x, y)), abs(x * piece.out[1] - y * piece.out[0]) + piece.width / 2
    if ahead >= 0:
        return 2 * (carrier.radius - ahead)
    return max(2 * (-ahead - carrier.radius), -ahead - math.sqrt(max(carrier.radius**2 - aside**2, 0.0)) + SUNK * piece.depth)


def _rectangle(piece: _RimPiece, reach: float) -> Ring:
    (x, y), (ux, uy), half = piece.at, piece.out, piece.width / 2
    corners = ((0.0, half), (0.0, -half), (reach, -half), (reach, half))
    return tuple((x + a * ux - b * uy, y + a * uy + b * ux, 0.0) for a, b in corners)
