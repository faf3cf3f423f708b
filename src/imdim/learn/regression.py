"""Numbers by regression: the mean squared error of the first design in place of distributions over marks and bins."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from imdim.learn.codes import ENDS, NUMBERS, Choices, to_bins, to_places

SCALE = 5.0  # at the start the errors weigh as much as the cross-entropies in whose place they stand


class Regression(nn.Module):
    """One value for each end (in shares) and number (0 to 1) of a primitive, from the hidden state of its slot."""

    def __init__(self, d_model: int) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.randn(ENDS + NUMBERS, d_model) * 0.01)
        self.bias = nn.Parameter(torch.full((ENDS + NUMBERS,), 0.5))

    def place(self, hidden: Tensor, end: int) -> tuple[Tensor, Tensor]:
        """Place int64 and offset [b] of an end, from `hidden` [b, d]."""
        value = self._value(hidden, end)
        return to_places(value, torch.zeros_like(value, dtype=torch.bool))

    def bin(self, hidden: Tensor, number: int) -> tuple[Tensor, Tensor]:
        """Bin int64 and offset [b] of a number."""
        return to_bins(self._value(hidden, ENDS + number))

    def errors(self, hidden: Tensor, choices: Choices, used: Tensor) -> Tensor:
        """Squared errors [b] of all ends and of the `used` numbers, from `hidden` [b, ENDS + NUMBERS, d]."""
        error = ((hidden * self.weight).sum(-1).float() + self.bias - choices.values()).square()
        return SCALE * (error[:, :ENDS].sum(1) + (error[:, ENDS:] * used).sum(1))

    def _value(self, hidden: Tensor, slot: int) -> Tensor:
        return hidden @ self.weight[slot] + self.bias[slot]
