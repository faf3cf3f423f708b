"""Pointing at a mark on a ruler. Source: Vinyals et al. 2015, "Pointer Networks"."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from imdim.learn.codes import OUTSIDE, PLACES, STEPS
from imdim.learn.profile import COUNTS

REACH = 3  # marks; how sharply a high end looks at its distance from the low one
CLUES = 3 * (COUNTS + 1) + 3


class Pointer(nn.Module):
    """Scores of all places for one end of a primitive. A mark within the box is judged by its slab's token and by the profile of the points
    that are within the ends chosen so far; marks outside have a learned key each."""

    def __init__(self, d_model: int, pointing: bool = True) -> None:
        """Without `pointing` every mark has a learned key and nothing else, as in a plain classifier over bins."""
        super().__init__()
        self.fixed = None if pointing else nn.Parameter(0.02 * torch.randn(STEPS + 1, d_model))
        self.from_slab = nn.Linear(d_model, d_model)
        self.from_clues = nn.Sequential(nn.Linear(CLUES, d_model), nn.GELU(), nn.Linear(d_model, d_model))
        self.outside = nn.Parameter(0.02 * torch.randn(PLACES - STEPS - 1, d_model))
        self.query, self.question = nn.Linear(d_model, d_model), nn.Linear(d_model, d_model)
        self.to_offset = nn.Sequential(nn.GELU(), nn.Linear(d_model, 1))

    def keys(self, slabs: Tensor, profile: Tensor | None, from_low: Tensor | None) -> Tensor:
        """Keys [b, PLACES, d] of slab tokens [b, STEPS + 1, d] and the profile [b, STEPS + 1, COUNTS + 1] along the same axis (needed for
        pointing alone).

        `from_low` [b] is the mark of the low end where the high one is sought, else None.
        """
        low, far = (o.expand(len(slabs), -1, -1) for o in self.outside.split(OUTSIDE + 1))
        if self.fixed is not None:
            return torch.cat([low, self.fixed.expand(len(slabs), -1, -1), far], 1)
        if profile is None:
            raise TypeError("pointing needs a profile")
        padded = nn.functional.pad(profile, (0, 0, 1, 1))
        around = torch.cat([padded[:, :-2], padded[:, 1:-1], padded[:, 2:]], -1)
        mark = torch.arange(STEPS + 1, device=slabs.device).expand(slabs.shape[:2])
        apart = torch.zeros_like(slabs[..., 0]) if from_low is None else mark - from_low[:, None]
        high = torch.full_like(apart, float(from_low is not None))
        clues = torch.cat([around, torch.stack([torch.tanh(apart / REACH), apart / STEPS, high], -1)], -1)
        within = self.from_slab(slabs) + self.from_clues(clues)
        return torch.cat([low, within, far], 1)

    def scores(self, hidden: Tensor, keys: Tensor) -> Tensor:
        """Logits [b, PLACES] for `hidden` [b, d]."""
        return (keys @ self.query(hidden)[..., None])[..., 0] / math.sqrt(hidden.shape[-1])

    def offset(self, hidden: Tensor, keys: Tensor, place: Tensor) -> Tensor:
        """How far the end is from the mark at `place` int64 [b], in steps, -0.5 to 0.5."""
        key = keys[torch.arange(len(place), device=place.device), place]
        return 0.5 * torch.tanh(self.to_offset(key + self.question(hidden))[..., 0])
