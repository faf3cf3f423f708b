"""Samples for CSG-Stump Net: a cloud and test points in and around the solid, labelled exactly by the program that made it."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from imdim.data.augment import augment
from imdim.data.dice import Dice
from imdim.data.solids import Solids, holds, inside
from imdim.data.synthesize import SynthesisConfig, draw_programs
from imdim.learn.stump.settings import StumpConfig


class Occupied(NamedTuple):
    """A batch: `cloud` [b, n, 3] as a scanner might deliver it, test `points` [b, m, 3] and which are `inside` [b, m] (0 or 1)."""

    cloud: Tensor
    points: Tensor
    inside: Tensor


def draw_samples(n: int, synthesis: SynthesisConfig, config: StumpConfig, generator: torch.Generator) -> Occupied:
    """`n` samples on the generator's device. Raises as `draw_programs` does."""
    solids, cloud = draw_programs(n, synthesis, generator)
    return label_solids(solids, cloud, synthesis, config, generator)


def label_solids(solids: Solids, exact: Tensor, synthesis: SynthesisConfig, config: StumpConfig, generator: torch.Generator) -> Occupied:
    """Samples of known `solids` and their clouds [b, n, 3]."""
    points = test_points(exact, config, generator)
    held = inside(solids, holds(solids, points))
    return Occupied(augment(exact, synthesis.augment, generator)[:, : config.cloud], points, held.float())


def test_points(cloud: Tensor, config: StumpConfig, generator: torch.Generator) -> Tensor:
    """`config.points` points [b, m, 3] in the box of a cloud [b, n, 3], the even ones first, then those beside the surface."""
    dice, beside = Dice(generator, len(cloud)), round(config.near * config.points)
    low, high = cloud.amin(1, keepdim=True) - config.margin, cloud.amax(1, keepdim=True) + config.margin
    even = dice.uniform(low, high, config.points - beside, 3)
    chosen = dice.integers(0, cloud.shape[1] - 1, beside)
    rows = torch.arange(len(cloud), device=cloud.device)[:, None]
    return torch.cat([even, cloud[rows, chosen] + config.spread * dice.normal(beside, 3)], 1)
