"""Which faces of a primitive lie on what was detected. Numbers that no detected surface explains are part of a program's complexity."""

from __future__ import annotations

import math

import numpy as np

from imdim.geometry.rotations import matrix_from_euler
from imdim.program.tree import Primitive
from imdim.search.arrangement import Arrangement

SAME_AXIS = 1 - 1e-10  # cosine above which two axes are one
SAME_PLACE = 1e-6  # of the diagonal


class Carriers:
    """The faces that an arrangement explains: planes at its offsets, and its curved surfaces."""

    def __init__(self, arrangement: Arrangement) -> None:
        self._arrangement = arrangement
        self._tolerance = SAME_PLACE * float(np.linalg.norm(arrangement.bounds[1] - arrangement.bounds[0]))
        self._axes, self._owner = _axes(arrangement)
        self._spans = [_span(arrangement.bounds, d.vector) for d in arrangement.directions]
        self._known: dict[Primitive, int] = {}

    def free_faces(self, primitive: Primitive) -> int:
        """How many of the faces (six of a box, one or three of the others) lie on nothing that was detected."""
        if primitive not in self._known:
            self._known[primitive] = self._count(primitive)
        return self._known[primitive]

    def _count(self, leaf: Primitive) -> int:
        axes, center = matrix_from_euler(leaf.rotation), np.asarray(leaf.center)
        if leaf.kind == "box":
            return sum(self._free_ends(center, axes[:, i], leaf.size[i]) for i in range(3))
        wall = not any(self._on_curved(leaf, center, axes[:, 2], i) for i in range(len(self._arrangement.curved)))
        return int(wall) + (self._free_ends(center, axes[:, 2], leaf.size[-1]) if leaf.kind in ("cylinder", "cone") else 0)

    def _free_ends(self, center: np.ndarray, axis: np.ndarray, length: float) -> int:
        """How many of the two ends of a span are at none of the offsets along its direction; beyond the part nothing is free."""
        cosine = np.abs(self._axes @ axis)
        best = int(np.argmax(cosine))
        if cosine[best] < SAME_AXIS:
            return 2
        direction = self._arrangement.directions[self._owner[best]]
        ends = center @ direction.vector + np.array([-0.5, 0.5]) * length
        low, high = self._spans[self._owner[best]]
        within = (ends > low) & (ends < high)
        return int((within & (np.abs(direction.offsets[:, None] - ends).min(0) > self._tolerance)).sum())

    def _on_curved(self, leaf: Primitive, center: np.ndarray, axis: np.ndarray, index: int) -> bool:
        surface = self._arrangement.curved[index]
        if surface.kind != leaf.kind:
            return False
        gap = center - surface.point
        if leaf.kind == "sphere":
            return self._same(leaf.size, surface.sizes) and self._near(gap)
        owner = self._arrangement.axis_of[index]
        true_axis = self._arrangement.directions[owner].vector if owner >= 0 else np.asarray(surface.axis)
        along = float(axis @ true_axis)
        if abs(along) < SAME_AXIS:
            return False
        if leaf.kind == "torus":
            return self._same(leaf.size, surface.sizes) and self._near(gap)
        if not self._near(gap - (gap @ true_axis) * true_axis):
            return False
        return self._same(leaf.size[:1], surface.sizes) if leaf.kind == "cylinder" else self._same_cone(leaf, gap, axis, surface.sizes[0])

    def _same_cone(self, leaf: Primitive, gap: np.ndarray, axis: np.ndarray, half_angle: float) -> bool:
        """Whether both rims are as wide as the nappe is at their distances from the apex."""
        height = float(gap @ axis)
        slope = math.tan(half_angle)
        rims = [abs(height + end * leaf.size[2]) * slope for end in (-0.5, 0.5)]
        return self._same(leaf.size[:2], tuple(rims))

    def _near(self, gap: np.ndarray) -> bool:
        return float(np.linalg.norm(gap)) <= self._tolerance

    def _same(self, a: tuple[float, ...], b: tuple[float, ...]) -> bool:
        return all(abs(x - y) <= self._tolerance for x, y in zip(a, b, strict=True))


def _span(box: np.ndarray, axis: np.ndarray) -> tuple[float, float]:
    """From where to where a box [2, 3] reaches along an axis."""
    middle, half = box.mean(0) @ axis, (box[1] - box[0]) / 2 @ np.abs(axis)
    return float(middle - half), float(middle + half)


def _axes(arrangement: Arrangement) -> tuple[np.ndarray, np.ndarray]:
    """Directions [n, 3] as detected and as frames make them orthogonal, and the index [n] of the direction that each stands for."""
    axes = [d.vector for d in arrangement.directions]
    owner = list(range(len(axes)))
    for frame in arrangement.frames:
        left, _, right = np.linalg.svd(np.stack([arrangement.directions[i].vector for i in frame], axis=1))
        axes += list((left @ right).T)
        owner += frame
    return np.array(axes), np.array(owner)
