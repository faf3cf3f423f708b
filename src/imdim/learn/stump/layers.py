"""The three layers of CSG-Stump on soft occupancies: complement, intersection, union (Ren et al. 2021, equations for F, S and T).

The paper's minimum and maximum pass a gradient to one entry each. As in the authors' published code, training takes the mean of the
entries under the weights softmax(-40 z), which carry no gradient themselves: near the minimum for entries 0 and 1, and all entries learn.
"""

from __future__ import annotations

import torch
from torch import Tensor

SHARPNESS = 40.0
CHUNK = 64  # points whose [C, K] tables are held at once: they should stay in a core's cache


def complement_nodes(occupancy: Tensor, complement: Tensor) -> Tensor:
    """F [b, n, K] of `occupancy` O [b, n, K]: its complement where W_C [b, K] is 1."""
    flip = complement[:, None]
    return flip * (1 - occupancy) + (1 - flip) * occupancy


def intersect_nodes(nodes: Tensor, connection: Tensor) -> Tensor:
    """S [b, n, C]: the soft minimum over k of ``W F + (1 - W)`` for `nodes` F [b, n, K] and `connection` W_I [b, C, K].

    Without a selected node it is the whole space.
    """
    return 1 - _SoftMaximum.apply(1 - nodes, connection)  # type: ignore[operator]


def unite_terms(terms: Tensor, union: Tensor) -> Tensor:
    """T [b, n]: the soft maximum over c of ``W S`` for `terms` S [b, n, C] and `union` W_U [b, C]."""
    return _SoftMaximum.apply(terms, union[:, None])[..., 0]  # type: ignore[index]


class _SoftMaximum(torch.autograd.Function):
    """The mean [b, n, C] over k of ``a = w x`` under the fixed weights softmax(40 a), for `x` [b, n, K] and `w` [b, C, K], both in 0..1.

    In chunks and with the weights made again on the way back: the whole [b, n, C, K] table would be memory traffic and little else.
    """

    @staticmethod
    def forward(ctx, x: Tensor, w: Tensor) -> Tensor:  # type: ignore[override]
        out = x.new_empty(*x.shape[:2], w.shape[1])
        sums = torch.empty_like(out)
        for b, part in _chunks(x):
            a = w[b] * x[b, part, None]
            weights = (SHARPNESS * a).exp_()  # at most e^40
            sums[b, part] = weights.sum(-1)
            out[b, part] = weights.mul_(a).sum(-1) / sums[b, part]
        ctx.save_for_backward(x, w, sums)
        return out

    @staticmethod
    def backward(ctx, grad: Tensor) -> tuple[Tensor, Tensor]:  # type: ignore[override]
        x, w, sums = ctx.saved_tensors
        share, grad_x, grad_w = grad / sums, torch.empty_like(x), torch.zeros_like(w)
        for b, part in _chunks(x):
            near = x[b, part, None]
            weights = (SHARPNESS * w[b] * near).exp_().mul_(share[b, part, :, None])
            grad_w[b] += (weights * near).sum(0)
            grad_x[b, part] = weights.mul_(w[b]).sum(1)
        return grad_x, grad_w


def _chunks(x: Tensor) -> list[tuple[int, slice]]:
    step = CHUNK if x.device.type == "cpu" else max(1, x.shape[1])
    return [(b, slice(first, first + step)) for b in range(len(x)) for first in range(0, x.shape[1], step)]
