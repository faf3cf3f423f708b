"""What a program is worth: F = distances + volume + price of its size, for whole populations in one batched call.

Design, section 3.1: ``F = sum of dist(p, surface) + lambda * complexity``. Each point stands for its share of the target's area, so the
sum of distances is a volume, and is divided by the target's: it then adds to the volume in which program and target differ, where inside
and outside are known. Operations are one fewer than primitives, so the price is per primitive.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from imdim.program.tree import Combine, Primitive, Program, leaves
from imdim.search.evolve.columns import Columns, packed
from imdim.search.evolve.kernels import mean_distances, states, wrong_weight

_NONE = np.zeros((0, 3))
_CODE = {"union": -1, "intersection": -2, "difference": -3}


@dataclass(frozen=True)
class Evidence:
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
    cap: float = 0.02  # of the diagonal: no point counts as farther away
    capacity: int = 4096  # primitives whose rows are kept


@dataclass(frozen=True, slots=True)
class Score:
    """`volume` and `distance` relative to the target's volume, `error` their weighted sum, `fitness` with the price of the size."""

    volume: float
    distance: float
    error: float
    primitives: int
    fitness: float


class Scorer:
    """Scores programs against one target, remembering leaves and trees. `evaluations` counts the trees that had to be folded."""

    def __init__(self, evidence: Evidence, config: FitnessConfig | None = None) -> None:
        self.evidence, self.config = evidence, config or FitnessConfig()
        self.evaluations = 0
        self._distances = Columns(evidence.surface, "distances", self.config.capacity)
        self.bits = Columns(evidence.samples, "bits", self.config.capacity)
        self.label = packed(evidence.w_in > evidence.w_out)
        self.weight = np.concatenate([np.abs(evidence.w_in - evidence.w_out), np.zeros(-len(evidence.samples) % 64)])
        self._least = float(np.minimum(evidence.w_in, evidence.w_out).sum())
        self._known: dict[int, Score] = {}
        self._keys: dict[Primitive | tuple[int, int, int], int] = {}

    def score(self, programs: Sequence[Program]) -> list[Score]:
        """The scores, in order. Trees equal up to the order of united and intersected parts are folded once."""
        keys = [self.key(p) for p in programs]
        fresh = {k: p for k, p in zip(keys, programs, strict=True) if k not in self._known}
        if fresh:
            self._known.update(zip(fresh, self._measure(list(fresh.values())), strict=True))
        return [self._known[k] for k in keys]

    def key(self, program: Program) -> int:
        """A number for the structure: equal for trees that differ in the order of united or intersected parts alone."""
        keys, stack, values = self._keys, [(program, False)], []
        while stack:
            node, ready = stack.pop()
            if isinstance(node, Primitive):
                values.append(keys.setdefault(node, len(keys)))
            elif ready:
                b, a = values.pop(), values.pop()
                if node.op != "difference" and b < a:
                    a, b = b, a
                values.append(keys.setdefault((_CODE[node.op], a, b), len(keys)))
            else:
                stack += ((node, True), (node.right, False), (node.left, False))
        return values[0]

    def filled(self, programs: Sequence[Program]) -> np.ndarray:
        """The samples inside of each program, as words [t, w]."""
        batch = Batch.of(programs, self.bits.rows(_leaves(programs)))
        out = np.empty((len(programs), len(self.label)), np.uint64)
        states(batch.code, batch.starts, batch.depth, self.bits.table, out)
        return out

    def _measure(self, programs: list[Program]) -> list[Score]:
        self.evaluations += len(programs)
        known = bool(len(self.evidence.samples))
        volume = (self._least + wrong_weight(self.filled(programs), self.label, self.weight)) / self.evidence.volume
        distance = self._distance(programs) * (self.evidence.area / self.evidence.volume)
        error = volume + (self.config.distance_weight if known else 1.0) * distance
        sizes = [sum(1 for _ in leaves(p)) for p in programs]
        return [
            Score(float(v), float(d), float(e), n, float(e) + self.config.size_weight * n)
            for v, d, e, n in zip(volume, distance, error, sizes, strict=True)
        ]

    def _distance(self, programs: list[Program]) -> np.ndarray:
        if not len(self.evidence.surface) or not self.evidence.area:
            return np.zeros(len(programs))
        batch = Batch.of(programs, self._distances.rows(_leaves(programs)))
        cap = np.float32(self.config.cap * self.evidence.diagonal)
        return mean_distances(batch.code, batch.starts, batch.depth, self._distances.table, cap)


@dataclass(frozen=True)
class Batch:
    """Postfix code of many trees in one array: tree t is ``code[starts[t]:starts[t + 1]]``; numbers >= 0 are rows of a table."""

    code: np.ndarray
    starts: np.ndarray
    depth: int

    @staticmethod
    def of(programs: Sequence[Program], rows: dict[Primitive, int]) -> Batch:
        code: list[int] = []
        starts, depth = [0], 1
        for program in programs:
            height = 0
            for step in _postfix(program):
                if isinstance(step, int):
                    height -= 1
                    code.append(step)
                else:
                    height += 1
                    depth = max(depth, height)
                    code.append(rows[step])
            starts.append(len(code))
        return Batch(np.array(code, np.int64), np.array(starts, np.int64), depth)


def _postfix(program: Program) -> list[Primitive | int]:
    # the reverse of node, right, left is left, right, node
    out: list[Primitive | int] = []
    stack = [program]
    while stack:
        node = stack.pop()
        if isinstance(node, Combine):
            out.append(_CODE[node.op])
            stack += (node.left, node.right)
        else:
            out.append(node)
    return out[::-1]


def _leaves(programs: Sequence[Program]) -> list[Primitive]:
    return [leaf for program in programs for leaf in leaves(program)]
