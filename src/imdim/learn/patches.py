"""Local tokens of a cloud: neighbourhoods of spread centres, each pooled by a small PointNet.

Source: Yu et al. 2022, "Point-BERT", section 3.1 (patches by farthest points and nearest neighbours).
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

FAR = 0.1  # of the diagonal: about where a gap between two clouds is large


class PatchTokens(nn.Module):
    """`count` tokens [b, count, d] of a cloud [b, n, 3] whose points carry one feature [b, n]."""

    def __init__(self, d_model: int, count: int, neighbours: int) -> None:
        super().__init__()
        self.count, self.neighbours = count, neighbours
        self.inner = nn.Sequential(nn.Linear(7, 64), nn.GELU(), nn.Linear(64, 128))
        self.outer = nn.Sequential(nn.Linear(128, d_model), nn.GELU(), nn.Linear(d_model, d_model))
        self.place = nn.Sequential(nn.Linear(3, d_model), nn.GELU(), nn.Linear(d_model, d_model))

    def forward(self, points: Tensor, feature: Tensor) -> Tensor:
        with torch.no_grad():
            rows = torch.arange(len(points), device=points.device)[:, None]
            centers = points[rows, farthest(points, self.count)]
            near = torch.cdist(centers, points).topk(min(self.neighbours, points.shape[1]), largest=False).indices
            around = points[rows[..., None], near]
            place = centers[:, :, None].expand_as(around)
            local = torch.cat([(around - place) * 4, place * 2, feature[rows[..., None], near][..., None]], -1)
        return self.outer(self.inner(local).amax(2)) + self.place(centers * 2)


def farthest(points: Tensor, count: int) -> Tensor:
    """Indices [b, count] of points [b, n, 3], each the farthest from those before; the first is point 0."""
    chosen = [torch.zeros(len(points), dtype=torch.long, device=points.device)]
    nearest = torch.full(points.shape[:2], torch.inf, device=points.device)
    rows = torch.arange(len(points), device=points.device)
    for _ in range(count - 1):
        nearest = torch.minimum(nearest, (points - points[rows, chosen[-1]][:, None]).square().sum(-1))
        chosen.append(nearest.argmax(1))
    return torch.stack(chosen, 1)


def gaps(gt_points: Tensor, cur_points: Tensor, there: Tensor) -> tuple[Tensor, Tensor]:
    """Features [b, n] and [b, m] in 0..1: how far each point is from the other cloud, `FAR` reading 0.76; 1 where `there` [b] is false."""
    between = torch.cdist(gt_points, cur_points)
    to_current, to_target = (torch.tanh(between.amin(axis) / FAR) for axis in (2, 1))
    return torch.where(there[:, None], to_current, 1.0), to_target
