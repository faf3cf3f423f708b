"""Supervised training: samples made on the fly or read from npz, one record per report, resumable to the same weights.

Step k draws its data from a generator that is a function of (seed, k) alone and the networks have no dropout, so a run that was killed and
resumed takes the steps that one left alone takes.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import torch
from torch import Tensor

from imdim.learn.batches import Batch, Batches
from imdim.learn.checkpoint import load_own_state, load_state, load_weights, save_net, save_state
from imdim.learn.distributed import Processes
from imdim.learn.optimise import NotFinite, Optimiser, means
from imdim.learn.schedule import Plan, learning_rate, plan_steps, shorten_plan
from imdim.learn.settings import TrainConfig, build, fill_defaults, precision, settings_to_keep
from imdim.learn.validation import Reconstructions, Validation


@dataclass(frozen=True)
class Report:
    """After an epoch, or when the run stops: means of the losses since the last report; `stop` says why it ended, else None.

    `measured` holds IoU and errors every few epochs, else nothing, and `shown` what was written then. `data_share` is the share of
    the time that went into waiting for samples, `validation_share` into validation.
    """

    step: int
    samples: int
    train: dict[str, float]
    val: dict[str, float]
    measured: dict[str, float]
    best: bool
    lr: float
    samples_per_second: float
    data_share: float
    validation_share: float
    shown: Reconstructions | None = None
    stop: str | None = None


def train(
    config: TrainConfig,
    notes: dict[str, str] | None = None,
    clock: Callable[[], float] = time.monotonic,
    processes: Processes | None = None,
) -> Iterator[Report]:
    """Train in `config.out`: `best.safetensors` by validation loss, `state.pt` every `save_every` steps and after each epoch, and
    `before_cooldown.pt`, from which a run that was over goes on when it may take more epochs.

    Of several `processes` the first one reports and writes.

    Raises NotFinite, which names the step and the file with the batch, FileNotFoundError when there is nothing to resume or to begin with,
    ValueError when the run to resume was of another configuration or is over, and when the weights to begin with are of another.
    """
    processes = processes or Processes()
    run = _TrainRun(fill_defaults(config, processes.count), notes or {}, clock, processes)
    yield from run.reports()


class _TrainRun:
    def __init__(self, config: TrainConfig, notes: dict[str, str], clock: Callable[[], float], processes: Processes) -> None:
        torch.set_num_threads(config.threads)
        self.config, self.notes, self.out, self.clock, self.processes = config, notes, Path(config.out), clock, processes
        net = build(config)
        if config.weights and not config.resume:
            load_weights(net, Path(config.weights))
        self.net = net.to(config.device)
        self.optimiser = Optimiser(self.net, config.ema, config.clip, precision(config), processes)
        self.batches = Batches(config, processes)
        self.validation = Validation(config)
        self.plan = plan_steps(self.batches.per_epoch * config.epochs, config.cooldown)
        self.whole = self.plan.end
        self.step, self.best = 0, math.inf
        if config.resume:
            self._load()

    def reports(self) -> Iterator[Report]:
        config, begun, first = self.config, self.clock(), self.step
        batches = self.batches.steps(self.step, self.whole)
        since, taken = begun, []
        while self.step < self.plan.end:
            if config.max_minutes:
                self._hurry(self.clock() - begun, self.step - first)
            if self.step == self.plan.start:
                self._save("before_cooldown.pt")
                self._save("state.pt")
            taken.append(self._take(batches))
            if self.step % self.batches.per_epoch == 0 or self.step == self.plan.end:
                if self.processes.first:
                    yield self._report(taken, since)
                since, taken = self.clock(), []
            elif self.step % config.save_every == 0:
                self._save("state.pt")

    def _hurry(self, seconds: float, taken: int) -> None:
        plan = shorten_plan(self.plan, self.step, taken, seconds, 60 * self.config.max_minutes, self.config.cooldown)
        self.plan = Plan(*self.processes.agree(plan, self.config.device))

    def _take(self, batches: Iterator[list[Batch]]) -> tuple[dict[str, Tensor], float]:
        """The losses of a step, and the seconds that its samples took to come."""
        before = self.clock()
        parts = next(batches)
        waited = self.clock() - before
        losses = [partial(self.net.losses, part) for part in parts]  # type: ignore[arg-type]
        try:
            found = self.optimiser.step(losses, self.config.shards, self._lr(self.step), self.step)
        except NotFinite as error:
            path = self.out / f"not_finite_{self.step}{f'_of_{self.processes.rank}' if self.processes.rank else ''}.pt"
            save_state(path, {"step": self.step, "parts": [{k: v.cpu() for k, v in part._asdict().items()} for part in parts]})
            raise NotFinite(f"{error} at step {self.step}; its batch is in {path}") from None
        self.step += 1
        return found, waited

    def _report(self, taken: list[tuple[dict[str, Tensor], float]], since: float) -> Report:
        config, over = self.config, self.step == self.plan.end
        trained = self.clock() - since
        average = self.optimiser.average
        val = self.validation.losses(average)
        measured, shown = {}, None
        if over or self.step // self.batches.per_epoch % config.measure_every == 0:
            measured, shown = self.validation.measure(average)
        seen = self.step * config.batch_size
        best = val["loss"] < self.best
        if best:
            self.best = val["loss"]
            facts = {"step": str(self.step), "samples": str(seen), "val_loss": f"{val['loss']:.4f}"}
            save_net(self.out / "best.safetensors", average, {**self.notes, **facts})
        self._save("state.pt")
        return Report(
            self.step,
            seen,
            means([losses for losses, _ in taken]),
            val,
            measured,
            best,
            lr=self._lr(self.step - 1),
            samples_per_second=len(taken) * config.batch_size / max(trained, 1e-9),
            data_share=sum(waited for _, waited in taken) / max(trained, 1e-9),
            validation_share=1 - trained / max(self.clock() - since, 1e-9),
            shown=shown,
            stop=None if not over else "finished" if self.step == self.whole else "max_minutes",
        )

    def _lr(self, step: int) -> float:
        return learning_rate(self.config.lr, self.config.warmup, self.plan, step)

    def _save(self, name: str) -> None:
        if not self.processes.first:
            return
        state = {"step": self.step, "best": self.best, "plan": list(self.plan), "config": settings_to_keep(self.config)}
        save_state(self.out / name, {**state, **self.optimiser.state_dict()})

    def _load(self) -> None:
        path = self.out / "state.pt"
        state = load_own_state(path, settings_to_keep(self.config))
        self.best = state["best"]
        start, end = state["plan"]
        if state["step"] >= end:
            if self.whole <= end:
                raise ValueError(f"{path} is of a run that is over, {end} steps long; give it more epochs")
            state = load_state(self.out / "before_cooldown.pt") if start < end else state
        elif state["step"] >= start:
            # a fall that has begun is seen through
            self.plan = Plan(start, end)
        self.step = state["step"]
        self.optimiser.load_state_dict(state)
