"""Which faces of a primitive lie on what was detected. Numbers that no detected surface explains are part of a program's complexity."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.surface import Surface
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Curve, arc_center, arc_radius
from imdim.program.tree import ACROSS, Primitive
from imdim.search.arrangement import Arrangement, span_along

DRIFTED = 40  # free faces that a wall beside a detected one counts as: it fits facets, which lie within the true surface


@dataclass(frozen=True)
class _Tolerance:
    """`cosine` above which two axes are one, `place` below which two points are (of the diagonal), `size` of one (relative)."""

    cosine: float
    place: float
    size: float


SAME = _Tolerance(1 - 1e-10, 1e-6, 1e-6)
NEAR = _Tolerance(1 - 6e-4, 0.02, 0.08)


class Carriers:
    """The faces that an arrangement explains: planes at its offsets, and its curved surfaces."""

    def __init__(self, arrangement: Arrangement) -> None:
        self._arrangement = arrangement
        self._diagonal = float(np.linalg.norm(arrangement.bounds[1] - arrangement.bounds[0]))
        self._axes, self._owner = _axes(arrangement)
        self._spans = [span_along(arrangement.bounds, d.vector) for d in arrangement.directions]
        self._known: dict[Primitive, int] = {}

    def free_faces(self, primitive: Primitive) -> int:
        """How many faces lie on nothing that was detected: of six of a box, one for each curve of an outline, one or three of the others.

        A curved wall close beside a detected one counts as many: the true surface is known there, and what is gained is the facets'.
        """
        if primitive not in self._known:
            self._known[primitive] = self._count(primitive)
        return self._known[primitive]

    def _count(self, leaf: Primitive) -> int:
        axes, center = matrix_from_euler(leaf.rotation), np.asarray(leaf.center)
        if leaf.outline is not None:
            ends = self._free_ends(center, axes[:, 2], leaf.size[0]) if leaf.kind in ACROSS else 0
            if leaf.kind == "drafted":  # walls that lean are drawn along detected ones alone
                return ends
            return ends + sum(self._free_side(leaf, axes, curve) for curve in leaf.outline.curves)
        if leaf.kind == "box":
            return sum(self._free_ends(center, axes[:, i], leaf.size[i]) for i in range(3))
        ends = self._free_ends(center, axes[:, 2], leaf.size[-1]) if leaf.kind in ("cylinder", "cone") else 0
        return ends + self._free_wall(leaf, center, axes[:, 2])

    def _free_side(self, leaf: Primitive, axes: np.ndarray, curve: Curve | Ellipse) -> int:
        """Whether the face that one curve of an outline draws lies on nothing; of turned ones only planes and cylinders are known."""
        if isinstance(curve, Ellipse):
            return 1
        x, y, u, v, bulge = curve
        across = leaf.kind == "extrude"
        side = axes[:, 1] if across else axes[:, 2]
        middle = leaf.center + (x + u) / 2 * axes[:, 0] + (y + v) / 2 * side
        if across and bulge:
            cx, cy = arc_center(curve)
            wall = Primitive("cylinder", (arc_radius(curve), leaf.size[0]), leaf.center, leaf.rotation)
            return self._free_wall(wall, leaf.center + cx * axes[:, 0] + cy * side, axes[:, 2])
        if not across and not bulge and x == u:
            wall = Primitive("cylinder", (x, abs(v - y)), leaf.center, leaf.rotation) if x else None
            return self._free_wall(wall, np.asarray(leaf.center), side) if wall else 0
        if bulge or (not across and y != v):
            return 1
        normal = (v - y) * axes[:, 0] - (u - x) * side
        return self._free_ends(middle, normal / np.linalg.norm(normal), 0.0) // 2

    def _free_wall(self, leaf: Primitive, center: np.ndarray, axis: np.ndarray) -> int:
        alike = [i for i, s in enumerate(self._arrangement.curved) if s.kind == leaf.kind]
        if any(self._lies_on(leaf, center, axis, i, SAME) for i in alike):
            return 0
        return DRIFTED if any(self._lies_on(leaf, center, axis, i, NEAR) for i in alike) else 1

    def _free_ends(self, center: np.ndarray, axis: np.ndarray, length: float) -> int:
        """How many of the two ends of a span are at none of the offsets along its direction; beyond the part nothing is free."""
        cosine = np.abs(self._axes @ axis)
        best = int(np.argmax(cosine))
        if cosine[best] < SAME.cosine:
            return 2
        direction = self._arrangement.directions[self._owner[best]]
        ends = center @ direction.vector + np.array([-0.5, 0.5]) * length
        low, high = self._spans[self._owner[best]]
        within = (ends > low) & (ends < high)
        return int((within & (np.abs(direction.offsets[:, None] - ends).min(0) > SAME.place * self._diagonal)).sum())

    def _lies_on(self, leaf: Primitive, center: np.ndarray, axis: np.ndarray, index: int, tolerance: _Tolerance) -> bool:
        surface = self._arrangement.curved[index]
        gap, owner = center - surface.point, self._arrangement.axis_of[index]
        true_axis = self._arrangement.directions[owner].vector if owner >= 0 else np.asarray(surface.axis)
        if leaf.kind == "ellipsoid":
            near = float(np.linalg.norm(gap)) <= tolerance.place * self._diagonal
            return near and _is_ellipsoid(matrix_from_euler(leaf.rotation), leaf.size, surface, tolerance.size)
        if leaf.kind != "sphere" and abs(float(axis @ true_axis)) < tolerance.cosine:
            return False
        if leaf.kind in ("cylinder", "cone"):
            gap = gap - (gap @ true_axis) * true_axis
        if float(np.linalg.norm(gap)) > tolerance.place * self._diagonal:
            return False
        if leaf.kind == "cone":
            height, slope = float((center - surface.point) @ axis), math.tan(surface.sizes[0])
            rims = (abs(height + end * leaf.size[2]) * slope for end in (-0.5, 0.5))  # of a nappe, at the ends of the leaf
            return all(abs(a - b) <= tolerance.size * max(leaf.size[:2]) for a, b in zip(leaf.size[:2], rims, strict=True))
        sizes = leaf.size[:1] if leaf.kind == "cylinder" else leaf.size
        return all(abs(a - b) <= tolerance.size * b for a, b in zip(sizes, surface.sizes, strict=True))


def _is_ellipsoid(axes: np.ndarray, sizes: Sequence[float], surface: Surface, tolerance: float) -> bool:
    """Whether semi-axes along the columns of `axes` [3, 3] make the detected ellipsoid, wherever its centre; their order is free."""
    ours, theirs = ((frame * s) @ frame.T for frame, s in ((axes, sizes), (surface.frame, surface.sizes)))
    return float(np.abs(ours - theirs).max()) <= tolerance * max(surface.sizes)


def _axes(arrangement: Arrangement) -> tuple[np.ndarray, np.ndarray]:
    """Directions [n, 3] as detected and as frames make them orthogonal, and the index [n] of the direction that each stands for."""
    axes = [d.vector for d in arrangement.directions]
    owner = list(range(len(axes)))
    for frame in arrangement.frames:
        axes += list(arrangement.rotation(frame).T)
        owner += frame
    return np.array(axes), np.array(owner)
