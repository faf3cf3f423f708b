"""The learning rate: warm up, stay, fall. Until the fall begins nothing depends on when it will, so a run can be made longer.

Source: Hägele et al. 2024, "Scaling laws and compute-optimal training beyond fixed training durations" (constant rate, then a fall along
1 - sqrt over a fifth of the steps does as well as a cosine of the right length).
"""

from __future__ import annotations

import math
from typing import NamedTuple


class Plan(NamedTuple):
    """The rate falls from step `start` and is nothing at step `end`, where the run is over."""

    start: int
    end: int


def plan_steps(steps: int, cooldown: float) -> Plan:
    """The fall takes the last `cooldown` share of `steps`. Raises ValueError for a share outside 0 to 1."""
    if not 0 <= cooldown <= 1:
        raise ValueError(f"cooldown is a share of the steps, 0 to 1, got {cooldown}")
    return Plan(steps - round(cooldown * steps), steps)


def shorten_plan(plan: Plan, step: int, taken: int, seconds: float, limit: float, cooldown: float) -> Plan:
    """`plan`, or one whose fall begins now, at `step`, so that it ends when `limit` seconds are over at the pace of the `taken` steps."""
    if step >= plan.start or seconds < (1 - cooldown) * limit:
        return plan
    left = round(taken * max(0.0, limit - seconds) / max(seconds, 1e-9))
    return Plan(step, min(plan.end, step + max(1, left)))


def learning_rate(peak: float, warmup: int, plan: Plan, step: int) -> float:
    """The rate of `step`, counted from 0."""
    warm = min(1.0, (step + 1) / max(1, warmup))
    fallen = max(0, step + 1 - plan.start) / (plan.end - plan.start + 1)
    return peak * warm * (1 - math.sqrt(min(1.0, fallen)))
