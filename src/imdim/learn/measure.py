"""What a policy is worth, by numbers that do not depend on its design: moves against the true next step, and executed programs.

Every target counts: a program without a solid has IoU 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from imdim.data.canonical import box_symmetries, canonical_primitives
from imdim.data.solids import BOX, EXTRUDE, NAMES, SIGN, SPHERE, Solids, adds_primitive, to_sequences
from imdim.data.synthesize import TrainingSamples
from imdim.learn.codes import FREE, encode, ruler
from imdim.learn.policy import Move, Policy, Sight


@dataclass(frozen=True)
class KindError:
    """Over `count` steps at which policy and truth add this kind: medians of the distance of the centres and of the largest error of a
    size (shares of the diagonal), and of the angle (degrees) to the nearest equal rotation (a ball has none)."""

    count: int
    center: float
    size: float
    angle_deg: float


@torch.no_grad()
def moves(policy: Policy, batch: TrainingSamples) -> tuple[Move, Tensor]:
    """The greedy moves from the true prefixes of `batch`, and which tokens [b] are the true next ones."""
    move = policy.propose(Sight(batch.gt_points, batch.cur_points, batch.written, batch.steps >= 0))
    return move, move.tokens == batch.following[0]


def errors_by_kind(batch: TrainingSamples, move: Move) -> dict[str, KindError]:
    """Errors of the proposed primitives, by kind, where the proposed kind is the true one; both are made canonical. "turned" are
    primitives other than balls along no coordinate axis."""
    tokens, part = batch.following
    truth, part = canonical_primitives(part), canonical_primitives(move.part)
    center = torch.linalg.vector_norm(truth.centers - part.centers, dim=-1)[:, 0]
    size = (truth.sizes - part.sizes).abs().amax(-1)[:, 0]
    angle = _angles(truth, part)[:, 0]
    right = tokens == move.tokens
    turned = adds_primitive(tokens) & (encode(truth, *ruler(batch.gt_points)).turn == FREE)
    met = {**{name: tokens == token for token, name in NAMES.items()}, "turned": turned}
    found = {}
    for name, rows in met.items():
        here = right & rows
        medians = [float(v[here].median()) if here.any() else float("nan") for v in (center, size, angle)]
        found[name] = KindError(int(here.sum()), *medians)
    return found


def exact_structure(found: Solids, truth: Solids) -> Tensor:
    """Whether each row has the kinds, signs and forms of the truth, in its order, bool [b]."""
    width = max(found.kinds.shape[1], truth.kinds.shape[1]) + 1
    (a, p), (b, q) = (to_sequences(s, width) for s in (found, truth))
    told = [SIGN, SIGN + 1, -1]
    return (a == b).all(1) & (p[..., told] == q[..., told]).flatten(1).all(1)


def summary(values: list[float]) -> dict[str, float]:
    """Median, mean, and share of at least 0.9."""
    array = np.array(values)
    return {"median": float(np.median(array)), "mean": float(array.mean()), "share_090": float((array >= 0.9).mean())}


def _angles(truth: Solids, found: Solids) -> Tensor:
    """Degrees [b, t] between boxes or ellipsoids up to their 24 symmetries, between axes of others; 0 for balls."""
    relative = truth.rotations.mT @ found.rotations
    trace = torch.einsum("...ij,gji->...g", relative, box_symmetries().to(relative)).amax(-1)
    box = torch.rad2deg(torch.arccos(((trace - 1) / 2).clamp(-1, 1)))
    axis = torch.rad2deg(torch.arccos(relative[..., 2, 2].abs().clamp(0, 1)))
    zero = torch.zeros_like(axis)
    turned = torch.where((truth.kinds == BOX) | (truth.kinds == EXTRUDE) | truth.ellipsoids, box, axis)
    return torch.where((truth.kinds == SPHERE) & ~truth.ellipsoids, zero, turned)
