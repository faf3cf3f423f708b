"""PointNet: one vector for one cloud. Source: Qi et al. 2017, without its input transforms; the project's design, section 5.1."""

from __future__ import annotations

from torch import Tensor, nn


class PointNet(nn.Module):
    """The same small network on every point, then the maximum over points."""

    def __init__(self, out_dim: int) -> None:
        super().__init__()
        self.net = nn.Sequential(nn.Conv1d(3, 64, 1), nn.ReLU(), nn.Conv1d(64, 128, 1), nn.ReLU(), nn.Conv1d(128, out_dim, 1))

    def forward(self, points: Tensor) -> Tensor:
        """[b, out_dim] of `points` [b, n, 3], n > 0."""
        return self.net(points.mT).amax(-1)
