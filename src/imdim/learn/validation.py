"""What a network in training is worth on targets that stay the same: losses, errors of the next primitive, IoU of whole programs."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import torch

from imdim.data.folder import chunk_generator
from imdim.data.solids import Solids, from_sequences
from imdim.data.synthesize import TrainingSamples, estimate_iou, synthesize
from imdim.learn.batches import TARGET_STREAM, Batch, validation_batches
from imdim.learn.decode import DecodeConfig, decode
from imdim.learn.measure import errors_by_kind, exact_structure, moves, summary
from imdim.learn.policy import Policy
from imdim.learn.settings import TrainConfig
from imdim.learn.stump.net import StumpNet, measure_shapes
from imdim.learn.stump.samples import Occupied, draw_samples

IOU_SAMPLES = 4096
IOU_POINTS = 2048  # of a shape, even in its box


class Reconstructions(NamedTuple):
    """Targets and what was written for them, row by row, with the IoU [b] of each."""

    truth: Solids
    found: Solids
    iou: torch.Tensor


class Validation:
    """The samples are drawn once, when they are first asked for."""

    def __init__(self, config: TrainConfig) -> None:
        self.config = config

    @cached_property
    def batches(self) -> list[Batch]:
        """For the losses, and for the moves from true prefixes."""
        return list(validation_batches(self.config))

    @cached_property
    def targets(self) -> TrainingSamples:
        """For whole programs: no program stands twice among them."""
        config = self.config
        if config.val_root:
            first = next(validation_batches(replace(config, n_val=config.n_measure, batch_size=config.n_measure)))
            assert isinstance(first, TrainingSamples)
            return first
        generator = chunk_generator(0, TARGET_STREAM, 0, config.device)
        return synthesize(config.n_measure, replace(config.synthesis, prefixes=1, p_undo=0.0, p_replace=0.0, p_hidden=0.0), generator)

    @cached_property
    def shapes(self) -> Occupied:
        """For the IoU of a CSG-Stump Net."""
        config = self.config
        generator = chunk_generator(0, TARGET_STREAM, 0, config.device)
        return draw_samples(config.n_measure, config.synthesis, replace(config.stump, points=IOU_POINTS, near=0.0), generator)

    @torch.no_grad()
    def losses(self, net: Policy | StumpNet) -> dict[str, float]:
        """Means over `n_val` samples."""
        net.eval()
        sums: dict[str, torch.Tensor] = {}
        for batch in self.batches:
            for name, value in net.losses(batch).items():  # type: ignore[arg-type]
                sums[name] = sums.get(name, 0.0) + value * len(batch[0])
        count = sum(len(batch[0]) for batch in self.batches)
        return {name: float(value) / count for name, value in sums.items()}

    def measure(self, net: Policy | StumpNet) -> tuple[dict[str, float], Reconstructions | None]:
        """Whole programs and next primitives, or shapes."""
        if isinstance(net, StumpNet):
            return measure_shapes(net, self.shapes), None
        values, shown = self.programs(net)
        return values | self.errors(net), shown

    @torch.no_grad()
    def programs(self, policy: Policy) -> tuple[dict[str, float], Reconstructions]:
        """Greedy programs for `n_measure` targets: IoU (sampled, standard error below 0.01) and share of exact structures."""
        policy.eval()
        targets, device = self.targets, self.config.device
        synthesis = self.config.synthesis
        # greedy programs gain nothing by taking back more, and cost twice the time
        settings = DecodeConfig(cur_points=synthesis.cur_points, max_primitives=synthesis.n_max, undo_limit=1)
        found = decode(policy, targets.gt_points, settings, torch.Generator(device).manual_seed(0))
        truth = from_sequences(targets.gt_tokens, targets.gt_params)
        iou = estimate_iou(found, truth, IOU_SAMPLES, torch.Generator(device).manual_seed(0))
        exact = exact_structure(found.compact(), truth).float().mean()
        values = {f"iou_{name}": value for name, value in summary(iou.tolist()).items()}
        return {**values, "exact_structure": float(exact)}, Reconstructions(truth, found, iou)

    @torch.no_grad()
    def errors(self, policy: Policy) -> dict[str, float]:
        """Medians of the errors of the next primitive at true prefixes, by kind; a kind that was never met is left out."""
        policy.eval()
        batch = self.batches[0]
        assert isinstance(batch, TrainingSamples)
        found = errors_by_kind(batch, moves(policy, batch)[0])
        return {
            f"{kind}_{name}": getattr(error, name)
            for kind, error in found.items()
            for name in ("center", "size", "angle_deg")
            if error.count
        }
