"""What operators may look at: the scorer, the candidate families of the detected surfaces (if any), and where a program is wrong."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from imdim.geometry import kernels
from imdim.geometry.rotations import euler_from_matrix
from imdim.geometry.sampling import subsample
from imdim.program.rewrite.containment import bounding_radius
from imdim.program.tree import Primitive, Program, Vec3, envelope, leaves
from imdim.search.bits import unpack_words
from imdim.search.candidate_families import Families
from imdim.search.front.fitness import Scorer
from imdim.search.front.leaf_cache import LeafCache

# Local frames whose z axis is the old z, x or y.
TURNS = ((0, 1, 2), (1, 2, 0), (2, 0, 1))
OWNED = 1024  # surface points that tell the local error of leaves


@dataclass
class Scene:
    """`bounds` [2, 3] is the box that every primitive must touch; lengths of mutations are shares of its diagonal."""

    scorer: Scorer
    bounds: np.ndarray
    families: Families | None = None
    cells: LeafCache | None = field(init=False, default=None)
    near: np.ndarray = field(init=False)
    rotations: tuple[Vec3, ...] = field(init=False)
    _held: dict[Primitive, bool] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        surface = self.scorer.target.surface
        self.near = subsample(surface, OWNED)
        if self.families is not None:
            self.cells = LeafCache(self.families.cells.points, "bits", self.scorer.registry, self.scorer.config.capacity)
        self.rotations = _rotations(self.families)

    @cached_property
    def diagonal(self) -> float:
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]))

    def holds(self, primitive: Primitive) -> bool:
        """Whether the ball around a primitive touches the bounds, and no size is negligible."""
        if primitive not in self._held:
            self._held[primitive] = self._holds(primitive)
        return self._held[primitive]

    def _holds(self, primitive: Primitive) -> bool:
        center = np.asarray(primitive.center)
        outside = np.maximum(np.maximum(self.bounds[0] - center, center - self.bounds[1]), 0.0)
        least = 1e-5 * self.diagonal
        size = envelope(primitive).size
        thin = min(size) < least if primitive.kind != "cone" else max(size[:2]) < least or size[2] < least
        return not thin and float(np.linalg.norm(outside)) <= bounding_radius(primitive)

    def wrong_point(self, program: Program, rng: np.random.Generator) -> np.ndarray | None:
        """A sample [3] on the wrong side of `program`, drawn by volume; of the surface, by distance, where no sample is wrong."""
        scorer = self.scorer
        wrong = unpack_words(scorer.fill([program])[0] ^ scorer.label, scorer.bits.count)
        weight = np.where(wrong, scorer.weight[: scorer.bits.count], 0.0)
        if weight.sum() > 0:
            return scorer.target.samples[rng.choice(len(weight), p=weight / weight.sum())]
        if not len(self.near):
            return None
        far = np.abs(kernels.program_sdf(program, self.near))
        return self.near[rng.choice(len(far), p=far / far.sum())] if far.sum() > 0 else None

    def local_errors(self, program: Program) -> np.ndarray:
        """Mean distance [k] to the surface points that each leaf decides; leaves that decide none get the mean of all."""
        if not len(self.near):
            return np.full(sum(1 for _ in leaves(program)), 0.01 * self.diagonal)
        leaf, value, _, _ = kernels.program_tangent(program, self.near)
        size = np.minimum(np.abs(value), self.scorer.config.cap * self.diagonal)
        count = sum(1 for _ in leaves(program))
        total, points = np.bincount(leaf, size, count), np.bincount(leaf, minlength=count)
        return np.where(points > 0, total / np.maximum(points, 1), size.mean())


def _rotations(families: Families | None) -> tuple[Vec3, ...]:
    """Orientations that occur: upright, lying along x and y, and the frames of detected directions."""
    out: list[Vec3] = [(0.0, 0.0, 0.0), (0.0, 90.0, 0.0), (-90.0, 0.0, 0.0)]
    for axes in (families.arrangement.rotation(frame) for frame in families.arrangement.frames) if families else ():
        out += [euler_from_matrix(axes[:, turn]) for turn in TURNS]
    return tuple(dict.fromkeys(out))
