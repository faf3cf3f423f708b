"""One way to write each signed sequence: equal solids of equal primitives get equal numbers in an equal order.

A box has 24 equal rotations, a cylinder a free spin and two ends, a cone may stand on its head; neighbours of one sign commute. A
network that regresses among such equals learns their mean, which is none of them.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from functools import cache

import torch
from torch import Tensor

from imdim.data.outlines import mask_shares, mirror, turn
from imdim.data.solids import ABSENT, BOX, CONE, CYLINDER, EXTRUDE, REVOLVE, TORUS, Solids
from imdim.data.surfaces import volumes


def canonical(solids: Solids) -> Solids:
    """The same solids with canonical primitives in canonical order."""
    return canonical_order(canonical_primitives(solids))


def canonical_primitives(solids: Solids) -> Solids:
    """Boxes and ellipsoids: of the 24 equal rotations the one nearest to none. Cylinders, cones and tori: the largest part of the axis is
    positive, and the rotation is the shortest from +z. Balls: none. Outlines: as cylinders, and what is extruded is spun by the least angle
    that quarter turns of its outline leave. Unused sizes become 0."""
    cone, cornered = solids.kinds == CONE, (solids.kinds == BOX) | solids.ellipsoids
    turning = cone | (solids.kinds == CYLINDER) | (solids.kinds == TORUS) | solids.drawn
    turned, edges = _nearest_box(solids.rotations, solids.sizes)
    axis = solids.rotations[..., 2]
    down = axis.gather(-1, axis.abs().argmax(-1, keepdim=True)) < 0
    axis = axis * torch.where(down, -1.0, 1.0)
    identity = torch.eye(3, dtype=axis.dtype, device=axis.device)
    rotations = torch.where(turning[..., None, None], shortest_from_z(axis), identity)
    used = torch.stack([torch.ones_like(cone), turning, cone | (solids.kinds == EXTRUDE)], -1)
    upright = torch.where(down & cone[..., None], solids.sizes[..., [1, 0, 2]], solids.sizes)
    sizes = torch.where(cornered[..., None], edges, torch.where(used, upright, 0.0))
    rotations = torch.where(cornered[..., None, None], turned, rotations)
    written = replace(solids, sizes=sizes, rotations=rotations)
    return _canonical_outlines(written, solids.rotations[..., 0], down[..., 0]) if solids.drawn.any() else written


def _canonical_outlines(solids: Solids, side: Tensor, down: Tensor) -> Solids:
    """Of solids whose rotations are the shortest: outlines as they lie there, where their x axis was `side` [b, t, 3] and z was `down`."""
    extruded = solids.kinds == EXTRUDE
    mirrored, swapped = mirror(solids.forms, solids.shares)
    forms = torch.where(down, mirrored, solids.forms)
    shares = torch.where((down & solids.drawn)[..., None], swapped, solids.shares)
    local = (solids.rotations.mT @ side[..., None])[..., 0]
    angle = torch.atan2(local[..., 1], local[..., 0])
    quarters = torch.round(angle / (math.pi / 2) - 1e-4)
    rest = torch.where(extruded, angle - quarters * (math.pi / 2), 0.0)
    quarters = torch.where(extruded, quarters, 0.0).long()
    spun = solids.rotations @ _about_z(rest)
    sizes = torch.where((quarters % 2 == 1)[..., None], solids.sizes[..., [1, 0, 2]], solids.sizes)
    rotations = torch.where(extruded[..., None, None], spun, solids.rotations)
    forms = turn(forms, quarters)
    shares = torch.where(mask_shares(forms, solids.kinds == REVOLVE), shares, 0.0)
    return replace(solids, forms=forms, shares=shares, sizes=sizes, rotations=rotations)


def _about_z(angle: Tensor) -> Tensor:
    """Rotations [..., 3, 3] by angles [...]."""
    c, s, o = torch.cos(angle), torch.sin(angle), torch.zeros_like(angle)
    return torch.stack([torch.stack([c, -s, o], -1), torch.stack([s, c, o], -1), torch.stack([o, o, o + 1], -1)], -2)


def canonical_order(solids: Solids) -> Solids:
    """The same solids, each run of one sign sorted by falling volume, then by position."""
    change = solids.positive[:, 1:] != solids.positive[:, :-1]
    run = torch.cat([torch.zeros_like(solids.kinds[:, :1]), change.cumsum(1)], 1)
    run = torch.where(solids.kinds == ABSENT, run.shape[1] + 1, run)
    # rounded, so that equal holes of a pattern are ordered by position and not by the noise of their numbers
    bulk = -torch.round(torch.log(volumes(solids).clamp_min(1e-12)) * 20)
    keys = [*(torch.round(c * 200) for c in solids.centers.unbind(-1)), bulk, run]
    # stable sorts from the least to the most significant key
    order = torch.arange(run.shape[1], device=run.device).expand(run.shape)
    for key in keys:
        order = order.gather(1, torch.argsort(key.gather(1, order), dim=1, stable=True))
    return solids.take(order)


def shortest_from_z(axis: Tensor) -> Tensor:
    """The rotation [..., 3, 3] by the smallest angle that takes +z to the unit vector `axis` [..., 3], which is not -z."""
    x, y, z = axis.unbind(-1)
    f = 1 / (1 + z).clamp_min(1e-6)
    rows = ((1 - x * x * f, -x * y * f, x), (-x * y * f, 1 - y * y * f, y), (-x, -y, z))
    return torch.stack([torch.stack(row, -1) for row in rows], -2)


@cache
def box_symmetries() -> Tensor:
    """The 24 proper rotations [24, 3, 3] that map coordinate axes to coordinate axes; always the same tensor."""
    orders, signs = itertools.permutations(range(3)), itertools.product((1.0, -1.0), repeat=3)
    signed = (torch.eye(3)[:, list(order)] * torch.tensor(sign) for order, sign in itertools.product(orders, signs))
    return torch.stack([matrix for matrix in signed if torch.linalg.det(matrix) > 0])


def _nearest_box(rotations: Tensor, sizes: Tensor) -> tuple[Tensor, Tensor]:
    group = box_symmetries().to(rotations)
    trace = torch.einsum("...ij,gji->...g", rotations, group)
    # at 45 degrees two are equally near; a small preference keeps rounding from choosing
    preference = torch.linspace(1e-3, 0.0, len(group), dtype=trace.dtype, device=trace.device)
    turn = group[(trace + preference).argmax(-1)]
    return rotations @ turn, (turn.abs().mT @ sizes[..., None])[..., 0]
