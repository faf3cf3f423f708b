"""Evolution wired to a body: its evidence, its seeds, the solver for its best, and the front of programs from crude to exact."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from imdim.geometry.surface import Surface
from imdim.program.cost import count
from imdim.program.front import Choice
from imdim.program.tree import Program, combine_all
from imdim.search.cells import Samples
from imdim.search.evolve.carriers import Carriers
from imdim.search.evolve.fitness import Evidence, FitnessConfig, Scorer
from imdim.search.evolve.front import Individual, spread
from imdim.search.evolve.population import EvolutionConfig, Generation, evolve
from imdim.search.evolve.scene import Scene
from imdim.search.evolve.seeds import steps, surface_seeds
from imdim.search.evolve.thinning import thinned
from imdim.search.families import Families
from imdim.search.structure import StructureConfig
from imdim.search.structure import search as search_structure
from imdim.seeding.decision_tree import grow
from imdim.seeding.tree_to_csg import to_program as tree_to_program
from imdim.solve.refine import RefineConfig, refine

SAMPLES = 65_536
SURFACE = 2_048  # points that scores and the solver see
MOST_CHOICES = 7
NEGLIGIBLE = 1e-5  # of the volume; a choice that betters the one before by less is none


@dataclass(frozen=True)
class Ground:
    """A body in its unit frame: its detected surfaces, families and labelled samples, points [s, 3] of its surface, which has `area`."""

    surfaces: Sequence[Surface]
    families: Families
    samples: Samples
    points: np.ndarray
    area: float
    size_weight: float
    exact: bool = False  # whether detected surfaces are exact: numbers then leave them only where it pays

    @cached_property
    def scorer(self) -> Scorer:
        rng = np.random.default_rng(0)  # which samples are looked at is no matter of chance from run to run
        chosen = rng.permutation(len(self.samples.points))[:SAMPLES]
        # fewer samples stand for the same volume
        share = len(self.samples.points) / len(chosen)
        w_in, w_out = self.samples.w_in[chosen] * share, self.samples.w_out[chosen] * share
        evidence = Evidence(self._surface(), self.area, self.samples.points[chosen], w_in, w_out)
        config = FitnessConfig(self.size_weight, free_weight=self.size_weight if self.exact else 0.0)
        return Scorer(evidence, config, Carriers(self.families.arrangement))

    def _surface(self) -> np.ndarray:
        return self.points[np.random.default_rng(1).permutation(len(self.points))[:SURFACE]]

    def solve(self, program: Program) -> Program:
        """The program with its numbers fitted to the surface, by a few steps."""
        return refine(program, self.scorer.evidence.surface, config=RefineConfig(adam_steps=0, newton_steps=15, start_scale=0.01)).program

    def tree(self, out_of_time: Callable[[], bool] = bool) -> Program | None:
        """The decision tree's program, made shorter while there is time (by default any)."""
        cells = self.families.cells
        tree = grow(cells.points, cells.w_in > cells.w_out, self.surfaces, cells.w_in + cells.w_out)
        low, high = self.families.arrangement.bounds
        return tree_to_program(tree, low, high, out_of_time)


def seeds_of(
    ground: Ground, rng: np.random.Generator, out_of_time: Callable[[], bool], policy: Sequence[Program] = ()
) -> dict[str, list[Program]]:
    """Programs to start from, per source."""
    tree = ground.tree(out_of_time)
    seeds = {"policy": list(policy), "tree": [tree] if tree else []}
    seeds["surfaces"] = surface_seeds(ground.families, ground.size_weight, out_of_time)
    config = StructureConfig(size_weight=ground.size_weight)
    found = search_structure(ground.families, config, rng, out_of_time)
    seeds["search"] = [p for f in found for p in steps(f.sequence, ground.families)]
    return seeds


def evolved(
    ground: Ground,
    seeds: dict[str, list[Program]],
    rng: np.random.Generator,
    out_of_time: Callable[[], bool],
    config: EvolutionConfig | None = None,
    solver: bool = True,
) -> Iterator[Generation]:
    """Generations over the body, programs in its unit frame, the best of them with fitted numbers where there is a `solver`."""
    scene = Scene(ground.scorer, ground.families.arrangement.outer, ground.families)
    return evolve(seeds, scene, rng, out_of_time, config, ground.solve if solver else None)


def choices(ground: Ground, programs: Sequence[Program]) -> list[Choice]:
    """The front of `programs` and of what thinning the last one leads through; the last one is among them, alone of its size."""
    score = ground.scorer.score([programs[-1]])[0]
    final = Individual(programs[-1], score, "final")
    others = [i for i in thinned(programs, ground.scorer) if i.score.primitives != score.primitives]
    out: list[Individual] = []
    for i in sorted([*others, final], key=lambda i: i.score.primitives):
        if i is final or not out or i.score.error < out[-1].score.error - NEGLIGIBLE:
            out.append(i)
    return [Choice(i.program, i.score.volume) for i in out]


def united(fronts: Sequence[Sequence[Choice]], finals: Sequence[Program], volumes: Sequence[float]) -> list[Choice]:
    """Fronts of several bodies as one of their union, which leads from the crudest through the finals to the most exact.

    Each step refines the body that gains most volume per primitive. Errors add up by the bodies' `volumes`.
    """
    at = [0] * len(fronts)
    stops = [next(i for i, c in enumerate(front) if c.program == final) for front, final in zip(fronts, finals, strict=True)]
    out = [_union(fronts, at, volumes)]
    for limits in (stops, [len(f) - 1 for f in fronts]):
        while steps_left := [b for b in range(len(fronts)) if at[b] < limits[b]]:
            chosen = max(steps_left, key=lambda b: _rate(fronts[b][at[b]], fronts[b][at[b] + 1], volumes[b]))
            at[chosen] += 1
            out.append(_union(fronts, at, volumes))
    return out


def _union(fronts: Sequence[Sequence[Choice]], at: Sequence[int], volumes: Sequence[float]) -> Choice:
    picked = [front[i] for front, i in zip(fronts, at, strict=True)]
    error = sum((c.error or 0.0) * v for c, v in zip(picked, volumes, strict=True)) / sum(volumes)
    return Choice(combine_all("union", [c.program for c in picked]), error)


def _rate(before: Choice, after: Choice, volume: float) -> float:
    more = count(after.program).primitives - count(before.program).primitives
    return ((before.error or 0.0) - (after.error or 0.0)) * volume / max(more, 1)


def few(front: Sequence[Choice], final: Program, most: int = MOST_CHOICES) -> list[Choice]:
    """At most `most` of a front, even in the logarithm of the error; the ends and `final` are among them. None of none."""
    final_at = next((i for i, c in enumerate(front) if c.program == final), len(front) - 1)
    return [front[i] for i in spread([c.error or 0.0 for c in front], most, final_at)]


def logged(generations: Iterable[Generation], folder: str, name: str) -> Iterator[Generation]:
    """The same generations, each written to tensorboard's event files in ``folder/name`` as it passes."""
    from torch.utils.tensorboard import SummaryWriter

    writer = SummaryWriter(Path(folder) / name)
    try:
        for g in generations:
            best, step = g.best.score, g.number
            values = {
                "best/fitness": best.fitness,
                "best/error": best.error,
                "best/volume": best.volume,
                "best/distance": best.distance,
                "best/primitives": best.primitives,
                "front/size": len(g.front),
                "front/least_error": g.front[-1].score.error,
                "population/diversity": g.diversity,
                "population/evaluations": g.evaluations,
                **{f"origins/{name}": count for name, count in g.origins.items()},
            }
            for name, value in values.items():
                writer.add_scalar(name, value, step)
            yield g
    finally:
        writer.close()
