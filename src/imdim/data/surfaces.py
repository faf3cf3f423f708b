"""Clouds on the boundary of a batch of signed sequences: area-weighted, exact membership, walls of cuts included."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from imdim.data.solids import BOX, CYLINDER, SPHERE, Solids, inside, levels

STEP = 1e-4  # how far both sides of a surface are looked at, as a share of the solid's size
ROUNDS = 4


def surface_clouds(solids: Solids, n: int, generator: torch.Generator) -> tuple[Tensor, Tensor, Tensor]:
    """Points [b, n, 3], outward unit normals [b, n, 3] and the number of different points int64 [b].

    A point is kept where the solid lies on one side of it only; faces on which several primitives coincide are sampled once. Rows whose
    boundary is a small share of their primitives' surfaces repeat points; rows without a boundary are zeros. `generator` lives on the
    device.
    """
    points, normals, kept = _candidates(solids, 2 * n, generator)
    for _ in range(ROUNDS - 1):
        poor = (kept.sum(1) < n).nonzero()[:, 0]
        if not len(poor):
            break
        # rows that have enough points carry the new columns as rejected candidates
        more = _candidates(solids[poor], 2 * n, generator)
        wide = [torch.zeros(len(kept), *m.shape[1:], dtype=m.dtype, device=m.device).index_copy(0, poor, m) for m in more]
        points, normals, kept = (torch.cat([a, b], 1) for a, b in zip((points, normals, kept), wide, strict=True))
    count = kept.sum(1)
    order = torch.argsort((~kept).to(torch.uint8), dim=1, stable=True)
    cycle = torch.arange(n, device=count.device) % count.clamp_min(1)[:, None]
    chosen = order.gather(1, cycle)[..., None].expand(-1, -1, 3)
    some = (count > 0)[:, None, None]
    return torch.where(some, points.gather(1, chosen), 0.0), torch.where(some, normals.gather(1, chosen), 0.0), count.clamp_max(n)


def _candidates(solids: Solids, m: int, generator: torch.Generator) -> tuple[Tensor, Tensor, Tensor]:
    """`m` points on the primitives' surfaces with outward normals [b, m, 3] and whether they are on the boundary of the solid."""
    area = surface_areas(solids)
    # a row of nothing still needs a distribution; its candidates are never kept
    owner = torch.multinomial(torch.where(area.sum(1, keepdim=True) > 0, area, 1.0), m, replacement=True, generator=generator)
    u = torch.rand(*owner.shape, 3, generator=generator, device=owner.device)
    rows = torch.arange(len(owner), device=owner.device)[:, None]
    local, direction = local_surface(solids.kinds[rows, owner], solids.sizes[rows, owner], u)
    rotation = solids.rotations[rows, owner]
    points = (rotation @ local[..., None])[..., 0] + solids.centers[rows, owner]
    normals = (rotation @ direction[..., None])[..., 0]
    low, high = bounds(solids)
    step = STEP * torch.linalg.vector_norm(high - low, dim=-1).clamp_min(1e-6)
    behind, ahead = (levels(solids, points + s * step[:, None, None] * normals) < 0 for s in (-1, 1))
    countdown = torch.arange(behind.shape[1], 0, -1, device=owner.device, dtype=torch.int16)[:, None]
    first = behind.shape[1] - (countdown * (behind != ahead)).amax(1)
    within, without = inside(solids, behind), inside(solids, ahead)
    kept = (within != without) & (first == owner) & solids.present.any(1)[:, None]
    return points, torch.where(within[..., None], normals, -normals), kept


def surface_areas(solids: Solids) -> Tensor:
    """Areas [b, t] of the primitives' surfaces, 0 where absent."""
    a, b, c = solids.sizes.unbind(-1)
    area = torch.zeros_like(a)
    area = torch.where(solids.kinds == BOX, 2 * (a * b + b * c + c * a), area)
    area = torch.where(solids.kinds == SPHERE, 4 * math.pi * a * a, area)
    return torch.where(solids.kinds == CYLINDER, 2 * math.pi * a * (a + b), area)


def volumes(solids: Solids) -> Tensor:
    """Volumes [b, t] of the primitives, 0 where absent."""
    a, b, c = solids.sizes.unbind(-1)
    volume = torch.where(solids.kinds == BOX, a * b * c, torch.zeros_like(a))
    volume = torch.where(solids.kinds == SPHERE, 4 / 3 * math.pi * a**3, volume)
    return torch.where(solids.kinds == CYLINDER, math.pi * a * a * b, volume)


def local_surface(kinds: Tensor, sizes: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
    """Even points and outward normals [..., 3] on primitives `kinds` [...] of `sizes` [..., 3] in their frames, from uniforms [..., 3]."""
    box, sphere = (kinds == BOX)[..., None], (kinds == SPHERE)[..., None]
    maps = [_on_box(sizes, u), _on_sphere(sizes, u), _on_cylinder(sizes, u)]
    points, normals = (torch.where(box, b, torch.where(sphere, s, c)) for b, s, c in zip(*maps, strict=True))
    return points, normals


def _on_box(sizes: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
    faces = (sizes[..., [1, 2, 0]] * sizes[..., [2, 0, 1]]).cumsum(-1)
    pick = u[..., :1] * 2
    axis = (faces[..., :2] <= (pick % 1) * faces[..., 2:]).sum(-1)
    fixed = torch.nn.functional.one_hot(axis, 3).bool()
    sign = torch.where(pick < 1, -1.0, 1.0)
    free = torch.stack([u[..., 1], torch.where(axis == 0, u[..., 1], u[..., 2]), u[..., 2]], -1) - 0.5
    return torch.where(fixed, sign / 2, free) * sizes, torch.where(fixed, sign, 0.0)


def _on_sphere(sizes: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
    z = 2 * u[..., 0] - 1
    ring, angle = torch.sqrt(1 - z * z), 2 * math.pi * u[..., 1]
    direction = torch.stack([ring * torch.cos(angle), ring * torch.sin(angle), z], -1)
    return direction * sizes[..., :1], direction


def _on_cylinder(sizes: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
    r, h = sizes[..., 0], sizes[..., 1]
    side = u[..., 0] * (r + h) >= r  # caps 2 pi r^2, side 2 pi r h
    end = torch.where(u[..., 0] * (r + h) < r / 2, -1.0, 1.0)
    rho = torch.where(side, r, r * torch.sqrt(u[..., 1]))
    z = torch.where(side, u[..., 1] - 0.5, end / 2) * h
    angle = 2 * math.pi * u[..., 2]
    cos, sin = torch.cos(angle), torch.sin(angle)
    outward = torch.where(side, 1.0, 0.0)
    normals = torch.stack([outward * cos, outward * sin, torch.where(side, 0.0, end)], -1)
    return torch.stack([rho * cos, rho * sin, z], -1), normals


def reach(solids: Solids) -> Tensor:
    """Radius [b, t] of a ball about each centre that holds the primitive."""
    a, b, _ = solids.sizes.unbind(-1)
    box = torch.linalg.vector_norm(solids.sizes, dim=-1) / 2
    return torch.where(solids.kinds == BOX, box, torch.where(solids.kinds == SPHERE, a, torch.hypot(a, b / 2)))


def bounds(solids: Solids) -> tuple[Tensor, Tensor]:
    """Lower and upper corners [b, 3] of a box that holds all positive primitives; zeros where there is none."""
    solid = (solids.present & solids.positive)[..., None]
    radius = reach(solids)[..., None]
    low = torch.where(solid, solids.centers - radius, torch.inf).amin(1)
    high = torch.where(solid, solids.centers + radius, -torch.inf).amax(1)
    some = solid.any(1)
    return torch.where(some, low, 0.0), torch.where(some, high, 0.0)
