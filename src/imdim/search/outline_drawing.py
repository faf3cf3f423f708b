"""The loops of a region of a plane arrangement: its boundary followed from node to node, pieces of one wall joined to lines and arcs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial

import numpy as np

from imdim.program.ellipse import Ellipse
from imdim.program.outline import Loop, Outline, Vertex, check_crossings, circle, orient_loops
from imdim.search.outline_plane import OutlinePlane

NO_LENGTH = 1e-6  # of the unit frame: a curve no longer is none
NEAR_NODE = 0.03  # of the unit frame, within which a tangent point is that of a node
WIDE, RIM_WIDE = 1.5 * math.pi, 6.0  # radians, from which an arc is drawn as two, and a rim: the ends of a small one then tell it badly
RIM = 0.1  # of the unit frame: the least radius of a rim


def draw_outline(plane: OutlinePlane, inside: np.ndarray) -> Outline:
    """The outline of a region. Where walls nearly coincide, vertices at their own crossings may make it cross itself: they are then where
    the nodes are. Raises ValueError where it crosses itself even so."""
    try:
        return _check(Outline(trace_loops(plane, inside)))
    except ValueError:
        return _check(Outline(trace_loops(plane, inside, exact=False)))


def _check(outline: Outline) -> Outline:
    check_crossings(outline)
    return outline


def trace_loops(plane: OutlinePlane, inside: np.ndarray, exact: bool = True) -> tuple[Loop, ...]:
    """The boundary of a region as loops of lines and arcs, outer ones counter-clockwise; raises ValueError where it does not close.

    Vertices are crossings of their two walls, or without `exact` the nodes that several crossings share.
    """
    at, nodes = plane.boundary(inside)
    forwards = (nodes[:, 0] == plane.segments.nodes[at, 0]).tolist()
    (begins, ends), pieces = nodes.T.tolist(), at.tolist()
    follows = {node: k for k, node in enumerate(begins)}
    left, loops = set(range(len(pieces))), []
    for first in range(len(pieces)):
        if first not in left:
            continue
        ring, k = list[int](), first
        while k in left:
            left.discard(k)
            ring.append(k)
            k = follows.get(ends[k], -1)
        if k != first:
            raise ValueError(f"the boundary of {int(inside.sum())} faces does not close")
        loop = _loop(plane, [(pieces[i], forwards[i]) for i in ring], exact)
        if loop is not None:
            loops.append(loop)
    return orient_loops(loops)


def _loop(plane: OutlinePlane, ring: list[tuple[int, bool]], exact: bool) -> Loop | None:
    """One loop of (segment, whether it is passed forwards), its pieces of one wall joined; None for what has no area."""
    wall = plane.segments.wall[[s for s, _ in ring]].tolist()
    # start where the wall changes, so that no curve is cut in two
    start = next((i for i in range(len(ring)) if wall[i] != wall[i - 1]), None)
    lines = len(plane.walls.offsets)
    if start is None:
        return _circle(plane, wall[0] - lines)
    runs = list(_same_wall(ring[start:] + ring[:start], wall[start:] + wall[:start]))
    corners = [_corner(plane, runs[i - 1], runs[i], exact) for i in range(len(runs))]
    passed = [
        (run, a, b) for run, a, b in zip(runs, corners, [*corners[1:], corners[0]], strict=True) if not (np.abs(a - b) <= NO_LENGTH).all()
    ]
    whole = max(runs, key=partial(_turn_along, plane))
    if not passed and _turn_along(plane, whole) > math.pi:  # a circle that a line all but touches comes back to the corner it left
        return _circle(plane, int(plane.segments.wall[whole[0][0]]) - lines)
    vertices = [v for run, begin, end in passed for v in _vertices(plane, run, begin, end)]
    return tuple(vertices) if len(vertices) > 2 or any(b for _, _, b in vertices) else None


def _circle(plane: OutlinePlane, at: int) -> Loop:
    """A whole circle or ellipse."""
    center = plane.walls.centers[at]
    if (axes := plane.walls.ovals.get(at)) is not None:
        (rx, ry), angle = np.linalg.norm(axes, axis=0).tolist(), math.degrees(math.atan2(axes[1, 0], axes[0, 0]))
        return Ellipse(rx, ry, float(center[0]), float(center[1]), angle).plain
    return circle(float(plane.walls.radii[at]), float(center[0]), float(center[1]))


def _turn_along(plane: OutlinePlane, run: list[tuple[int, bool]]) -> float:
    """By how much a run of pieces of one wall turns, 0 for a line."""
    at = int(plane.segments.wall[run[0][0]]) - len(plane.walls.offsets)
    return 0.0 if at < 0 else sum(float(plane.segments.length[s]) for s, _ in run) / float(plane.walls.radii[at])


def _same_wall(ring: list[tuple[int, bool]], wall: list[int]) -> Iterator[list[tuple[int, bool]]]:
    first = 0
    for i in range(1, len(ring) + 1):
        if i == len(ring) or wall[i] != wall[first]:
            yield ring[first:i]
            first = i


def _corner(plane: OutlinePlane, before: list[tuple[int, bool]], after: list[tuple[int, bool]], exact: bool) -> np.ndarray:
    """Where a curve starts [2]: its wall's own crossing with the wall before, which a node shares with others nearby."""
    segments, (first, forwards) = plane.segments, after[0]
    node = plane.nodes[segments.nodes[first, 0 if forwards else 1]]
    if not exact:
        return node
    crossings = plane.cross(int(segments.wall[before[0][0]]), int(segments.wall[first]))
    near = min(crossings, key=lambda p: float(np.linalg.norm(p - node)), default=node)
    near = near if np.linalg.norm(near - node) <= NEAR_NODE else node
    return np.maximum(near, (0.0, -np.inf)) if plane.kind == "revolve" else near


def _vertices(plane: OutlinePlane, run: list[tuple[int, bool]], begin: np.ndarray, end: np.ndarray) -> list[Vertex]:
    """A curve from its begin to its end [2], with its bulge; an arc that is nearly a circle is two, since its ends say little of its
    centre."""
    (x, y), at = begin.tolist(), int(plane.segments.wall[run[0][0]]) - len(plane.walls.offsets)
    if at < 0:
        return [(x, y, 0.0)]
    center = plane.walls.centers[at]
    about = _turn_along(plane, run) * (1 if run[0][1] else -1)
    (ax, ay), (bx, by) = begin - center, end - center
    turn = math.atan2(ax * by - ay * bx, ax * bx + ay * by)
    turn += 2 * math.pi * round((about - turn) / (2 * math.pi))
    if abs(turn) < (RIM_WIDE if math.hypot(ax, ay) > RIM else WIDE):
        return [(x, y, math.tan(turn / 4))]
    cosine, sine, bulge = math.cos(turn / 2), math.sin(turn / 2), math.tan(turn / 8)
    return [(x, y, bulge), (float(center[0] + cosine * ax - sine * ay), float(center[1] + sine * ax + cosine * ay), bulge)]
