"""What real scans do to a cloud: noise, outliers, uneven density, missing sides; batched, on any device."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from imdim.data.dice import Dice


@dataclass
class AugmentConfig:
    """Each effect meets a row with its probability `p_*`, with a strength drawn evenly from 0 to the maximum beside it.

    `noise` is a standard deviation relative to the diagonal, drawn from `least_noise` on, `outliers` a share of the points, `thinning` how
    much sparser the cloud gets from one end to the other, `missing` the share of the points lost at one side, `views` the number of sides
    from which a solid is seen, drawn from 1 (see `hide_unseen`, which needs the solid). All off by default.
    """

    p_noise: float = 0.0
    noise: float = 0.01
    least_noise: float = 0.0
    p_outliers: float = 0.0
    outliers: float = 0.05
    p_uneven: float = 0.0
    thinning: float = 0.9
    p_missing: float = 0.0
    missing: float = 0.4
    p_views: float = 0.0
    views: int = 6


def augment(points: Tensor, config: AugmentConfig, generator: torch.Generator) -> Tensor:
    """Clouds [b, n, 3] of diagonal 1 as a scanner might deliver them, still [b, n, 3]: lost points are replaced by repeats of others."""
    dice = Dice(generator, len(points))
    points = _thin(points, dice, config)
    strength = torch.where(dice.coin(config.p_noise), dice.uniform(config.least_noise, config.noise), 0.0)
    points = points + strength[:, None, None] * dice.normal(*points.shape[1:])
    share = torch.where(dice.coin(config.p_outliers), dice.uniform(0.0, config.outliers), 0.0)
    low, high = points.amin(1, keepdim=True), points.amax(1, keepdim=True)
    stray = low + (high - low) * dice.uniform(-0.1, 1.1, *points.shape[1:])
    return torch.where((dice.uniform(0.0, 1.0, points.shape[1]) < share[:, None])[..., None], stray, points)


def _thin(points: Tensor, dice: Dice, config: AugmentConfig) -> Tensor:
    """Drop points along a random direction, by a gradient of density and beyond a plane, and repeat kept ones in their place."""
    n = points.shape[1]
    along = torch.linalg.vecdot(points, dice.rotations()[:, None, 0])
    rank = torch.argsort(torch.argsort(along, dim=1), dim=1) / n
    lean = torch.where(dice.coin(config.p_uneven), dice.uniform(0.0, config.thinning), 0.0)
    lost = torch.where(dice.coin(config.p_missing), dice.uniform(0.0, config.missing), 0.0)
    weight = (1 - lean[:, None] * rank) * (rank < 1 - lost[:, None])
    touched = (lean > 0) | (lost > 0)
    weight = torch.where(touched[:, None], weight, 1.0)
    chosen = torch.multinomial(weight, n, replacement=True, generator=dice.generator)
    chosen = torch.where(touched[:, None], chosen, torch.arange(n, device=points.device))
    return points.gather(1, chosen[..., None].expand(-1, -1, 3))
