"""What judges programs of one body: its detected surfaces and labelled samples, the scorer over them, and its decision tree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.geometry.surface import Surface
from imdim.numbers.refine import RefineConfig, refine
from imdim.program.tree import Program
from imdim.search.candidate_families import Families
from imdim.search.cells import VolumeSamples
from imdim.search.decision_tree import DecisionTreeConfig, grow
from imdim.search.front.face_support import Carriers
from imdim.search.front.fitness import FitnessConfig, SampledTarget, Scorer
from imdim.search.tree_to_csg import to_program as tree_to_program

SAMPLES = 65_536
SURFACE = 2_048  # points that scores and the solver see
SIDE_S = 5e-8  # that a tree takes for each cell and surface
GROWTH, LEAST_S = 0.5, 0.1  # of the time left, for a tree to grow before it is written, and the least that it gets
SAMPLES_SEED, SURFACE_SEED = 0, 1  # which of them are looked at is no matter of chance from run to run


@dataclass(frozen=True)
class ScoringSamples:
    """A body in its unit frame: its detected surfaces, families and labelled samples, points [s, 3] of its surface, which has `area`."""

    surfaces: Sequence[Surface]
    families: Families
    samples: VolumeSamples
    points: np.ndarray
    area: float
    size_weight: float
    exact: bool = False  # whether detected surfaces are exact: numbers then leave them only where it pays

    @cached_property
    def scorer(self) -> Scorer:
        chosen = np.random.default_rng(SAMPLES_SEED).permutation(len(self.samples.points))[:SAMPLES]
        # fewer samples stand for the same volume
        share = len(self.samples.points) / len(chosen)
        w_in, w_out = self.samples.w_in[chosen] * share, self.samples.w_out[chosen] * share
        surface = self.points[np.random.default_rng(SURFACE_SEED).permutation(len(self.points))[:SURFACE]]
        target = SampledTarget(surface, self.area, self.samples.points[chosen], w_in, w_out)
        config = FitnessConfig(self.size_weight, free_weight=self.size_weight if self.exact else 0.0)
        return Scorer(target, config, Carriers(self.families.arrangement))

    def solve(self, program: Program) -> Program:
        """The program with its numbers fitted to the surface, by a few steps."""
        return refine(program, self.scorer.target.surface, config=RefineConfig(newton_steps=15, start_scale=0.01)).program

    def tree(self, deadline: Deadline = NEVER, config: DecisionTreeConfig | None = None, of_some: bool = False) -> Program | None:
        """The decision tree's program, made shorter while there is time (by default any); where there is none for all cells, some stand for
        them if it may be `of_some`."""
        cells = self.families.cells
        if of_some and (most := self._count_in_time(deadline)) < len(cells.points):
            cells = cells.choose(np.random.default_rng(SAMPLES_SEED).permutation(len(cells.points))[:most])
        tree = grow(cells.points, cells.w_in > cells.w_out, self.surfaces, cells.w_in + cells.w_out, config, deadline)
        low, high = self.families.arrangement.bounds
        return tree_to_program(tree, low, high, deadline)

    def has_time_for_all_cells(self, deadline: Deadline) -> bool:
        """Whether a tree can grow over all of them in the time that is left."""
        return self._count_in_time(deadline) >= len(self.families.cells.points)

    def _count_in_time(self, deadline: Deadline) -> int:
        cells = max(GROWTH * deadline.left(), LEAST_S) / (SIDE_S * max(len(self.surfaces), 1))
        return int(min(cells, len(self.families.cells.points)))
