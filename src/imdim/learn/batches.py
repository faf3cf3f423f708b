"""The samples of each training step and of the validation: functions of the settings and the step alone."""

from __future__ import annotations

from collections.abc import Iterator

import torch
from torch import Tensor
from torch.utils.data import Dataset

from imdim.data.folder import chunk_generator
from imdim.data.npz import NPZCADDataset, collate
from imdim.data.synthesize import Samples, SynthesisConfig, synthesize, with_prefixes
from imdim.learn.settings import TrainConfig

TRAIN_STREAM, ORDER_STREAM, VAL_STREAM, NPZ_STREAM, TARGET_STREAM = 10, 11, 12, 13, 14


class Batches:
    """The training data; `per_epoch` is the number of steps of an epoch."""

    def __init__(self, config: TrainConfig) -> None:
        self.config = config
        self.data = NPZCADDataset(config.data_root, config.max_seq_len) if config.data_root else None
        self.per_epoch = max(1, (len(self.data) if self.data else config.samples_per_epoch) // config.batch_size)

    def of_step(self, step: int) -> Samples:
        """The samples of one step, on the device."""
        config = self.config
        generator = chunk_generator(config.seed, TRAIN_STREAM, step, config.device)
        if self.data is None:
            return synthesize(config.batch_size, config.synthesis, generator)
        epoch, place = divmod(step, self.per_epoch)
        order = torch.randperm(len(self.data), generator=chunk_generator(config.seed, ORDER_STREAM, epoch))
        chosen = order[place * config.batch_size : (place + 1) * config.batch_size].tolist()
        return from_npz(self.data, chosen, config.synthesis, generator)


def validation_batches(config: TrainConfig) -> Iterator[Samples]:
    """The validation set in batches of `batch_size`: at most `n_val` files of `val_root`, or samples of a stream of their own."""
    data = NPZCADDataset(config.val_root, config.max_seq_len) if config.val_root else None
    total = min(config.n_val, len(data)) if data else config.n_val
    for index, first in enumerate(range(0, total, config.batch_size)):
        count = min(config.batch_size, total - first)
        # a fixed seed: runs of any seed are validated on the same samples
        generator = chunk_generator(0, NPZ_STREAM if data else VAL_STREAM, index, config.device)
        if data is None:
            yield synthesize(count, config.synthesis, generator)
        else:
            yield from_npz(data, list(range(first, first + count)), config.synthesis, generator)


def from_npz(data: Dataset[dict[str, Tensor]], rows: list[int], synthesis: SynthesisConfig, generator: torch.Generator) -> Samples:
    """Samples of files. Their prefixes are drawn and rendered anew: a file does not say how long the one is that its `cur_points` shows."""
    batch = {name: tensor.to(generator.device) for name, tensor in collate([data[i] for i in rows]).items()}
    return with_prefixes(batch["gt_points"], batch["gt_tokens"], batch["gt_params"], synthesis, generator)
