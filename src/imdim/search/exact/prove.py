"""Whether a program is the shortest that the candidates allow, by counterexamples (after Du et al. 2018, section 4.3).

The price of a program is its error, in units of what a primitive costs, plus its primitives. A relaxation bounds it from below: any
program must separate the cells inside from those outside by its primitives (`cover`). It is solved over a few pairs of cells, and those
that the answer leaves mixed are added. No answer left proves that no program of any form over the candidates is as cheap with fewer
primitives. Candidates that separate all cells are joined into a tree, if there is one: a shorter program, below which the proof goes on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.program.cost import count
from imdim.program.tree import Program
from imdim.search.bits import unpack_words
from imdim.search.candidate_families import Candidate, Families
from imdim.search.exact.columns import TooManyError, candidate_count, maximal_columns
from imdim.search.exact.cover import CoverLimits, cover
from imdim.search.exact.read_once import join_candidates
from imdim.search.exact.separation_pairs import CellLabels, counterexamples, least_error

EQUAL = 1e-3  # of a primitive's price
OFF = 1.0  # primitives' prices, by which an answer may be dearer over all cells than over the pairs for it to be joined
TOO_HARD, OUT_OF_TIME = "time of the solver ran out", "time ran out"
FINE = 0.25  # of a primitive's price; what less error is worth, once no fewer primitives can do


@dataclass(frozen=True)
class ProveConfig:
    """Limits of a proof; all but the last count work."""

    most_primitives: int = 48
    pairs_per_round: int = 20  # more at a time crowd out those that earlier answers have failed at
    most_pairs: int = 180  # those that bear no bound then go
    refinements: int = 6  # rounds for less error with no fewer primitives
    most_columns: int = 20_000
    most_barred: int = 12  # sets of candidates without a tree, over all proofs that they stand in the way of
    solver_s: float = 3.0  # of one solution at most, which its count of nodes ends first


@dataclass(frozen=True)
class Proof:
    """`minimal`: no program over the candidates has fewer than `primitives` and is as cheap; otherwise `why` that is not known.

    `program` in the frame of the cells is shorter than what was asked about, None where nothing shorter was found. `extra` is its error
    beyond what no program over the candidates can avoid, in units of a primitive's price.
    """

    minimal: bool
    primitives: int
    candidates: int
    why: str = ""
    program: Program | None = None
    extra: float = 0.0

    def __str__(self) -> str:
        return "proved minimal over these candidates" if self.minimal else f"not proved: {self.why}"


@dataclass(frozen=True)
class _Best:
    """The shortest program so far: its primitives, price, and itself where it was found here."""

    primitives: int
    price: float
    program: Program | None = None


@dataclass(frozen=True)
class _Treeless:
    """Candidates that tell all cells apart at a `price`, of which no tree cheaper than `below` was found."""

    candidates: list[Candidate]
    price: float
    below: float


class Prover:
    """Proofs about programs of one body; counterexamples found for one program, and candidates without a tree, serve the next."""

    def __init__(self, families: Families, size_weight: float, config: ProveConfig | None = None) -> None:
        self.families, self.config = families, config or ProveConfig()
        cells = families.cells
        self.unit = size_weight * cells.volume
        self.mixed = float(np.minimum(cells.w_in, cells.w_out).sum()) / self.unit  # which no program over the candidates can avoid
        codes = np.concatenate([cells.slabs, cells.inside], axis=1).astype(float)
        self.candidates = candidate_count(families)
        self.labels = CellLabels(codes, cells.gain > 0, np.abs(cells.gain) / self.unit)
        self.treeless: list[_Treeless] = []
        self._over_pairs = 0.0  # price of the latest answer
        self.proved: list[_Best] = []
        self.found: _Best | None = None  # the latest program that came out of a proof
        self.too_large = ""  # why there are more candidates than can be listed; pairs only grow, so that no later proof can do with fewer
        self.inside, self.outside = np.zeros(0, np.int64), np.zeros(0, np.int64)

    def prove(self, primitives: int, error: float, deadline: Deadline = NEVER) -> Proof:
        """A proof about a program of so many `primitives` that differs from the target by the volume `error` over the cells.

        It ends at the `deadline` (by default never).
        """
        if primitives > self.config.most_primitives:
            return Proof(False, primitives, self.candidates, f"more than {self.config.most_primitives} primitives")
        if self.too_large:
            return Proof(False, primitives, self.candidates, self.too_large)
        best = _Best(primitives, primitives + error / self.unit - self.mixed)
        if self.found is not None and self.found.primitives <= primitives and self.found.price <= best.price - EQUAL:
            best = self.found
        best, why = self._shortest(best, deadline)
        if not why:
            best = self._refine(best, deadline)
        self.found = best if best.program is not None else self.found
        return Proof(not why, best.primitives, self.candidates, why, best.program, best.price - best.primitives)

    def _shortest(self, best: _Best, deadline: Deadline) -> tuple[_Best, str]:
        """Shorter programs until none is left, or why that is not known."""
        why, chosen = None, list[Candidate]()
        while why is None and not self._is_proved(best):
            why, chosen = self._round(chosen, best, deadline)
            if why is None:
                best = self._join(chosen, best) or best
        if not why:
            self.proved.append(best)
        return best, why or ""

    def _is_proved(self, best: _Best) -> bool:
        """Whether an earlier proof covers this one: of more primitives, at no lower price."""
        return best.primitives <= 1 or any(best.primitives <= p.primitives and best.price <= p.price + EQUAL for p in self.proved)

    def _refine(self, best: _Best, deadline: Deadline) -> _Best:
        """No fewer primitives but less error, where a few more counterexamples lead to it; they are forgotten then."""
        before, chosen = (self.inside, self.outside), list[Candidate]()
        for _ in range(self.config.refinements):
            if best.price - best.primitives < FINE:
                break
            goal = _Best(best.primitives + 1, best.price - FINE + EQUAL)
            why, chosen = self._round(chosen, goal, deadline)
            if why is not None:
                break
            best = self._join(chosen, goal) or best
        self.inside, self.outside = before
        return best

    def _masks(self, chosen: list[Candidate]) -> np.ndarray:
        return np.array([self.families.mask(c) for c in chosen], bool).reshape(len(chosen), len(self.labels.weight))

    def _round(self, chosen: list[Candidate], best: _Best, deadline: Deadline) -> tuple[str | None, list[Candidate]]:
        """More counterexamples and the cheapest candidates that satisfy them; "" for none, which is the proof, or why it must end."""
        config, barred = self.config, self._list_barred(best)
        if len(barred) > config.most_barred:
            return _describe_unjoined(barred), chosen
        if chosen or not len(self.inside):
            more = counterexamples(self.labels, self._masks(chosen), config.pairs_per_round)
            self.inside, self.outside = np.append(self.inside, more.inside), np.append(self.outside, more.outside)
        if not len(self.inside):
            return "", chosen  # one label for all cells: nothing to tell apart
        if deadline.has_passed():
            return OUT_OF_TIME, chosen
        try:
            columns = maximal_columns(self.families, self.inside, self.outside)
            if len(columns.candidates) > config.most_columns:
                raise TooManyError(f"more than {config.most_columns} candidates that matter")
        except TooManyError as error:
            self.too_large = f"too large, {error}"
            return self.too_large, chosen
        separates = unpack_words(columns.bits, len(self.inside))
        place = {candidate: i for i, candidate in enumerate(columns.candidates)}
        # counterexamples that were added since may have other columns stand for those of a set without a tree
        places = [[place[c] for c in some] for some in barred if all(c in place for c in some)]
        limits = CoverLimits(best.primitives - 1, best.price - EQUAL, config.solver_s, places, deadline)
        found = cover(separates, self.inside, self.outside, self.labels.weight, limits)
        if len(self.inside) > config.most_pairs:
            kept = found.binding | (np.arange(len(self.inside)) >= len(self.inside) - config.pairs_per_round)
            self.inside, self.outside = self.inside[kept], self.outside[kept]
        self._over_pairs = found.price
        if found.chosen is not None:
            return None, [columns.candidates[i] for i in found.chosen]
        if not found.known:
            return OUT_OF_TIME if deadline.has_passed() else TOO_HARD, chosen
        return _describe_unjoined(barred) if barred else "", chosen

    def _list_barred(self, best: _Best) -> list[list[Candidate]]:
        """Sets without a tree that would be answers."""
        return [
            t.candidates
            for t in self.treeless
            if len(t.candidates) < best.primitives and t.price <= best.price - EQUAL and best.price <= t.below + EQUAL
        ]

    def _join(self, chosen: list[Candidate], best: _Best) -> _Best | None:
        """A tree of the chosen candidates that is cheaper than the best; groups of cells too light to matter are left to chance.

        Candidates that could be as cheap, without such a tree, are noted.
        """
        price = len(chosen) + least_error(self.labels, self._masks(chosen))  # of the best function of them
        if price > self._over_pairs + OFF:
            return None  # what the pairs miss is worth a primitive: more of them first, or a crude tree would end the search for a good one
        slack = best.price - EQUAL - price
        allowed = sorted({s for s in (0.0, 0.3, 1.0, slack) if 0 <= s <= slack}) if chosen else []
        found = next((f for s in allowed if (f := join_candidates(chosen, self.labels, self.families, s))), None)
        if found is None:
            if slack >= 0:
                self.treeless.append(_Treeless(chosen, price, best.price))
            return None
        program, filled = found
        used = count(program).primitives
        return _Best(used, used + float(self.labels.weight[filled != self.labels.filled].sum()), program)


def _describe_unjoined(barred: list[list[Candidate]]) -> str:
    return f"{len(barred[0])} candidates could tell all cells apart, but no tree of them was found"
