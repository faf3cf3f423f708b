"""Whether a program is the shortest that the candidates allow, by counterexamples (after Du et al. 2018, section 4.3).

The price of a program is its error, in units of what a primitive costs, plus its primitives. A relaxation bounds it from below: any
program must separate the cells inside from those outside by its primitives (`cover`). It is solved over a few pairs of cells; those that the
answer leaves mixed are added, until there is no answer left, which proves that no program of any form over the candidates is as cheap with
fewer primitives, or until an answer separates all cells. Its few candidates are then joined into a tree, if there is one; that is
a shorter program, and the search for a proof goes on below it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from imdim.program.tree import Program
from imdim.search.exact.columns import TooManyError, candidate_count, maximal_columns, unpack
from imdim.search.exact.cover import cover
from imdim.search.exact.formula import MOST_SETS, holds, read_once, to_program
from imdim.search.exact.pairs import Labels, counterexamples, groups, least_error
from imdim.search.families import Candidate, Families

EQUAL = 1e-3  # of a primitive's price


@dataclass(frozen=True)
class ProveConfig:
    """Limits of a proof; all but the last count work."""

    most_primitives: int = 16
    pairs_per_round: int = 60
    most_pairs: int = 480
    most_columns: int = 8_000
    solver_s: float = 6.0  # of one solution, which its count of nodes ends first


@dataclass(frozen=True)
class Proof:
    """`minimal`: no program over the candidates has fewer than `primitives` and is as cheap; otherwise `why` that is not known.

    `program` in the frame of the cells is shorter than what was asked about, None where nothing shorter was found.
    """

    minimal: bool
    primitives: int
    candidates: int
    why: str = ""
    program: Program | None = None

    def __str__(self) -> str:
        return "proved minimal over these candidates" if self.minimal else f"not proved: {self.why}"


def prove(
    families: Families,
    size_weight: float,
    primitives: int,
    error: float,
    out_of_time: Callable[[], bool],
    config: ProveConfig | None = None,
) -> Proof:
    """A proof about a program of so many `primitives` that differs from the target by the volume `error` over the cells."""
    config = config or ProveConfig()
    if primitives > config.most_primitives:
        return Proof(False, primitives, candidate_count(families), f"more than {config.most_primitives} primitives")
    return _Prover(families, size_weight, config, out_of_time).run(primitives, error)


@dataclass(frozen=True)
class _Best:
    """The shortest program so far: its primitives, price, and itself where it was found here."""

    primitives: int
    price: float
    program: Program | None = None


class _Prover:
    def __init__(self, families: Families, size_weight: float, config: ProveConfig, out_of_time: Callable[[], bool]) -> None:
        self.families, self.config, self.out_of_time = families, config, out_of_time
        cells = families.cells
        self.unit = size_weight * cells.volume
        self.mixed = float(np.minimum(cells.w_in, cells.w_out).sum()) / self.unit  # which no program over the candidates can avoid
        codes = np.concatenate([cells.slabs, cells.inside], axis=1).astype(float)
        self.labels = Labels(codes, cells.gain > 0, np.abs(cells.gain) / self.unit)
        self.inside, self.outside = np.zeros(0, np.int64), np.zeros(0, np.int64)

    def run(self, primitives: int, error: float) -> Proof:
        best = _Best(primitives, primitives + error / self.unit - self.mixed)
        chosen: list[Candidate] = []
        why = None
        while why is None:
            shorter = self._joined(chosen, best)
            if shorter is None and chosen and self._price(chosen) <= best.price - EQUAL:
                why = f"{len(chosen)} candidates tell all cells apart, but no tree of them was found"
                break
            best = shorter or best
            if best.primitives <= 1:
                why = ""
                break
            why, chosen = self._round(chosen, best)
        return Proof(not why, best.primitives, candidate_count(self.families), why or "", best.program)

    def _price(self, chosen: list[Candidate]) -> float:
        """Of the best function of the chosen candidates."""
        return len(chosen) + least_error(self.labels, self._masks(chosen))

    def _masks(self, chosen: list[Candidate]) -> np.ndarray:
        m = len(self.labels.weight)
        return np.stack([self.families.mask(c) for c in chosen]) if chosen else np.zeros((0, m), bool)

    def _round(self, chosen: list[Candidate], best: _Best) -> tuple[str | None, list[Candidate]]:
        """More counterexamples and the cheapest candidates that satisfy them; "" for none, which is the proof, or why it must end."""
        config, limit = self.config, best.price - EQUAL
        more = counterexamples(self.labels, self._masks(chosen), config.pairs_per_round)
        self.inside, self.outside = np.append(self.inside, more.inside), np.append(self.outside, more.outside)
        if self.out_of_time():
            return "time ran out", chosen
        if len(self.inside) > config.most_pairs:
            return f"more than {config.most_pairs} counterexamples", chosen
        try:
            columns = maximal_columns(self.families, self.inside, self.outside)
        except TooManyError as error:
            return f"too large, {error}", chosen
        if len(columns.candidates) > config.most_columns:
            return f"too large, more than {config.most_columns} candidates that matter", chosen
        separates = unpack(columns.bits, len(self.inside))
        found = cover(separates, self.inside, self.outside, self.labels.weight, best.primitives - 1, limit, config.solver_s)
        if found.chosen is None:
            return "" if found.known else "time of the solver ran out", chosen
        return None, [columns.candidates[i] for i in found.chosen]

    def _joined(self, chosen: list[Candidate], best: _Best) -> _Best | None:
        """A tree of the chosen candidates that is cheaper than the best; groups of cells too light to matter are left to chance."""
        if not chosen or len(chosen) > MOST_SETS:
            return None
        masks = self._masks(chosen)
        group = groups(masks, masks.shape[1])
        gain = np.bincount(group, np.where(self.labels.filled, 1, -1) * self.labels.weight)
        order = np.argsort(np.abs(gain), kind="stable")
        slack = best.price - EQUAL - len(chosen) - least_error(self.labels, masks)
        matters = order[np.cumsum(np.abs(gain)[order]) > slack]
        if slack < 0 or not len(matters):
            return None
        first = np.unique(group, return_index=True)[1]
        sets = [_bits(masks[k, first]) for k in range(len(chosen))]
        wanted = np.isin(np.arange(len(gain)), matters)
        formula = read_once(sets, _bits(wanted & (gain > 0)), _bits(wanted & (gain < 0)))
        program = to_program(formula, [self.families.primitive(c) for c in chosen]) if formula else None
        if formula is None or program is None:
            return None
        everything = (1 << len(gain)) - 1
        filled = np.array([holds(formula, sets, everything) >> g & 1 for g in range(len(gain))], bool)[group]
        used = len(_leaves(program))
        return _Best(used, used + float(self.labels.weight[filled != self.labels.filled].sum()), program)


def _leaves(program: Program) -> list:
    from imdim.program.tree import leaves

    return list(leaves(program))


def _bits(flags: np.ndarray) -> int:
    return int.from_bytes(np.packbits(flags, bitorder="little").tobytes(), "little")
