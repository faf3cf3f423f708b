"""What scanners see of a solid: of each point whether the way to one of them is free; batched, on any device."""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import Tensor

from imdim.data.dice import Dice
from imdim.data.solids import Solids, holds, inside

MARCH = 24  # places looked at on the way out
FIRST, LAST = 0.004, 1.1  # of the diagonal: how far out they begin and end
LEAST = 0.1  # of the points: what shows less is seen all around


def hide_unseen(solids: Solids, points: Tensor, p_views: float, most: int, generator: torch.Generator) -> Tensor:
    """Clouds [b, n, 3] on `solids`, of diagonal 1, as scanners far away see them: with probability `p_views` from one to `most` random
    sides, else all around. Hidden points are replaced by repeats of others; walls thinner than the steps of the march may let rays pass."""
    dice = Dice(generator, len(points))
    sides = torch.where(dice.coin(p_views), dice.integers(1, most), 0)
    directions = dice.rotations(most)[..., 0]
    some = (sides > 0).nonzero()[:, 0]
    if not len(some):
        return points
    seen = torch.zeros(len(some), points.shape[1], dtype=torch.bool, device=points.device)
    for side in range(most):
        free = ~_blocked(solids[some], points[some], directions[some, side])
        seen |= free & (side < sides[some])[:, None]
    seen |= (seen.sum(1) < LEAST * points.shape[1])[:, None]
    chosen = torch.multinomial(seen.float(), points.shape[1], replacement=True, generator=generator)
    # points that are seen stay where they are
    column = torch.arange(points.shape[1], device=points.device)
    chosen = torch.where(seen, column, chosen)
    return points.index_copy(0, some, points[some].gather(1, chosen[..., None].expand(-1, -1, 3)))


def _blocked(solids: Solids, points: Tensor, direction: Tensor) -> Tensor:
    """Whether the solid stands on the way from `points` [b, n, 3] along `direction` [b, 3], bool [b, n]."""
    steps = torch.cat([torch.tensor([FIRST]), torch.linspace(0.02, LAST, MARCH - 1)]).to(points)
    way = points[:, :, None] + steps[:, None] * direction[:, None, None]
    held = inside(solids, holds(solids, way.flatten(1, 2)))
    return held.unflatten(1, (points.shape[1], MARCH)).any(2)


def fit_frame(solids: Solids, points: Tensor) -> tuple[Solids, Tensor]:
    """Programs and clouds [b, n, 3] moved and scaled together: box centre 0, box diagonal 1."""
    low, high = points.amin(1), points.amax(1)
    middle, scale = (low + high) / 2, 1 / torch.linalg.vector_norm(high - low, dim=-1).clamp_min(1e-9)
    placed = replace(solids, centers=(solids.centers - middle[:, None]) * scale[:, None, None], sizes=solids.sizes * scale[:, None, None])
    return placed, (points - middle[:, None]) * scale[:, None, None]
