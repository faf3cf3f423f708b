"""One shape fitted by its own occupancy, from a network's prediction or from a random start, and made binary.

Adam on the decoder's numbers and logits (the paper trains the network alone): first with soft matrices, then straight through thresholds,
so that little is lost when they become binary; then the numbers of what is left alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from imdim.geometry import kernels
from imdim.geometry.lowering import pack
from imdim.learn.stump.binary import Labels, Matrices, improved, to_stump, used
from imdim.learn.stump.decoded import Decoded, selected, to_primitives
from imdim.learn.stump.net import losses
from imdim.program.stump import CsgStump
from imdim.program.tree import combine_all

CERTAIN = 20.0  # a logit of 1 or 0


@dataclass
class FitConfig:
    """`soft`, `hard` and `last` steps of the three stages, each on `points` of the labels; learning rates of numbers and logits; `eta`
    grows from the first to the second; an entry of W_I must set `price` of the volume right, over `counted` points."""

    soft: int = 200
    hard: int = 100
    last: int = 150
    points: int = 1024
    lr: float = 0.01
    lr_logits: float = 0.1
    eta: tuple[float, float] = (40.0, 300.0)
    primitive_weight: float = 0.001
    price: float = 1e-3
    counted: int = 8192


def fit(shape: Decoded, labels: Labels, config: FitConfig, seed: int = 0, out_of_time: Callable[[], bool] = lambda: False) -> CsgStump:
    """The binary CSG-Stump that explains `labels` from the batch of one `shape`; the same for the same arguments.

    Where `out_of_time`, the stages end early.
    """
    torch.set_num_threads(1)
    generator = torch.Generator().manual_seed(seed)
    counted = labels.some(np.random.default_rng(seed).permutation(len(labels.points))[: config.counted])
    descend = _Descent(labels, config, generator, out_of_time)
    middle = config.eta[0] ** 0.5 * config.eta[1] ** 0.5
    shape = descend(shape, config.soft, (config.eta[0], middle), binary=False)
    shape = descend(shape, config.hard, (middle, middle), binary=True)
    shape, matrices = binarised(shape, counted, config.price)
    shape = descend(shape, config.last, (middle, config.eta[1]), binary=True, numbers_only=True)
    shape, matrices = binarised(shape, counted, config.price)
    return to_stump(to_primitives(shape), matrices)


def binarised(shape: Decoded, labels: Labels, price: float) -> tuple[Decoded, Matrices]:
    """Only what is used of a shape, its logits certain, and the same as matrices."""
    complement, connection, union = ((t[0] > 0).numpy() for t in shape.tensors[1:])
    matrices = improved(Matrices(complement, connection, union), columns(shape, labels.points), labels, price)
    kept, terms = used(matrices)
    matrices = Matrices(complement[kept], matrices.connection[np.ix_(terms, kept)], matrices.union[terms])
    certain = [torch.where(torch.as_tensor(m), CERTAIN, -CERTAIN)[None] for m in (matrices.complement, matrices.connection, matrices.union)]
    return Decoded(*_leading(selected(shape, kept, terms)), *certain), matrices


def _leading(shape: Decoded) -> tuple[tuple[int, ...], Tensor]:
    return shape.kinds, shape.numbers


def columns(shape: Decoded, points: np.ndarray) -> np.ndarray:
    """Which of `points` [n, 3] each primitive of a batch of one holds, bool [K, n]."""
    return kernels.leaf_table(*pack(combine_all("union", list(to_primitives(shape)))), points) < 0


@dataclass
class _Descent:
    """Adam on batches of labels, half of them inside, half as the labels lie."""

    labels: Labels
    config: FitConfig
    generator: torch.Generator
    out_of_time: Callable[[], bool]

    def __post_init__(self) -> None:
        w_in, w_out = (torch.as_tensor(w) for w in (self.labels.w_in, self.labels.w_out))
        self.chance = w_in / w_in.sum() + 1 / len(w_in)
        self.points = torch.as_tensor(self.labels.points, dtype=torch.float32)
        self.inside = (w_in / (w_in + w_out)).float()

    def __call__(self, shape: Decoded, steps: int, eta: tuple[float, float], binary: bool, numbers_only: bool = False) -> Decoded:
        numbers, *logits = (t.detach().clone().requires_grad_(i == 0 or not numbers_only) for i, t in enumerate(shape.tensors))
        config, shape = self.config, Decoded(shape.kinds, numbers, *logits)
        groups = [{"params": [numbers], "lr": config.lr}, {"params": [] if numbers_only else logits, "lr": config.lr_logits}]
        adam = torch.optim.Adam([g for g in groups if g["params"]], betas=(0.9, 0.98))
        rates = [group["lr"] for group in adam.param_groups]
        for step in range(steps):
            if self.out_of_time():
                break
            done = step / steps
            for group, rate in zip(adam.param_groups, rates, strict=True):
                group["lr"] = rate * (1 - 0.9 * done)
            rows = torch.multinomial(self.chance, config.points, replacement=True, generator=self.generator)
            steep = eta[0] * (eta[1] / eta[0]) ** done
            found = losses(shape, self.points[rows][None], self.inside[rows][None], steep, config.primitive_weight, binary)
            adam.zero_grad()
            found["loss"].backward()
            adam.step()
        return Decoded(shape.kinds, *(t.detach() for t in shape.tensors))
