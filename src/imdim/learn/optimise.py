"""One training step: gradients, their clipping, AdamW, and the average of the weights."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Generic, TypeVar

import torch
from torch import Tensor, nn

from imdim.learn.distributed import Processes

N = TypeVar("N", bound=nn.Module)


class NotFinite(FloatingPointError):
    """The loss or a gradient is not finite."""


def means(records: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Of each number of the `records`, which have the same ones; nothing of no records."""
    return {name: float(sum(r[name] for r in records)) / len(records) for name in records[0]} if records else {}


class Optimiser(Generic[N]):
    """`policy` is what is trained, `average` the exponential moving average of its weights (Polyak and Juditsky 1992)."""

    def __init__(self, policy: N, ema: float, clip: float, dtype: torch.dtype = torch.float32, processes: Processes | None = None) -> None:
        self.policy, self.ema, self.clip, self.dtype = policy, ema, clip, dtype
        self.processes = processes or Processes()
        self.average = copy.deepcopy(policy).eval().requires_grad_(False)
        self.weights = list(policy.parameters())
        self.adam = torch.optim.AdamW(self.weights, weight_decay=0.01)

    def step(self, parts: list[Callable[[], dict[str, Tensor]]], shards: int, lr: float, step: int) -> dict[str, Tensor]:
        """Learn at rate `lr` from the mean of the losses that `shards` parts of a batch give, of which `parts` are this process's.

        `step` counts from 0. Returns the means of all losses over all parts. Raises NotFinite before any weight has changed.
        """
        self.policy.train()
        self.adam.zero_grad()
        sums: dict[str, Tensor] = {}
        for part in parts:
            with torch.autocast(self.weights[0].device.type, self.dtype, enabled=self.dtype != torch.float32):
                losses = part()
            (losses["loss"] / shards).backward()
            for name, value in losses.items():
                sums[name] = sums.get(name, 0.0) + value.detach().float() / shards
        norm = self._gradients(sums)
        if not torch.isfinite(sums["loss"] + norm):
            raise NotFinite(f"loss {sums['loss'].item()}, gradient norm {norm.item()}")
        for group in self.adam.param_groups:
            group["lr"] = lr
        self.adam.step()
        self._follow(step)
        return {**sums, "gradient_norm": norm}

    def _gradients(self, sums: dict[str, Tensor]) -> Tensor:
        """Gradients and losses of all processes together; the norm of the former before it is clipped."""
        for weight in self.weights:
            if weight.grad is None:
                weight.grad = torch.zeros_like(weight)
        self.processes.total([weight.grad for weight in self.weights if weight.grad is not None] + list(sums.values()))
        return torch.nn.utils.clip_grad_norm_(self.weights, self.clip)

    @torch.no_grad()
    def _follow(self, step: int) -> None:
        # early weights are not worth remembering: the first steps average over few
        share = 1 - min(self.ema, (1 + step) / (10 + step))
        weights = self.policy.state_dict()
        for name, mean in self.average.state_dict().items():
            if mean.is_floating_point():
                mean.lerp_(weights[name], share)
            else:
                mean.copy_(weights[name])

    def state_dict(self) -> dict[str, Any]:
        return {"policy": self.policy.state_dict(), "average": self.average.state_dict(), "optimizer": self.adam.state_dict()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Raises ValueError when the weights are of another design."""
        try:
            self.policy.load_state_dict(state["policy"])
            self.average.load_state_dict(state["average"])
            self.adam.load_state_dict(state["optimizer"])
        except RuntimeError as error:
            raise ValueError(f"the weights of the run to resume do not fit this program's design {type(self.policy).__name__}") from error
