"""What kind of thing a region of a mesh is that a program does not hold: a thread, teeth, text on a face, or freeform.

Only the target is looked at, and where its elements lie off the result. What cannot be told reliably has no kind.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, NamedTuple

import numpy as np

from imdim.delivery.surface_elements import SurfaceElements
from imdim.detection.face_pieces import number_faces
from imdim.detection.faceting import ON_SURFACE, chord_pairs
from imdim.detection.facets import Facets
from imdim.detection.fit_surface import MIN_POINTS, fit_surface
from imdim.detection.flank_rows import FlankRow, find_flank_rows
from imdim.detection.threads import describe_thread, find_threads
from imdim.geometry.components import components
from imdim.geometry.sampling import subsample
from imdim.geometry.surface import CLOSED_KINDS, unit

Kind = Literal["thread", "teeth", "text", "freeform"]

ONE_DEPTH = 0.05  # of a text's depth, by which that of its pieces differs
ROUND_ENDS = 0.5  # of the height of flanks: tips and roots beyond them
LEAST_LETTERS = 3
SMALL = 0.1  # of the face that carries it: a piece of text
ON_ONE_FACE = 0.9  # share of the rim of a piece
LEVEL = 0.9  # share of pieces of a text that are as high as most
UNLIKE = 0.05  # relative, by which areas of letters differ at least
BENT_TWO_WAYS = 0.3  # sine between two directions about which a surface turns
FREEFORM = 0.5  # share of a region
MOST_FITTED = 400  # points of a freeform region, when it is asked whether it is a torus after all


class Recognised(NamedTuple):
    """A region whose kind was told: its elements [n] bool, and in words what it is."""

    chosen: np.ndarray
    kind: Kind
    says: str


def find_thread_regions(elements: SurfaceElements, facets: Facets, off: np.ndarray) -> Iterator[Recognised]:
    """Threads most of whose surface is `off` [n], as far as it is: their crests may lie on the program's cylinder."""
    for thread in find_threads(facets):
        own = np.isin(elements.facet, thread.facets)
        if elements.areas[own & off].sum() > elements.areas[own].sum() / 2:
            yield Recognised(own & off, "thread", describe_thread(thread))


def find_teeth(elements: SurfaceElements, facets: Facets, off: np.ndarray) -> Iterator[Recognised]:
    """Rows and circles of equal teeth of whose flanks more than half is `off` [n]: with the tips and roots between them, as far as these
    are off too."""
    lost = np.bincount(elements.facet, elements.areas * off, len(facets.areas)) > facets.areas / 2
    taken = np.zeros(len(off), bool)
    for row in find_flank_rows(facets, lost):
        chosen = off & _lies_in(elements, facets, row) & ~taken
        if elements.areas[chosen].sum() < facets.areas[row.facets].sum() / 2:
            continue  # of a row that is told already
        taken |= chosen
        where = f"on a circle of {2 * row.radius:.4g}" if row.radius else "in a row"
        yield Recognised(chosen, "teeth", f"{row.teeth} teeth {where}")


def _lies_in(elements: SurfaceElements, facets: Facets, row: FlankRow) -> np.ndarray:
    """Which elements [n] lie where the flanks of a row do."""
    slack = 5 * ON_SURFACE * facets.diagonal

    def seen(points: np.ndarray) -> np.ndarray:
        local = (points - row.point) @ row.frame
        return np.column_stack([np.linalg.norm(local[:, :2], axis=1), local[:, 2]]) if row.radius else local

    flanks, places = seen(facets.corners[facets.triangles(row.facets)].reshape(-1, 3)), seen(elements.points)
    low, high = flanks.min(0) - slack, flanks.max(0) + slack
    # round tips and roots reach beyond the flanks
    beyond = ROUND_ENDS * (high - low) * np.isin(elements.facet, row.chain)[:, None]
    return ((places >= low - beyond) & (places <= high + beyond)).all(1)


def find_text(elements: SurfaceElements, facets: Facets, off: np.ndarray) -> Iterator[Recognised]:
    """Unequal small pieces of what is `off` [n], all raised from one flat face or sunk into it by the same amount."""
    a, b = elements.links.T
    both = off[a] & off[b]
    count, piece = components(a[both], b[both], len(off))
    face, sizes = number_faces(facets)
    on = _carriers(elements, off, piece, count, face, len(sizes))
    carried = np.flatnonzero(off & (on[piece] >= 0))
    height, own = _heights(elements, facets, carried, face, on[piece[carried]]), piece[carried]
    high, low = np.zeros(count), np.zeros(count)
    np.maximum.at(high, own, height)
    np.minimum.at(low, own, height)
    near = ON_SURFACE * facets.diagonal
    areas = np.bincount(piece, elements.areas * off, count)
    for number, size in enumerate(sizes):
        small = (on == number) & (areas < SMALL * size)
        for how, depths in (("raised", np.where(low > -near, high, 0.0)), ("sunk", np.where(high < near, -low, 0.0))):
            pieces = np.flatnonzero(small & (depths > near))
            if _is_text(areas[pieces], depths[pieces]):
                says = f"text or decoration, {len(pieces)} pieces {how} by {np.median(depths[pieces]):.3g}"
                yield Recognised(off & np.isin(piece, pieces), "text", says)


def _is_text(areas: np.ndarray, depths: np.ndarray) -> bool:
    """Whether pieces [k] of these areas and depths are letters: of one depth, and not all alike."""
    if len(areas) < LEAST_LETTERS or np.ptp(areas) < UNLIKE * areas.max():
        return False
    return bool(np.mean(np.abs(depths - np.median(depths)) < ONE_DEPTH * np.median(depths)) >= LEVEL)


def _carriers(elements: SurfaceElements, off: np.ndarray, piece: np.ndarray, count: int, face: np.ndarray, faces: int) -> np.ndarray:
    """The face [count] on which nearly all of a piece's rim lies, -1 where there is none."""
    a, b = elements.links.T
    rim = off[a] != off[b]
    inner, outer = np.where(off[a], a, b)[rim], np.where(off[a], b, a)[rim]
    own, other, length = piece[inner], face[elements.facet[outer]], elements.lengths[rim]
    whole = np.bincount(own, length, count)
    pairs, which = np.unique(own[other >= 0] * faces + other[other >= 0], return_inverse=True)
    along = np.bincount(which, length[other >= 0], len(pairs))
    most = along >= ON_ONE_FACE * whole[pairs // max(faces, 1)]
    on = np.full(count, -1)
    on[pairs[most] // max(faces, 1)] = pairs[most] % max(faces, 1)
    return on


def _heights(elements: SurfaceElements, facets: Facets, chosen: np.ndarray, face: np.ndarray, on: np.ndarray) -> np.ndarray:
    """How far chosen elements [k] stand above the planes of the faces `on` [k]."""
    if not len(chosen):
        return np.empty(0)
    known = np.flatnonzero(face >= 0)
    known = known[np.lexsort((-facets.areas[known], face[known]))]
    largest = known[np.searchsorted(face[known], on)]  # facet of each face
    return ((elements.points[chosen] - facets.centers[largest]) * facets.normals[largest]).sum(1)


def find_double_bends(facets: Facets) -> np.ndarray:
    """Which facets [u] turn towards their neighbours about axes of more than one direction."""
    pairs, _, _ = chord_pairs(facets)
    turns = unit(np.cross(facets.normals[pairs[:, 0]], facets.normals[pairs[:, 1]]))
    spread = np.zeros((len(facets.areas), 3, 3))
    np.add.at(spread, pairs.ravel(), np.repeat(turns[:, :, None] * turns[:, None, :], 2, axis=0))
    return np.linalg.eigvalsh(spread)[:, 1] > BENT_TWO_WAYS**2  # of one axis alone there is no second eigenvalue


def is_freeform(elements: SurfaceElements, facets: Facets, bent: np.ndarray, chosen: np.ndarray) -> bool:
    """Whether most of the chosen elements [n] are of facets that are `bent` [u] two ways, and these no ball, torus or ellipsoid."""
    both = bent[elements.facet] & chosen
    if elements.areas[both].sum() < FREEFORM * elements.areas[chosen].sum():
        return False
    points = np.unique(facets.corners[facets.triangles(np.unique(elements.facet[both]))].reshape(-1, 3), axis=0)
    points = subsample(points, MOST_FITTED)
    near = ON_SURFACE * facets.diagonal
    return not any(fit_surface(kind, points)[1] < near for kind in CLOSED_KINDS if len(points) >= MIN_POINTS[kind])
