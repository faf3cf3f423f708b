"""A cloud with sharp edges in place of its fillets and chamfers, as the search is to see it.

Between two faces that meet, the points tell an arc or a bevel from a corner (`edge_profile`). Those on it are moved onto the two faces,
half of it onto either, and keep how far they lie off it. Points in corners where several blends meet lie on no face of the sharp part and
are left out. A blend that runs in one direction alone, or about one axis, stays: a drawing has it as well.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from imdim.detection.edge_profile import Crossing, Profile, SeenEdge, Wedge, section_of, see_edge
from imdim.detection.noise import NoiseModel
from imdim.geometry.blended_edge import Track
from imdim.geometry.components import components
from imdim.geometry.edges import tracks_between
from imdim.geometry.surface import Patch, Surface, vec
from imdim.program.edges import EDGE_KINDS

REACHES = (0.025, 0.05, 0.07, 0.1)  # of the diagonal: how far about an edge points are looked at
CALM = 1.5e-4  # of the diagonal: how far points may be off at least
CLEAR = 3.0  # deviations of the noise: the smallest size that is taken off
SIDES = ("plane", "cylinder")
SLENDER = math.radians(1.5)  # half the angle of a cone that may be a cylinder
FEWEST = 20  # points of a face, and of a blend
BLUNT = 0.34  # sine of the least angle between two faces
COAXIAL = 2e-3  # of the diagonal, within which axes are one
INNER = 0.75  # of the radius of a round edge, beyond which points crowd about its axis
BIN = 4.0  # spacings, that bins along an edge are long
LONG = 1.5  # times its size, that a blend is long at least
ON = 4.0  # deviations of the noise within which a point lies on a blend
SHOWN = 0.6  # of the points before the faces that a blend meets, that lie on it
SURE, CHAIN_SURE = 8.0, 30.0  # nats, by which a blend is likelier than the corner, and all blends of a chain together
ONE_WAY = math.cos(math.radians(2.0))
JOIN = 1.5  # bins, within which blends may end that join
LIKE = 0.15  # by which sizes of blends that join may differ


@dataclass(frozen=True, eq=False)
class SharpCloud:
    """The points [m, 3] of a cloud without its `blends`, and the normals [m, 3] that they have on its faces, None where it has none."""

    points: np.ndarray
    normals: np.ndarray | None
    blends: tuple[CloudBlend, ...]


@dataclass(frozen=True, eq=False)
class CloudBlend:
    """A blend along a stretch of the track in which the carriers of two patches meet, by the numbers of these."""

    sides: tuple[int, int]
    track: Track
    wedge: Wedge
    low: float
    high: float
    profile: Profile
    gain: float

    @property
    def size(self) -> float:
        return max(self.profile.sizes)

    @property
    def ends(self) -> np.ndarray:
        """The points [2, 3] in which it begins and ends."""
        return self.track.at(np.array([self.low, self.high]), np.zeros((2, 2)))

    def along(self, points: np.ndarray, beyond: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Whether points [n, 3] lie along it, or `beyond` an end by no more, their places [n, 2] in the section, and their angles or
        lengths [n]."""
        t, section = section_of(self.track, points)
        if self.track.is_round:
            t = _about(t, (self.low + self.high) / 2)
            beyond /= self.track.radius
        return (t > self.low - beyond) & (t < self.high + beyond), section, t


def sharpen_cloud(
    points: np.ndarray, normals: np.ndarray | None, patches: Sequence[Patch], noise: NoiseModel, known: Sequence[CloudBlend] = ()
) -> SharpCloud | None:
    """A cloud [n, 3] whose surfaces are `patches` with sharp edges in the place of its blends; None where it shows none. Those `known` were
    taken off before: what goes on with them is a blend, too, where it runs in one direction alone."""
    blends = _choose(list(_blends(points, patches, noise)), patches, noise, known)
    if not blends:
        return None
    sigma = _deviation(noise)
    moved, turned = points.copy(), None if normals is None else normals.copy()
    taken, corner = np.zeros(len(points), bool), np.zeros(len(points), int)
    for blend in blends:
        along, section, t = blend.along(points, blend.size)
        before = along & _before(section, blend)
        crossing = Crossing.of(section, blend.profile, blend.wedge)
        on = before & ~taken & (np.abs(crossing.inside) < ON * sigma)
        place, side = _unroll(crossing, blend, on)
        moved[on] = blend.track.at(t[on], place)
        if turned is not None:
            turned[on] = _facing(turned[on], blend, t[on], side)
        taken |= on
        corner += before
    keep = taken | (corner < 2)
    return SharpCloud(moved[keep], None if turned is None else turned[keep], (*known, *blends))


def _deviation(noise: NoiseModel) -> float:
    return max(noise.sigma, CALM * noise.diagonal)


def _about(angles: np.ndarray, middle: float) -> np.ndarray:
    return middle + np.remainder(angles - middle + math.pi, 2 * math.pi) - math.pi


def _before(section: np.ndarray, blend: CloudBlend) -> np.ndarray:
    """Which places [n, 2] lie before both faces, where the blend is."""
    one, two = blend.profile.starts(blend.wedge)
    along, depth = blend.wedge.along @ section.T, blend.wedge.inward @ section.T
    near = np.linalg.norm(section, axis=1) < 2 * max(one, two)
    return near & (along[0] < one) & (along[1] < two) & (depth > -0.5 * blend.size).all(axis=0)


def _unroll(crossing: Crossing, blend: CloudBlend, on: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the points `on` a blend go in the section [m, 2], half of it to either face, and to which of them [m]."""
    share, inside = np.clip(crossing.share[on], 0, 1), crossing.inside[on]
    side = (share > 0.5).astype(int)
    starts = np.array(blend.profile.starts(blend.wedge))
    way = np.where(side == 0, 1 - 2 * share, 2 * share - 1) * starts[side]
    return blend.wedge.along[side] * way[:, None] + blend.wedge.inward[side] * inside[:, None], side


def _facing(old: np.ndarray, blend: CloudBlend, t: np.ndarray, side: np.ndarray) -> np.ndarray:
    """The normals [m, 3] of the faces that points at `t` [m] have gone to, on the side of the `old` ones [m, 3]."""
    new = blend.track.at(t, blend.wedge.inward[side]) - blend.track.at(t, np.zeros((len(t), 2)))
    return new * np.where((new * old).sum(1) < 0, -1.0, 1.0)[:, None]


# --- which blends there are ------------------------------------------------------------------------------------------


def _blends(points: np.ndarray, patches: Sequence[Patch], noise: NoiseModel) -> Iterator[CloudBlend]:
    """A blend for each stretch along which two patches meet in one."""
    carriers = {i: carrier for i, p in enumerate(patches) if len(p.points) >= FEWEST and (carrier := _side(p)) is not None}
    for i, j in combinations(carriers, 2):
        one, two = carriers[i], carriers[j]
        if one.kind == two.kind == "plane" and np.linalg.norm(np.cross(one.axis, two.axis)) < BLUNT:
            continue
        for track in tracks_between(*_about_one_axis(one, two), COAXIAL * noise.diagonal):
            yield from _along_track((i, j), track, points, (patches[i].points, patches[j].points), noise)


def _side(patch: Patch) -> Surface | None:
    """The carrier of a face that blends may lie beside: a plane or a cylinder, which few points show as a slender cone; None of others."""
    surface = patch.surface
    if surface.kind in SIDES:
        return surface
    if surface.kind != "cone" or surface.sizes[0] > SLENDER:
        return None
    axis, away = np.asarray(surface.axis), patch.points - np.asarray(surface.point)
    along = away @ axis
    radius = float(np.linalg.norm(away - along[:, None] * axis, axis=1).mean())
    return Surface("cylinder", vec(np.asarray(surface.point) + along.mean() * axis), surface.axis, (radius,))


def _about_one_axis(one: Surface, two: Surface) -> tuple[Surface, Surface]:
    """Two carriers, the axis of a cylinder along a plane's normal where it all but is."""
    if {one.kind, two.kind} != {"plane", "cylinder"}:
        return one, two
    flat, tube = (one, two) if one.kind == "plane" else (two, one)
    if abs(np.dot(flat.axis, tube.axis)) < ONE_WAY:
        return one, two
    tube = replace(tube, axis=flat.axis)
    return (flat, tube) if one.kind == "plane" else (tube, flat)


def _along_track(
    sides: tuple[int, int], track: Track, points: np.ndarray, own: tuple[np.ndarray, np.ndarray], noise: NoiseModel
) -> Iterator[CloudBlend]:
    reach = REACHES[-1] * noise.diagonal
    sections = [section_of(track, face) for face in own]
    near = [np.linalg.norm(section, axis=1) < reach for _, section in sections]
    if min(at.sum() for at in near) < FEWEST / 2:
        return
    for low, high in _stretches(track, [t[at] for (t, _), at in zip(sections, near, strict=True)], noise):
        wedge = _wedge(track, [section[at & _between(track, t, low, high)] for (t, section), at in zip(sections, near, strict=True)])
        if wedge is None or not _leaves_faces(track, wedge, low, high, points, noise):
            continue
        best: CloudBlend | None = None
        for seen in _views(track, wedge, low, high, points, noise):
            for kind in EDGE_KINDS:
                found = seen.likeliest(kind, SURE / 4)
                if found is None or (best is not None and seen.sharp - found[1] <= best.gain):
                    continue
                best = CloudBlend(sides, track, wedge, low, high, found[0], seen.sharp - found[1])
        if best is not None and best.gain > SURE and best.size > CLEAR * _deviation(noise) and _is_shown(best, points, noise):
            yield best


def _between(track: Track, t: np.ndarray, low: float, high: float) -> np.ndarray:
    """Which lengths or angles [n] along a track are in a stretch."""
    t = _about(t, (low + high) / 2) if track.is_round else t
    return (t > low) & (t < high)


def _wedge(track: Track, sections: Sequence[np.ndarray]) -> Wedge | None:
    """The wedge between two faces that have points at `sections`, [n, 2] each; None where a face has none, or lies on both sides of the
    other."""
    beside = zip(sections, track.normals[::-1], strict=True)
    signs = [float(np.median(np.sign(section @ normal))) if len(section) else 0.0 for section, normal in beside]
    return Wedge.of(track, (int(signs[1]), int(signs[0]))) if all(signs) else None


def _leaves_faces(track: Track, wedge: Wedge, low: float, high: float, points: np.ndarray, noise: NoiseModel) -> bool:
    """Whether some points near an edge lie inside both faces, as all do of a blend."""
    t, section = section_of(track, points)
    near = section[(np.linalg.norm(section, axis=1) < REACHES[2] * noise.diagonal) & _between(track, t, low, high)]
    return bool(((wedge.inward @ near.T).min(axis=0) > _deviation(noise)).sum() >= FEWEST / 4)


def _views(track: Track, wedge: Wedge, low: float, high: float, points: np.ndarray, noise: NoiseModel) -> Iterator[SeenEdge]:
    """The points along a stretch as far as some reaches."""
    t, section = section_of(track, points)
    for reach in (share * noise.diagonal for share in REACHES):
        if track.is_round and reach > INNER * track.radius:
            continue
        # what meets a round stretch at its ends goes on with it for the most part
        inset = (high - low) / 8 if track.is_round else min(reach, (high - low) / 4)
        own = section[_between(track, t, low + inset, high - inset)]
        seen = see_edge(own, wedge, reach, _deviation(noise), (0.0, 0.0))
        if len(seen.points) >= FEWEST / 2:
            yield seen


def _stretches(track: Track, spans: Sequence[np.ndarray], noise: NoiseModel) -> Iterator[tuple[float, float]]:
    """Where both faces have points beside a track: from one length or angle to another."""
    width = BIN * noise.spacing / (track.radius if track.is_round else 1.0)
    if track.is_round:
        start = max(map(_widest_gap, spans))[1]
        spans = [np.remainder(t - start, 2 * math.pi) + start for t in spans]
    low = max(t.min() for t in spans)
    high = min(t.max() for t in spans)
    count = int((high - low) / width)
    if count < 1:
        return
    edges = np.linspace(low, high, count + 1)
    held = np.all([np.histogram(t, edges)[0] > 0 for t in spans], axis=0)
    begin = np.flatnonzero(np.diff(np.concatenate([[0], held.astype(int), [0]])) == 1)
    end = np.flatnonzero(np.diff(np.concatenate([[0], held.astype(int), [0]])) == -1)
    for a, b in zip(begin, end, strict=True):
        yield float(edges[a]), float(edges[b])


def _widest_gap(angles: np.ndarray) -> tuple[float, float]:
    """How wide the widest gap between angles [n] is, and its middle."""
    every = np.sort(angles)
    gaps = np.diff(np.append(every, every[0] + 2 * math.pi))
    return float(gaps.max()), float(every[int(gaps.argmax())] + gaps.max() / 2)


def _is_shown(blend: CloudBlend, points: np.ndarray, noise: NoiseModel) -> bool:
    """Whether most of the points before both faces lie on the blend, and it is longer than wide."""
    along, section, _ = blend.along(points)
    before = along & _before(section, blend)
    length = (blend.high - blend.low) * (blend.track.radius if blend.track.is_round else 1.0)
    if before.sum() < FEWEST / 2 or length < LONG * blend.size:
        return False
    crossing = Crossing.of(section[before], blend.profile, blend.wedge)
    return bool(np.mean(np.abs(crossing.inside) < ON * _deviation(noise)) > SHOWN)


def _choose(found: Sequence[CloudBlend], patches: Sequence[Patch], noise: NoiseModel, known: Sequence[CloudBlend]) -> list[CloudBlend]:
    """Those blends that are smaller than their sides, which are no blends themselves, without chains that run in one direction or about one
    axis."""
    chosen: list[CloudBlend] = []
    blended: set[int] = set()
    for blend in sorted(found, key=lambda b: -b.gain):
        if not blended.isdisjoint(blend.sides):
            continue
        own = {i for i, patch in enumerate(patches) if i not in blend.sides and _lies_on(patch.points, blend, noise)}
        # a wall between two bevels lies between these as a bevel does between walls
        if max((len(patches[i].points) for i in own), default=0) < min(len(patches[i].points) for i in blend.sides):
            chosen.append(blend)
            blended |= own
    chosen = [b for b in chosen if blended.isdisjoint(b.sides)]
    if not chosen:
        return []
    links = [(i, j) for (i, a), (j, b) in combinations(enumerate(chosen), 2) if _join(a, b)]
    ends = np.array(links, int).reshape(-1, 2)
    group = components(ends[:, 0], ends[:, 1], len(chosen))[1]
    chains = [[chosen[k] for k in np.flatnonzero(group == g)] for g in range(group.max() + 1)]
    return [blend for chain in chains if _is_taken(chain, known, noise) for blend in chain]


def _is_taken(chain: Sequence[CloudBlend], known: Sequence[CloudBlend], noise: NoiseModel) -> bool:
    """Whether a chain is told for certain, and is more than a drawing has."""
    if _goes_on(chain, known, noise):
        return True
    return sum(blend.gain for blend in chain) > CHAIN_SURE and not _runs_one_way(chain)


def _lies_on(points: np.ndarray, blend: CloudBlend, noise: NoiseModel) -> bool:
    along, section, _ = blend.along(points, blend.size)
    on = along & _before(section, blend)
    if on.sum() < 0.7 * len(points):
        return False
    return bool(np.median(np.abs(Crossing.of(section[on], blend.profile, blend.wedge).inside)) < ON * _deviation(noise))


def _join(a: CloudBlend, b: CloudBlend) -> bool:
    """Whether two blends of about one size lie along one face."""
    return _is_alike(a, b) and not set(a.sides).isdisjoint(b.sides)


def _is_alike(a: CloudBlend, b: CloudBlend) -> bool:
    return a.profile.kind == b.profile.kind and abs(a.size - b.size) < LIKE * max(a.size, b.size)


def _goes_on(chain: Sequence[CloudBlend], known: Sequence[CloudBlend], noise: NoiseModel) -> bool:
    """Whether a chain begins or ends near a known blend of its size."""
    reach = JOIN * BIN * noise.spacing

    def meet(a: CloudBlend, b: CloudBlend) -> bool:
        return bool(np.linalg.norm(a.ends[:, None] - b.ends[None], axis=2).min() < reach + max(a.size, b.size))

    return any(_is_alike(a, b) and meet(a, b) for a in chain for b in known)


def _runs_one_way(chain: Sequence[CloudBlend]) -> bool:
    """Whether all blends of a chain run in one direction, or about one axis."""
    first = chain[0].track
    if any(b.track.is_round != first.is_round or abs(b.track.frame[:, 2] @ first.frame[:, 2]) < ONE_WAY for b in chain):
        return False
    off = [np.linalg.norm(np.cross(first.frame[:, 2], b.track.origin - first.origin)) for b in chain]
    return not first.is_round or bool(max(off) < LIKE * first.radius)
