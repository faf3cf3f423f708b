"""What a CSG-Stump Net in training is worth: losses, and the IoU of its matrices made binary, on shapes that stay the same."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import torch

from imdim.data.folder import chunk_generator
from imdim.learn.batches import TARGET_STREAM, validation_batches
from imdim.learn.settings import TrainConfig
from imdim.learn.stump.decoded import occupancy
from imdim.learn.stump.net import StumpNet
from imdim.learn.stump.samples import Occupied, draw_samples
from imdim.learn.validation import mean_losses

IOU_POINTS = 2048  # even in the box
STEEP = 1e4  # of occupancies that are all but 0 and 1


class StumpValidation:
    """The samples are drawn once, when they are first asked for."""

    def __init__(self, config: TrainConfig) -> None:
        self.config = config

    @cached_property
    def batches(self) -> list[Occupied]:
        """For the losses."""
        return [b for b in validation_batches(self.config) if isinstance(b, Occupied)]

    @cached_property
    def targets(self) -> Occupied:
        """For the IoU."""
        config = self.config
        generator = chunk_generator(0, TARGET_STREAM, 0, config.device)
        return draw_samples(config.n_measure, config.synthesis, replace(config.stump, points=IOU_POINTS, near=0.0), generator)

    def losses(self, net: StumpNet) -> dict[str, float]:
        """Means over `n_val` samples."""
        return mean_losses(net, self.batches)

    @torch.no_grad()
    def measure(self, net: StumpNet) -> tuple[dict[str, float], None]:
        """IoU of the binary shape as predicted, not fitted, and the intersections in its union."""
        net.eval()
        targets = self.targets
        shape = net(targets.cloud)
        found, truth = occupancy(shape, targets.points, STEEP, binary=True)[0] > 0.5, targets.inside > 0.5
        iou = (found & truth).sum(1) / (found | truth).sum(1).clamp_min(1)
        used = (shape.union > 0).sum(1).float()
        return {"iou_mean": float(iou.mean()), "iou_median": float(iou.median()), "intersections": float(used.mean())}, None
