"""The facets of a mesh that a carrier explains, and the carrier that fits them: collected, fitted and doubted in turn."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from imdim.detection.facets import Facets, Growing, MeshSurfaceConfig, points_of
from imdim.detection.fit_ellipsoid import lies_on
from imdim.detection.fit_surface import MIN_POINTS, fit_surface
from imdim.detection.member_kernels import Carrier, follow, lie_within
from imdim.geometry.rotations import frame_from_axis
from imdim.geometry.sampling import subsample
from imdim.geometry.surface import FRAMED, Surface, is_spindle, normals, signed_distance, unit, vec

# facets along a patch; four circles of corners may lie on a torus by mere symmetry, three similar ellipses on an ellipsoid
LEAST_STEPS = {"sphere": 2.5, "torus": 4.5, "ellipsoid": 3.5}
WIDER, FAR_MORE = 3.0, 1.5  # tolerances about a carrier, in which times as many facets as lie on it are far more
LOPSIDED, LOPSIDED_STEPS = 0.3, 0.6  # of what a ball's band spans, by which its middle is off the equator; what that is worth in steps
LEAN = 0.6  # of what it leans by at a corner: what a facet may lean by in its middle
LEVEL = math.radians(2.0)  # beside that
WHOLE_TUBE = 1.0  # further steps that a tube counts as along its bend: an elbow of 16 sides has four, and no cone goes all around
NEEDLES = 1e-3  # of the largest facet's area, up to which one tells nothing: any two strips and a corner lie on a cylinder
SLIVERS = 0.3  # of a facet's area, up to which triangles tell nothing of how it leans
MOSTLY = 0.75  # of its corners, that lie on an elliptic cylinder
PARTED = 0.3  # of what a sphere's facets span one way, from which a gap between them parts two bands,
LEVEL_SHARE = 0.02  # of which each is between two circles, where its corners are as near to these
UNROUND = 4e-4  # of the diagonal, by which the semi-axes of an ellipse differ; with less a circle does it
FEW_STRIPS, STANDS_OUT = 7, 4.0  # of a cylinder, among which one that is wider by more than this factor is a flat between strips of others
ONE_FACET = 0.7  # of a curved patch's area: one facet that has more of it is a flat between strips of roundings
DRAWN_FLAT = 0.01  # of the diagonal: OpenSCAD's usual 30 sides lie a fifth of that within a circle as large as the part
FEW_SIDES = 12.5  # of a circle, which a person may have meant as a polygon's
POLYGON = 0.003  # of the part's volume, by which it would be another with the circle instead of the polygon
LEAST_TURN = {"ellipsoid": 30.0, "elliptic": 60.0}  # degrees, on the ball; any smooth surface is one for less


def settle(guess: Surface, state: Growing) -> tuple[Surface, np.ndarray] | None:
    """Refit on the members and collect again until nothing is added; None when there are too few facets."""
    facets, config = state.facets, state.config
    surface, members, loose = guess, members_of(guess, state, 5.0), 5.0
    if len(members) < 2 or not _sane(surface, facets.diagonal):
        return None
    for _ in range(4):
        fitted = _refit(surface, members, state)
        if fitted is None:
            return None
        surface, grown = fitted
        if len(grown) == len(members) and loose == 1.0:
            break
        members, loose = grown, 1.0
        if len(members) < 2:
            return None
    # some facets lie on a carrier that leans, too: where far more are near it, and these lie on one more exactly, that is theirs
    near = members_of(surface, state, WIDER)
    if len(near) > FAR_MORE * len(members) and (fitted := _refit(surface, near, state)) is not None:
        grows = facets.areas[fitted[1]].sum() > facets.areas[members].sum()
        if grows and _typical_miss(*fitted, facets) < _typical_miss(surface, members, facets):
            surface, members = fitted
    if not believable(surface, members, facets):
        return None
    surface = _polish(surface, facets, members, config)
    # the corners of an ellipse that lie on chords are few: cuts across the axis leave theirs on it
    share = MOSTLY if surface.kind == "elliptic" else 0.5
    was_drawn = surface.kind not in FRAMED or lies_on(surface, points_of(facets, members), facets.diagonal, share)
    return (surface, members) if was_drawn else None


def _typical_miss(surface: Surface, members: np.ndarray, facets: Facets) -> float:
    """How far off a carrier half of the corners of its facets lie at most."""
    return float(np.median(np.abs(signed_distance(surface, points_of(facets, members)))))


def _refit(surface: Surface, members: np.ndarray, state: Growing) -> tuple[Surface, np.ndarray] | None:
    """A carrier that fits its facets, and the facets that lie on that; None where there are too few, or it does not fit."""
    facets, config = state.facets, state.config
    points = points_of(facets, members)
    if len(points) < max(7, MIN_POINTS[surface.kind]):
        return None
    surface, rms = _fit_carrier(surface, subsample(points, 1500), facets, members, config)
    if not _sane(surface, facets.diagonal) or rms > config.on_surface * facets.diagonal:
        return None
    return surface, members_of(surface, state, 1.0)


def _fit_carrier(
    surface: Surface, points: np.ndarray, facets: Facets, members: np.ndarray, config: MeshSurfaceConfig
) -> tuple[Surface, float]:
    """The carrier through corners [n, 3] of its facets, and their rms distance to it.

    The normals of a cylinder's strips are exact, so they give its axis. Corners on chords lie off by the sagitta: where the plain fit
    is not good a robust one follows those on the curve.
    """
    hold = ""
    if surface.kind == "cylinder":
        n = facets.normals[members] * np.sqrt(facets.areas[members])[:, None]
        spread, vectors = np.linalg.eigh(n.T @ n)
        if spread[1] > 1e-3 * spread[2]:
            surface, hold = replace(surface, axis=vec(vectors[:, 0])), "axis"
    tolerance = config.on_surface * facets.diagonal
    fitted, rms = fit_surface(surface.kind, points, start=surface, iterations=12, hold=hold)
    if rms > 0.3 * tolerance:
        return fit_surface(surface.kind, points, start=surface, scale=0.5 * tolerance, iterations=12, hold=hold)
    return fitted, rms


def _polish(surface: Surface, facets: Facets, members: np.ndarray, config: MeshSurfaceConfig) -> Surface:
    """Reweighted twice with the scale of the better half: a design's corners are exact but for those that cuts made."""
    points = points_of(facets, members)
    hold = "axis" if surface.kind == "cylinder" else ""
    for _ in range(2):
        scale = 3 * float(np.median(np.abs(signed_distance(surface, points)))) + 1e-7 * facets.diagonal
        polished, rms = fit_surface(surface.kind, points, start=surface, scale=scale, iterations=12, hold=hold)
        if not _sane(polished, facets.diagonal) or not rms < config.on_surface * facets.diagonal:
            break
        surface = polished
    return surface


def sagitta(surface: Surface, facets: Facets, members: np.ndarray) -> float:
    """How far the chords leave the carrier: where a cut crosses a facet its new corners lie on the chord, not on the curve."""
    middle = facets.corners[facets.triangles(members)].mean(1)
    return 1.5 * float(np.abs(signed_distance(surface, middle)).max())


def _sane(surface: Surface, diagonal: float) -> bool:
    if surface.kind == "cone":
        return 0.01 < surface.sizes[0] < 1.56
    if is_spindle(surface):
        return False
    if surface.kind == "elliptic" and abs(surface.sizes[0] - surface.sizes[1]) < UNROUND * diagonal:
        return False
    # a sphere or torus far larger than the part is a flat with noise; long gentle arcs are drawn with cylinders
    largest = 6.0 if surface.kind == "cylinder" else 2.0
    return all(1e-5 * diagonal < s < largest * diagonal for s in surface.sizes)


def members_of(surface: Surface, state: Growing, slack: float, among: np.ndarray | None = None, curved: bool = False) -> np.ndarray:
    """Free facets, of all or `among` some, whose every corner lies on the carrier within `slack` tolerances and whose normal follows it.
    Those known to be of a `curved` face are no flats with their corners on the carrier, however they lean."""
    facets, config = state.facets, state.config
    triangles = np.flatnonzero(state.free[facets.facet_of]) if among is None else facets.triangles(among)
    state.spent += len(triangles)
    carrier = Carrier.of(surface)
    fine = triangles[lie_within(carrier, facets.corners, facets.turns, triangles, slack * config.on_surface * facets.diagonal)]
    if not len(fine):  # as of most guesses
        return fine
    facing = facets.normals[facets.facet_of[fine]]
    along, middle, off = follow(carrier, facets.corners, facing, fine, 10 * config.on_surface * facets.diagonal)
    if not curved:
        along[_lean(facets, fine, along, middle)] = 0.0
    own, count = np.unique(facets.facet_of[fine[along >= np.cos(np.radians(config.follow_deg))]], return_counts=True)
    whole = own[count == facets.triangle_counts[own]]
    return whole if curved else _without_flats(whole, facets.facet_of[fine], along, off, state)


def _lean(facets: Facets, fine: np.ndarray, along: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """Which of the `fine` triangles [t] are of facets that follow a carrier at their corners alone, as a disc inside a torus's topmost
    circle does: most of them leans in its `middle` [t] by almost as much as at the corners, both given as cosines, where `along` [t] is the
    least of these. Slivers along a facet's edge, where a cut has split it, lean as that edge does and tell nothing."""
    leans = np.arccos(np.minimum(middle, 1)) > LEAN * np.arccos(np.minimum(along, 1)) + LEVEL
    owners = facets.facet_of[fine]
    leaning = np.bincount(owners, facets.triangle_areas[fine] * leans, len(facets.areas))
    return (leaning > SLIVERS * facets.areas)[owners]


def to_ball(surface: Surface, direction: np.ndarray) -> np.ndarray:
    """Normals [n, 3] of an ellipsoid, or an elliptic cylinder, as they are on the unit ball, or the round one, that it is stretched from,
    in its frame."""
    return unit((direction @ surface.frame) * (*surface.sizes, 1.0)[:3])


def _without_flats(members: np.ndarray, owners: np.ndarray, along: np.ndarray, off: np.ndarray, state: Growing) -> np.ndarray:
    """Drop facets that span much more of the curve than is typical: the flat of a D-shaft has its corners on the shaft.

    By the least cosine `along` [t] that triangles of facets `owners` [t] make with the carrier, and how far `off` it their middles are [t]:
    a slight span counts only where the middle leaves the carrier too, as a wall between two strips lies on a cylinder that is far too wide.
    """
    if len(members) < 3:
        return members
    facets, config = state.facets, state.config
    worst, farthest = np.ones(len(facets.areas)), np.zeros(len(facets.areas))
    np.minimum.at(worst, owners, along)
    np.maximum.at(farthest, owners, off)
    span = np.arccos(np.clip(worst[members], -1, 1))
    slight = (span < np.radians(4.0)) & (farthest[members] < config.loose * facets.diagonal)
    return members[(span <= config.wide_span * np.median(span)) | slight]


def believable(surface: Surface, members: np.ndarray, facets: Facets) -> bool:
    """Enough facets for the turn they make: two coarse strips are a chamfer, not a cylinder."""
    least = {"cylinder": 3, "cone": 3, "sphere": 6, "torus": 8, "ellipsoid": 12, "elliptic": 7}[surface.kind]
    if surface.kind == "cone" and surface.sizes[0] > 1.35:
        least = 8  # nearly flat
    areas = facets.areas[members]
    if (areas > NEEDLES * areas.max(initial=0.0)).sum() < least:
        return False
    if surface.kind != "cylinder" and areas.max() > ONE_FACET * areas.sum():
        return False
    if surface.kind == "cylinder" and (
        _is_drawn_flat(surface, members, facets) or (len(members) <= FEW_STRIPS and _stands_out(surface, members, facets))
    ):
        return False
    if surface.kind in LEAST_STEPS and _least_steps(surface, members, facets) < LEAST_STEPS[surface.kind]:
        return False
    n = to_ball(surface, facets.normals[members]) if surface.kind in FRAMED else facets.normals[members]
    turn = np.arccos(np.clip((n @ n.T).min() if len(n) < 800 else -1.0, -1, 1))
    return turn > np.radians(LEAST_TURN.get(surface.kind, 4.0))


def _is_drawn_flat(surface: Surface, members: np.ndarray, facets: Facets) -> bool:
    """Whether strips lie so far within a cylinder that no tessellation is as coarse, or so far that few of them would be round at the cost
    of much of the part: they are the sides of a polygon."""
    apothems = np.abs(((facets.centers[members] - surface.point) * facets.normals[members]).sum(1))
    radius, apothem = surface.sizes[0], float(np.median(apothems))
    depth = radius - apothem
    if depth > DRAWN_FLAT * facets.diagonal:
        return True
    has_few = math.cos(math.pi / FEW_SIDES) > apothem / radius
    return has_few and 2 / 3 * depth * float(facets.areas[members].sum()) > POLYGON * facets.volume


def _stands_out(surface: Surface, members: np.ndarray, facets: Facets) -> bool:
    """Whether one facet takes far more of a cylinder's turn than any other: the straight side of a slot and a strip or two of the round end
    on either side lie on a wide cylinder, as any four lines do of which one pair is the mirror image of the other."""
    triangles = facets.triangles(members)
    number = np.searchsorted(np.sort(members), facets.facet_of[triangles])
    radial = facets.corners[triangles] - surface.point
    facing = facets.normals[facets.facet_of[triangles]]
    aside = np.cross(np.asarray(surface.axis), facing)
    angles = np.arctan2(np.einsum("tci,ti->tc", radial, aside), np.abs(np.einsum("tci,ti->tc", radial, facing)))
    low, high = np.full(len(members), np.inf), np.full(len(members), -np.inf)
    np.minimum.at(low, number, angles.min(1))
    np.maximum.at(high, number, angles.max(1))
    *_, second, widest = np.sort(high - low)
    return bool(widest > STANDS_OUT * second)


def _least_steps(surface: Surface, members: np.ndarray, facets: Facets) -> float:
    """How many facets long a sphere's patch is along its pole, a torus's along and about its axis, an ellipsoid's any way, at least.

    Two circles of corners lie on many spheres and tori, and mean a cone; strips that are one facet long mean a cylinder.
    """
    triangles = facets.triangles(members)
    corners, areas = facets.corners[triangles], facets.areas[facets.facet_of[triangles]]
    direction = normals(surface, corners.reshape(-1, 3)).reshape(-1, 3, 3)
    if surface.kind == "ellipsoid":
        # two strips of a cylinder and a cone lie on one too, about an axis of its own or of the patch
        direction = to_ball(surface, direction.reshape(-1, 3)).reshape(-1, 3, 3)
        own = np.linalg.eigh(np.cov(direction.reshape(-1, 3).T))[1]
        return min(_turns(np.arcsin(np.clip(direction @ axis, -1, 1)), areas) for axis in (*np.eye(3), *own.T))
    if surface.kind == "sphere":
        # the axis of a band, the pole of a cap
        own = np.linalg.eigh(np.cov(direction.reshape(-1, 3).T))[1]
        latitudes = [np.arcsin(np.clip(direction @ axis, -1, 1)) for axis in own.T]
        if any(_are_two_bands(angles) for angles in latitudes):
            return 1.0
        steps, low, high = _turns(latitudes[0], areas), latitudes[0].min(), latitudes[0].max()
        # of three circles two lie on a ball about the middle between these, whatever they are, and no third beside it
        return steps + LOPSIDED_STEPS if abs(low + high) > LOPSIDED * (high - low) else steps
    frame = frame_from_axis(np.asarray(surface.axis))
    local = (corners - surface.point) @ frame
    around = np.arctan2(local[..., 1], local[..., 0])
    radial = np.cos(around)[..., None] * frame[:, 0] + np.sin(around)[..., None] * frame[:, 1]
    along = np.arctan2(direction @ frame[:, 2], (direction * radial).sum(2))
    return min(_turns(along, areas), _turns(around, areas) + (WHOLE_TUBE if _is_closed(along) else 0.0))


def _is_closed(angles: np.ndarray) -> bool:
    """Whether corners go all around, as those of a tube do and those of a fillet do not."""
    places = np.unique(angles)
    return bool(np.diff(places, append=places[0] + 2 * np.pi).max() < np.pi / 2)


def _are_two_bands(angles: np.ndarray) -> bool:
    """Whether triangles with corners at `angles` [t, 3] lie in two bands with a gap between them, and in each between two circles of
    corners, as the chamfers at both ends of a pin do."""
    low, high = angles.min(1), angles.max(1)
    order = np.argsort(low, kind="stable")
    gaps = low[order][1:] - np.maximum.accumulate(high[order])[:-1]
    if not len(gaps) or gaps.max() < PARTED * (high.max() - low.min()):
        return False
    first = int(np.argmax(gaps)) + 1
    return all(_are_two_circles(angles[own]) for own in (order[:first], order[first:]))


def _are_two_circles(angles: np.ndarray) -> bool:
    low, high = angles.min(), angles.max()
    return bool((np.minimum(angles - low, high - angles) < LEVEL_SHARE * (high - low)).all())


def _turns(angles: np.ndarray, areas: np.ndarray) -> float:
    """Angle that triangles with corners at `angles` [t, 3] cover together, over the range of one: the median by area, of facets with
    `areas` [t], since slivers along a cut say nothing of the steps."""
    middle = np.arctan2(np.sin(angles).mean(), np.cos(angles).mean())
    centered = (angles - middle + np.pi) % (2 * np.pi)
    low, high = centered.min(1), centered.max(1)
    whole = np.flatnonzero(high - low < np.pi)  # the others lie across the cut
    order = whole[np.argsort(low[whole], kind="stable")]
    reach = np.concatenate([[-np.inf], np.maximum.accumulate(high[order])])
    covered = np.maximum(high[order] - np.maximum(low[order], reach[:-1]), 0).sum()
    ranked = np.argsort(high - low, kind="stable")
    below = np.cumsum(areas[ranked])
    typical = (high - low)[ranked[np.searchsorted(below, below[-1] / 2)]]
    return float(covered) / max(float(typical), 1e-9)
