"""The leaf table and its folds in torch: differentiable, batched, on any device. It is the reference of the other backends.

Distances are negative inside. Box, sphere, cylinder, cone and torus have their exact Euclidean distance. The ellipsoid has the
first-order distance ``k0 (k0 - 1) / k1`` with ``k0 = |q / s|``, ``k1 = |q / s^2|``, not below ``-min(s)``: its sign and zero set
are exact, its gradient has length one on the surface, and away from it the value is an estimate that does not exceed
``|q| - min(s)``. A program's value, the minimum and maximum of those, has the exact sign and is a lower bound of the distance
outside (Hart 1996, "Sphere tracing", section 2).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
import torch
from torch import Tensor
from torch.linalg import vector_norm

from imdim.geometry.lowering import pack, unpack
from imdim.geometry.rotations import rotation_rows
from imdim.program.tree import KINDS, Op, Program, fold

__all__ = ["LOCAL_SDF", "SDF_OPS", "fold_table", "leaf_table", "pack", "program_sdf", "rotation_matrices", "to_local", "unpack"]

SDF_OPS: Mapping[Op, Callable[[Tensor, Tensor], Tensor]] = {
    "union": torch.minimum,
    "intersection": torch.maximum,
    "difference": lambda keep, cut: torch.maximum(keep, -cut),
}


def leaf_table(kinds: np.ndarray, params: Tensor, points: Tensor) -> Tensor:
    """Signed distances [..., k, n] of `points` [..., n, 3] to the leaves `kinds` [k], `params` [..., k, 9]; leading axes broadcast."""
    local = to_local(params, points)
    rows: list[Tensor] = [params.new_empty(0)] * len(kinds)
    for kind in np.unique(kinds):
        members = np.flatnonzero(kinds == kind)
        index = torch.as_tensor(members, device=params.device)
        sizes = params[..., :3].index_select(-2, index)[..., None, :]
        values = LOCAL_SDF[KINDS[kind]](local.index_select(-3, index), sizes)
        for row, leaf in enumerate(members):
            rows[leaf] = values[..., row, :]
    return torch.stack(rows, -2)


def fold_table(program: Program, table: Tensor) -> Tensor:
    """The program's values [..., n] from its leaf table [..., k, n]."""
    return fold(program, lambda i, _: table[..., i, :], SDF_OPS)


def program_sdf(program: Program, params: Tensor, points: Tensor) -> Tensor:
    """Values [..., n] at `points` [..., n, 3] of the structure of `program` with the numbers `params` [..., k, 9]."""
    return fold_table(program, leaf_table(pack(program)[0], params, points))


def to_local(params: Tensor, points: Tensor) -> Tensor:
    """World `points` [..., n, 3] in the frame of each leaf [..., k, n, 3]."""
    offsets = points[..., None, :, :] - params[..., :, None, 3:6]
    return offsets @ rotation_matrices(params[..., 6:9])


def rotation_matrices(euler_deg: Tensor) -> Tensor:
    """``Rz @ Ry @ Rx`` [..., 3, 3] of Euler degrees [..., 3]."""
    rows = rotation_rows(*(f(euler_deg * (math.pi / 180)).unbind(-1) for f in (torch.cos, torch.sin)))
    return torch.stack([torch.stack(row, -1) for row in rows], -2)


def _from_faces(distances: Tensor) -> Tensor:
    """Distance [...] to the corner of the half-spaces with signed distances [..., m] and orthogonal normals."""
    deepest = distances.amax(-1)
    return torch.where(deepest > 0, vector_norm(distances.clamp_min(0), dim=-1), deepest)


def _cylinder(q: Tensor, size: Tensor) -> Tensor:
    rho = vector_norm(q[..., :2], dim=-1)
    return _from_faces(torch.stack([rho - size[..., 0], q[..., 2].abs() - size[..., 1] / 2], -1))


def _cone(q: Tensor, size: Tensor) -> Tensor:
    """In the half plane (rho, z) the solid is a convex trapezoid: inside, the nearest edge line; outside, the nearest edge segment."""
    rho, z = vector_norm(q[..., :2], dim=-1), q[..., 2]
    bottom, top, height = size.unbind(-1)
    edge = torch.stack(torch.broadcast_tensors(top - bottom, height), -1)
    from_rim = torch.stack([rho - bottom, z + height / 2], -1)
    t = ((from_rim * edge).sum(-1) / (edge * edge).sum(-1)).clamp(0, 1)
    slant = from_rim - t[..., None] * edge
    above = z.abs() - height / 2
    beside = rho - torch.where(z < 0, bottom, top)
    cap = torch.stack([beside.clamp_min(0), above], -1)
    nearer = (cap * cap).sum(-1, keepdim=True) < (slant * slant).sum(-1, keepdim=True)
    normal = torch.stack([edge[..., 1], -edge[..., 0]], -1) / vector_norm(edge, dim=-1, keepdim=True)
    inside = torch.maximum((from_rim * normal).sum(-1), above)
    return torch.where(inside > 0, vector_norm(torch.where(nearer, cap, slant), dim=-1), inside)


def _torus(q: Tensor, size: Tensor) -> Tensor:
    rho = vector_norm(q[..., :2], dim=-1)
    return vector_norm(torch.stack([rho - size[..., 0], q[..., 2]], -1), dim=-1) - size[..., 1]


def _ellipsoid(q: Tensor, size: Tensor) -> Tensor:
    k0, k1 = vector_norm(q / size, dim=-1), vector_norm(q / size**2, dim=-1)
    deepest = -size.amin(-1).expand_as(k0)
    central = k1 == 0
    return torch.where(central, deepest, torch.maximum(k0 * (k0 - 1) / torch.where(central, 1.0, k1), deepest))


# Local points [..., n, 3] and sizes [..., 1, 3] to signed distances [..., n].
LOCAL_SDF: Mapping[str, Callable[[Tensor, Tensor], Tensor]] = {
    "box": lambda q, size: _from_faces(q.abs() - size / 2),
    "sphere": lambda q, size: vector_norm(q, dim=-1) - size[..., 0],
    "cylinder": _cylinder,
    "cone": _cone,
    "torus": _torus,
    "ellipsoid": _ellipsoid,
}
