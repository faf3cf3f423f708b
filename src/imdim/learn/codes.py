"""A primitive as twelve bounded numbers, each with bins: what `base` predicts instead of ten raw ones.

Slots: the z axis (3) and the x axis (3) of the frame, the centre (3), the sizes (3). Two columns of the rotation are a continuous code
(Zhou et al. 2019, "On the continuity of rotation representations"); the z axis comes first, so that a cylinder needs no other.
"""

from __future__ import annotations

import torch
from torch import Tensor

from imdim.data.canonical import canonical_primitives
from imdim.data.solids import ABSENT, BOX, CYLINDER, Solids

SLOTS = 12
BINS = 61  # odd, so that -1, 0 and 1 of an axis are centres of bins
LOW = torch.tensor([-1.0] * 6 + [-0.6] * 3 + [0.0] * 3)
HIGH = torch.tensor([1.0] * 6 + [0.6] * 3 + [1.2] * 3)
# which slots mean something, by kind
USED = torch.tensor([[True] * 12, [False] * 6 + [True] * 4 + [False] * 2, [True] * 3 + [False] * 3 + [True] * 5 + [False]])
SMALLEST = 1e-3


def encode(solids: Solids) -> Tensor:
    """Numbers [b, t, 12] of canonical `solids`."""
    return torch.cat([solids.rotations[..., 2], solids.rotations[..., 0], solids.centers, solids.sizes], -1)


def used(kinds: Tensor) -> Tensor:
    """bool [..., 12] of `kinds` [...]; nothing of what is absent."""
    return USED.to(kinds.device)[kinds.clamp(BOX, CYLINDER)] & (kinds != ABSENT)[..., None]


def decode(kinds: Tensor, positive: Tensor, numbers: Tensor) -> Solids:
    """Canonical solids [b, t] of `numbers` [b, t, 12], read by magnitude and made orthogonal."""
    z = torch.nn.functional.normalize(numbers[..., 0:3] + torch.tensor([0.0, 0.0, 1e-6], device=numbers.device), dim=-1)
    x = numbers[..., 3:6] - (numbers[..., 3:6] * z).sum(-1, keepdim=True) * z
    # an x axis along z, or none, leaves the choice open
    spare = torch.eye(3, device=z.device)[z.abs().argmin(-1)]
    spare = spare - (spare * z).sum(-1, keepdim=True) * z
    x = torch.nn.functional.normalize(torch.where(torch.linalg.vector_norm(x, dim=-1, keepdim=True) > 1e-3, x, spare), dim=-1)
    rotations = torch.stack([x, torch.linalg.cross(z, x), z], -1)
    return canonical_primitives(Solids(kinds, positive, numbers[..., 6:9], numbers[..., 9:12].abs().clamp_min(SMALLEST), rotations))


def to_bins(numbers: Tensor) -> tuple[Tensor, Tensor]:
    """Bin indices int64 [..., 12] and offsets from the bin's centre in bins, -0.5 to 0.5 (more beyond the range)."""
    low, high = LOW.to(numbers), HIGH.to(numbers)
    place = (numbers - low) / (high - low) * (BINS - 1)
    index = place.round().clamp(0, BINS - 1)
    return index.long(), place - index


def from_bins(index: Tensor, offset: Tensor, slot: int) -> Tensor:
    """The numbers [...] of one slot."""
    return LOW[slot].item() + (index + offset) * ((HIGH[slot] - LOW[slot]).item() / (BINS - 1))
