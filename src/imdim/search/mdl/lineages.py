"""Several searches for one program that share the time: each has its next round when it promises the most."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from imdim.deadline import NEVER, Deadline
from imdim.numbers.em import FittedProgram
from imdim.program.tree import Program

MOST_LINEAGES = 16  # searches that begin: more than there ever are
ROUNDS_EACH = 2  # that there is time for in each of several searches: fewer begin where there is not
AHEAD = 2.0  # rounds like its last one that a search is given credit for
HARDLY = 0.05  # nats per point by which the next best of several searches is longer, and goes on too


@dataclass
class Lineage:
    """One of several searches: its `best` program so far, how long that takes, and the `rounds` that shorten it, with what is `promised`
    of the next ones by what the last one `won`."""

    best: FittedProgram
    length: float
    rounds: Iterator[tuple[FittedProgram, float]]
    promised: float = -math.inf
    won: float = math.inf
    most_won: float = 0.0

    def time_round(self, clock: Deadline) -> float:
        """Have two rounds, and tell how many seconds of a deadline's clock the last one took: what all share is worked out in the first."""
        took = 0.0
        for _ in range(2):
            begun = clock.now()
            going = self.advance()
            took = clock.now() - begun
            if not going:
                break
        return took

    def advance(self) -> bool:
        """Have another round; whether that found anything."""
        found = next(self.rounds, None)
        if found is None:
            self.promised = self.length
            return False
        self.won = self.length - found[1]
        self.most_won = max(self.most_won, self.won)
        (self.best, self.length), self.promised = found, found[1] - AHEAD * self.won
        return True


def run_in_turn(
    lineages: list[Lineage], deadline: Deadline = NEVER, slow: float = 0.0, end_with: Callable[[Program], Deadline] | None = None
) -> list[Lineage]:
    """The lineages as far as they come, the shortest first. The next round is that of the one which promises the most by what it won in
    its last, one that had none by the most that any has won in one, until none promises more than one has, or wins more in a round than
    is `slow`. From each new shortest program on the deadline is the one that they `end_with` if it is to be delivered."""
    going, known = list(lineages), None
    while going and not deadline.has_passed():
        largest = max(lineage.most_won for lineage in lineages)
        for fresh in (lineage for lineage in going if largest and not lineage.most_won):
            fresh.promised = fresh.length - AHEAD * largest
        most = min(going, key=lambda lineage: lineage.promised)
        if most.promised > min(lineage.length for lineage in lineages):
            break
        if not most.advance() or most.won < slow:
            going.remove(most)
        shortest = min(lineages, key=lambda lineage: lineage.length).best
        if end_with is not None and shortest is not known:
            known, deadline = shortest, end_with(shortest.program)
    return sorted(lineages, key=lambda lineage: lineage.length)


def choose_heirs(found: Sequence[Lineage], cut: bool) -> list[Lineage]:
    """Those of several searches, the shortest first, that go on: the shortest; the next one where it is hardly longer, since what the
    others found may help it more; and the one that promised most where time has `cut` them."""
    out = [found[0], *(h for h in found[1:2] if h.length < found[0].length + HARDLY)]
    most = min(found, key=lambda h: h.promised)
    return [*out, *([most] if cut and all(most is not h for h in out) else [])]


def count_with_time(left: float, round_s: float) -> int:
    """How many searches have time for ROUNDS_EACH that take so long; two in any case, since what grows from one part may come to little."""
    return max(2, int(min(left / (ROUNDS_EACH * max(round_s, 1e-9)), MOST_LINEAGES)))
