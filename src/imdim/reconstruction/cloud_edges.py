"""Edges of a program that a cloud shows to be rounded or bevelled.

Along each edge of the solid the points say how much likelier a fillet or a chamfer is than the sharp corner. Edges that one size explains
are one feature. It is taken where it shortens the description of the points: a size costs half the logarithm of their number (Schwarz
1978), an edge as much as it takes to name it. How well a size is known follows from the likelihood, and it is rounded only within that.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from imdim.deadline import NEVER, Deadline
from imdim.detection.edge_profile import BLUR, SMALLEST, Crossing, Profile, SeenEdge, Wedge, section_of, see_edge
from imdim.detection.noise import NoiseModel
from imdim.geometry.blended_edge import BlendedEdge
from imdim.geometry.edges import find_edges
from imdim.geometry.kernels import program_sdf
from imdim.geometry.sampling import subsample
from imdim.geometry.solid_edges import FacedSolid
from imdim.geometry.surface import Surface, signed_distance
from imdim.numbers.design_values import FINE, NORMAL_95, ON_GRID, finest_grid, grids, round_to_grid, row_of
from imdim.program.edges import EDGE_KINDS, EdgeFeature, EdgeKind, Face, describe_size, name_edges
from imdim.program.tree import Program, leaves
from imdim.reconstruction.edge_features import EdgesFound, MeasuredSizes, tidy_sizes
from imdim.target.target import sample_surface

PROBE = 1e-3  # of the diagonal: a size by which edges are looked for
REACH = 0.1  # of the diagonal: how far about an edge points are looked at, at most,
SHARES = (0.2, 0.45, 1.0)  # and shares of that
INNER = 0.75  # of the radius of a round edge, beyond which points crowd about its axis
OPEN = 0.75  # of the way to the next face, which may be blended too
SAME_FACE = 1e-3  # of the diagonal, within which a place of the surface is one of a face
SEED = 0  # of places on the surface
CALM = 1.5e-4  # of the diagonal: how far points may be off at least
AMPLE = 0.5  # of a reach, before which a blend ends that is well seen
INSET = 0.25  # of an edge's length at most, by which what meets it at its ends is left out
CLEAR = 8.0  # deviations of the noise, that points are looked at about an edge at least
MEDIAN = math.sqrt(math.pi / 2)  # how much farther off a median is than a mean
BAND = 4.0  # deviations of the noise, within which points are a face's
ALONG = 64  # places along an edge
MARGINS, ENOUGH = (0.06, 0.04, 0.025), 25  # of the diagonal: how far from all edges; and points, that tell where a face is
FEWEST = 10  # points about an edge, that tell anything
MOST_EDGES = 400
SAMPLED = 4096  # points that tell how far off the program they are
DOUBT = 2e-3  # nats per point that mean nothing
SURE = 3.0  # nats beside the name of an edge: among all edges of a part the noise makes one that is blended one time in twenty
EITHER = 3.0  # nats, by which a kind must be likelier than the other: odds of twenty to one
LIKE = 0.01  # of a size, by which sizes of one feature may differ beside what is known of them
ON = 3.0  # deviations of the noise within which a point lies on a blend
UNEQUAL = 12.0  # nats, by which two distances must be likelier than one: where a program is off its points they are two anywhere
SLANT = 3.0  # deviations of the noise, below which the smaller of two distances is that of a face which slants, or lies off its place
RATIO_OF_TWO = 1.1  # between the distances of a bevel that are two
SHARED = (0.5, 0.2, 0.06, 0.015, 0.003)  # of a size: the rows of sizes that all edges of a feature are tried with
SAME, COARSEST = 1e-9, 1e-4  # of a program's largest number: what is on a grid, and the finest grid
STRANGE = 0.35  # of the points before the faces that a blend meets, that lie on it no better than anywhere


class LikelyBlend(NamedTuple):
    """The likeliest blend of a kind along an edge, and by how many nats it is likelier than the sharp corner."""

    profile: Profile
    gain: float


@dataclass(frozen=True, eq=False)
class ReadEdge:
    """A stretch of an edge between the two faces of `pair`, its points as far as some reaches, narrowest first, and its readings by
    kind."""

    pair: tuple[Face, Face]
    edge: BlendedEdge
    views: tuple[SeenEdge, ...]
    readings: dict[EdgeKind, LikelyBlend]

    def view(self, profile: Profile) -> SeenEdge | None:
        """The points as far as they have to be seen to tell of a blend."""
        seen = [view for view in self.views if view.has_room(profile)]
        return next((view for view in seen if max(profile.starts(view.wedge)) < AMPLE * view.reach), seen[-1] if seen else None)

    def gain(self, profile: Profile) -> float:
        """By how many nats a blend is likelier here than the sharp corner, its sizes known no better than those of one feature agree; 0
        where there is no room to tell."""
        view = self.view(profile)
        if view is None:
            return 0.0
        return view.sharp - _cost(profile, [view], LIKE) - DOUBT * len(view.points)

    @cached_property
    def best(self) -> float:
        """The gain of the likeliest blend."""
        return max((self.gain(reading.profile) for reading in self.readings.values()), default=0.0)


def find_cloud_edges(program: Program, points: np.ndarray, noise: NoiseModel, deadline: Deadline = NEVER) -> EdgesFound:
    """The fillets and chamfers that `points` [n, 3] with this noise show along the edges of a program, all in one unit; as far as there is
    time until the `deadline`."""
    solid = FacedSolid.of(program)
    read, unseen = _read_edges(program, solid, points, _blurring(program, points, noise), deadline)
    common = _common_grid(program)
    features, measured, doubtful = list[EdgeFeature](), list[MeasuredSizes](), list[str]()
    for profile, own in _gather(read, len(points)):
        sure = _measure_sizes(profile, own)
        if _is_told(profile, own):
            features.append(_feature(replace(profile, sizes=_round_sizes(sure, noise, common)), own))
            measured.append(sure)
        else:
            doubtful.append(_say_either(profile, own))
    said = (*doubtful, *_say_unseen(len(read), unseen, deadline))
    return EdgesFound(name_edges(features), said, tuple(measured))


def _blurring(program: Program, points: np.ndarray, noise: NoiseModel) -> NoiseModel:
    """The noise about the surface of a program: what the points are off it in the middle, between what was measured and twice that."""
    off = 1.4826 * float(np.median(np.abs(program_sdf(program, subsample(points, SAMPLED)))))
    return replace(
        noise, sigma=float(np.clip(off, max(noise.sigma, CALM * noise.diagonal), max(2 * noise.sigma, 2 * CALM * noise.diagonal)))
    )


def _read_edges(
    program: Program, solid: FacedSolid, points: np.ndarray, noise: NoiseModel, deadline: Deadline
) -> tuple[list[ReadEdge], int]:
    """What the points say of each stretch of each edge, and of how many stretches they say nothing."""
    pairs = solid.edges()[:MOST_EDGES]
    if not pairs:
        return [], 0
    probe = EdgeFeature("fillet", (PROBE * noise.diagonal,), tuple(pairs))
    shown = sample_surface(solid.mesh.vertices, solid.mesh.faces, SAMPLED, np.random.default_rng(SEED))[0]
    carriers = dict(zip(solid.faces, solid.surfaces, strict=True))
    off = {face: np.abs(signed_distance(carriers[face], shown)) > SAME_FACE * noise.diagonal for pair in pairs for face in pair}
    edges, taken = find_edges(program, [probe]).edges, list[BlendedEdge]()
    for edge in edges:
        middle = edge.points(3)[1:2]
        if all(other.distances(middle)[0] > probe.sizes[0] for other in taken):
            taken.append(edge)
    offsets = _face_offsets(program, carriers, taken, points, noise)
    read, unseen = list[ReadEdge](), 0
    for edge in taken:
        one, two = pairs[edge.edge]
        untold = 0.0, noise.sigma / math.sqrt(ENOUGH)
        view = _FacedEdge(edge, shown[off[one] & off[two]], (offsets.get(one, untold), offsets.get(two, untold)))
        known = None if deadline.has_passed() else _read((one, two), view, points, noise)
        if known is None:
            unseen += 1
        else:
            read.append(known)
    return read, unseen


def _face_offsets(
    program: Program, carriers: Mapping[Face, Surface], edges: Sequence[BlendedEdge], points: np.ndarray, noise: NoiseModel
) -> dict[Face, tuple[float, float]]:
    """How far the points of each face lie beyond its carrier, in the middle of those that are far from all edges, and the deviation of
    that; of faces without such points nothing is told."""
    if not edges:
        return {}
    near = points[np.abs(program_sdf(program, points)) < BAND * noise.sigma]
    away = KDTree(np.concatenate([edge.points(ALONG) for edge in edges])).query(near)[0]
    out = {}
    for face, surface in carriers.items():
        off = signed_distance(surface, near)
        on = np.abs(off) < BAND * noise.sigma
        for margin in MARGINS:
            own = off[on & (away > margin * noise.diagonal)]
            if len(own) >= ENOUGH:
                out[face] = float(np.median(own)), MEDIAN * noise.sigma / math.sqrt(len(own))
                break
    return out


class _FacedEdge(NamedTuple):
    """An edge, places [m, 3] of other faces, before which the look ends, and how far points of its faces lie beyond these, with the
    deviation of that."""

    edge: BlendedEdge
    others: np.ndarray
    offsets: tuple[tuple[float, float], tuple[float, float]]


def _read(pair: tuple[Face, Face], view: _FacedEdge, points: np.ndarray, noise: NoiseModel) -> ReadEdge | None:
    """The likeliest blend of each kind along an edge; None where too few points are near it."""
    edge, track = view.edge, view.edge.track
    wedge = Wedge.of(track, edge.stretch.sides)
    (one, known), (two, also_known) = view.offsets
    inside = edge.stretch.sides[0] * one, edge.stretch.sides[1] * two
    nearest = float(np.linalg.norm(_along(edge, view.others, math.inf)[1], axis=1).min(initial=np.inf))
    widest = min(REACH * noise.diagonal, OPEN * nearest, INNER * track.radius if track.is_round else np.inf)
    views = []
    for reach in (widest * share for share in SHARES if widest * share > CLEAR * noise.sigma):
        seen = see_edge(_along(edge, points, reach)[1], wedge, reach, noise.sigma, inside, (known, also_known))
        if len(seen.points) >= FEWEST:
            views.append(seen)
    readings: dict[EdgeKind, LikelyBlend] = {}
    for seen in views:
        for kind in EDGE_KINDS:
            best = _read_kind(seen, kind)
            if best is None:
                continue
            gain = seen.sharp - best[1] - DOUBT * len(seen.points)
            if kind not in readings or gain > readings[kind].gain:
                readings[kind] = LikelyBlend(best[0], gain)
    return ReadEdge(pair, edge, tuple(views), readings) if views else None


def _along(edge: BlendedEdge, points: np.ndarray, inset: float) -> tuple[np.ndarray, np.ndarray]:
    """The lengths or angles [m] and places [m, 2] in the section of those points [n, 3] that lie along an edge, no nearer to its ends than
    `inset`, or than a part of its length."""
    t, section = section_of(edge.track, points)
    if edge.track.is_round:
        middle = (edge.stretch.low + edge.stretch.high) / 2
        t = middle + np.remainder(t - middle + math.pi, 2 * math.pi) - math.pi
    if not edge.stretch.is_closed:
        inset = min(inset / (edge.track.radius if edge.track.is_round else 1.0), INSET * (edge.stretch.high - edge.stretch.low))
        own = (t > edge.stretch.low + inset) & (t < edge.stretch.high - inset)
        t, section = t[own], section[own]
    return t, section


def _read_kind(seen: SeenEdge, kind: EdgeKind) -> tuple[Profile, float] | None:
    """The likeliest blend of a kind that the points follow; a bevel of two distances only where these are worth another number, and neither
    is within the noise."""
    best = seen.likeliest(kind)
    if best is not None and kind == "chamfer" and best[1] + EITHER < seen.sharp:
        other = seen.unequal(best[0])
        worth = 0.5 * math.log(len(seen.points)) + UNEQUAL
        small, large = sorted(other[0].sizes)
        if large > RATIO_OF_TWO * small and small > SLANT * seen.sigma and other[1] + worth < best[1]:
            best = other
    return best if best is not None and _is_followed(seen, best[0]) else None


def _is_followed(seen: SeenEdge, profile: Profile) -> bool:
    """Whether the points before the faces that a blend meets lie on it."""
    starts = profile.starts(seen.wedge)
    along = seen.wedge.along @ seen.points.T
    depth = seen.wedge.inward @ seen.points.T
    before = (along[0] < starts[0]) & (along[1] < starts[1]) & (depth > -ON * seen.sigma).all(axis=0)
    if not before.any():
        return False
    crossing = Crossing.of(seen.points[before], profile, seen.wedge)
    return bool(np.mean(np.abs(crossing.inside) > ON * seen.sigma) < STRANGE)


def _gather(read: Sequence[ReadEdge], count: int) -> Iterator[tuple[Profile, list[ReadEdge]]]:
    """Blends with the edges that each explains, as long as one shortens the description of the points."""
    rest = list(read)
    price, naming = 0.5 * math.log(count) + math.log(len(EDGE_KINDS)), math.log(max(len(read), 2)) + SURE
    while rest:
        offers = [r.profile for e in rest for r in e.readings.values() if r.gain > 0]
        explained = [(*_explain(profile, rest, price, naming), profile) for profile in offers]
        worth, own, profile = max(explained, key=lambda found: found[0], default=(0.0, [], None))
        if profile is None or worth <= price:
            return
        rest = [e for e in rest if e not in own]
        if _is_worth(profile, own, price + naming):
            yield profile, own


def _explain(profile: Profile, edges: Sequence[ReadEdge], price: float, naming: float) -> tuple[float, list[ReadEdge]]:
    """The edges that a blend explains, and by how many nats they are told shorter by it: named one by one, or all at once in which a face
    meets another feature. What another blend explains better by its `price` and
    the edge's `naming` is left to it."""
    gains = {e: gain for e in edges if (gain := e.gain(profile)) > e.best - price - naming}
    loops = defaultdict[object, list[ReadEdge]](list)
    for e in gains:
        for face, other in (e.pair, e.pair[::-1]):
            loops[face, other.leaf, e.edge.stretch.is_convex].append(e)
    worth, own = 0.0, list[ReadEdge]()
    for loop in sorted(loops.values(), key=lambda loop: -sum(gains[e] for e in loop)):
        rest = [gains[e] for e in loop if e not in own]
        at_once = sum(rest) - naming
        if len(rest) > 1 and at_once > sum(max(gain - naming, 0.0) for gain in rest):
            worth += at_once
            own += [e for e in loop if e not in own]
    alone = [e for e, gain in gains.items() if gain > naming and e not in own]
    return worth + sum(gains[e] - naming for e in alone), own + alone


def _is_told(profile: Profile, own: Sequence[ReadEdge]) -> bool:
    """Whether some edges show that a blend is of its kind, and not of the other."""
    seen = _views(profile, own)
    rival = _rival(profile, own)
    return rival is None or _cost(rival, seen) > _cost(_share_size(profile, seen), seen) + EITHER


def _rival(profile: Profile, own: Sequence[ReadEdge]) -> Profile | None:
    """The likeliest blend of the other kind for some edges; None where they have no room for one."""
    seen = _views(profile, own)
    other: EdgeKind = "chamfer" if profile.kind == "fillet" else "fillet"
    sizes = [best[0].sizes[0] for view in seen if (best := view.likeliest(other)) is not None]
    return _share_size(Profile(other, (float(np.median(sizes)),)), seen) if sizes else None


def _views(profile: Profile, own: Sequence[ReadEdge]) -> list[SeenEdge]:
    return [view for edge in own if (view := edge.view(profile)) is not None]


def _cost(profile: Profile, seen: Sequence[SeenEdge], blur: float = 0.0) -> float:
    """The negative log-density of the points of some edges with one blend, whose sizes are blurred by a share."""
    return sum(min(view.cost(p, blur * max(p.sizes)) for p in profile.either_way) for view in seen)


def _is_worth(profile: Profile, own: Sequence[ReadEdge], price: float) -> bool:
    """Whether one blend of some edges, as likely as it can be made, still shortens the description of their points."""
    seen = _views(profile, own)
    if not seen or max(_share_size(profile, seen).sizes) < SMALLEST * seen[0].sigma:
        return False
    return sum(view.sharp for view in seen) - _cost(_share_size(profile, seen), seen) > price + DOUBT * sum(
        len(view.points) for view in seen
    )


def _measure_sizes(profile: Profile, own: Sequence[ReadEdge]) -> MeasuredSizes:
    """The likeliest sizes of a blend of some edges. What is not known of their faces is the same for edges that share one, and does not
    grow less with their number."""
    seen = _views(profile, own)
    best = _share_size(profile, seen)
    weights = np.array([view.deviation(best) ** -2.0 for view in seen])
    if not weights.sum():
        return MeasuredSizes(tuple(sorted(map(float, best.sizes))), math.inf)
    by_faces = np.array([view.deviation_by_faces(best) for view in seen])
    deviation = math.sqrt(1 / weights.sum() + float(np.average(by_faces**2, weights=weights)))
    return MeasuredSizes(tuple(sorted(map(float, best.sizes))), NORMAL_95 * deviation)


def _share_size(profile: Profile, seen: Sequence[SeenEdge]) -> Profile:
    """The likeliest blend of some edges that have one, among those with the proportions of a given one."""
    for width in SHARED:
        row = [profile.scale(1 + width * step) for step in np.linspace(-1, 1, 9)]
        profile = min(row, key=lambda p: _cost(p, seen, BLUR * width / 4))
    return profile


def _round_sizes(sure: MeasuredSizes, noise: NoiseModel, common: float) -> tuple[float, ...]:
    """Sizes on the coarsest grid that their interval allows; of a calm cloud rounded as those of a mesh."""
    if not noise.blurs:
        return tidy_sizes(sure.sizes)
    return tuple(_round(size, sure.half, common) for size in sure.sizes)


def _round(size: float, half: float, common: float) -> float:
    if not 0 < half < math.inf:
        return size
    finest = float(finest_grid(half, common))
    offers = (round_to_grid(size, grid) for grid in grids(10 * max(size, finest), finest) if grid >= finest)
    trimmed = round_to_grid(size, 10.0 ** math.floor(math.log10(2 * FINE * half)))
    return next((offer for offer in offers if offer > 0 and abs(offer - size) <= half), trimmed)


def _common_grid(program: Program) -> float:
    """The coarsest decimal grid on which most numbers of a program lie; 0 where they lie on none."""
    numbers = np.concatenate([row_of(leaf) for leaf in leaves(program)])
    numbers = numbers[np.abs(numbers) > 0]
    largest = float(np.abs(numbers).max(initial=0.0))
    if not largest:
        return 0.0
    on = ((grid, np.abs(numbers - np.round(numbers / grid) * grid) < SAME * largest) for grid in grids(largest, COARSEST * largest))
    return next((grid for grid, lie in on if lie.mean() >= ON_GRID), 0.0)


def _feature(profile: Profile, own: Sequence[ReadEdge]) -> EdgeFeature:
    """The feature of a blend's edges, the first face of each that along which it is smaller."""
    small, *large = sorted(profile.sizes)
    edges = [edge.pair if not large or _runs_first(edge, small, large[0]) else (edge.pair[1], edge.pair[0]) for edge in own]
    return EdgeFeature(profile.kind, (small, *large), tuple(dict.fromkeys(edges)))


def _runs_first(edge: ReadEdge, small: float, large: float) -> bool:
    """Whether a bevel of two distances has the smaller along the first face of an edge."""
    one, two = Profile("chamfer", (small, large)).either_way
    return all(view.cost(one) <= view.cost(two) for view in _views(one, [edge]))


def _say_either(profile: Profile, own: Sequence[ReadEdge]) -> str:
    """A sentence about edges whose kind the points leave open."""
    rival = _rival(profile, own)
    both = (describe_size(p.kind, [float(f"{s:.2g}") for s in p.sizes]) for p in (profile, rival) if p is not None)
    return f"{len(own)} edges have a {' or a '.join(both)}, the points do not tell which: these are sharp"


def _say_unseen(read: int, unseen: int, deadline: Deadline) -> tuple[str, ...]:
    """A sentence about edges of which the points do not tell whether they are sharp."""
    if not unseen:
        return ()
    why = "for lack of time" if deadline.has_passed() else "for lack of points or of room beside them"
    return (f"{unseen} of {read + unseen} edges could not be told to be sharp, rounded or bevelled, {why}: these are sharp",)
