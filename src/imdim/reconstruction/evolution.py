"""Evolution wired to a body: its seeds, the solver for its best, and its log."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from imdim.deadline import Deadline
from imdim.program.tree import Program
from imdim.reconstruction.evidence import ScoringSamples
from imdim.search.evolve.population import EvolutionConfig, Generation, evolve
from imdim.search.evolve.scene import Scene
from imdim.search.evolve.seeds import steps, surface_seeds
from imdim.search.structure import StructureConfig
from imdim.search.structure import search as search_structure


def seeds_of(
    evidence: ScoringSamples, rng: np.random.Generator, deadline: Deadline, policy: Sequence[Program] = ()
) -> dict[str, list[Program]]:
    """Programs to start from, per source."""
    tree = evidence.tree(deadline)
    seeds = {"policy": list(policy), "tree": [tree] if tree else []}
    seeds["surfaces"] = surface_seeds(evidence.families, evidence.size_weight, deadline)
    config = StructureConfig(size_weight=evidence.size_weight)
    found = search_structure(evidence.families, config, rng, deadline)
    seeds["search"] = [p for f in found for p in steps(f.sequence, evidence.families)]
    return seeds


def evolve_observation(
    evidence: ScoringSamples,
    seeds: dict[str, list[Program]],
    rng: np.random.Generator,
    deadline: Deadline,
    config: EvolutionConfig | None = None,
    solver: bool = True,
) -> Iterator[Generation]:
    """Generations over the body, programs in its unit frame, the best of them with fitted numbers where there is a `solver`."""
    scene = Scene(evidence.scorer, evidence.families.arrangement.outer, evidence.families)
    return evolve(seeds, scene, rng, deadline, config, evidence.solve if solver else None)


def log_generations(generations: Iterable[Generation], folder: str, name: str) -> Iterator[Generation]:
    """The same generations, each written to tensorboard's event files in ``folder/name`` as it passes."""
    from torch.utils.tensorboard import SummaryWriter

    writer = SummaryWriter(Path(folder) / name)
    try:
        for g in generations:
            values = {
                **{f"best/{part}": getattr(g.best.score, part) for part in ("fitness", "error", "volume", "distance", "primitives")},
                "front/size": len(g.front),
                "front/least_error": g.front[-1].score.error,
                "population/diversity": g.diversity,
                "population/evaluations": g.evaluations,
                **{f"origins/{name}": count for name, count in g.origins.items()},
            }
            for name, value in values.items():
                writer.add_scalar(name, value, g.number)
            yield g
    finally:
        writer.close()
