"""Clouds on the boundary of a batch of signed sequences: area-weighted, exact membership, walls of cuts included."""

from __future__ import annotations

import math
from collections.abc import Callable

import torch
from torch import Tensor

from imdim.data.outlines import Measures, corners, measure_outlines, on_outlines, rounding
from imdim.data.solids import BOX, CONE, CYLINDER, EXTRUDE, SPHERE, TORUS, Solids, holds, inside, outline_boxes

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
    area = _map_areas(solids)
    # a row of nothing still needs a distribution; its candidates are never kept
    owner = torch.multinomial(torch.where(area.sum(1, keepdim=True) > 0, area, 1.0), m, replacement=True, generator=generator)
    u = torch.rand(*owner.shape, 3, generator=generator, device=owner.device)
    rows = torch.arange(len(owner), device=owner.device)[:, None]
    kinds, sizes = solids.kinds[rows, owner], solids.sizes[rows, owner]
    local, direction = local_surface(kinds, sizes, u)
    even = torch.rand(*owner.shape, generator=generator, device=owner.device) < _stretching(kinds, sizes, local)
    drawn = (kinds >= EXTRUDE).nonzero(as_tuple=True)
    if len(drawn[0]):
        chance = torch.rand(len(drawn[0]), 2, generator=generator, device=owner.device)
        places = _on_drawn(solids, (drawn[0], owner[drawn]), u[drawn], chance)
        local, direction = (v.index_put(drawn, w) for v, w in zip((local, direction), places, strict=True))
    rotation = solids.rotations[rows, owner]
    points = (rotation @ local[..., None])[..., 0] + solids.centers[rows, owner]
    normals = (rotation @ direction[..., None])[..., 0]
    low, high = bounds(solids)
    step = STEP * torch.linalg.vector_norm(high - low, dim=-1).clamp_min(1e-6)
    behind, ahead = (holds(solids, points + s * step[:, None, None] * normals) for s in (-1, 1))
    countdown = torch.arange(behind.shape[1], 0, -1, device=owner.device, dtype=torch.int16)[:, None]
    first = behind.shape[1] - (countdown * (behind != ahead)).amax(1)
    within, without = inside(solids, behind), inside(solids, ahead)
    kept = (within != without) & (first == owner) & even & solids.present.any(1)[:, None]
    return points, torch.where(within[..., None], normals, -normals), kept


def surface_areas(solids: Solids) -> Tensor:
    """Areas [b, t] of the primitives' surfaces, 0 where absent."""
    a, b, c = solids.sizes.unbind(-1)
    area = torch.zeros_like(a)
    area = torch.where(solids.kinds == BOX, 2 * (a * b + b * c + c * a), area)
    area = torch.where(solids.kinds == SPHERE, 4 * math.pi * a * a, area)
    area = torch.where(solids.ellipsoids, _ellipsoid_area(a, b, c), area)
    area = torch.where(solids.kinds == CONE, math.pi * (a * a + b * b + (a + b) * torch.hypot(a - b, c)), area)
    area = torch.where(solids.kinds == TORUS, 4 * math.pi**2 * a * b, area)
    area = torch.where(solids.kinds == CYLINDER, 2 * math.pi * a * (a + b), area)
    return _of_drawn(
        solids, area, lambda told, _, h: 2 * told.area + told.around * h, lambda told: 2 * math.pi * told.middle_of_edge * told.around
    )


def _of_drawn(
    solids: Solids, values: Tensor, extruded: Callable[[Measures, Tensor, Tensor], Tensor], turned: Callable[[Measures], Tensor]
) -> Tensor:
    """`values` [b, t] with those of extruded outlines by their measures, the area of their box and their height, and of turned ones by
    measures whose middles are radii (Pappus)."""
    if not solids.drawn.any():
        return values
    half, beside, is_turned = outline_boxes(solids.kinds, solids.sizes, solids.shares)
    told = measure_outlines(*_edges(solids, half))
    pulled = extruded(told, 4 * half.prod(-1), solids.sizes[..., 2])
    about = told._replace(middle=told.middle + beside, middle_of_edge=told.middle_of_edge + beside)
    return torch.where(is_turned, turned(about), torch.where(solids.kinds == EXTRUDE, pulled, values))


def _ellipsoid_area(a: Tensor, b: Tensor, c: Tensor) -> Tensor:
    """Within 1.1 % (K. Thomsen 2004, as given by G. Michon, "Surface area of an ellipsoid")."""
    p = 1.6075
    return 4 * math.pi * (((a * b) ** p + (a * c) ** p + (b * c) ** p) / 3) ** (1 / p)


def _map_areas(solids: Solids) -> Tensor:
    """Areas [b, t] of surfaces that are as much too large where `local_surface` is not even as its points are thinned by `_stretching`."""
    a, b, c = solids.sizes.unbind(-1)
    area = torch.where(solids.kinds == TORUS, 4 * math.pi**2 * (a + b) * b, surface_areas(solids))
    widest = torch.maximum(torch.maximum(a * b, b * c), c * a)
    area = torch.where(solids.ellipsoids, 4 * math.pi * widest, area)
    # ends are looked for in all of the outline's box, and what is turned is drawn as if it were as far out as it reaches
    return _of_drawn(solids, area, lambda told, box, h: 2 * box + told.around * h, lambda told: 2 * math.pi * a * told.around)


def _stretching(kinds: Tensor, sizes: Tensor, local: Tensor) -> Tensor:
    """How much the map of `local_surface` stretches areas at its points `local` [..., 3], as a share of its most: 1 where it is even."""
    a, b, c = sizes.unbind(-1)
    ring = torch.hypot(local[..., 0], local[..., 1]) / (a + b).clamp_min(1e-12)
    share = torch.where(kinds == TORUS, ring, 1.0)
    products = torch.stack([b * c, c * a, a * b], -1)
    oval = torch.linalg.vector_norm(products * local / sizes.clamp_min(1e-12), dim=-1) / products.amax(-1).clamp_min(1e-12)
    return torch.where((kinds == SPHERE) & (b > 0), oval, share)


def volumes(solids: Solids) -> Tensor:
    """Volumes [b, t] of the primitives, 0 where absent."""
    a, b, c = solids.sizes.unbind(-1)
    volume = torch.where(solids.kinds == BOX, a * b * c, torch.zeros_like(a))
    volume = torch.where(solids.kinds == SPHERE, 4 / 3 * math.pi * a * torch.where(solids.ellipsoids, b * c, a * a), volume)
    volume = torch.where(solids.kinds == CONE, math.pi / 3 * c * (a * a + a * b + b * b), volume)
    volume = torch.where(solids.kinds == TORUS, 2 * math.pi**2 * a * b * b, volume)
    volume = torch.where(solids.kinds == CYLINDER, math.pi * a * a * b, volume)
    return _of_drawn(solids, volume, lambda told, _, h: told.area * h, lambda told: 2 * math.pi * told.middle * told.area)


def local_surface(kinds: Tensor, sizes: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
    """Points and outward normals [..., 3] on primitives `kinds` [...] of `sizes` [..., 3] in their frames, from uniforms [..., 3]; even but
    on ellipsoids and tori, see `_stretching`."""
    box, sphere, torus = ((kinds == kind)[..., None] for kind in (BOX, SPHERE, TORUS))
    maps = [_on_box(sizes, u), _on_ellipsoid(sizes, u), _on_torus(sizes, u), _on_cone(*_as_cone(kinds, sizes), u)]
    points, normals = (torch.where(box, b, torch.where(sphere, s, torch.where(torus, t, c))) for b, s, t, c in zip(*maps, strict=True))
    return points, normals


def _on_box(sizes: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
    faces = (sizes[..., [1, 2, 0]] * sizes[..., [2, 0, 1]]).cumsum(-1)
    pick = u[..., :1] * 2
    axis = (faces[..., :2] <= (pick % 1) * faces[..., 2:]).sum(-1)
    fixed = torch.nn.functional.one_hot(axis, 3).bool()
    sign = torch.where(pick < 1, -1.0, 1.0)
    free = torch.stack([u[..., 1], torch.where(axis == 0, u[..., 1], u[..., 2]), u[..., 2]], -1) - 0.5
    return torch.where(fixed, sign / 2, free) * sizes, torch.where(fixed, sign, 0.0)


def _on_ellipsoid(sizes: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
    """Images of the even points of a ball; what has one size is a ball."""
    axes = torch.where(sizes[..., 1:2] > 0, sizes, sizes[..., :1])
    z = 2 * u[..., 0] - 1
    around, angle = torch.sqrt(1 - z * z), 2 * math.pi * u[..., 1]
    direction = torch.stack([around * torch.cos(angle), around * torch.sin(angle), z], -1)
    return direction * axes, torch.nn.functional.normalize(direction / axes.clamp_min(1e-12), dim=-1)


def _on_torus(sizes: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
    """Even in both angles."""
    turn, tilt = 2 * math.pi * u[..., 0], 2 * math.pi * u[..., 1]
    out = torch.stack([torch.cos(turn), torch.sin(turn), torch.zeros_like(turn)], -1)
    up = torch.tensor([0.0, 0.0, 1.0], device=sizes.device)
    normal = out * torch.cos(tilt)[..., None] + up * torch.sin(tilt)[..., None]
    return out * sizes[..., :1] + normal * sizes[..., 1:2], normal


def _as_cone(kinds: Tensor, sizes: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Bottom radius, top radius and height [...] of cones and cylinders."""
    a, b, c = sizes.unbind(-1)
    cone = kinds == CONE
    return a, torch.where(cone, b, a), torch.where(cone, c, b)


def _on_cone(bottom: Tensor, top: Tensor, h: Tensor, u: Tensor) -> tuple[Tensor, Tensor]:
    slant = torch.hypot(bottom - top, h).clamp_min(1e-12)
    low, side, high = bottom.square(), (bottom + top) * slant, top.square()  # areas in units of pi
    pick = u[..., 0] * (low + side + high)
    on_low, on_high = pick < low, pick >= low + side
    # along the side the area grows with the radius, so that its square is even between those of the ends
    rho = torch.sqrt(low + u[..., 1] * (high - low))
    flat = (top - bottom).abs() < 1e-4 * slant
    along = torch.where(flat, u[..., 1], (rho - bottom) / torch.where(flat, 1.0, top - bottom))
    spread = torch.sqrt(u[..., 1])
    rho = torch.where(on_low, bottom * spread, torch.where(on_high, top * spread, rho))
    z = torch.where(on_low, -0.5, torch.where(on_high, 0.5, along - 0.5)) * h
    angle = 2 * math.pi * u[..., 2]
    cos, sin = torch.cos(angle), torch.sin(angle)
    end = on_low | on_high
    out = torch.where(end, 0.0, h / slant)
    rise = torch.where(on_low, -1.0, torch.where(on_high, 1.0, (bottom - top) / slant))
    return torch.stack([rho * cos, rho * sin, z], -1), torch.stack([out * cos, out * sin, rise], -1)


def _edges(solids: Solids, half: Tensor) -> tuple[Tensor, Tensor]:
    """Corners [b, t, 8, 2] of the outlines in boxes of half edges `half` [b, t, 2], and how round they are [b, t]."""
    return corners(solids.forms, solids.shares, half), rounding(solids.forms, solids.shares, half)


def _on_drawn(solids: Solids, at: tuple[Tensor, Tensor], u: Tensor, chance: Tensor) -> tuple[Tensor, Tensor]:
    """Points and outward normals [m, 3] on the extruded and turned outlines `at` rows and columns, in their frames, from uniforms [m, 3]
    and [m, 2], as `_map_areas` says they are spread: those of ends that are beside the outline are on no surface, nor is what is put off it
    to thin what is turned."""
    halves, besides, turns = outline_boxes(solids.kinds, solids.sizes, solids.shares)
    edges, rounds = _edges(solids, halves)
    sizes, half, beside, turned = solids.sizes[at], halves[at], besides[at], turns[at]
    on, normal = on_outlines(edges[at], rounds[at], half, u[:, 0], u[:, 1])
    around, box = measure_outlines(edges, rounds).around[at], 4 * half.prod(-1)
    h = sizes[:, 2]
    is_end = ~turned & (chance[:, 0] * (2 * box + around * h) < 2 * box)
    up = torch.where(chance[:, 1] < 0.5, -1.0, 1.0)
    zero = torch.zeros_like(up)
    end = torch.stack([(2 * u[:, 0] - 1) * half[:, 0], (2 * u[:, 1] - 1) * half[:, 1], up * h / 2], -1)
    side = torch.cat([on, ((u[:, 2] - 0.5) * h)[:, None]], -1)
    out, angle = on[:, 0] + beside, 2 * math.pi * u[:, 2]
    cos, sin = torch.cos(angle), torch.sin(angle)
    # thinned by the radius: what is too much leaves for where nothing is
    away = chance[:, 1] * sizes[:, 0] > out
    ring = torch.stack([out * cos, out * sin, torch.where(away, 10 * sizes[:, 0] + 10, on[:, 1])], -1)
    points = torch.where(turned[:, None], ring, torch.where(is_end[:, None], end, side))
    flat = torch.where(
        turned[:, None], torch.stack([normal[:, 0] * cos, normal[:, 0] * sin, normal[:, 1]], -1), torch.cat([normal, zero[:, None]], -1)
    )
    return points, torch.where(is_end[:, None], torch.stack([zero, zero, up], -1), flat)


def reach(solids: Solids) -> Tensor:
    """Radius [b, t] of a ball about each centre that holds the primitive."""
    a, b, c = solids.sizes.unbind(-1)
    box = torch.linalg.vector_norm(solids.sizes, dim=-1) / 2
    radius = torch.where(solids.kinds == BOX, box, torch.hypot(a, b / 2))
    radius = torch.where(solids.kinds == SPHERE, solids.sizes.amax(-1), radius)
    radius = torch.where(solids.kinds == CONE, torch.hypot(torch.maximum(a, b), c / 2), radius)
    radius = torch.where(solids.kinds == EXTRUDE, box, radius)
    return torch.where(solids.kinds == TORUS, a + b, radius)


def bounds(solids: Solids) -> tuple[Tensor, Tensor]:
    """Lower and upper corners [b, 3] of a box that holds all positive primitives; zeros where there is none."""
    solid = (solids.present & solids.positive)[..., None]
    radius = reach(solids)[..., None]
    low = torch.where(solid, solids.centers - radius, torch.inf).amin(1)
    high = torch.where(solid, solids.centers + radius, -torch.inf).amax(1)
    some = solid.any(1)
    return torch.where(some, low, 0.0), torch.where(some, high, 0.0)
