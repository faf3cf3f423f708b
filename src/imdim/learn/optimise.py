"""One training step: gradients, their clipping, AdamW, and the average of the weights."""

from __future__ import annotations

import copy
from typing import Any

import torch
from torch import Tensor

from imdim.data.synthesize import Samples
from imdim.learn.policy import Policy


class NotFinite(FloatingPointError):
    """The loss or a gradient is not finite."""


class Optimiser:
    """`policy` is what is trained, `average` the exponential moving average of its weights (Polyak and Juditsky 1992)."""

    def __init__(self, policy: Policy, ema: float, clip: float) -> None:
        self.policy, self.ema, self.clip = policy, ema, clip
        self.average = copy.deepcopy(policy).eval().requires_grad_(False)
        self.adam = torch.optim.AdamW(policy.parameters(), weight_decay=0.01)

    def step(self, batch: Samples, lr: float, step: int) -> dict[str, Tensor]:
        """Learn from one batch at rate `lr`; `step` counts from 0. Raises NotFinite before any weight has changed."""
        self.policy.train()
        for group in self.adam.param_groups:
            group["lr"] = lr
        losses = self.policy.losses(batch)
        self.adam.zero_grad()
        losses["loss"].backward()
        norm = torch.nn.utils.clip_grad_norm_(self.policy.parameters(), self.clip)
        if not torch.isfinite(losses["loss"].detach() + norm):
            raise NotFinite(f"loss {losses['loss'].item()}, gradient norm {norm.item()}")
        self.adam.step()
        self._follow(step)
        return {**{name: value.detach() for name, value in losses.items()}, "gradient_norm": norm}

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
        self.policy.load_state_dict(state["policy"])
        self.average.load_state_dict(state["average"])
        self.adam.load_state_dict(state["optimizer"])
