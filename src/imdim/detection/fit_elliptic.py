"""Elliptic cylinders through the flat strips of a mesh: the direction that all strips share, and the conic through their section."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from imdim.detection.facets import Growing, points_of
from imdim.detection.fit_ellipsoid import DRAWN, lies_on
from imdim.geometry.conic import fit_conic
from imdim.geometry.rotations import cross
from imdim.geometry.surface import Surface, make_elliptic, unit, vec

ALONG, NEAR_AXIS = 0.01, 0.03  # sine, by which normals may leave the plane across an axis: one that they share, one that two of them have
NEAR_CUTS = 10  # times as far off as drawn corners may be those of a chain, whose axis is not exact yet
CHAINS = (14, 60)  # strips that a guess is made from: few keep clear of cuts and of other walls, many are more exact
LEAST_CORNERS = 8  # of the section, five of which fix an ellipse
SAME_CORNER = 1e-4  # of the diagonal, within which corners of the section are one
MOST_AXES, SAME_AXIS = 3, 0.9995  # of a seed, and the cosine above which two are one


def elliptic_guesses(seed: int, near: list[int], state: Growing) -> list[Surface]:
    """Elliptic cylinders through chains of strips from a seed facet; none where a circle says as much, or where corners do not lie on
    the ellipse to their last digits: five numbers bend to many a curve that is none."""
    facets, out = state.facets, list[Surface]()
    axes: list[np.ndarray] = []
    for other in near:
        axis = unit(cross(facets.normals[seed], facets.normals[other]))
        if len(axes) < MOST_AXES and not any(abs(axis @ known) > SAME_AXIS for known in axes):
            axes.append(axis)
    for axis in axes:
        whole = _chain(seed, axis, NEAR_AXIS, state)
        for most in CHAINS:
            chain = whole[:most]
            # triangles between corners that do not lie above each other lean a little, one way and the other
            shared = np.linalg.svd(facets.normals[chain] * np.sqrt(facets.areas[chain])[:, None], full_matrices=False)[2][-1]
            chain = chain[np.abs(facets.normals[chain] @ shared) < ALONG]
            section = _section(points_of(facets, chain), shared, facets.diagonal) if len(chain) else np.empty((0, 2))
            found = _through(section, shared, facets.diagonal) if len(section) >= LEAST_CORNERS else None
            if found is not None:
                out.append(found)
                break
            if len(whole) <= most:
                break
    return out


def turn_elliptic(surface: Surface, axis: np.ndarray) -> Surface:
    """The surface about another axis nearby, its semi-axes still across it."""
    across = np.asarray(surface.across)
    return replace(surface, axis=vec(axis), across=vec(unit(across - (across @ axis) * axis)))


def _chain(seed: int, axis: np.ndarray, slack: float, state: Growing) -> np.ndarray:
    """The seed and the free strips along an axis, to within a sine, that go on from it, nearest first."""
    found, known = [seed], {seed}
    for n in found:
        if len(found) >= CHAINS[-1]:
            break
        fresh = [m for m in state.neighbours[n] if m not in known and state.free[m] and abs(state.facets.normals[m] @ axis) < slack]
        known.update(fresh)
        found += fresh
    return np.array(found)


def _section(points: np.ndarray, axis: np.ndarray, diagonal: float) -> np.ndarray:
    """Corners [n, 2] as they are seen along an axis, those at one place once."""
    flat = points @ _across(axis)
    order = np.unique(np.round(flat / (SAME_CORNER * diagonal)).astype(np.int64), axis=0, return_index=True)[1]
    return flat[np.sort(order)]


def _across(axis: np.ndarray) -> np.ndarray:
    """Two unit vectors across an axis, as columns [3, 2]."""
    u = unit(cross(axis, np.eye(3)[np.argmin(np.abs(axis))]))
    return np.column_stack([u, cross(axis, u)])


def _through(section: np.ndarray, axis: np.ndarray, diagonal: float) -> Surface | None:
    if _is_round(section, diagonal) or (found := fit_conic(section)) is None:
        return None
    center, turned, semi_axes = found
    plane = _across(axis)
    surface = make_elliptic(plane @ center, axis, plane @ turned[:, 0], semi_axes)
    return surface if lies_on(surface, section @ plane.T, NEAR_CUTS * diagonal) else None


def _is_round(section: np.ndarray, diagonal: float) -> bool:
    """Whether half of the corners lie on one circle (Kasa's) to their last digits."""
    q = section - section.mean(0)
    *center, rest = np.linalg.lstsq(np.column_stack([2 * q, np.ones(len(q))]), (q * q).sum(1), rcond=1e-9)[0]
    radius = np.sqrt(max(rest + center[0] ** 2 + center[1] ** 2, 0.0))
    return float(np.median(np.abs(np.linalg.norm(q - center, axis=1) - radius))) <= DRAWN * diagonal
