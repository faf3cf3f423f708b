"""Fewer statements for blends: pieces that are extruded side by side between the same two levels are drawn as one outline."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from imdim.geometry.edge_solids import BlendSolid
from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.surface import vec
from imdim.program.outline import Outline, Vertex, curve_bounds, loop_curves, reverse_ring
from imdim.program.tree import Primitive, Program

ONE_WAY = 1e-12  # by which the cosine between two directions of one line may be off
LEVEL = 1e-5  # of a height, by which two levels may be apart


def gather_pieces(pieces: Sequence[BlendSolid]) -> list[BlendSolid]:
    """The pieces, those that are extruded along one direction between the same two levels as one outline of several loops."""
    groups: list[list[BlendSolid]] = []
    for piece in pieces:
        like = next((g for g in groups if _can_share(g, piece)), None)
        if like is None:
            groups.append([piece])
        else:
            like.append(piece)
    return [group[0] if len(group) == 1 else group[0]._replace(solid=_shared([p.solid for p in group])) for group in groups]


def _can_share(group: Sequence[BlendSolid], piece: BlendSolid) -> bool:
    """Whether a piece goes along with a group of them, and lies beside them all."""
    first, other = group[0], piece.solid
    if (first.feature, first.cuts) != (piece.feature, piece.cuts):
        return False
    if not all(isinstance(p, Primitive) and p.kind == "extrude" for p in (first.solid, other)):
        return False
    assert isinstance(first.solid, Primitive)
    assert isinstance(other, Primitive)
    height = first.solid.size[0]
    if abs(other.size[0] - height) > LEVEL * height:  # tells most apart in a moment
        return False
    turn, own = matrix_from_euler(first.solid.rotation), matrix_from_euler(other.rotation)
    level = float((np.asarray(other.center) - first.solid.center) @ turn[:, 2])
    if abs(abs(own[:, 2] @ turn[:, 2]) - 1) > ONE_WAY or abs(level) > LEVEL * height:
        return False
    bounds = [_bounds_in(first.solid, p.solid) for p in (*group, piece)]
    (left, bottom), (right, top) = bounds[-1]
    return not any(left < high[0] and low[0] < right and bottom < high[1] and low[1] < top for low, high in bounds[:-1])


@lru_cache(maxsize=4096)
def _bounds_in(first: Primitive, part: Primitive) -> tuple[tuple[float, float], tuple[float, float]]:
    """Both corners of the box of an extrusion's loop, as `_loop_in`."""
    return curve_bounds(loop_curves(_loop_in(first, part)))


def _shared(parts: Sequence[Program]) -> Primitive:
    """Extrusions that `_can_share` as one."""
    first = parts[0]
    assert isinstance(first, Primitive)
    loops = tuple(_loop_in(first, part) for part in parts)
    (left, low), (right, high) = Outline(loops).bounds
    x, y = (left + right) / 2, (low + high) / 2
    turn = matrix_from_euler(first.rotation)
    return replace(first, center=vec(first.center + turn[:, 0] * x + turn[:, 1] * y), outline=Outline(loops).shift(-x, -y))


def _loop_in(first: Primitive, part: Program) -> tuple[Vertex, ...]:
    """The loop of an extrusion in the frame of another one along the same line, either way."""
    assert isinstance(part, Primitive)
    assert part.outline is not None
    turn, own = matrix_from_euler(first.rotation), matrix_from_euler(part.rotation)
    same = float(own[:, 2] @ turn[:, 2]) > 0
    loop = np.array(part.outline.loops[0])
    world = np.asarray(part.center) + loop[:, :2] @ own[:, :2].T
    flat = (world - first.center) @ turn[:, :2]
    placed = tuple((float(x), float(y), float(b) if same else -float(b)) for (x, y), b in zip(flat, loop[:, 2], strict=True))
    return placed if same else reverse_ring(placed)
