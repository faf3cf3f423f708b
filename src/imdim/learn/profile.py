"""What a policy looks at: a PointNet on every point, pooled in slabs along the three axes of the target's box.

A face across an axis is a slab full of points, a hole leaves its tangent planes in two: the numbers of a program can be read off such
profiles. One vector for the whole cloud blurs them. Points know their surroundings (moments of the target's points in their voxel) and
where they stand relative to the solid written so far, so that what is already explained can be told from what is not.
Source of the pooling: Peng et al. 2020, "Convolutional Occupancy Networks", section 3.1 (features projected and pooled along axes), here
onto lines.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from imdim.data.solids import Solids, levels
from imdim.learn.codes import STEPS, relative

VOXELS = 14  # along each axis; the diagonal of the cloud's box is 1
WAVES = 3
NEAR = 0.012  # of the diagonal: closer to the written solid's surface is explained
COUNTS = 6  # kinds of points that are counted, see `_kinds_of`
POINT = 3 + 3 + 6 * WAVES + 10 + 2


@dataclass(frozen=True)
class Clouds:
    """Both clouds of a state. `shares` [b, n, 3] in the ruler's terms, `features` [b, n, POINT], `kinds` [b, n, COUNTS] (0 or 1; the first
    is "a point of the target"), `slabs` [b, n, STEPS + 1] for each axis: 1 at the point's mark; `target` points stand first."""

    shares: Tensor
    features: Tensor
    kinds: Tensor
    slabs: tuple[Tensor, Tensor, Tensor]
    target: int


@torch.no_grad()
def look(gt_points: Tensor, cur_points: Tensor, written: Solids, low: Tensor, edges: Tensor, outside: Tensor | None = None) -> Clouds:
    """The clouds of targets [b, n, 3] and of what is `written` [b, m, 3] (zeros: nothing), with what each point knows; how far it is
    `outside` [b, n] of what is written follows from its primitives where it is not given."""
    with torch.autocast(gt_points.device.type, enabled=False):
        return _clouds(gt_points, cur_points, fold_levels(written, gt_points) if outside is None else outside, low, edges)


def _clouds(gt_points: Tensor, cur_points: Tensor, outside: Tensor, low: Tensor, edges: Tensor) -> Clouds:
    points = torch.cat([gt_points, cur_points], 1)
    table = voxel_moments(gt_points)
    rows = torch.arange(len(points), device=points.device)[:, None]
    moments = table[rows, voxel_of(points)]
    moments[..., 1:4] = (points - moments[..., 1:4]) * VOXELS * moments[..., :1].sign()
    there = cur_points.flatten(1).any(1)[:, None]
    shares = relative(points, low, edges)
    level = torch.cat([outside, torch.zeros_like(cur_points[..., 0])], 1)
    waves = shares[..., None] * (math.pi * 2.0 ** torch.arange(WAVES, device=points.device))
    near = torch.stack([torch.tanh(level / 0.05), torch.exp(-(level / NEAR).square())], -1)
    around = torch.cat([torch.log1p(moments[..., :1]), moments[..., 1:]], -1)
    features = torch.cat([shares, points * 2, waves.sin().flatten(2), waves.cos().flatten(2), around, near], -1)
    seen = gt_points.shape[1]
    kinds = torch.zeros(*points.shape[:2], COUNTS, device=points.device)
    kinds[:, :seen] = _kinds_of(outside)
    kinds[:, seen:, 4] = there.float()
    kinds[:, seen:, 5] = (there & (moments[:, seen:, 0] == 0)).float()
    ruled = torch.arange(STEPS + 1.0, device=points.device)
    x, y, z = ((m[..., None] == ruled).float() for m in (shares * STEPS).round().clamp(0, STEPS).unbind(-1))
    return Clouds(shares, features, kinds, (x, y, z), seen)


def _kinds_of(outside: Tensor) -> Tensor:
    """Target points [b, n, COUNTS]: any; beyond, within and on the written solid. The last two are points of the written one: any, and
    those near no target point."""
    zero = torch.zeros_like(outside)
    return torch.stack([zero + 1, (outside > NEAR).float(), (outside < -NEAR).float(), (outside.abs() <= NEAR).float(), zero, zero], -1)


def fold_levels(written: Solids, points: Tensor) -> Tensor:
    """Levels [b, n] of the left fold at points [b, n, 3]: negative inside, 1 where nothing is written."""
    each = levels(written, points)
    level = torch.ones_like(points[..., 0])
    for t in range(each.shape[1]):
        added = torch.minimum(level, each[:, t])
        cut = torch.where(written.common[:, t, None] & written.present[:, t, None], each[:, t], -each[:, t])
        level = torch.where(written.positive[:, t, None], added, torch.maximum(level, cut))
    return level.clamp(-1, 1)


def voxel_of(points: Tensor) -> Tensor:
    """Index int64 [b, n] of the voxel of each point of the unit frame."""
    cell = ((points + 0.5) * VOXELS).floor().clamp(0, VOXELS - 1).long()
    return (cell[..., 0] * VOXELS + cell[..., 1]) * VOXELS + cell[..., 2]


def voxel_moments(points: Tensor) -> Tensor:
    """Count, mean [3] and normalised covariance [6] of the points in each voxel, [b, VOXELS^3, 10]; the covariance's trace is 1, or 0."""
    b = len(points)
    first, second = torch.triu_indices(3, 3, device=points.device)
    columns = torch.cat([torch.ones_like(points[..., :1]), points, points[..., first] * points[..., second]], -1)
    at = (voxel_of(points) + VOXELS**3 * torch.arange(b, device=points.device)[:, None]).flatten()
    table = torch.zeros(b * VOXELS**3, 10, device=points.device).index_add_(0, at, columns.flatten(0, 1))
    count = table[:, :1]
    mean = table[:, 1:] / count.clamp_min(1)
    spread = mean[:, 3:] - mean[:, first] * mean[:, second]
    trace = spread[:, [0, 3, 5]].sum(-1, keepdim=True)
    return torch.cat([count, mean[:, :3], spread / trace.clamp_min(1e-9) * (trace > 1e-7)], -1).view(b, VOXELS**3, 10)


def histograms(clouds: Clouds, axis: int, weight: Tensor | None = None) -> Tensor:
    """Profile [b, STEPS + 1, COUNTS + 1] along `axis`: logarithms of the counts of each kind, and the target points' mean offset from the
    mark, in steps. A share of 1 of the target reads 2. With `weight` [b * w, n] of the points, w profiles of each row."""
    # counts and offsets are wanted exactly, in whatever precision the network runs
    with torch.autocast(clouds.shares.device.type, enabled=False):
        return _histograms(clouds, axis, weight)


def _histograms(clouds: Clouds, axis: int, weight: Tensor | None) -> Tensor:
    kinds, place = clouds.kinds, clouds.shares[..., axis] * STEPS
    columns = torch.cat([kinds, (place - place.round())[..., None] * kinds[..., :1]], -1)
    slabs = clouds.slabs[axis].mT
    if weight is None:
        sums = slabs @ columns
    else:
        # the profiles of a row share one product: their columns stand side by side
        weights = weight.view(len(columns), -1, columns.shape[1]).mT[..., None]
        sums = (slabs @ (weights * columns[:, :, None]).flatten(2)).unflatten(2, (weights.shape[2], -1)).transpose(1, 2).flatten(0, 1)
    scale = (math.exp(2) - 1) * 4 / clouds.target
    return torch.cat([torch.log1p(sums[..., :-1] * scale), sums[..., -1:] / sums[..., :1].clamp_min(1)], -1)


class SlabTokens(nn.Module):
    """Tokens [b, 3 * (STEPS + 1) + 1, d] of the slabs of x, y and z, and one of everything.

    Not `local`: tokens [b, 3, d], the maximum over the target's points, that over the written solid's, and one of everything.
    """

    def __init__(self, d_model: int, width: int, local: bool = True) -> None:
        super().__init__()
        self.point_net = nn.Sequential(nn.Linear(POINT + 1, 2 * width), nn.GELU(), nn.Linear(2 * width, width), nn.GELU())
        self.slab = nn.Sequential(nn.Linear(2 * width + COUNTS + 1, 2 * d_model), nn.GELU(), nn.Linear(2 * d_model, d_model))
        self.place = nn.Parameter(0.02 * torch.randn(3, STEPS + 1, d_model))
        self.mark = nn.Parameter(0.2 * torch.randn(STEPS + 1, d_model))
        self.whole = nn.Linear(width + 3, d_model)
        self.pooled = None if local else nn.Linear(width, d_model)

    def forward(self, clouds: Clouds, edges: Tensor) -> Tensor:
        source = torch.ones_like(clouds.features[..., :1])
        source[:, clouds.target :] = 0.0
        split = self.point_net(torch.cat([clouds.features, source], -1)).split((clouds.target, source.shape[1] - clouds.target), 1)
        whole = self.whole(torch.cat([split[0].mean(1), torch.log(edges)], -1))[:, None]
        if self.pooled is not None:
            target, current = (self.pooled(part).amax(1, keepdim=True) for part in split)
            return torch.cat([target, current * clouds.kinds[:, clouds.target :, 4:5].amax(1, keepdim=True), whole], 1)
        return torch.cat([*(self._slabs(clouds, axis, split) for axis in range(3)), whole], 1)

    def _slabs(self, clouds: Clouds, axis: int, split: tuple[Tensor, ...]) -> Tensor:
        slabs = clouds.slabs[axis]
        parts = (slabs[:, : clouds.target], slabs[:, clouds.target :] * clouds.kinds[:, clouds.target :, 4:5])
        pooled = [(s.mT @ f) / s.sum(1)[..., None].clamp_min(1) for s, f in zip(parts, split, strict=True)]
        return self.slab(torch.cat([*pooled, histograms(clouds, axis)], -1)) + self.place[axis] + self.mark
