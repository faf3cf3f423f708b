"""Supervised training: samples made on the fly or read from npz, one record per report, resumable to the same weights.

Step k draws its data from a generator that is a function of (seed, k) alone and the networks have no dropout, so a run that was killed and
resumed takes the steps that one left alone takes.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path

import torch
from torch import Tensor
from torch.utils.data import Dataset

from imdim.data.folder import chunk_generator
from imdim.data.npz import NPZCADDataset, collate
from imdim.data.synthesize import Samples, SynthesisConfig, synthesize, with_prefixes
from imdim.learn.base import BaseConfig, BasePolicy
from imdim.learn.checkpoint import load_state, save_policy, save_state, state_tensors
from imdim.learn.policy import Policy
from imdim.learn.seed import SeedConfig, SeedPolicy

TRAIN_STREAM, ORDER_STREAM, VAL_STREAM, NPZ_STREAM = 10, 11, 12, 13


@dataclass
class TrainConfig:
    """`data_root` and `val_root` are folders of npz; where empty, samples are made on the fly and never repeat. An epoch is
    `samples_per_epoch` samples (or the folder, once) and ends with a validation on `n_val` samples. `max_seq_len` counts END.
    `max_minutes` (0: none) stops early; the learning rate warms up, then falls along a cosine over all `epochs`."""

    experiment: str = "base"
    data_root: str = ""
    val_root: str = ""
    out: str = "runs/base"
    epochs: int = 20
    samples_per_epoch: int = 4096
    n_val: int = 256
    batch_size: int = 32
    lr: float = 5e-4
    warmup: int = 200
    clip: float = 1.0
    max_seq_len: int = 13
    device: str = "cpu"
    threads: int = 1
    seed: int = 0
    max_minutes: float = 0.0
    save_every: int = 200
    resume: bool = False
    synthesis: SynthesisConfig = field(default_factory=SynthesisConfig)
    base: BaseConfig = field(default_factory=BaseConfig)
    seed_design: SeedConfig = field(default_factory=SeedConfig)


@dataclass(frozen=True)
class Report:
    """After an epoch, or when the run stops: means of the losses since the last report; `stop` says why it ended, else None.

    `data_share` is the share of the time that went into samples.
    """

    step: int
    samples: int
    train: dict[str, float]
    val: dict[str, float]
    best: bool
    lr: float
    samples_per_second: float
    data_share: float
    stop: str | None = None


class NotFinite(FloatingPointError):
    """The loss or a gradient is not finite; the message names the step and the file with the batch."""


def build(config: TrainConfig) -> Policy:
    """A fresh policy of `config.experiment`, the same for the same `config.seed`. Raises ValueError for an unknown experiment."""
    kinds = {"seed": (SeedPolicy, config.seed_design), "base": (BasePolicy, config.base)}
    if config.experiment not in kinds:
        raise ValueError(f"unknown experiment {config.experiment!r}; known are {', '.join(kinds)}")
    kind, settings = kinds[config.experiment]
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(config.seed)
        return kind(settings, config.max_seq_len)


def train(config: TrainConfig, notes: dict[str, str] | None = None) -> Iterator[Report]:
    """Train in `config.out`: `best.safetensors` by validation loss, `state.pt` every `save_every` steps and after each epoch.

    Raises NotFinite, FileNotFoundError when there is nothing to resume, ValueError when the run to resume was of another configuration.
    """
    run = _Run(config, notes or {})
    yield from run.reports()


class _Run:
    def __init__(self, config: TrainConfig, notes: dict[str, str]) -> None:
        torch.set_num_threads(config.threads)
        self.config, self.notes, self.out = config, notes, Path(config.out)
        self.policy = build(config).to(config.device)
        self.optimizer = torch.optim.AdamW(self.policy.parameters(), config.lr, weight_decay=0.01)
        self.data = NPZCADDataset(config.data_root, config.max_seq_len) if config.data_root else None
        size = len(self.data) if self.data else config.samples_per_epoch
        self.per_epoch = max(1, size // config.batch_size)
        self.total = self.per_epoch * config.epochs
        self.step, self.best = 0, math.inf
        if config.resume:
            self._load()

    def reports(self) -> Iterator[Report]:
        start = since = time.monotonic()
        sums, waited, first = {}, 0.0, self.step
        while self.step < self.total:
            before = time.monotonic()
            batch = self.batch(self.step)
            waited += time.monotonic() - before
            for name, value in self._learn(batch).items():
                sums[name] = sums.get(name, 0.0) + value
            self.step += 1
            late = bool(self.config.max_minutes) and time.monotonic() - start > 60 * self.config.max_minutes
            if self.step % self.per_epoch == 0 or late or self.step == self.total:
                spent, count = time.monotonic() - since, self.step - first
                val = self.validate()
                best = val["loss"] < self.best
                self.best = min(self.best, val["loss"])
                if best:
                    steps = {"step": str(self.step), "samples": str(self.step * self.config.batch_size), "val_loss": f"{val['loss']:.4f}"}
                    save_policy(self.out / "best.safetensors", self.policy, {**self.notes, **steps})
                self._save()
                means = {name: value / count for name, value in sums.items()}
                rate = count * self.config.batch_size / spent
                stop = "max_minutes" if late else "finished" if self.step == self.total else None
                seen = self.step * self.config.batch_size
                yield Report(self.step, seen, means, val, best, self._lr(self.step - 1), rate, waited / spent, stop)
                if stop:
                    return
                sums, waited, first, since = {}, 0.0, self.step, time.monotonic()
            elif self.step % self.config.save_every == 0:
                self._save()

    def batch(self, step: int) -> Samples:
        """The samples of one step, on the device."""
        config = self.config
        generator = chunk_generator(config.seed, TRAIN_STREAM, step, config.device)
        if self.data is None:
            return synthesize(config.batch_size, config.synthesis, generator)
        epoch, place = divmod(step, self.per_epoch)
        order = torch.randperm(len(self.data), generator=chunk_generator(config.seed, ORDER_STREAM, epoch))
        chosen = order[place * config.batch_size : (place + 1) * config.batch_size].tolist()
        return from_npz(self.data, chosen, config.synthesis, generator)

    @torch.no_grad()
    def validate(self) -> dict[str, float]:
        """Mean losses over the validation set, the same samples every time."""
        self.policy.eval()
        sums: dict[str, float] = {}
        count = 0
        for batch in validation_batches(self.config):
            for name, value in self.policy.losses(batch).items():
                sums[name] = sums.get(name, 0.0) + float(value) * len(batch.steps)
            count += len(batch.steps)
        return {name: value / count for name, value in sums.items()}

    def _learn(self, batch: Samples) -> dict[str, float]:
        self.policy.train()
        for group in self.optimizer.param_groups:
            group["lr"] = self._lr(self.step)
        losses = self.policy.losses(batch)
        self.optimizer.zero_grad()
        losses["loss"].backward()
        norm = torch.nn.utils.clip_grad_norm_(self.policy.parameters(), self.config.clip)
        if not (torch.isfinite(losses["loss"]) and torch.isfinite(norm)):
            path = self.out / f"not_finite_{self.step}.pt"
            save_state(path, {"step": self.step, **state_tensors(batch._asdict())})
            found = f"loss {losses['loss'].item()}, gradient norm {norm.item()}"
            raise NotFinite(f"{found} at step {self.step}; its batch is in {path}")
        self.optimizer.step()
        return {**{name: float(value.detach()) for name, value in losses.items()}, "gradient_norm": float(norm)}

    def _lr(self, step: int) -> float:
        warm = min(1.0, (step + 1) / max(1, self.config.warmup))
        return self.config.lr * warm * (0.02 + 0.98 * 0.5 * (1 + math.cos(math.pi * step / self.total)))

    def _save(self) -> None:
        state = {"step": self.step, "best": self.best, "config": _fixed(self.config)}
        save_state(self.out / "state.pt", {**state, "policy": self.policy.state_dict(), "optimizer": self.optimizer.state_dict()})

    def _load(self) -> None:
        path = self.out / "state.pt"
        if not path.is_file():
            raise FileNotFoundError(f"nothing to resume: no {path}")
        state = load_state(path)
        other = [key for key, value in _fixed(self.config).items() if state["config"].get(key) != value]
        if other:
            raise ValueError(f"{path} is of a run with another {', '.join(other)}")
        self.policy.load_state_dict(state["policy"])
        self.optimizer.load_state_dict(state["optimizer"])
        self.step, self.best = state["step"], state["best"]


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


def _fixed(config: TrainConfig) -> dict[str, object]:
    """The settings that a resumed run must share; where it runs and how long may change."""
    free = ("resume", "max_minutes", "device", "threads", "out", "save_every", "n_val", "val_root")
    return {key: _plain(value) for key, value in asdict(config).items() if key not in free}


def _plain(value: object) -> object:
    """Tuples as lists, as they come back from a file."""
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    return [_plain(v) for v in value] if isinstance(value, (tuple, list)) else value
