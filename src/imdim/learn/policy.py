"""What every policy offers: losses on a batch of samples, and a move from a state that it sees as a cloud."""

from __future__ import annotations

from abc import abstractmethod
from typing import NamedTuple

import torch
from torch import Tensor, nn

from imdim.data.solids import ADDING, PAD, VOCABULARY, Solids
from imdim.data.synthesize import TrainingSamples
from imdim.program.state import END, UNDO_LAST

VOCAB = len(VOCABULARY)


class Move(NamedTuple):
    """One step for each row: `tokens` int64 [b], the primitive `part` [b, 1] (meaningless unless the token adds it), log p [b], and the
    primitive `at` int64 [b] of the program whose place it takes (APPEND: none's).

    `draws` [b, k] is what a policy drew to get there, for its own `log_prob`, where the primitive does not tell.
    """

    tokens: Tensor
    part: Solids
    log_p: Tensor
    at: Tensor
    draws: Tensor | None = None

    def of(self, rows: Tensor) -> Move:
        """The moves of some rows."""
        draws = None if self.draws is None else self.draws[rows]
        return Move(self.tokens[rows], self.part[rows], self.log_p[rows], self.at[rows], draws)


class Sight(NamedTuple):
    """States as a policy sees them: targets `gt_points` [b, n, 3], the cloud `current` [b, m, 3] (zeros: empty) of the `written` programs,
    and whether each `may_undo` [b]. Else UNDO_LAST is barred, and taking another one's place: a policy that adds and takes back without end
    would not halt.

    Where the program has more than primitives, `outside` [b, n] is how far the target's points are outside of it (negative: within), and
    `written` is empty. Who `must_add` asks for primitives alone.
    """

    gt_points: Tensor
    current: Tensor
    written: Solids
    may_undo: Tensor
    outside: Tensor | None = None
    must_add: bool = False

    def of(self, rows: Tensor) -> Sight:
        """Some rows."""
        outside = None if self.outside is None else self.outside[rows]
        return Sight(self.gt_points[rows], self.current[rows], self.written[rows], self.may_undo[rows], outside, self.must_add)


class Policy(nn.Module):
    """`max_seq_len` is the longest sequence it writes, END included."""

    max_seq_len: int

    @abstractmethod
    def losses(self, batch: TrainingSamples) -> dict[str, Tensor]:
        """Scalars; `loss` is what training minimises, `token_accuracy` is 0 to 1."""

    @abstractmethod
    def propose(self, seen: Sight, generator: torch.Generator | None = None, ways: int = 1) -> Move:
        """`ways` legal moves for each row, side by side.

        The most likely one without `generator`, else samples. The first primitive is positive.
        """

    @abstractmethod
    def log_prob(self, seen: Sight, move: Move) -> Tensor:
        """Log p [b * ways], with gradients, with which `propose` draws the token, the sign and the numbers of `move` in this state.

        Numbers that the policy does not draw do not count. What `propose` bars has no probability.
        """


def legal(lengths: Tensor, most: int, may_undo: Tensor | None = None, vocab: int = VOCAB) -> Tensor:
    """Mask [b, vocab]: no UNDO_LAST or END in an empty state, no primitive beyond `most`."""
    mask = torch.ones(len(lengths), vocab, dtype=torch.bool, device=lengths.device)
    mask[:, int(END)] = lengths > 0
    mask[:, int(UNDO_LAST)] = lengths > 0 if may_undo is None else (lengths > 0) & may_undo
    mask[:, [token for token in ADDING if token < vocab]] = (lengths < most)[:, None]
    return mask


def choose_tokens(
    logits: Tensor,
    lengths: Tensor,
    most: int,
    generator: torch.Generator | None,
    may_undo: Tensor | None = None,
    must_add: bool = False,
) -> tuple[Tensor, Tensor]:
    """Tokens [b] and their log p [b] among the legal ones, or among those that add a primitive."""
    mask = legal(lengths, most, may_undo, logits.shape[1])
    if must_add:
        mask[:, [token for token in range(logits.shape[1]) if token not in ADDING]] = False
    return draw_index(logits.masked_fill(~mask, -torch.inf), generator)


def token_log_p(logits: Tensor, tokens: Tensor, lengths: Tensor, most: int, may_undo: Tensor | None = None) -> Tensor:
    """Log p [b] of `tokens` [b] among the legal ones."""
    mask = legal(lengths, most, may_undo, logits.shape[1])
    return logits.masked_fill(~mask, -torch.inf).log_softmax(-1).gather(1, tokens[:, None])[:, 0]


def draw_index(logits: Tensor, generator: torch.Generator | None) -> tuple[Tensor, Tensor]:
    """The likeliest index [b] of `logits` [b, k], or one drawn with `generator`, and its log p."""
    log_p = logits.log_softmax(-1)
    index = log_p.argmax(-1) if generator is None else torch.multinomial(log_p.exp(), 1, generator=generator)[:, 0]
    return index, log_p.gather(1, index[:, None])[:, 0]


def mask_supervised(tokens: Tensor) -> Tensor:
    """Steps [b, t] to learn: not padding, and not a primitive that the next step takes back."""
    following = torch.cat([tokens[:, 1:], tokens.new_full((len(tokens), 1), PAD)], 1)
    return (tokens != PAD) & (following != int(UNDO_LAST))
