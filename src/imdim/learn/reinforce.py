"""Reinforcement: a policy tries several programs or moves and makes those likelier that came out better than their siblings.

Source: the project's design, section 9; Shao et al. 2024, "DeepSeekMath", section 4.1 (advantages within a group, clipped ratios). Instead
of a divergence from the first policy, the supervised loss on fresh samples holds the weights where programs look like programs.

Step k is a function of the seed, k and the weights alone, so a run that was killed and resumed takes the steps that one left alone takes.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path

import torch
from torch import Tensor

from imdim.data.folder import chunk_generator
from imdim.data.solids import from_sequences
from imdim.data.synthesize import SynthesisConfig, TrainingSamples, estimate_iou, synthesize
from imdim.learn.checkpoint import load_own_state, save_net, save_state
from imdim.learn.decode import DecodeConfig, steps
from imdim.learn.optimise import Optimiser, means
from imdim.learn.policy import Policy
from imdim.learn.rollouts import CREDIT, RewardConfig, Written, moves_of
from imdim.learn.settings import PRECISIONS, settings_to_keep

STREAM, TARGETS = 20, 21
# what a resumed run may change
FREE = ("resume", "steps", "max_minutes", "device", "threads", "out", "checkpoint", "n_val", "validate_every")


@dataclass
class ReinforceConfig:
    """Each step tries `group` programs for each of `targets` clouds (`credit` "program") or `group` moves from each state of one program
    for each ("move"), and learns `reuse` times from them at rate `lr`, `rows` moves at a time with the products in `precision`. The reward
    is the IoU (by `iou_samples` points) minus `price` for each move; `undo_limit` steps of a program may be taken back. Ratios are clipped
    at 1 +- `clip_ratio`; `anchor` weighs the supervised loss on `anchor_batch` samples. Every `validate_every` steps greedy programs for
    `n_val` targets are rewarded, and the best average of the weights (decay `ema` per step) is saved.
    """

    checkpoint: str = "models/imdim-base.safetensors"
    out: str = "runs/reinforce"
    steps: int = 1000
    max_minutes: float = 0.0
    targets: int = 8
    group: int = 8
    credit: str = "program"
    undo_limit: int = 4
    reuse: int = 2
    rows: int = 128
    lr: float = 5e-5
    precision: str = "float32"
    price: float = 0.005
    clip_ratio: float = 0.2
    anchor: float = 0.1
    anchor_batch: int = 32
    clip: float = 1.0
    ema: float = 0.95
    iou_samples: int = 2048
    n_val: int = 128
    validate_every: int = 20
    device: str = "cpu"
    threads: int = 1
    seed: int = 0
    resume: bool = False
    synthesis: SynthesisConfig = field(default_factory=SynthesisConfig)


@dataclass(frozen=True)
class Progress:
    """After a validation: means over the steps since the last one, and greedy reward, IoU and number of moves on the validation targets."""

    step: int
    train: dict[str, float]
    val: dict[str, float]
    best: bool
    programs_per_second: float
    stop: str | None = None


def reinforce(
    policy: Policy, config: ReinforceConfig, notes: dict[str, str] | None = None, clock: Callable[[], float] = time.monotonic
) -> Iterator[Progress]:
    """Fine-tune `policy` in place; `best.safetensors` and `state.pt` in `config.out`. The first record is of the policy as it was.

    Raises NotFinite, FileNotFoundError when there is nothing to resume, ValueError when the run to resume was of other settings.
    """
    yield from _ReinforceRun(policy, config, notes or {}, clock).progress()


class _ReinforceRun:
    def __init__(self, policy: Policy, config: ReinforceConfig, notes: dict[str, str], clock: Callable[[], float]) -> None:
        torch.set_num_threads(config.threads)
        self.config, self.notes, self.out, self.clock = config, notes, Path(config.out), clock
        for name, known in (("credit", CREDIT), ("precision", PRECISIONS)):
            if getattr(config, name) not in known:
                raise ValueError(f"unknown {name} {getattr(config, name)!r}; known are {', '.join(known)}")
        self.optimiser = Optimiser(policy, config.ema, config.clip, PRECISIONS[config.precision])
        self.rewards = RewardConfig(config.group, config.price, config.iou_samples)
        self.targets_of = replace(config.synthesis, prefixes=1, p_undo=0.0, p_replace=0.0, p_hidden=0.0)
        limits = {"max_primitives": config.synthesis.n_max, "undo_limit": config.undo_limit}
        self.decoding = DecodeConfig(cur_points=config.synthesis.cur_points, **limits)
        self.step, self.best = 0, -math.inf
        if config.resume:
            self._load()

    def progress(self) -> Iterator[Progress]:
        config, begun = self.config, self.clock()
        if self.step == 0:
            yield self._validate([], begun, None)
        since, facts = self.clock(), []
        while self.step < config.steps:
            facts.append(self._learn())
            self.step += 1
            late = bool(config.max_minutes) and self.clock() - begun > 60 * config.max_minutes
            if self.step % config.validate_every == 0 or self.step == config.steps or late:
                stop = "finished" if self.step == config.steps else "max_minutes" if late else None
                yield self._validate(facts, since, stop)
                if stop:
                    return
                since, facts = self.clock(), []

    def _learn(self) -> dict[str, float]:
        config, chance = self.config, chunk_generator(self.config.seed, STREAM, self.step, self.config.device)
        self.optimiser.policy.eval()
        targets = self._targets(config.targets, chance)
        made, facts = CREDIT[config.credit](self.optimiser.policy, targets, self.rewards, self.decoding, chance)
        anchor = synthesize(config.anchor_batch, config.synthesis, chance)
        chunks = torch.arange(made.states, device=config.device).split(max(1, config.rows // made.ways))
        old: list[Tensor | None] = [None] * len(chunks)
        for _ in range(config.reuse):
            parts = [partial(self._gain, made, rows, old, i) for i, rows in enumerate(chunks)]
            facts |= self.optimiser.step([*parts, partial(self._anchor_loss, anchor)], 1, config.lr, self.step)
        return {name: float(value) for name, value in facts.items()}

    def _targets(self, n: int, chance: torch.Generator) -> TrainingSamples:
        return synthesize(n, self.targets_of, chance)

    def _gain(self, made: Written, rows: Tensor, old: list[Tensor | None], chunk: int) -> dict[str, Tensor]:
        """The clipped objective of the moves from some states, as their share of the mean over all; fills `old` where there is none yet."""
        some = made.of(rows)
        log_p = self.optimiser.policy.log_prob(some.seen, some.move)
        before = old[chunk]
        if before is None:
            before = old[chunk] = log_p.detach()
        loss = clip_objective(log_p - before, some.advantage, self.config.clip_ratio)
        share = len(rows) / made.states
        moved = ((log_p - before).exp() - 1).abs() > self.config.clip_ratio
        return {"loss": loss.mean() * share, "clipped": moved.float().mean() * share}

    def _anchor_loss(self, anchor: TrainingSamples) -> dict[str, Tensor]:
        loss = self.optimiser.policy.losses(anchor)["loss"]
        return {"loss": self.config.anchor * loss, "supervised": loss}

    @cached_property
    def _validation(self) -> TrainingSamples:
        return self._targets(self.config.n_val, chunk_generator(0, TARGETS, 0, self.config.device))

    def _validate(self, facts: list[dict[str, float]], since: float, stop: str | None) -> Progress:
        config, average = self.config, self.optimiser.average
        seconds = self.clock() - since
        targets = self._validation
        chance = chunk_generator(0, TARGETS, 1, config.device)
        made = list(steps(average, targets.gt_points, self.decoding, chance))
        count = moves_of(made, config.n_val)
        iou = estimate_iou(made[-1].after, from_sequences(targets.gt_tokens, targets.gt_params), 2 * config.iou_samples, chance)
        reward = iou - config.price * count
        val = {"reward": reward.mean().item(), "iou": iou.mean().item(), "iou_median": iou.median().item(), "moves": count.mean().item()}
        best = val["reward"] > self.best
        if best:
            self.best = val["reward"]
            worth = {f"reinforced_{name}": f"{value:.4f}" for name, value in val.items()}
            save_net(self.out / "best.safetensors", average, {**self.notes, "reinforced_steps": str(self.step), **worth})
        self._save()
        pace = len(facts) * config.targets * (config.group if config.credit == "program" else 1) / max(seconds, 1e-9)
        return Progress(self.step, means(facts), val, best, pace, stop)

    def _save(self) -> None:
        state = {"step": self.step, "best": self.best, "config": settings_to_keep(self.config, FREE)}
        save_state(self.out / "state.pt", {**state, **self.optimiser.state_dict()})

    def _load(self) -> None:
        path = self.out / "state.pt"
        state = load_own_state(path, settings_to_keep(self.config, FREE))
        if state["step"] >= self.config.steps:
            raise ValueError(f"{path} is of a run that is over, {state['step']} steps long; give it more steps")
        self.step, self.best = state["step"], state["best"]
        self.optimiser.load_state_dict(state)


def clip_objective(log_ratio: Tensor, advantage: Tensor, clip_ratio: float) -> Tensor:
    """What to minimise, [m] (Schulman et al. 2017, "Proximal policy optimization", equation 7)."""
    ratio = log_ratio.exp()
    return -torch.minimum(ratio * advantage, ratio.clamp(1 - clip_ratio, 1 + clip_ratio) * advantage)
