"""Families of planted parts, made of the very surfaces they were drawn with: search without detection."""

from __future__ import annotations

from functools import cache

import numpy as np
from tests.planted import PARTS, carriers

from imdim.geometry import kernels
from imdim.geometry.solid import to_manifold
from imdim.program.tree import Program
from imdim.search.arrangement import Arrangement, ArrangementConfig, arrange
from imdim.search.candidate_families import Candidate, Families
from imdim.search.cells import Cells, compress_samples, label_samples


def arrangement_of(program: Program) -> Arrangement:
    surfaces = carriers(program)
    bounds = np.array(to_manifold(program).bounding_box()).reshape(2, 3)
    return arrange(surfaces, [1.0] * len(surfaces), bounds, ArrangementConfig())


def families_of(program: Program, count: int = 40_000) -> Families:
    arrangement = arrangement_of(program)
    return Families(arrangement, cells_of(arrangement, program, count))


def cells_of(arrangement: Arrangement, program: Program, count: int) -> Cells:
    samples = label_samples(arrangement, lambda p: kernels.inside(program, p).astype(float), count, np.random.default_rng(7))
    return compress_samples(arrangement, samples)


@cache
def planted(name: str) -> Families:
    return families_of(PARTS[name])


def random_candidates(families: Families, count: int, rng: np.random.Generator) -> list[Candidate]:
    """Members of all families with random ranges that hold at least one cell."""
    arrangement, out = families.arrangement, []
    sources = [("box", f) for f in range(len(arrangement.frames))] + [("curved", i) for i in range(len(arrangement.curved))]
    while len(out) < count:
        kind, index = sources[rng.integers(len(sources))]
        axes = arrangement.frames[index] if kind == "box" else (arrangement.axis_of[index],)
        widths = [len(arrangement.directions[a].offsets) if a >= 0 else 2 for a in axes]
        ranges = [tuple(int(i) for i in np.sort(rng.choice(w, 2, replace=False))) for w in widths]
        candidate = Candidate((kind, index), tuple(ranges))  # type: ignore[arg-type]
        if families.mask(candidate).any():
            out.append(candidate)
    return out
