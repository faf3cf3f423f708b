"""A moment by which work is to end, as a value: asking whether it has passed changes nothing."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

BUSY = 1.5


@dataclass(frozen=True)
class Deadline:
    """Has passed once the clock `now` shows more than `at`, in seconds."""

    at: float
    # looked up when a deadline is made: scripts/bench/processor.py puts another clock there
    now: Callable[[], float] = field(default_factory=lambda: time.perf_counter, repr=False)

    @staticmethod
    def of_process(seconds: float) -> Deadline:
        """One so many seconds of the processor from now, so that other work on the machine changes little of what is done by then; or BUSY
        times as many on the wall, where there is much of it."""
        spent, began = time.process_time(), time.perf_counter()
        return Deadline(seconds, lambda: max(time.process_time() - spent, (time.perf_counter() - began) / BUSY))

    def has_passed(self) -> bool:
        return self.now() > self.at

    def left(self) -> float:
        """Seconds; 0 once it has passed."""
        return max(self.at - self.now(), 0.0)

    def ahead(self, seconds: float) -> Deadline:
        """One so many seconds from now, by the same clock."""
        return Deadline(self.now() + seconds, self.now)

    def earlier(self, other: Deadline) -> Deadline:
        """The earlier one of two by the same clock."""
        return other if other.at < self.at else self

    def later(self, other: Deadline) -> Deadline:
        """The later one of two by the same clock."""
        return other if other.at > self.at else self


NEVER = Deadline(math.inf)
