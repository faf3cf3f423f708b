"""Screw threads on the surface of a mesh: helices and rows of rings, each about one axis, with its pitch and diameters.

A flank of a thread is moved into itself by a screw motion. A facet's normal n at x and a motion x -> c' + c x x that does so obey
n . (c' + c x x) = 0, so that the motion of a smooth piece is the smallest eigenvector of a quadratic form, without any first guess
(Pottmann and Randrup 1998, "Rotational and helical surface approximation for reverse engineering"): c is the axis, c . c' tells the lead,
which is 0 for a ring. Many programs draw threads as rings: these are threads where their flanks have 60 degrees and the depth of one, since
other grooves stand in rows, too.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from imdim.detection.facets import Facets, points_of
from imdim.detection.fit_surface import MIN_POINTS, fit_surface
from imdim.geometry.components import components
from imdim.geometry.rows import dot_rows, lengths
from imdim.geometry.surface import Surface, vec
from imdim.program.metric import metric_thread

SMOOTH_DEG = 25.0  # under which the facets of one flank meet
LEAST_FACETS = 12  # of a flank: two turns of six
LEAST_TURNS = 2.0  # of a helix; the thread of a bottle has fewer
LEAST_RINGS = 3
LEANS = 0.2  # mean sine of a flank's slope from a cylinder
BENDS = 0.01  # least variance of its normals along any direction: those of a prism have none
ROUNDS, STRAY = 3, 0.5  # of fitting, without what leaves the motion by more than this much of the pace along the axis
ON_BALL = 1e-5  # of a piece's squared size, by which it leaves itself about two axes
LOOSE = 0.1  # of a piece's size, by which no motion of it leaves it
OFF_HELIX = 0.25  # of the pace along the axis, by which normals may leave a screw motion
OFF_RING = 0.006  # of the radius, the same for a ring
NO_LEAD = 0.002  # of the radius, by which a ring climbs a radian at most
FLANK = (math.cos(math.radians(33)), math.cos(math.radians(27)))  # of a ring: between its normal and the axis
DEPTH = (0.45, 0.9)  # of the pitch, of a row of rings: ISO 68-1 has 0.54 and 0.61, a sharp V 0.87
SLIMMEST = 0.5  # of the major diameter, that the minor one has at least: a spring's wire has no core
ALIKE = 0.05  # relative, by which pitches of one thread differ
ALIGNED, BESIDE = 0.9995, 0.05  # cosine between axes of one thread, and how far one lies beside another, of the radius
BOTH = 0.1  # share of the flanks that lean either way
ONE_SIDED = 0.95  # of the area: a thread looks outwards, or inwards
BINS = 64  # of a lead, when starts are counted
FLAT_END, ACROSS = 1e-3, math.cos(math.radians(0.8))  # of the pitch: a face across the axis is no higher, and its normal lies along that
SLACK = 0.02  # of the depth
AT_CREST = (0.2, 0.05, 0.01)  # of the depth, within which corners are taken for those of crests, closer and closer
EXACT = 1e-6  # of the radius, within which a mesh is


@dataclass(frozen=True, eq=False)
class Thread:
    """A thread about the line through `point` along `axis` [3], from `low` to `high` along it, in the units of its mesh.

    `lead` is how far a turn leads, negative where left-handed, 0 where the thread is a row of rings; `minor` and `major` are diameters,
    `internal` where it is in a hole. `facets` [t] are the numbers of those that show it, crests and roots among them.
    """

    point: np.ndarray
    axis: np.ndarray
    low: float
    high: float
    pitch: float
    lead: float
    minor: float
    major: float
    internal: bool
    facets: np.ndarray

    @property
    def crest(self) -> float:
        """The diameter of the cylinder that carries the thread, as it is drawn: the major one of a bolt, the minor one of a nut."""
        return self.minor if self.internal else self.major


class _Motion(NamedTuple):
    """A screw motion about the line through `point` along `axis`, `climb` along it a radian; `off` [m] is by how much each facet's surface
    would leave itself, a radian, which is of this `size`."""

    point: np.ndarray
    axis: np.ndarray
    climb: float
    off: np.ndarray
    size: float


class _Flank(NamedTuple):
    """A smooth piece that a motion about the line through `point` along `axis` leaves in place, `climb` along it a radian.

    `facets` [m]; it reaches from `low` to `high` along the axis, from `inner` to `outer` away from it; `up` is the share of its area that
    leans along the axis, `lean` the mean sine by which it does, `outward` the share that looks away from the axis.
    """

    facets: np.ndarray
    area: float
    point: np.ndarray
    axis: np.ndarray
    climb: float
    off: float
    low: float
    high: float
    inner: float
    outer: float
    lean: float
    up: float
    outward: float

    @property
    def turns(self) -> float:
        return (self.high - self.low) / (2 * math.pi * max(abs(self.climb), 1e-300))


def find_threads(facets: Facets) -> list[Thread]:
    """The threads that a mesh shows, the largest of each kind first; no facet shows two."""
    flanks = [flank for piece in _smooth_pieces(facets) if (flank := _flank_of(facets, piece)) is not None]
    flanks.sort(key=lambda flank: -flank.area)
    taken = np.zeros(len(facets.areas), bool)
    found: list[Thread] = []
    for tell, of_kind in ((_tell_helix, _is_helical), (_tell_rings, _is_ring)):
        for group in _gather([flank for flank in flanks if of_kind(flank)]):
            if not any(taken[flank.facets].any() for flank in group) and (thread := tell(facets, group)) is not None:
                taken[thread.facets] = True
                found.append(thread)
    return found


def describe_thread(thread: Thread) -> str:
    """In words, with the metric size where its numbers, in millimetres, have one."""
    size = metric_thread(thread.major, thread.pitch, thread.internal)
    kind = f"{'internal ' if thread.internal else ''}thread{f' {size}' if size else ''}"
    starts = round(abs(thread.lead) / thread.pitch)
    wound = f"{', left-handed' if thread.lead < 0 else ''}{f', {starts} starts' if starts > 1 else ''}"
    return f"{kind}, pitch {thread.pitch:.3g}, diameters {thread.minor:.4g} and {thread.major:.4g}{wound}"


class _SmoothPiece(NamedTuple):
    """Facets [m] that hang together, and the places [k, 2] among them of those that meet."""

    facets: np.ndarray
    links: np.ndarray

    def only(self, keep: np.ndarray) -> _SmoothPiece:
        """Some of the facets, [m] bool."""
        place = np.cumsum(keep) - 1
        return _SmoothPiece(self.facets[keep], place[self.links[keep[self.links].all(1)]])


def _smooth_pieces(facets: Facets) -> Iterator[_SmoothPiece]:
    """Facets that hang together by edges which turn little."""
    links = facets.edges[facets.angles < math.radians(SMOOTH_DEG)]
    count, label = components(links[:, 0], links[:, 1], len(facets.areas))
    order, sizes = np.argsort(label, kind="stable"), np.bincount(label, minlength=count)
    ends = np.cumsum(sizes)
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order)) - np.repeat(ends - sizes, sizes)
    own = label[links[:, 0]]
    links, own = links[np.argsort(own, kind="stable")], np.sort(own)
    for k in np.flatnonzero(sizes >= LEAST_FACETS):
        first, last = np.searchsorted(own, [k, k + 1])
        yield _SmoothPiece(order[ends[k] - sizes[k] : ends[k]], place[links[first:last]])


def _join(facets: Facets, pieces: Sequence[np.ndarray]) -> _SmoothPiece:
    """Several pieces as one."""
    members = np.unique(np.concatenate(pieces))
    place = np.full(len(facets.areas), -1)
    place[members] = np.arange(len(members))
    links = place[facets.edges]
    return _SmoothPiece(members, links[(links >= 0).all(1)])


def _flank_of(facets: Facets, piece: _SmoothPiece) -> _Flank | None:
    """The flank that a smooth piece is, without what else hangs together with it; None where it is none, or several motions leave it in
    place, as with planes and cylinders."""
    motion = _motion_of(facets, piece)
    for _ in range(ROUNDS):
        if motion is None:
            break
        lean = float(np.abs(facets.normals[piece.facets] @ motion.axis).mean())
        keep = np.abs(motion.off) <= max(STRAY * abs(motion.climb) * lean, OFF_RING * motion.size)
        if keep.all() or np.count_nonzero(keep) < max(LEAST_FACETS, len(keep) / 2):
            break
        piece = piece.only(keep)
        motion = _motion_of(facets, piece)
    return None if motion is None else _measure_flank(facets, piece.facets, motion)


def _motion_of(facets: Facets, piece: _SmoothPiece) -> _Motion | None:
    """The one screw motion that leaves a smooth piece in place, None where none does, or several do."""
    area, facing = facets.areas[piece.facets], facets.normals[piece.facets]
    share = area / area.sum()
    middle = share @ facets.centers[piece.facets]
    arm = facets.centers[piece.facets] - middle
    size = math.sqrt(float(share @ dot_rows(arm, arm))) or 1.0
    moment = np.cross(arm / size, facing)
    spread, both, turning = ((a * share[:, None]).T @ b for a, b in ((facing, facing), (moment, facing), (moment, moment)))
    if np.linalg.eigvalsh(spread)[0] < BENDS:
        return None
    shift = np.linalg.solve(spread, both.T)
    values, vectors = np.linalg.eigh(turning - both @ shift)
    axis = vectors[:, 0]
    if values[1] < ON_BALL:  # one circle of flat facets lies on a ball, too, which has any axis: of a cone the normals tell it
        axis = np.linalg.eigh(spread - np.outer(share @ facing, share @ facing))[1][:, 0]
    pace = -shift @ axis * size
    off = _calm(piece, dot_rows(facing, pace + np.cross(axis, arm)))
    if math.sqrt(float(share @ off**2)) > LOOSE * size:
        return None
    return _Motion(middle + np.cross(axis, pace), axis, float(axis @ pace), off, size)


def _calm(piece: _SmoothPiece, off: np.ndarray) -> np.ndarray:
    """Values [m] of a piece's facets as means with their neighbours': the two triangles of a twisted quad lean to either side."""
    ends, others = np.concatenate([piece.links, piece.links[:, ::-1]]).T
    count = np.bincount(ends, minlength=len(off))
    return np.where(count > 0, (off + np.bincount(ends, off[others], len(off)) / np.maximum(count, 1)) / 2, off)


def _measure_flank(facets: Facets, piece: np.ndarray, motion: _Motion) -> _Flank:
    area, facing = facets.areas[piece], facets.normals[piece]
    share = area / area.sum()
    away, along = measure_to_axis(facets.corners[facets.triangles(piece)].reshape(-1, 3), motion.point, motion.axis)
    lean = facing @ motion.axis
    radial = facets.centers[piece] - motion.point
    radial -= np.outer(radial @ motion.axis, motion.axis)
    return _Flank(
        piece,
        float(area.sum()),
        motion.point,
        motion.axis,
        motion.climb,
        math.sqrt(float(share @ motion.off**2)),
        float(along.min()),
        float(along.max()),
        float(away.min()),
        float(away.max()),
        float(share @ np.abs(lean)),
        float(share[lean > 0].sum()),
        float(share[dot_rows(radial, facing) > 0].sum()),
    )


def measure_to_axis(points: np.ndarray, point: np.ndarray, axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far points [n, 3] lie away from a line, and along it from `point`."""
    arm = points - point
    along = arm @ axis
    return lengths(arm - np.outer(along, axis)), along


def _is_helical(flank: _Flank) -> bool:
    return _is_threadlike(flank) and flank.turns >= LEAST_TURNS / 2 and flank.off < OFF_HELIX * flank.lean * abs(flank.climb)


def _is_ring(flank: _Flank) -> bool:
    steep = FLANK[0] <= flank.lean <= FLANK[1]
    return _is_threadlike(flank) and steep and abs(flank.climb) < NO_LEAD * flank.outer and flank.off < OFF_RING * flank.outer


def _is_threadlike(flank: _Flank) -> bool:
    one_sided = max(flank.outward, 1 - flank.outward) > ONE_SIDED
    return one_sided and flank.lean > LEANS and flank.inner > SLIMMEST * flank.outer


def _gather(flanks: Sequence[_Flank]) -> Iterator[list[_Flank]]:
    """Flanks about one axis that climb alike and face the same side, the largest of each group first."""
    groups: list[list[_Flank]] = []
    for flank in flanks:
        group = next((g for g in groups if _go_together(g[0], flank)), None)
        if group is None:
            groups.append([flank])
        else:
            group.append(flank)
    yield from groups


def _go_together(one: _Flank, two: _Flank) -> bool:
    alike = abs(one.climb - two.climb) <= max(ALIKE * abs(one.climb), NO_LEAD * one.outer / 2)
    aside = float(measure_to_axis(two.point[None], one.point, one.axis)[0][0])
    aligned = abs(float(one.axis @ two.axis)) > ALIGNED and aside < BESIDE * one.outer
    slack = BESIDE * one.outer
    if _is_ring(one):  # rings are as deep as each other, a helix may be in strips
        meets = max(abs(one.inner - two.inner), abs(one.outer - two.outer)) <= slack
    else:
        meets = max(one.inner, two.inner) <= min(one.outer, two.outer) + slack
    return alike and aligned and meets and (one.outward > 0.5) == (two.outward > 0.5)


def _tell_helix(facets: Facets, group: Sequence[_Flank]) -> Thread | None:
    """The thread that flanks are of which climb alike, if it has turns enough and flanks that lean both ways."""
    first, members = group[0], np.concatenate([flank.facets for flank in group])
    lean, area = facets.normals[members] @ first.axis, facets.areas[members]
    up = float(area[lean > LEANS].sum() / area[np.abs(lean) > LEANS].sum())
    if max(flank.turns for flank in group) < LEAST_TURNS or not BOTH < up < 1 - BOTH:
        return None
    lead = 2 * math.pi * first.climb
    starts = _count_starts(facets, members, first)
    return _thread(facets, group, abs(lead) / starts, lead) if starts else None


def _count_starts(facets: Facets, members: np.ndarray, first: _Flank) -> int:
    """How many threads wind about the axis side by side: how often flanks lean along it within a lead."""
    lead = 2 * math.pi * abs(first.climb)
    centers, lean = facets.centers[members], facets.normals[members] @ first.axis
    turned = (centers - first.point) @ first.axis - first.climb * measure_turns(centers, first.point, first.axis)
    steep = np.abs(lean) > LEANS
    place = (turned[steep] % lead / lead * BINS).astype(int) % BINS
    leaning = np.bincount(place, (facets.areas[members] * np.sign(lean))[steep], BINS)
    ways = np.sign(leaning[leaning != 0])
    return int(np.count_nonzero((ways > 0) & (np.roll(ways, 1) < 0)))


def measure_turns(points: np.ndarray, point: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """The angles [n] of points [n, 3] about a line."""
    arm, across = points - point, _across(axis)
    return np.arctan2(arm @ np.cross(axis, across), arm @ across)


def _across(axis: np.ndarray) -> np.ndarray:
    """Some unit vector [3] across an axis."""
    across = np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())])
    return across / np.linalg.norm(across)


def _tell_rings(facets: Facets, group: Sequence[_Flank]) -> Thread | None:
    """The thread that cones of 60 degrees draw, if they stand at one distance and are as deep as a thread's."""
    up = [(flank.up > 0.5) == (float(flank.axis @ group[0].axis) > 0) for flank in group]
    sides = [sorted([f for f, u in zip(group, up, strict=True) if u == way], key=lambda f: _middle(f, group[0])) for way in (True, False)]
    if min(map(len, sides)) < LEAST_RINGS:
        return None
    steps = [np.diff([_middle(f, group[0]) for f in side]) for side in sides]
    pitch = float(np.median(np.concatenate(steps)))
    if any((np.abs(step - pitch) > ALIKE * pitch).any() for step in steps):
        return None
    depth = (group[0].outer - group[0].inner) / pitch
    return _thread(facets, group, pitch, 0.0) if DEPTH[0] <= depth <= DEPTH[1] else None


def _middle(flank: _Flank, first: _Flank) -> float:
    """Where the middle of a flank lies along the axis of the `first`."""
    return float((flank.point - first.point) @ first.axis) + (flank.low + flank.high) / 2 * float(flank.axis @ first.axis)


def _thread(facets: Facets, group: Sequence[_Flank], pitch: float, lead: float) -> Thread:
    """The thread of a group of flanks, with what hangs together with them in its place."""
    members, internal = np.concatenate([flank.facets for flank in group]), group[0].outward < 0.5
    whole = _flank_of(facets, _join(facets, [flank.facets for flank in group]))
    crest = _fit_crest(points_of(facets, members), whole or group[0], internal)
    point, axis = np.asarray(crest.point), np.asarray(crest.axis)
    away, along = measure_to_axis(points_of(facets, members), point, axis)
    root = float(away.max() if internal else away.min())
    reach, ends = sorted((root, crest.sizes[0])), (float(along.min()), float(along.max()))
    shown = _grow_over(facets, members, crest, (reach[0], reach[1]), (ends[0] - pitch, ends[1] + pitch), FLAT_END * pitch)
    return Thread(point, axis, *ends, pitch, lead, 2 * reach[0], 2 * reach[1], internal, shown)


def _fit_crest(points: np.ndarray, first: _Flank, internal: bool) -> Surface:
    """The cylinder through the crests among the corners [n, 3] of a thread's flanks: these lie on it, and far apart along the axis."""
    crest = Surface("cylinder", vec(first.point), vec(first.axis), (first.inner if internal else first.outer,))
    for window in AT_CREST:
        away, _ = measure_to_axis(points, np.asarray(crest.point), np.asarray(crest.axis))
        beyond = away.min() if internal else away.max()
        near = np.abs(away - beyond) < window * (first.outer - first.inner)
        if np.count_nonzero(near) < MIN_POINTS["cylinder"]:
            break
        scale = float(np.median(np.abs(away[near] - crest.sizes[0]))) + EXACT * first.outer
        fitted, _ = fit_surface("cylinder", points[near], start=crest, scale=scale)
        aside = float(measure_to_axis(np.asarray(fitted.point)[None], first.point, first.axis)[0][0])
        if abs(float(np.dot(fitted.axis, first.axis))) < ALIGNED or aside > BESIDE * first.outer:
            break
        crest = fitted
    return crest


def _grow_over(
    facets: Facets, members: np.ndarray, crest: Surface, reach: tuple[float, float], ends: tuple[float, float], flat: float
) -> np.ndarray:
    """The facets that hang together with `members` and lie between two cylinders and two `ends`: crests, roots and where these run out.

    Faces across the axis are none of them: a thread ends in these.
    """
    slack, point, axis = SLACK * (reach[1] - reach[0]), np.asarray(crest.point), np.asarray(crest.axis)
    away, along = (v.reshape(-1, 3) for v in measure_to_axis(facets.corners.reshape(-1, 3), point, axis))
    inner = reach[0] * math.cos(math.radians(SMOOTH_DEG / 2)) - slack  # corners that cuts made lie on chords
    inside = (away >= inner) & (away <= reach[1] + slack) & (along >= ends[0]) & (along <= ends[1])
    outside = np.bincount(facets.facet_of, ~inside.all(1), len(facets.areas)) > 0
    low, high = np.full(len(facets.areas), np.inf), np.full(len(facets.areas), -np.inf)
    np.minimum.at(low, facets.facet_of, along.min(1))
    np.maximum.at(high, facets.facet_of, along.max(1))
    own = np.zeros(len(facets.areas), bool)
    own[members] = True
    middle = measure_to_axis(facets.centers, point, axis)[0]
    around = middle >= reach[0] * math.cos(math.radians(SMOOTH_DEG)) - slack  # else a disc that fills the thread's end
    ends_it = (high - low < flat) & (np.abs(facets.normals @ axis) > ACROSS)
    allowed = own | (~outside & around & ~ends_it)
    one, two = facets.edges.T
    both = allowed[one] & allowed[two]
    _, label = components(one[both], two[both], len(facets.areas))
    return np.flatnonzero(allowed & np.isin(label, label[members]))
