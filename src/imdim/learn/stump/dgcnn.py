"""DGCNN: one vector for one cloud, from edges to the nearest points of each layer's own features (Wang et al. 2019, section 3).

EdgeConv with one linear layer h(x_i, x_j - x_i) = A x_i + B (x_j - x_i), then the maximum over the neighbours j. The layer is linear, so
that maximum is (A - B) x_i + max_j B x_j: it is computed per point, not per edge, which is `neighbours` times cheaper. For this, batch
normalisation stands behind the maximum, not before it.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

CHANNELS = (64, 64, 64)  # as in the published code of CSG-Stump Net
SLOPE = 0.2


class DGCNN(nn.Module):
    """EdgeConvs whose graphs are made anew from their inputs, all their outputs together into one layer, the maximum over points."""

    def __init__(self, out_dim: int, neighbours: int) -> None:
        super().__init__()
        self.edges = nn.ModuleList(EdgeConv(i, o, neighbours) for i, o in zip((3, *CHANNELS), CHANNELS, strict=False))
        self.join = nn.Linear(sum(CHANNELS), out_dim, bias=False)
        self.norm = nn.BatchNorm1d(out_dim)

    def forward(self, points: Tensor) -> Tensor:
        """[b, out_dim] of `points` [b, n, 3], n > 0."""
        features, all_features = points, []
        for edge in self.edges:
            features = edge(features)
            all_features.append(features)
        joined = self.join(torch.cat(all_features, -1)).amax(1)
        return F.leaky_relu(self.norm(joined), SLOPE)


class EdgeConv(nn.Module):
    def __init__(self, in_dim: int, out_dim: int, neighbours: int) -> None:
        super().__init__()
        self.neighbours = neighbours
        self.own = nn.Linear(in_dim, out_dim, bias=False)  # A
        self.offset = nn.Linear(in_dim, out_dim, bias=False)  # B
        self.norm = nn.BatchNorm1d(out_dim)

    def forward(self, x: Tensor) -> Tensor:
        """[b, n, out_dim] of features [b, n, in_dim]; a point is a neighbour of itself."""
        edges = self.strongest(x)
        return F.leaky_relu(self.norm(edges.flatten(0, 1)).view_as(edges), SLOPE)

    def strongest(self, x: Tensor) -> Tensor:
        """max_j A x_i + B (x_j - x_i) [b, n, out_dim]."""
        near, offset = nearest(x, self.neighbours), self.offset(x).float()
        first = torch.arange(len(x), device=x.device)[:, None, None] * x.shape[1]
        # a bag is a point's neighbours; its maximum is found without the table of all edges
        strongest = F.embedding_bag((near + first).flatten(0, 1), offset.flatten(0, 1), mode="max").view_as(offset)
        return self.own(x) - offset + strongest


@torch.no_grad()
def nearest(x: Tensor, count: int) -> Tensor:
    """Indices int64 [b, n, count] of the points of `x` [b, n, d] nearest to each; all n where there are fewer."""
    x = x.float()
    return torch.cdist(x, x).topk(min(count, x.shape[1]), -1, largest=False, sorted=False).indices
