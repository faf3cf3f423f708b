"""The point-set backend: a shape state as a cloud, by sampling, membership, and union and difference of point sets in order.

Source: the project's design, section 4. The cloud is approximate: a cut removes points and adds no wall, and surfaces inside of other
solids stay. `sampling.surface_points` samples the true boundary. Membership and sampling take primitives of the tree or of a state.
"""

from __future__ import annotations

import torch
from torch import Tensor

from imdim.geometry.lowering import Outlines, pack
from imdim.geometry.sdf import leaf_table, rotation_matrices
from imdim.geometry.surface_map import SURFACE_MAPS, map_surface
from imdim.program.state import ShapeState, SignedPrimitive
from imdim.program.tree import Primitive


def sample_points(
    primitive: Primitive | SignedPrimitive, n_points: int, generator: torch.Generator | None = None, device: torch.device | str = "cpu"
) -> Tensor:
    """Area-weighted points [n_points, 3] float32 on the primitive's surface, in world coordinates.

    `generator` must live on `device`.
    """
    solid = _solid(primitive)
    kept: list[Tensor] = []
    missing = n_points
    while missing > 0:
        u = torch.rand(missing, 4, generator=generator, device=device, dtype=torch.float64)
        local, share = _map_surface(solid, u[:, :3])
        kept.append(local[u[:, 3] < share])
        missing -= len(kept[-1])
    if not kept:
        return torch.empty(0, 3, device=device)
    row = torch.from_numpy(pack(solid)[1][0]).to(device)
    return (torch.cat(kept) @ rotation_matrices(row[6:9]).mT + row[3:6]).float()


def _map_surface(solid: Primitive, u: Tensor) -> tuple[Tensor, Tensor]:
    """Local points and shares; of a drawn primitive by way of numpy."""
    if solid.outline is None:
        local, _, share = SURFACE_MAPS[solid.kind](torch, solid.size, u)
        return local, share
    local, _, share = map_surface(solid, u.cpu().numpy())
    return torch.from_numpy(local).to(u), torch.from_numpy(share).to(u)


def is_inside(primitive: Primitive | SignedPrimitive, points: Tensor) -> Tensor:
    """Whether each of `points` [n, 3] lies inside the primitive or on it, bool [n]."""
    solid = _solid(primitive)
    kinds, params = pack(solid)
    return leaf_table(kinds, torch.from_numpy(params).to(points), points, Outlines.of([solid]))[0] <= 0


def state_to_point_cloud(
    state: ShapeState, n_points: int, device: torch.device | str = "cpu", generator: torch.Generator | None = None
) -> Tensor:
    """The state as a cloud [n_points, 3] float32: solids add surface points in order, cuts remove what lies inside them.

    Zeros where nothing is left. `generator` must live on `device`.
    """
    primitives = state.to_primitives()
    solids = sum(p.sign > 0 for p in primitives)
    points = torch.empty(0, 3, device=device)
    for primitive in primitives:
        solid = primitive.solid(state.ellipsoids)
        if primitive.sign > 0:
            # twice the share, so that cuts leave enough to choose from
            added = sample_points(solid, max(1, -(-2 * n_points // solids)), generator, device)
            points = torch.cat([points, added])
        else:
            points = points[~is_inside(solid, points)]
    return resample_to_fixed_size(points, n_points, generator)


def resample_to_fixed_size(points: Tensor, n_points: int, generator: torch.Generator | None = None) -> Tensor:
    """`points` [m, 3] as [n_points, 3]: a random subset, or all of them and random repeats; zeros if there are none."""
    m = len(points)
    if m == 0:
        return points.new_zeros(n_points, 3)
    order = torch.randperm(m, generator=generator, device=points.device)[:n_points]
    if m >= n_points:
        return points[order]
    repeats = torch.randint(m, (n_points - m,), generator=generator, device=points.device)
    return points[torch.cat([order, repeats])]


def compute_error_embedding(gt_points: Tensor, cur_points: Tensor) -> Tensor:
    """[B, 3]: Chamfer distance, distance of the centroids, log ratio of the box diagonals (current over target).

    `gt_points` [B, n, 3], `cur_points` [B, m, 3]. The Chamfer distance is the sum of both directed mean nearest distances, unsquared.
    All three are zero where a set is empty (n or m is 0). The log ratio of sets that are single points is zero.
    """
    batch = gt_points.shape[0]
    if gt_points.shape[1] == 0 or cur_points.shape[1] == 0:
        return gt_points.new_zeros(batch, 3)
    distances = torch.cdist(gt_points, cur_points)
    chamfer = distances.amin(2).mean(1) + distances.amin(1).mean(1)
    centroid = torch.linalg.vector_norm(gt_points.mean(1) - cur_points.mean(1), dim=-1)
    gt_diagonal, diagonal = (torch.linalg.vector_norm(p.amax(1) - p.amin(1), dim=-1) for p in (gt_points, cur_points))
    known = (gt_diagonal > 0) & (diagonal > 0)
    ratio = torch.where(known, diagonal, 1.0).log() - torch.where(known, gt_diagonal, 1.0).log()
    return torch.stack([chamfer, centroid, ratio], -1)


def _solid(primitive: Primitive | SignedPrimitive) -> Primitive:
    return primitive if isinstance(primitive, Primitive) else primitive.solid()
