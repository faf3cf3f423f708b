"""What lies around a feature: material or air just beyond the faces of its box, in its own frame, however it is turned."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from imdim.geometry.kernels import inside
from imdim.geometry.lowering import Lowered
from imdim.program.tree import Primitive

BESIDE = 1e-2  # of the smallest edge: so far from a face it is looked
ALONG = (-0.5, 0.0, 0.5)  # of half an edge: stations across a face
HALVINGS = 40  # of a depth, whose digits are those of the program's numbers then
STATIONS = np.linspace(-1.0, 1.0, 9)  # from end to end, of half an edge


@dataclass(frozen=True)
class Surroundings:
    """A box around a leaf, by its middle [3], the directions of its edges as columns [3, 3] and half their lengths [3], in a solid."""

    solid: Lowered
    middle: np.ndarray
    axes: np.ndarray
    half: np.ndarray

    @staticmethod
    def of(solid: Lowered, leaf: int, p: Primitive) -> Surroundings | None:
        """Of a box, a cylinder or an extrusion; None of others. `solid` is the program whose leaf that is."""
        axes = solid.rotations[leaf]
        if p.kind == "box":
            return Surroundings(solid, np.array(p.center), axes, np.array(p.size) / 2)
        if p.kind == "cylinder":
            return Surroundings(solid, np.array(p.center), axes, np.array((p.size[0], p.size[0], p.size[1] / 2)))
        if p.kind == "extrude" and p.outline is not None:
            low, high = map(np.array, p.outline.bounds)
            off = axes[:, :2] @ ((low + high) / 2)
            return Surroundings(solid, p.center + off, axes, np.array((*((high - low) / 2), p.size[0] / 2)))
        return None

    @property
    def step(self) -> float:
        """How far beyond a face it is looked."""
        return BESIDE * 2 * float(self.half.min())

    def is_material(self, local: np.ndarray) -> np.ndarray:
        """Whether there is material at points [n, 3] of the box's frame, which begins at its middle."""
        return inside(self.solid, self.middle + local @ self.axes.T)

    def is_beyond(self, axis: int, side: int) -> np.ndarray:
        """Whether there is material at nine places across a face, a step beyond it."""
        others = [a for a in range(3) if a != axis]
        local = np.zeros((len(ALONG) ** 2, 3))
        local[:, others] = np.array(list(product(ALONG, ALONG))) * self.half[others]
        local[:, axis] = side * (self.half[axis] + self.step)
        return self.is_material(local)

    def is_beside(self, axis: int, side: int, along: int) -> np.ndarray:
        """Whether there is material beyond the middle of a face, at STATIONS along another axis."""
        local = np.zeros((len(STATIONS), 3))
        local[:, axis] = side * (self.half[axis] + self.step)
        local[:, along] = STATIONS * (self.half[along] - self.step)
        return self.is_material(local)

    def passes_through(self) -> bool:
        """Whether a cut leaves the material at both ends of an axis, between two walls that face each other."""
        return any(self.ends_in_air(axis) and self._is_walled(axis) for axis in range(3))

    def measure_pocket(self) -> tuple[int, float] | None:
        """Of a blind cut the axis along which it goes in, and how deep from the highest wall beside it; None where it has no bottom or no
        walls, or more than one face that it might have come through."""
        ways = [(a, side) for a in range(3) for side in (-1, 1) if self.is_beyond(a, side).any() and not self.is_beyond(a, -side).any()]
        depth = self._depth(*ways[0]) if len(ways) == 1 else 0.0
        return (ways[0][0], depth) if depth > self.step else None

    def has_walls(self, axis: int) -> bool:
        """Whether there is material beyond both ends along an axis."""
        return bool(self.is_beyond(axis, -1).any() and self.is_beyond(axis, 1).any())

    def _depth(self, axis: int, bottom: int) -> float:
        """From the bottom to where the walls end that stand on it."""
        across = [a for a in range(3) if a != axis]
        local = np.zeros((len(across) * 2, 3))
        for row, (a, side) in enumerate(product(across, (-1, 1))):
            local[row, a] = side * (self.half[a] + self.step)
        size = 2 * self.half[axis]
        low, high = np.zeros(len(local)), np.full(len(local), size)
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            local[:, axis] = bottom * (self.half[axis] - middle)
            held = self.is_material(local)
            low, high = np.where(held, middle, low), np.where(held, high, middle)
        return float(high.max())

    def _is_walled(self, axis: int) -> bool:
        others = (a for a in range(3) if a != axis)
        return any((self.is_beside(a, -1, axis) & self.is_beside(a, 1, axis)).any() for a in others)

    def ends_in_air(self, axis: int) -> bool:
        """Whether there is nothing beyond both ends along an axis."""
        return not (self.is_beyond(axis, -1).any() or self.is_beyond(axis, 1).any())
