"""One shape fitted by its own occupancy, from a network's prediction or from a random start, and made binary.

Adam on the decoder's numbers and logits (the paper trains the network alone): first with soft matrices, then straight through thresholds,
so that little is lost when they become binary; then the numbers of what the binary matrices use and these matrices in turns, from few
entries to many.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch

from imdim.deadline import NEVER, Deadline
from imdim.geometry import kernels
from imdim.geometry.lowering import pack_all
from imdim.learn.stump.binary import LabelledPoints, Matrices, find_used, improve, to_stump
from imdim.learn.stump.decoded import Decoded, start, to_primitives
from imdim.learn.stump.net import losses
from imdim.program.stump import CsgStump

CERTAIN = 20.0  # a logit of 1 or 0
RICHER = 4.0  # times as dear an entry of W_I is in a round as in the next
FALLEN = 0.1  # of the learning rate, at the end of a stage
HEAVIEST = 10.0  # times the mean, that a drawn point may count
CENTER = slice(4, 7)  # of a primitive's numbers


@dataclass
class FitConfig:
    """Steps: `soft`, then `hard` ones on `points` labels each, then `rounds` times `last` on `last_points`; learning rates of numbers and
    logits, which fall to a tenth; the steepness of occupancy in the first two stages and at the ends of a round. In the last round an
    entry of W_I must set `price` of the volume right; matrices are judged by `counted` labels."""

    soft: int = 200
    hard: int = 60
    rounds: int = 4
    last: int = 80
    points: int = 512
    last_points: int = 2048
    lr: float = 0.01
    lr_logits: float = 0.1
    eta: tuple[float, float] = (40.0, 110.0)
    last_eta: tuple[float, float] = (40.0, 250.0)
    primitive_weight: float = 0.001
    price: float = 2.5e-4
    counted: int = 8192


def random_start(labels: LabelledPoints, primitives: int, intersections: int, seed: int) -> Decoded:
    """`start` with its plain primitives at labels inside, its complemented ones at labels outside but in the box of those inside."""
    generator = torch.Generator().manual_seed(seed)
    shape = start(primitives, intersections, generator)
    held = labels.points[labels.w_in > 0]
    near = ((labels.points >= held.min(0)) & (labels.points <= held.max(0))).all(1)
    weights = (torch.as_tensor(w) for w in (labels.w_in, near * (labels.w_out + 1e-9 * labels.w_in)))
    drawn = [torch.multinomial(w, primitives, replacement=True, generator=generator) for w in weights]
    within, without = (torch.as_tensor(labels.points, dtype=torch.float32)[rows] for rows in drawn)
    shape.numbers[0, :, CENTER] = torch.where(shape.complement[0][:, None] > 0, without, within)
    return shape


def fit(shape: Decoded, labels: LabelledPoints, config: FitConfig, seed: int = 0, deadline: Deadline = NEVER) -> CsgStump:
    """The binary CSG-Stump that explains `labels` from the batch of one `shape`; the same for the same arguments.

    Past the `deadline`, the stages end early.
    """
    counted = labels.some(np.random.default_rng(seed).permutation(len(labels.points))[: config.counted])
    generator = torch.Generator().manual_seed(seed)
    descend = _AdamDescent(labels, config, generator, deadline)
    shape = descend(shape, config.soft, config.eta, binary=False)
    shape = descend(shape, config.hard, (config.eta[1], config.eta[1]), binary=True)
    descend = _AdamDescent(labels, replace(config, points=config.last_points), generator, deadline)
    matrices, passed = threshold(shape), []
    for turn in reversed(range(config.rounds)):
        matrices = improve(matrices, columns(shape, counted.points), counted, config.price * RICHER**turn)
        passed.append((price_of(shape, matrices, counted, config.price), to_stump(to_primitives(shape), matrices)))
        part, before = select_used(shape, matrices), shape.numbers.clone()
        shape.numbers[:, find_used(matrices)[0]] = descend(part, config.last, config.last_eta, binary=True, numbers_only=True).numbers
        if price_of(shape, matrices, counted, config.price) > passed[-1][0]:
            shape.numbers.copy_(before)
    matrices = improve(matrices, columns(shape, counted.points), counted, config.price)
    passed.append((price_of(shape, matrices, counted, config.price), to_stump(to_primitives(shape), matrices)))
    return min(passed, key=lambda found: found[0])[1]


def price_of(shape: Decoded, matrices: Matrices, labels: LabelledPoints, price: float) -> float:
    """Error of a batch of one, relative to the target's volume, + `price` per entry of W_I."""
    held = matrices.contains(columns(shape, labels.points))
    wrong = float(np.where(held, labels.w_out, labels.w_in).sum() / labels.w_in.sum())
    return wrong + price * int(matrices.connection[matrices.union].sum())


def threshold(shape: Decoded) -> Matrices:
    """The matrices of a batch of one. The node that is most nearly plain is: without one there is no bounded solid."""
    complement, connection, union = ((t[0] > 0).numpy() for t in shape.tensors[1:])
    complement[int(shape.complement[0].argmin())] = False
    return Matrices(complement, connection, union)


def select_used(shape: Decoded, matrices: Matrices) -> Decoded:
    """What `matrices` use of a batch of one, with logits that say so."""
    kept, terms = find_used(matrices)
    bits = (matrices.complement[kept], matrices.connection[np.ix_(terms, kept)], matrices.union[terms])
    logits = (torch.where(torch.as_tensor(b), CERTAIN, -CERTAIN)[None] for b in bits)
    return Decoded(tuple(shape.kinds[k] for k in kept), shape.numbers[:, kept], *logits)


def columns(shape: Decoded, points: np.ndarray) -> np.ndarray:
    """Which of `points` [n, 3] each primitive of a batch of one holds, bool [K, n]."""
    return kernels.leaf_table(*pack_all(to_primitives(shape)), points) < 0


@dataclass
class _AdamDescent:
    """Adam on batches of labels: half of them drawn by the volume they hold inside, half as they lie. Soft matrices take all alike, so
    that little volume counts as much as much of it; binary ones take them by the volume they stand for, which is the error."""

    labels: LabelledPoints
    config: FitConfig
    generator: torch.Generator
    deadline: Deadline

    def __post_init__(self) -> None:
        w_in, w_out = (torch.as_tensor(w) for w in (self.labels.w_in, self.labels.w_out))
        self.chance = w_in / w_in.sum() + 1 / len(w_in)
        # what a drawn point stands for; far outside few points stand for much
        weight = (w_in + w_out) / self.chance
        self.weight = (weight / (weight * self.chance).sum() * self.chance.sum()).clamp_max(HEAVIEST).float()
        self.points = torch.as_tensor(self.labels.points, dtype=torch.float32)
        self.inside = (w_in / (w_in + w_out)).float()

    def __call__(self, shape: Decoded, steps: int, eta: tuple[float, float], binary: bool, numbers_only: bool = False) -> Decoded:
        config = self.config
        numbers, *logits = (t.detach().clone() for t in shape.tensors)
        shape = Decoded(shape.kinds, numbers, *logits)
        adam = torch.optim.Adam([{"params": [numbers], "lr": config.lr}], betas=(0.9, 0.98))
        if not numbers_only:
            adam.add_param_group({"params": logits, "lr": config.lr_logits})
        rates = [group["lr"] for group in adam.param_groups]
        for group in adam.param_groups:
            for weight in group["params"]:
                weight.requires_grad_()
        for step in range(steps):
            if self.deadline.has_passed():
                break
            done = step / steps
            for group, rate in zip(adam.param_groups, rates, strict=True):
                group["lr"] = rate * (1 - (1 - FALLEN) * done)
            self._step(shape, adam, eta[0] * (eta[1] / eta[0]) ** done, binary)
        return Decoded(shape.kinds, *(t.detach() for t in shape.tensors))

    def _step(self, shape: Decoded, adam: torch.optim.Adam, eta: float, binary: bool) -> None:
        rows = torch.multinomial(self.chance, self.config.points, replacement=True, generator=self.generator)
        weight = self.weight[rows][None] if binary else None
        found = losses(shape, self.points[rows][None], self.inside[rows][None], eta, self.config.primitive_weight, binary, weight)
        adam.zero_grad()
        found["loss"].backward()
        adam.step()
