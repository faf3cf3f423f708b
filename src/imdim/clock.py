"""How long a run has been going, and whether the search's share of its budget is spent."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

DETECT_BY, LABEL_BY = 0.3, 0.37  # of the budget: by then a cloud's surfaces are found, and its samples know their side
SEARCH_SHARE = 0.5  # of the budget, by which the search ends; the solver and delivery need the rest
CHOOSE_BY, FIT_BY = 0.7, 0.82  # a noisy cloud's program is chosen; programs are short and their numbers fitted
RELATE_BY = 0.88  # the search for relations ends


@dataclass
class Clock:
    """Seconds since the start. `cut`: whether the search's share of the budget is spent; `late`: whether the clock cut other work short;
    `ending` is how an evolution ended."""

    budget_s: float
    now: Callable[[], float] = time.perf_counter
    start: float = field(init=False)
    cut: bool = False
    late: bool = False
    ending: str = "finished"

    def __post_init__(self) -> None:
        self.start = self.now()

    def seconds(self) -> float:
        return self.now() - self.start

    def out_of_time(self) -> bool:
        """Whether the search must end; that it was cut stays known."""
        self.cut = self.cut or self.seconds() > SEARCH_SHARE * self.budget_s
        return self.cut

    def near_end(self, share: float) -> Callable[[], bool]:
        """Whether a share of the whole budget is spent; that it was asked too late stays known."""
        return self._noting(lambda: self.seconds() > share * self.budget_s)

    def ending_at(self, share: float, by: float = SEARCH_SHARE) -> Callable[[], bool]:
        """`part`; that it was asked too late stays known."""
        return self._noting(self.part(share, by))

    def left(self, by: float) -> float:
        """Seconds until a share `by` of the budget is spent; 0 once it is."""
        return max(by * self.budget_s - self.seconds(), 0.0)

    def _noting(self, spent: Callable[[], bool]) -> Callable[[], bool]:
        def asked() -> bool:
            over = spent()
            self.late = self.late or over
            return over

        return asked

    def part(self, share: float, by: float = SEARCH_SHARE) -> Callable[[], bool]:
        """Whether a share of the time left until `by` (a share of the budget, by default the search's) is spent."""
        end = self.seconds() + share * self.left(by)
        return lambda: self.seconds() > end
