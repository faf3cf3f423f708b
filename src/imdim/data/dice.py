"""Random tensors from one generator, on its device."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True)
class Dice:
    """Draws for `n` rows from `generator`."""

    generator: torch.Generator
    n: int

    def uniform(self, low: float | Tensor, high: float | Tensor, *shape: int) -> Tensor:
        """Even between `low` and `high`, [n, *shape]."""
        return low + (high - low) * torch.rand(self.n, *shape, generator=self.generator, device=self.generator.device)

    def log_uniform(self, low: float, high: float, *shape: int) -> Tensor:
        """Even in the logarithm, [n, *shape]."""
        return torch.exp(self.uniform(math.log(low), math.log(high), *shape))

    def coin(self, p: float, *shape: int) -> Tensor:
        """True with probability `p`, bool [n, *shape]."""
        return self.uniform(0.0, 1.0, *shape) < p

    def integers(self, low: int, high: int, *shape: int) -> Tensor:
        """`low` to `high`, both included, int64 [n, *shape]."""
        return torch.randint(low, high + 1, (self.n, *shape), generator=self.generator, device=self.generator.device)

    def normal(self, *shape: int) -> Tensor:
        """Standard normal [n, *shape]."""
        return torch.randn(self.n, *shape, generator=self.generator, device=self.generator.device)

    def rotations(self, *shape: int) -> Tensor:
        """Evenly distributed rotations [n, *shape, 3, 3] (Shoemake 1992: unit quaternions from normal numbers)."""
        return quaternion_matrices(self.normal(*shape, 4))


def quaternion_matrices(quaternions: Tensor) -> Tensor:
    """Rotations [..., 3, 3] of quaternions [..., 4] (real part first) of any length but zero."""
    w, x, y, z = (quaternions / torch.linalg.vector_norm(quaternions, dim=-1, keepdim=True)).unbind(-1)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )
    return torch.stack([torch.stack(row, -1) for row in rows], -2)
