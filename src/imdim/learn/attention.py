"""Pre-norm transformer layers, batch first throughout. Source: Vaswani et al. 2017; Xiong et al. 2020, "On Layer Normalization".

`torch.nn.MultiheadAttention` lays its inputs out sequence first inside; on a CPU its copies take as long as its products.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

Read = tuple[Tensor, Tensor]


class Attention(nn.Module):
    """Multi-head attention of queries [b, q, d] to what `read` made of a memory [b, s, d].

    `mask`, broadcast to [b, heads, q, s], is true where one may look. The scores of all pairs are never laid out at once (Dao et al. 2022).
    """

    def __init__(self, d_model: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.query, self.key, self.value, self.out = (nn.Linear(d_model, d_model) for _ in range(4))

    def read(self, memory: Tensor) -> Read:
        """Keys and values [b, heads, s, d / heads]."""
        return self._split(self.key(memory)), self._split(self.value(memory))

    def forward(self, x: Tensor, read: Read, mask: Tensor | None) -> Tensor:
        q, (k, v) = self._split(self.query(x)), read
        return self.out(nn.functional.scaled_dot_product_attention(q, k, v, mask).transpose(1, 2).flatten(2))

    def _split(self, x: Tensor) -> Tensor:
        return x.unflatten(-1, (self.heads, -1)).transpose(1, 2)


class Layer(nn.Module):
    """Self-attention, attention to a memory if `cross`, and a feed-forward part, each added to what comes in."""

    def __init__(self, d_model: int, heads: int, cross: bool = False) -> None:
        super().__init__()
        self.norms = nn.ModuleList(nn.LayerNorm(d_model) for _ in range(3 if cross else 2))
        self.attend = Attention(d_model, heads)
        self.consult = Attention(d_model, heads) if cross else None
        self.feed = nn.Sequential(nn.Linear(d_model, 2 * d_model), nn.GELU(), nn.Linear(2 * d_model, d_model))

    def read(self, memory: Tensor) -> Read:
        """What `forward` consults. Raises TypeError for a layer without `cross`."""
        if not isinstance(self.consult, Attention):
            raise TypeError("this layer consults no memory")
        return self.consult.read(memory)

    def forward(self, x: Tensor, mask: Tensor, memory: Read | None = None, memory_mask: Tensor | None = None) -> Tensor:
        inner = self.norms[0](x)
        x = x + self.attend(inner, self.attend.read(inner), mask)
        if self.consult is not None and memory is not None:
            x = x + self.consult(self.norms[1](x), memory, memory_mask)
        return x + self.feed(self.norms[-1](x))


def causal(count: int, device: torch.device) -> Tensor:
    """Mask bool [count, count]: each place sees itself and those before it."""
    return torch.ones(count, count, dtype=torch.bool, device=device).tril()
