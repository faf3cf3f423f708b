"""Rows and circles of equal flanks, as teeth have: on a mesh, whatever else is on it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from imdim.detection.faceting import ON_SURFACE
from imdim.detection.facets import Facets
from imdim.geometry.components import components
from imdim.geometry.rotations import frame_from_axis

LEAST_TEETH = 8
ALIKE = 0.01  # relative, by which areas of equal flanks differ: roots lie on chords
MOST_SHARED = 4  # flanks beside a tip or a root; the ends of a gear are beside all
MOST_GROUPS = 60  # of equal flanks, the largest, that are looked at
LEANS = 0.2  # sine: a flank leans out of the way to the axis by more, a facet of a cylinder does not
REGULAR = 0.05  # of the pitch
MOST_REGULAR = 0.75  # share of the gaps, and of the flanks: a row of teeth may be broken
TOOTH = (0.1, 0.9)  # of the pitch: from one flank to the other
PARALLEL = math.cos(math.radians(0.5))


@dataclass(frozen=True)
class FlankRow:
    """Flanks in a row or on a circle: their facets, the frame [3, 3] of the row with its last column along the axis (or the row), a point
    of it, and the radius, 0 for a straight row; how many `teeth` they make, at which `pitch` (in radians on a circle); and the facets of
    the `chain` of flanks, tips and roots."""

    facets: np.ndarray
    frame: np.ndarray
    point: np.ndarray
    radius: float
    teeth: int
    pitch: float
    chain: np.ndarray = field(default_factory=lambda: np.empty(0, np.int64))


def find_flank_rows(facets: Facets, of: np.ndarray | None = None) -> list[FlankRow]:
    """Rows and circles of equal flanks that lead from one to the next; most of those of each are among the facets `of` [u], if given."""
    return _merge(facets, _rows(facets, of))


def _rows(facets: Facets, of: np.ndarray | None) -> Iterator[FlankRow]:
    for group in _groups_of_equals(facets):
        if of is None or np.count_nonzero(of[group]) * 2 > len(group):
            row = _circle(facets, group) or _straight(facets, group)
            if row is not None and (chain := _chain_of(facets, row)) is not None:
                yield replace(row, chain=chain)


def _chain_of(facets: Facets, row: FlankRow) -> np.ndarray | None:
    """The facets [c] that hang together with the flanks of a row, tips and roots among them; None where these do not lead from flank to
    flank: between the slots of a grating lies nothing but faces that all of them share."""
    flank = np.zeros(len(facets.areas), bool)
    flank[row.facets] = True
    one, two = facets.edges.T
    shared = np.bincount(one[flank[two]], minlength=len(flank)) + np.bincount(two[flank[one]], minlength=len(flank)) > MOST_SHARED
    inner = ~shared[one] & ~shared[two]
    _, label = components(one[inner], two[inner], len(flank))
    flanks = np.bincount(label[row.facets])
    return np.flatnonzero(label == flanks.argmax()) if flanks.max() >= MOST_REGULAR * len(row.facets) else None


def _merge(facets: Facets, rows: Iterator[FlankRow]) -> list[FlankRow]:
    """Circles of as many flanks about one axis as one: round teeth have many flanks each."""
    out: list[FlankRow] = []
    near = 5 * ON_SURFACE * facets.diagonal
    for row in rows:
        for i, other in enumerate(out):
            arm = row.point - other.point
            axis = other.frame[:, 2]
            alike = bool(row.radius) == bool(other.radius) and row.teeth == other.teeth and abs(float(axis @ row.frame[:, 2])) > PARALLEL
            if alike and row.radius and np.linalg.norm(arm - (arm @ axis) * axis) < near:
                both, chain = np.union1d(other.facets, row.facets), np.union1d(other.chain, row.chain)
                out[i] = replace(other, facets=both, chain=chain, radius=(other.radius + row.radius) / 2)
                break
        else:
            out.append(row)
    return out


def _groups_of_equals(facets: Facets) -> list[np.ndarray]:
    """Facets of equal area, LEAST_TEETH pairs of flanks or more, those that are most together first."""
    order = np.argsort(-facets.areas, kind="stable")
    cuts = np.flatnonzero(facets.areas[order][1:] < facets.areas[order][:-1] * (1 - ALIKE)) + 1
    groups = [g for g in np.split(order, cuts) if len(g) >= 2 * LEAST_TEETH]
    return sorted(groups, key=lambda g: -float(facets.areas[g].sum()))[:MOST_GROUPS]


def _circle(facets: Facets, group: np.ndarray) -> FlankRow | None:
    """The flanks of a group that stand regularly about one axis."""
    normals, centers = facets.normals[group], facets.centers[group]
    axis = np.linalg.eigh(normals.T @ normals)[1][:, 0]
    frame = frame_from_axis(axis)
    flat = centers @ frame
    solution = np.linalg.lstsq(np.column_stack([2 * flat[:, :2], np.ones(len(flat))]), (flat[:, :2] ** 2).sum(1), rcond=None)[0]
    radius = math.sqrt(max(float(solution[2] + solution[:2] @ solution[:2]), 0.0))
    arm = flat[:, :2] - solution[:2]
    away = np.linalg.norm(arm, axis=1)
    keep = (np.abs(away - radius) < ON_SURFACE * facets.diagonal * 5) & (np.abs(normals @ axis) < LEANS)
    if np.count_nonzero(keep) < MOST_REGULAR * len(group):
        return None
    around = np.arctan2(arm[:, 1], arm[:, 0])
    tangent = np.column_stack([-arm[:, 1], arm[:, 0]]) / np.maximum(away, 1e-300)[:, None]
    leans = ((normals @ frame)[:, :2] * tangent).sum(1)
    teeth = _count_teeth(around[keep], leans[keep], 2 * math.pi)
    return FlankRow(group[keep], frame, frame[:, :2] @ solution[:2], radius, *teeth) if teeth else None


def _straight(facets: Facets, group: np.ndarray) -> FlankRow | None:
    """The flanks of a group that stand regularly along one line."""
    normals, centers = facets.normals[group], facets.centers[group]
    middle = np.median(centers, axis=0)
    along = np.linalg.eigh((centers - middle).T @ (centers - middle))[1][:, 2]
    beside = (centers - middle) - np.outer((centers - middle) @ along, along)
    keep = np.linalg.norm(beside, axis=1) < np.linalg.norm(beside, axis=1).min() + ON_SURFACE * facets.diagonal * 5
    if np.count_nonzero(keep) < MOST_REGULAR * len(group):
        return None
    teeth = _count_teeth(centers[keep] @ along, (normals @ along)[keep], None)
    return FlankRow(group[keep], frame_from_axis(along), middle, 0.0, *teeth) if teeth else None


def _count_teeth(places: np.ndarray, leans: np.ndarray, turn: float | None) -> tuple[int, float] | None:
    """How many teeth flanks at `places` [m] make that lean [m] one way and the other, and their pitch; None where these are none. `turn` is
    a whole one, about a circle."""
    sides = [np.unique(np.round(places[way * leans > LEANS], 9)) for way in (1, -1)]
    if min(map(len, sides)) < LEAST_TEETH:
        return None
    pitches = [np.diff(np.append(side, side[0] + turn) if turn else side) for side in sides]
    pitch = float(np.median(pitches[0]))
    if any(np.mean(np.abs(p - pitch) < REGULAR * pitch) < MOST_REGULAR for p in pitches):
        return None
    # from the flanks of one side to the next ones of the other
    apart = (sides[1][np.searchsorted(sides[1], sides[0]) % len(sides[1])] - sides[0]) % pitch / pitch
    return (max(map(len, sides)), pitch) if TOOTH[0] < float(np.median(apart)) < TOOTH[1] else None
