"""Rotations as six numbers of 0 to 1, of which a code uses as many as it needs; the others are 0."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn.functional import normalize, pad

from imdim.data.canonical import shortest_from_z
from imdim.data.solids import euler_from_matrices
from imdim.geometry.sdf import rotation_matrices


class RotationCode(NamedTuple):
    """`numbers` [b, 6] of rotations [b, 3, 3] and back, what the first three of a canonical cylinder say of the others, and how many a box
    and a cylinder need."""

    numbers: Callable[[Tensor], Tensor]
    rotations: Callable[[Tensor], Tensor]
    implied: Callable[[Tensor], Tensor]
    box: int
    cylinder: int


def columns(rotations: Tensor) -> Tensor:
    """The z and the x axis."""
    return (torch.cat([rotations[..., 2], rotations[..., 0]], -1) + 1) / 2


def from_columns(numbers: Tensor) -> Tensor:
    """Rotations from approximate z and x axes by Gram-Schmidt."""
    z_axis, x_axis = (numbers * 2 - 1).split(3, 1)
    z = normalize(z_axis + torch.tensor([0.0, 0.0, 1e-6], device=numbers.device), dim=-1)
    x = x_axis - (x_axis * z).sum(-1, keepdim=True) * z
    # an x axis along z, or none, leaves the choice open
    spare = torch.eye(3, device=z.device)[z.abs().argmin(-1)]
    spare = spare - (spare * z).sum(-1, keepdim=True) * z
    x = normalize(torch.where(torch.linalg.vector_norm(x, dim=-1, keepdim=True) > 1e-3, x, spare), dim=-1)
    return torch.stack([x, torch.linalg.cross(z, x), z], -1)


def infer_x(numbers: Tensor) -> Tensor:
    """The x axis of a canonical cylinder, from its z axis."""
    z = normalize(numbers * 2 - 1 + torch.tensor([0.0, 0.0, 1e-6], device=numbers.device), dim=-1)
    return (shortest_from_z(z)[..., 0] + 1) / 2


def euler(rotations: Tensor) -> Tensor:
    """Euler degrees, half a turn each way."""
    return pad(euler_from_matrices(rotations) / 360 + 0.5, (0, 3))


def from_euler(numbers: Tensor) -> Tensor:
    """Rotations from their Euler degrees."""
    return rotation_matrices((numbers[:, :3] - 0.5) * 360)


# the continuous one: Zhou et al. 2019, "On the continuity of rotation representations"; Euler angles jump, and are there to compare
ROTATION_CODES: Mapping[str, RotationCode] = {
    "columns": RotationCode(columns, from_columns, infer_x, 6, 3),
    "euler": RotationCode(euler, from_euler, torch.zeros_like, 3, 3),
}
