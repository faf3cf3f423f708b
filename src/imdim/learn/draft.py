"""What `policy_net` sees of a state, and a primitive as far as it is written."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from imdim.learn.attention import Read
from imdim.learn.codes import ENDS, NUMBERS, Choices
from imdim.learn.profile import Clouds


@dataclass(frozen=True)
class StateView:
    """What a state shows: the ruler `low`, `edges` [b, 3], the `clouds`, what each decoder layer `reads` of its encoded
    tokens, which of them are `there` [b, 1, 1, s], the encoded `slabs` [b, STEPS + 1, d] of each axis, and the encoded primitives
    written so far, `past` [b, t, d]."""

    low: Tensor
    edges: Tensor
    clouds: Clouds
    reads: tuple[Read, ...]
    there: Tensor
    slabs: tuple[Tensor, ...]
    past: Tensor

    def only(self, rows: Tensor) -> StateView:
        """Some rows, without the clouds."""
        reads = tuple((k[rows], v[rows]) for k, v in self.reads)
        slabs = tuple(s[rows] for s in self.slabs)
        return StateView(self.low[rows], self.edges[rows], self.clouds, reads, self.there[rows], slabs, self.past[rows])

    def repeat(self, ways: int) -> StateView:
        """Each row `ways` times; the clouds, which are large, stay shared."""
        rows = torch.arange(len(self.low), device=self.low.device)
        return self if ways == 1 else self.only(rows.repeat_interleave(ways))


@dataclass
class Draft:
    """A primitive as far as it is written: `tokens`, `at` whose place it takes (APPEND: none's), `sign` [b] and `choices`; `profiles`
    [b, marks, kinds] are of the axes begun."""

    tokens: Tensor
    at: Tensor
    sign: Tensor
    choices: Choices
    profiles: list[Tensor]

    def only(self, rows: Tensor) -> Draft:
        """A copy of some rows."""
        c = self.choices
        choices = Choices(c.turn[rows], c.form[rows], c.places[rows], c.bins[rows], c.offsets[rows])
        return Draft(self.tokens[rows], self.at[rows], self.sign[rows], choices, [p[rows] for p in self.profiles])

    def draws(self) -> Tensor:
        """Place, sign, turn, form, places, bins and offsets [b, 4 + 2 (ENDS + NUMBERS)], from which `of` makes the draft again."""
        c = self.choices
        return torch.cat([self.at[:, None], self.sign[:, None], c.turn[:, None], c.form[:, None], c.places, c.bins, c.offsets], 1)

    @staticmethod
    def of(tokens: Tensor, draws: Tensor) -> Draft:
        """The draft of `tokens` [b] and their `draws`."""
        heads, places, bins, offsets = draws.split([4, ENDS, NUMBERS, ENDS + NUMBERS], 1)
        at, sign, turn, form = heads.long().unbind(1)
        return Draft(tokens, at, sign, Choices(turn, form, places.long(), bins.long(), offsets), [])
