"""What each stage of a run may take of its budget, and the deadlines that follow."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from imdim.deadline import Deadline

Stage = Literal[
    "detect",
    "label",
    "search",
    "noisy_search",
    "starts",
    "seeds",
    "resume",
    "prove",
    "choose",
    "propose",
    "likely",
    "measure",
    "fit",
    "relate",
    "front",
]


class Share(NamedTuple):
    """Of a budget: a stage ends `by` that share of the whole, and takes `of` the time that is left until then at most."""

    by: float
    of: float = 1.0


SHARES: Mapping[Stage, Share] = {
    "detect": Share(0.3),  # a cloud's surfaces are found
    "label": Share(0.37),  # a cloud's samples know their side
    "search": Share(0.5),  # the solver and delivery need the rest
    "noisy_search": Share(0.5, 0.08),  # what the cells of a noisy cloud say is not worth more
    "starts": Share(0.5, 0.4),  # the search's best starts get the rest
    "seeds": Share(0.5, 0.4),  # evolution needs the rest
    "resume": Share(0.7),  # a person's program is evolved
    "prove": Share(0.6),  # a search that took all of its own leaves some for the last proof
    "choose": Share(0.84),  # a noisy cloud's program is chosen; earlier where it is slow to deliver
    "propose": Share(0.85, 0.5),  # the policy's programs, until numbers must be fitted
    "likely": Share(0.87),  # the numbers of a noisy cloud's program are fitted
    "measure": Share(0.89),  # it is measured how well they are known
    "fit": Share(0.82),  # programs are short and their numbers fitted
    "relate": Share(0.9),  # the search for relations ends
    "front": Share(0.93),  # later no other choices are looked for
}


@dataclass(frozen=True)
class Budget:
    """`whole_s` seconds by the clock `now`, from the moment that the budget is made."""

    whole_s: float
    # looked up when a budget is made: scripts/bench/processor.py puts another clock there
    now: Callable[[], float] = field(default_factory=lambda: time.perf_counter, repr=False)
    start: float = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", self.now())

    def seconds(self) -> float:
        """Since the start."""
        return self.now() - self.start

    @property
    def end(self) -> Deadline:
        """When all of it is spent."""
        return Deadline(self.start + self.whole_s, self.now)

    def end_of(self, stage: Stage) -> Deadline:
        """When the stage ends at the latest."""
        return Deadline(self.start + SHARES[stage].by * self.whole_s, self.now)

    def part_of(self, stage: Stage, share: float) -> Deadline:
        """When a body's `share` of the time that the stage may take from now on is spent."""
        end = self.end_of(stage)
        return Deadline(end.at - (1 - share * SHARES[stage].of) * end.left(), self.now)

    def within(self, seconds: float) -> Deadline:
        """So many seconds from now."""
        return Deadline(self.now() + seconds, self.now)
