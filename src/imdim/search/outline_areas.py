"""Booleans of outlines: what some cover and others don't, drawn anew with the same lines and arcs."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from imdim.program.outline import Curve, Outline, arc_center, arc_radius, curve_bounds, has_ellipse, is_in_loop, line_of, ring_curves
from imdim.search.outline_drawing import draw_outline
from imdim.search.outline_plane import ASIDE, OUTSIDE, OutlinePlane, Walls, make_plane

ONE_WALL = 1e-7  # of the unit frame, within which two curves lie on one wall
MARGIN = 0.1  # of the unit frame, by which the window is larger than the outlines
MOST_WALLS = 60  # the faces grow with the square
FINE = 100.0  # times as exact as what is drawn through cells: these outlines are given, and walls that all but coincide are two


def draw_area(kept: Sequence[Outline], cut: Sequence[Outline]) -> Outline | None:
    """What at least one outline of `kept` and none of `cut` covers; None where that is nothing, has an ellipse, or can't be drawn.

    Coordinates are those of the unit frame: crossings nearer than `outline_plane.SAME_NODE` / FINE are one.
    """
    if any(map(has_ellipse, [*kept, *cut])):
        return None
    added, removed = ([outline.map_lengths(_enlarge) for outline in outlines] for outlines in (kept, cut))
    walls = _walls_of(added, removed)
    plane = make_plane("extrude", 0, np.zeros(3), np.eye(3), walls) if len(walls.columns) <= MOST_WALLS else None
    if plane is None:
        return None
    points = _points_in(plane)
    inside = _covered(added, points) & ~_covered(removed, points)
    if not inside.any():
        return None
    try:
        return draw_outline(plane, inside).map_lengths(_reduce)
    except ValueError:  # of walls that all but coincide even so
        return None


def _enlarge(length: float) -> float:
    return length * FINE


def _reduce(length: float) -> float:
    return length / FINE


def _walls_of(kept: Sequence[Outline], cut: Sequence[Outline]) -> Walls:
    """The lines and circles that the curves of outlines lie on, each once; of what is cut those that come into what is kept."""
    bounds = np.array([outline.bounds for outline in kept])
    low, high = bounds[:, 0].min(0), bounds[:, 1].max(0)
    curves = _curves(kept) + [curve for curve in _curves(cut) if _reaches(curve, low, high)]
    lines = _distinct([line_of(curve) for curve in curves if not curve[4]])
    rounds = _distinct([(*arc_center(curve), arc_radius(curve)) for curve in curves if curve[4]])
    window = np.stack([low - MARGIN * FINE, high + MARGIN * FINE])
    columns = tuple((k, None) for k in range(len(lines) + len(rounds)))
    return Walls(lines[:, :2], lines[:, 2], rounds[:, :2], rounds[:, 2], window, columns)


def _curves(outlines: Sequence[Outline]) -> list[Curve]:
    return [curve for outline in outlines for ring in outline.rings for curve in ring_curves(ring)]


def _reaches(curve: Curve, low: np.ndarray, high: np.ndarray) -> bool:
    """Whether a curve comes into a rectangle, and not to its edge alone."""
    corners = curve_bounds([curve])
    return bool((corners[0] < high - ONE_WALL * FINE).all() and (corners[1] > low + ONE_WALL * FINE).all())


def _distinct(rows: Sequence[tuple[float, float, float]]) -> np.ndarray:
    """Rows [n, 3] that differ, the first of those that are alike."""
    out: list[tuple[float, float, float]] = []
    for row in rows:
        if all(max(abs(a - b) for a, b in zip(row, known, strict=True)) > ONE_WALL * FINE for known in out):
            out.append(row)
    return np.array(out).reshape(-1, 3)


def _points_in(plane: OutlinePlane) -> np.ndarray:
    """A point [f, 2] of each face, beside the middle of its longest piece of wall."""
    out = np.full((plane.faces, 2), np.nan)
    segments, walls = plane.segments, plane.walls
    for s in np.argsort(segments.length).tolist():
        wall = int(segments.wall[s])
        if wall < 0:  # on the window's edge, where nothing is covered
            continue
        start, end = plane.nodes[segments.nodes[s]]
        circle = wall - len(walls.offsets)
        if circle < 0:
            middle, left = (start + end) / 2, walls.normals[wall]
        else:
            a, b = (math.atan2(y, x) for x, y in (start - walls.centers[circle], end - walls.centers[circle]))
            turn = a + ((b - a) % (2 * math.pi)) / 2
            left = -np.array([math.cos(turn), math.sin(turn)])
            middle = walls.centers[circle] - walls.radii[circle] * left
        aside = min(ASIDE, 0.25 * float(segments.length[s])) * left
        for face, point in zip(segments.faces[s].tolist(), (middle + aside, middle - aside), strict=True):
            if face != OUTSIDE:
                out[face] = point
    return out


def _covered(outlines: Sequence[Outline], points: np.ndarray) -> np.ndarray:
    """Which points [n, 2] are in at least one of some outlines."""
    out = np.zeros(len(points), bool)
    for outline in outlines:
        low, high = outline.bounds
        for i in np.flatnonzero((points > low).all(1) & (points < high).all(1) & ~out).tolist():
            x, y = points[i].tolist()
            out[i] = sum(is_in_loop(loop, x, y) for loop in outline.loops) % 2 == 1
    return out
