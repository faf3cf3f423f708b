"""CSG-Stump Net: encoder, decoder, primitive head and connection head (Ren et al. 2021, section 4)."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from imdim.learn.pointnet import PointNet
from imdim.learn.stump.decoded import NUMBERS, Decoded, occupancy, start
from imdim.learn.stump.dgcnn import DGCNN
from imdim.learn.stump.samples import Occupied
from imdim.learn.stump.settings import StumpConfig, check

STEEP = 1e4  # of occupancies that are all but 0 and 1


class StumpNet(nn.Module):
    """The heads say how a shape differs from `start`, which is learnt too."""

    def __init__(self, config: StumpConfig) -> None:
        super().__init__()
        self.config = check(config)
        k, c, width = config.primitives, config.intersections, config.width
        self.encoder = DGCNN(width, config.neighbours) if config.encoder == "dgcnn" else PointNet(width)
        self.decoder = nn.Sequential(nn.Linear(width, 2 * width), nn.LeakyReLU(), nn.Linear(2 * width, 2 * width), nn.LeakyReLU())
        first = start(k, c, torch.Generator().manual_seed(0))
        self.kinds = first.kinds
        self.primitive_head = _head(2 * width, first.numbers)
        self.connection_heads = nn.ModuleList(_head(2 * width, t) for t in (first.complement, first.connection, first.union))

    def forward(self, cloud: Tensor) -> Decoded:
        """The shapes of clouds [b, n, 3] in their frame (box centre 0, box diagonal 1)."""
        k, c = self.config.primitives, self.config.intersections
        code = self.decoder(self.encoder(cloud))
        complement, connection, union = (head(code) for head in self.connection_heads)
        return Decoded(self.kinds, self.primitive_head(code).view(-1, k, NUMBERS), complement, connection.view(-1, c, k), union)

    def losses(self, batch: Occupied) -> dict[str, Tensor]:
        """`loss` = `recon` + primitive_weight * `primitive`; `error` is the share of test points on the wrong side, 0 to 1."""
        shape = self(batch.cloud)
        # products may run in bfloat16; distances and the steep sigmoid may not
        with torch.autocast(batch.cloud.device.type, enabled=False):
            shape = Decoded(shape.kinds, *(t.float() for t in shape.tensors))
            return losses(shape, batch.points, batch.inside, self.config.eta, self.config.primitive_weight)


@torch.no_grad()
def measure_shapes(net: StumpNet, targets: Occupied) -> dict[str, float]:
    """IoU of the binary shapes as predicted, not fitted, and the intersections in their unions."""
    net.eval()
    shape = net(targets.cloud)
    found, truth = occupancy(shape, targets.points, STEEP, binary=True)[0] > 0.5, targets.inside > 0.5
    iou = (found & truth).sum(1) / (found | truth).sum(1).clamp_min(1)
    used = (shape.union > 0).sum(1).float()
    return {"iou_mean": float(iou.mean()), "iou_median": float(iou.median()), "intersections": float(used.mean())}


def losses(
    shape: Decoded, points: Tensor, inside: Tensor, eta: float, weight: float, binary: bool = False, each: Tensor | None = None
) -> dict[str, Tensor]:
    """Of shapes at test `points` [b, n, 3] that are `inside` [b, n]: mean squared error of occupancy, each point with its weight in `each`
    [b, n], and the mean over primitives of the squared distance to the nearest test point, which still has a gradient where the steep
    sigmoid has none."""
    found, sdf = occupancy(shape, points, eta, binary)
    squares = (found - inside).square()
    recon, primitive = (squares if each is None else each * squares).mean(), sdf.square().amin(1).mean()
    error = ((found > 0.5) != (inside > 0.5)).float().mean()
    return {"loss": recon + weight * primitive, "recon": recon, "primitive": primitive, "error": error}


def _head(width: int, first: Tensor) -> nn.Linear:
    """A layer that says `first`, nearly."""
    head = nn.Linear(width, first.numel())
    with torch.no_grad():
        head.weight.mul_(0.3)
        head.bias.copy_(first.flatten())
    return head
