"""The samples of each training step and of the validation: functions of the settings and the step alone."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import torch
from torch.utils.data import DataLoader, Dataset

from imdim.data.folder import chunk_generator
from imdim.data.npz import NPZCADDataset, collate
from imdim.data.solids import from_sequences
from imdim.data.synthesize import TrainingSamples, join_samples, synthesize, with_prefixes
from imdim.learn.distributed import Processes
from imdim.learn.settings import TrainConfig
from imdim.learn.stump.samples import Occupied, draw_samples, label_solids

Batch = TrainingSamples | Occupied

TRAIN_STREAM, ORDER_STREAM, VAL_STREAM, NPZ_STREAM, TARGET_STREAM = 10, 11, 12, 13, 14
AHEAD = 4  # steps whose samples wait in memory, for each worker


class Batches(Dataset[list[Batch] | Exception]):
    """Item k are the parts of step k's batch that this process learns from; `per_epoch` is the number of steps of an epoch.

    A part is a function of the seed, the step and its own number: one process that has all parts learns what several learn together.
    Raises ValueError where a batch cannot be shared out.
    """

    def __init__(self, config: TrainConfig, processes: Processes) -> None:
        if config.shards % processes.count or config.batch_size % config.shards:
            raise ValueError(
                f"{config.shards} shards (setting shards) cannot share a batch of {config.batch_size} among {processes.count} process(es)"
            )
        self.config = config
        self.device = "cpu" if config.workers else config.device
        self.mine = range(processes.rank, config.shards, processes.count)
        self.data = NPZCADDataset(config.data_root, config.max_seq_len) if config.data_root else None
        self.expert = NPZCADDataset(config.expert_root, config.max_seq_len) if config.expert_root else None
        if self.expert is not None and (self.data is not None or not 0 < config.p_expert < 1 or config.experiment == "stump"):
            raise ValueError("settings expert_root and p_expert need a share between 0 and 1 of samples of programs made on the fly")
        self.kept: dict[int, dict[int, Batch]] = {}
        self.per_epoch = max(1, (len(self.data) if self.data else config.samples_per_epoch) // config.batch_size)

    def __getitem__(self, step: int) -> list[Batch] | Exception:
        try:
            return [self.part(step, shard) for shard in self.mine]
        except (ValueError, OSError, RuntimeError) as error:
            # from a worker it would come with a traceback in its message
            return error

    def part(self, step: int, shard: int) -> Batch:
        """Part `shard` of the batch of one step."""
        config = self.config
        chosen: Sequence[int] = range(config.batch_size // config.shards)
        if self.data is not None:
            epoch, place = divmod(step, self.per_epoch)
            order = torch.randperm(len(self.data), generator=chunk_generator(config.seed, ORDER_STREAM, epoch))
            chosen = order[place * config.batch_size : (place + 1) * config.batch_size][shard :: config.shards].tolist()
        elif config.together > 1:
            whole, at = divmod(step, config.together)
            made = self._made(whole, shard, len(chosen) * config.together)
            return made._make(tensor[at * len(chosen) : (at + 1) * len(chosen)] for tensor in made)
        generator = chunk_generator(config.seed, TRAIN_STREAM, step * config.shards + shard, self.device)
        return self._draw(self.data, chosen, generator)

    def _draw(self, data: NPZCADDataset | None, chosen: Sequence[int], generator: torch.Generator) -> Batch:
        """Samples of the files `chosen`, or as many made on the fly, of which some may be the expert's."""
        if self.expert is None:
            return _samples(data, chosen, self.config, generator)
        taken = round(self.config.p_expert * len(chosen))
        rows = torch.randint(len(self.expert), (taken,), generator=generator, device=generator.device).tolist()
        made = _samples(None, range(len(chosen) - taken), self.config, generator)
        found = _samples(self.expert, rows, self.config, generator)
        assert isinstance(made, TrainingSamples)
        assert isinstance(found, TrainingSamples)
        return join_samples(made, found)

    def _made(self, whole: int, shard: int, count: int) -> Batch:
        """Part `shard` of the samples of several steps, number `whole`; the last ones made are kept."""
        if whole not in self.kept:
            self.kept = {whole: {}}
        if shard not in self.kept[whole]:
            generator = chunk_generator(self.config.seed, TRAIN_STREAM, whole * self.config.shards + shard, self.device)
            self.kept[whole][shard] = self._draw(None, range(count), generator)
        return self.kept[whole][shard]

    def steps(self, first: int, end: int) -> Iterator[list[Batch]]:
        """The items from `first` to before `end`, on the device, made ahead where there are workers."""
        workers = self.config.workers
        loader = DataLoader(
            self, None, sampler=range(first, end), num_workers=workers, collate_fn=_as_it_is, prefetch_factor=AHEAD if workers else None
        )
        for parts in loader:
            if isinstance(parts, Exception):
                raise parts
            yield [part._make(tensor.to(self.config.device) for tensor in part) for part in parts]


def validation_batches(config: TrainConfig) -> Iterator[Batch]:
    """The validation set in batches of `batch_size`: at most `n_val` files of `val_root`, or samples of a stream of their own."""
    data = NPZCADDataset(config.val_root, config.max_seq_len) if config.val_root else None
    total = min(config.n_val, len(data)) if data else config.n_val
    for index, first in enumerate(range(0, total, config.batch_size)):
        # a fixed seed: runs of any seed are validated on the same samples
        generator = chunk_generator(0, NPZ_STREAM if data else VAL_STREAM, index, config.device)
        yield _samples(data, range(first, min(first + config.batch_size, total)), config, generator)


def _samples(data: NPZCADDataset | None, rows: Sequence[int], config: TrainConfig, generator: torch.Generator) -> Batch:
    """Samples of the files `rows`, or without `data` as many made for the experiment. The prefixes of files are drawn and rendered anew: a
    file does not say how long the one is that its `cur_points` shows."""
    stump = config.experiment == "stump"
    if data is None:
        n, synthesis = len(rows), config.synthesis
        return draw_samples(n, synthesis, config.stump, generator) if stump else synthesize(n, synthesis, generator)
    batch = collate([data[i] for i in rows])
    clouds, tokens, params = (batch[name].to(generator.device) for name in ("gt_points", "gt_tokens", "gt_params"))
    if stump:
        return label_solids(from_sequences(tokens, params), clouds, config.synthesis, config.stump, generator)
    return with_prefixes(clouds, tokens, params, config.synthesis, generator)


def _as_it_is(item: object) -> object:
    return item
