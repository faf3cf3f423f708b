"""What a program is worth: F = distances + volume + price of its size, for whole populations in one batched call.

Design, section 3.1: ``F = sum of dist(p, surface) + lambda * complexity``. Each point stands for its share of the target's area, so the
sum of distances is a volume, and is divided by the target's: it then adds to the volume in which program and target differ, where inside
and outside are known. Operations are one fewer than primitives, so the price is per primitive. Where detected surfaces are exact, as those
of a mesh are, a face that lies on none of them has a price too: else numbers would drift to fit the facets of round surfaces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import chain

import numpy as np

from imdim.geometry.lowering import OP_CODES
from imdim.program.tree import Combine, Program
from imdim.search.bits import pack_words
from imdim.search.front.face_support import Carriers
from imdim.search.front.kernels import mean_distances, states, wrong_weight
from imdim.search.front.leaf_cache import LeafCache, Registry

_NONE = np.zeros((0, 3))


@dataclass(frozen=True)
class SampledTarget:
    """What is known of the target: points [s, 3] of its surface, which has `area`, and samples [n, 3] with the volumes that they
    stand for inside and outside, `w_in` and `w_out` [n]. Without samples the volume of the hull of all that is known is taken.
    """

    surface: np.ndarray
    area: float = 0.0
    samples: np.ndarray = field(default_factory=lambda: _NONE)
    w_in: np.ndarray = field(default_factory=lambda: np.zeros(0))
    w_out: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def diagonal(self) -> float:
        points = self.surface if len(self.surface) else self.samples
        return float(np.linalg.norm(np.ptp(points, axis=0)))

    @property
    def volume(self) -> float:
        return float(self.w_in.sum()) if len(self.samples) else self.diagonal**3


@dataclass
class FitnessConfig:
    size_weight: float = 2.5e-4  # lambda: of the target's volume, per primitive
    distance_weight: float = 0.25  # of the distances where volumes are known too; else 1
    free_weight: float = 0.0  # of the target's volume, per face that lies on no detected surface, where that is known
    cap: float = 0.02  # of the diagonal: no point counts as farther away
    capacity: int = 4096  # primitives whose rows are kept


@dataclass(frozen=True, slots=True)
class Score:
    """`volume` and `distance` relative to the target's volume, `error` their weighted sum and the price of `free` faces, `fitness` with the
    price of the size.
    """

    volume: float
    distance: float
    error: float
    primitives: int
    fitness: float
    free: int = 0


class Scorer:
    """Scores programs against one target, remembering leaves and trees. `evaluations` counts the trees that had to be folded."""

    def __init__(self, target: SampledTarget, config: FitnessConfig | None = None, carriers: Carriers | None = None) -> None:
        self.target, self.config, self.carriers = target, config or FitnessConfig(), carriers
        self.evaluations = 0
        self.registry = Registry()
        self._distances = LeafCache(target.surface, "distances", self.registry, self.config.capacity)
        self.bits = LeafCache(target.samples, "bits", self.registry, self.config.capacity)
        self.label = pack_words(target.w_in > target.w_out)
        self.weight = np.concatenate([np.abs(target.w_in - target.w_out), np.zeros(-len(target.samples) % 64)])
        self._least = float(np.minimum(target.w_in, target.w_out).sum())
        self._known: dict[int, Score] = {}
        self._nodes: dict[tuple[int, int, int], int] = {}

    def score(self, programs: Sequence[Program]) -> list[Score]:
        """The scores, in order. Trees equal up to the order of united and intersected parts are folded once."""
        codes = [self._code(p) for p in programs]
        keys = [self._key(code) for code in codes]
        fresh = {k: code for k, code in zip(keys, codes, strict=True) if k not in self._known}
        if fresh:
            self._known.update(zip(fresh, self._measure(list(fresh.values())), strict=True))
        return [self._known[k] for k in keys]

    def key(self, program: Program) -> int:
        """A number for the structure: equal for trees that differ in the order of united or intersected parts alone."""
        return self._key(self._code(program))

    def fill(self, programs: Sequence[Program]) -> np.ndarray:
        """The samples inside of each program, as words [t, w]."""
        return self._fill_batch(_Batch.of([self._code(p) for p in programs]))

    def _code(self, program: Program) -> list[int]:
        """Postfix code: ids of primitives and the codes of operations."""
        # the reverse of node, right, left is left, right, node
        out: list[int] = []
        stack, number = [program], self.registry.id
        while stack:
            node = stack.pop()
            if isinstance(node, Combine):
                out.append(OP_CODES[node.op])
                stack += (node.left, node.right)
            else:
                out.append(number(node))
        return out[::-1]

    def _key(self, code: list[int]) -> int:
        nodes, values = self._nodes, []
        for step in code:
            if step >= 0:
                values.append(step)
                continue
            b, a = values.pop(), values[-1]
            if b < a and step != OP_CODES["difference"]:
                a, b = b, a
            values[-1] = nodes.setdefault((step, a, b), -1 - len(nodes))
        return values[0]

    def _measure(self, codes: list[list[int]]) -> list[Score]:
        self.evaluations += len(codes)
        batch = _Batch.of(codes)
        volume = (self._least + wrong_weight(self._fill_batch(batch), self.label, self.weight)) / self.target.volume
        distance = self._distance(batch) * (self.target.area / self.target.volume)
        free = [self._free_faces(code) for code in codes]
        weight = self.config.distance_weight if len(self.target.samples) else 1.0
        error = volume + weight * distance + self.config.free_weight * np.array(free)
        sizes = [(len(code) + 1) // 2 for code in codes]
        fitness = error + self.config.size_weight * np.array(sizes)
        rows = zip(volume.tolist(), distance.tolist(), error.tolist(), sizes, fitness.tolist(), free, strict=True)
        return [Score(*row) for row in rows]

    def _free_faces(self, code: list[int]) -> int:
        if self.carriers is None or not self.config.free_weight:
            return 0
        parts = self.registry.primitives
        return sum(self.carriers.free_faces(parts[step]) for step in code if step >= 0)

    def _fill_batch(self, batch: _Batch) -> np.ndarray:
        out = np.empty((len(batch.starts) - 1, len(self.label)), np.uint64)
        code = batch.over(self.bits)
        states(code, batch.starts, batch.depth, self.bits.table, out)
        return out

    def _distance(self, batch: _Batch) -> np.ndarray:
        if not len(self.target.surface) or not self.target.area:
            return np.zeros(len(batch.starts) - 1)
        cap = np.float32(self.config.cap * self.target.diagonal)
        code = batch.over(self._distances)
        return mean_distances(code, batch.starts, batch.depth, self._distances.table, cap)


@dataclass(frozen=True)
class _Batch:
    """Postfix code of many trees in one array: tree t is ``code[starts[t]:starts[t + 1]]``; its stack holds `depth` values at most."""

    code: np.ndarray
    starts: np.ndarray
    depth: int

    @staticmethod
    def of(codes: Sequence[list[int]]) -> _Batch:
        code = np.fromiter(chain.from_iterable(codes), np.int64)
        lengths = np.array([len(c) for c in codes], np.int64)
        starts = np.concatenate([[0], np.cumsum(lengths)])
        # every tree leaves one value behind
        heights = np.cumsum(np.where(code >= 0, 1, -1)) - np.repeat(np.arange(len(codes)), lengths)
        return _Batch(code, starts, int(heights.max(initial=1)))

    def over(self, columns: LeafCache) -> np.ndarray:
        """The code with rows of `columns` in place of ids."""
        out = self.code.copy()
        out[out >= 0] = columns.rows(out[out >= 0])
        return out
