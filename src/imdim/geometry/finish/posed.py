"""A primitive in its place: its box in the world, its solid, and whether it holds another or lies apart from it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from manifold3d import Manifold

from imdim.geometry import kernels
from imdim.geometry.finish.section import CHECK_SEGMENTS, flatten
from imdim.geometry.lowering import Lowered, lower
from imdim.geometry.rows import dot_rows
from imdim.geometry.solid import exact_rotation, primitive_to_manifold
from imdim.program.outline import Outline, arc_radii
from imdim.program.tree import OUTLINED, Primitive, envelope

INSCRIBED = 1 - 3.3e-3  # of a radius: what polyhedra of CHECK_SEGMENTS hold in every direction; a sphere's lacks the most


@dataclass(frozen=True)
class PosedPrimitive:
    """A primitive with what is asked of it again and again, made when it is first asked for."""

    leaf: Primitive
    segments: int = CHECK_SEGMENTS

    @cached_property
    def rotation(self) -> np.ndarray:
        """World from local [3, 3]."""
        return exact_rotation(self.leaf)

    @cached_property
    def half(self) -> np.ndarray:
        """Half extents [3] of the local box."""
        held_by = envelope(self.leaf)
        return np.array(_HALF[held_by.kind](held_by.size))

    @cached_property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Low and high corner [3] of the world box."""
        reach = np.abs(self.rotation) @ self.half
        return self.leaf.center - reach, self.leaf.center + reach

    @cached_property
    def sizes(self) -> np.ndarray:
        """Sizes [2, 3], padded with zeros: the primitive's, and those of a like one that its polyhedron holds."""
        size = self.leaf.size
        held = size if self.leaf.kind in ("box", *OUTLINED) else tuple(INSCRIBED * s for s in size)
        if self.leaf.kind in ("cylinder", "cone"):
            held = (*held[:-1], size[-1])
        elif self.leaf.kind == "torus":
            held = (size[0], max(size[1] - (1 - INSCRIBED) * sum(size), 1e-9 * size[1]))
        return np.array([(*s, 0.0, 0.0)[:3] for s in (size, held)], float)

    @cached_property
    def outlines(self) -> tuple[Outline | None, Outline | None]:
        """As `sizes`, of what is drawn: where both agree about a point, so does the polyhedron."""
        outline = self.leaf.outline
        return outline, outline and flatten(outline, INSCRIBED if self.leaf.kind == "revolve" else 1.0)

    @cached_property
    def corners(self) -> np.ndarray:
        """The eight corners [8, 3] of the local box, in the world."""
        return (_CUBE * self.half) @ self.rotation.T + self.leaf.center

    @cached_property
    def inexactness(self) -> float:
        """How far the polyhedron lies off the primitive at most."""
        radii = arc_radii(self.leaf.outline) if self.leaf.outline else []
        return (1 - INSCRIBED) * max([float(self.half.max()), *radii])

    @cached_property
    def lowered(self) -> Lowered:
        """As the kernels take it."""
        return lower(self.leaf)

    @cached_property
    def solid(self) -> Manifold:
        """The polyhedron, of `segments` facets a circle."""
        return primitive_to_manifold(self.leaf, self.segments)


_CUBE = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])

_HALF: Mapping[str, Callable[[tuple[float, ...]], tuple[float, float, float]]] = {
    "box": lambda s: (s[0] / 2, s[1] / 2, s[2] / 2),
    "sphere": lambda s: (s[0], s[0], s[0]),
    "cylinder": lambda s: (s[0], s[0], s[1] / 2),
    "cone": lambda s: (max(s[:2]), max(s[:2]), s[2] / 2),
    "torus": lambda s: (s[0] + s[1], s[0] + s[1], s[1]),
    "ellipsoid": lambda s: (s[0], s[1], s[2]),
}

# Whether local points [n, 3] lie inside, for the convex kinds: all corners inside means the whole region inside
_CONVEX: Mapping[str, Callable[[tuple[float, ...], np.ndarray], Any]] = {
    "box": lambda s, q: (np.abs(q) <= np.array(s) / 2).all(axis=1),
    "sphere": lambda s, q: dot_rows(q, q) <= s[0] ** 2,
    "cylinder": lambda s, q: (np.hypot(q[:, 0], q[:, 1]) <= s[0]) & (np.abs(q[:, 2]) <= s[1] / 2),
    "cone": lambda s, q: (np.hypot(q[:, 0], q[:, 1]) <= s[0] + (s[1] - s[0]) * (q[:, 2] / s[2] + 0.5)) & (np.abs(q[:, 2]) <= s[2] / 2),
    "ellipsoid": lambda s, q: dot_rows(q / np.array(s), q / np.array(s)) <= 1,
}


def apart(a: PosedPrimitive, b: PosedPrimitive) -> bool:
    """Whether a face of one of the two local boxes parts them."""
    turn, gap = a.rotation.T @ b.rotation, np.subtract(b.leaf.center, a.leaf.center)
    along_a = np.abs(a.rotation.T @ gap) >= a.half + np.abs(turn) @ b.half
    along_b = np.abs(b.rotation.T @ gap) >= b.half + np.abs(turn.T) @ a.half
    return bool(along_a.any() or along_b.any())


def holds(a: PosedPrimitive, b: PosedPrimitive) -> bool:
    """Whether a convex primitive holds the whole local box of another; False where this does not show."""
    contains = _CONVEX.get(a.leaf.kind)
    return contains is not None and bool(contains(a.leaf.size, (b.corners - a.leaf.center) @ a.rotation).all())


def side_of_ball(a: PosedPrimitive, b: PosedPrimitive) -> int:
    """Whether a ball about the whole local box of b lies outside (1) or inside (-1) the polyhedron of a; 0 where this does not show, as
    beside an ellipsoid, whose value is no distance."""
    if a.leaf.kind == "ellipsoid":
        return 0
    reach = float(np.linalg.norm(b.half)) + a.inexactness
    value = float(kernels.program_sdf(a.lowered, np.array([b.leaf.center], float))[0])
    return int(math.copysign(1, value)) if abs(value) > reach else 0


def diagonal(parts: Sequence[PosedPrimitive]) -> float:
    """Length of the diagonal of the world box of several."""
    low = np.min([part.bounds[0] for part in parts], axis=0)
    high = np.max([part.bounds[1] for part in parts], axis=0)
    return float(np.linalg.norm(high - low))
