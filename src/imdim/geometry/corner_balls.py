"""Corners in which three fillets of one radius meet: a ball of that radius rolls into each and leaves a piece of a sphere.

The sweeps of the three edges alone mitre there: what all of them leave of the corner is more than the ball does. It is taken off, or filled
in where the edges are concave, with a prism that reaches from the corner to the planes through the centre of the ball across each edge.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from imdim.geometry.blended_edge import BlendedEdge
from imdim.geometry.near_pairs import near_pairs
from imdim.geometry.rotations import cross, euler_from_matrix
from imdim.geometry.surface import vec
from imdim.program.outline import Outline
from imdim.program.tree import FULL_TURN, Combine, Primitive

BEYOND = 0.25  # of the radius, by which the prism goes past the faces, so that no skin stays
MEET = 0.01  # of the radius, within which ends of three fillets are one corner: where an edge ends is looked for a little beside it
ALIKE = 1e-9  # of the radius, within which radii are one
SQUARE = 1e-6  # cosine between directions at right angles
SLIM = 0.1  # sine of an angle between edges, below which no ball rolls into the corner


class CornerBall(NamedTuple):
    """One of the three fillets that meet in a corner, and the solid of what the ball leaves there."""

    edge: BlendedEdge
    solid: Combine


def find_corner_balls(edges: Sequence[BlendedEdge]) -> Iterator[CornerBall]:
    """The corners in which three straight fillets of one radius end, all of convex edges or all of concave ones, and one of them at right
    angles to both others. Where an edge is too short for the ball, the sweeps are left as they are."""
    ends = [(e, k) for e in edges if e.kind == "fillet" and not e.track.is_round for k in (0, 1) if e.goes_on[k]]
    if len(ends) < 3:
        return
    corners = np.array([edge.end(k) for edge, k in ends])
    met: dict[int, list[int]] = {}
    for i, j in near_pairs(corners, MEET * max(edge.size for edge, _ in ends)):
        met.setdefault(i, []).append(j)
    taken: set[int] = set()
    for i, others in met.items():
        if i not in taken and len(others) == 2 and (solid := _roll([ends[n] for n in (i, *others)])) is not None:
            yield CornerBall(ends[i][0], solid)
        taken.update(others)


def _roll(ends: Sequence[tuple[BlendedEdge, int]]) -> Combine | None:
    """What a ball leaves of a corner in which fillets end: with their first point, 0, or their last, 1."""
    radius = ends[0][0].size
    if len({edge.stretch.is_convex for edge, _ in ends}) > 1 or any(abs(edge.size - radius) > ALIKE * radius for edge, _ in ends):
        return None
    ways = [edge.track.frame[:, 2] * (-1.0 if k else 1.0) for edge, k in ends]
    for up, one, two in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        if max(abs(float(ways[up] @ ways[one])), abs(float(ways[up] @ ways[two]))) < SQUARE:
            break
    else:
        return None
    if cross(ways[one], ways[two]) @ ways[up] < 0:
        one, two = two, one
    turn = math.acos(float(np.clip(ways[one] @ ways[two], -1, 1)))
    along = radius / math.tan(turn / 2)
    if math.sin(turn) < SLIM or any(ends[n][0].length < need for n, need in ((up, radius), (one, along), (two, along))):
        return None
    corner = _meet([edge for edge, _ in ends])
    frame = np.column_stack([ways[one], cross(ways[up], ways[one]), ways[up]])
    center = corner + frame @ np.array([along, radius, radius])
    # turned, its facets begin where those of the sweeps end
    half_disc = Outline((((0.0, -radius, 1.0), (0.0, radius, 0.0)),))
    ball = Primitive("revolve", (FULL_TURN,), vec(center), euler_from_matrix(frame), half_disc)
    return Combine("difference", _prism(frame, corner, turn, radius), ball)


def _meet(edges: Sequence[BlendedEdge]) -> np.ndarray:
    """The point [3] that is nearest to the lines along several edges."""
    across = [np.eye(3) - np.outer(way, way) for way in (edge.track.frame[:, 2] for edge in edges)]
    return np.linalg.solve(sum(across), sum(a @ edge.track.origin for a, edge in zip(across, edges, strict=True)))


def _prism(frame: np.ndarray, corner: np.ndarray, turn: float, radius: float) -> Primitive:
    """What lies between the corner and the planes through the centre of the ball, and a little beyond the faces. The columns of the `frame`
    [3, 3] are the directions of the first edge, across it, and of the upright one; by `turn` the first is turned to the second."""
    along, beyond = radius / math.tan(turn / 2), BEYOND * radius
    second, out = np.array([math.cos(turn), math.sin(turn)]), np.array([-math.sin(turn), math.cos(turn)])
    outer = -beyond / math.sin(turn) * (second + np.array([1.0, 0.0]))
    loop = np.array([outer, (along, -beyond), (along, radius), along * second + beyond * out])
    middle = (loop.min(0) + loop.max(0)) / 2
    outline = Outline((tuple((float(x), float(y), 0.0) for x, y in loop - middle),))
    center = corner + frame @ np.array([*middle, (radius - beyond) / 2])
    return Primitive("extrude", (radius + beyond,), vec(center), euler_from_matrix(frame), outline)
