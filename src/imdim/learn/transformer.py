"""A causal transformer over the token history, conditioned on clouds and error. Source: the project's design, section 5.2."""

from __future__ import annotations

import torch
from torch import Tensor, nn


class TokenTransformer(nn.Module):
    """Position t sees the tokens before t, never token t itself: the design feeds and predicts the same tokens, and unshifted the head
    would read its own answer. A start symbol stands at position 0."""

    def __init__(self, vocab: int, d_model: int, layers: int, heads: int, max_seq_len: int) -> None:
        super().__init__()
        self.embed = nn.Embedding(vocab + 1, d_model)
        self.position = nn.Parameter(0.02 * torch.randn(max_seq_len, d_model))
        self.from_error = nn.Linear(3, d_model)
        layer = nn.TransformerEncoderLayer(d_model, heads, 2 * d_model, dropout=0.0, batch_first=True, norm_first=True)
        self.blocks = nn.TransformerEncoder(layer, layers, enable_nested_tensor=False)

    def forward(self, tokens: Tensor, gt_embed: Tensor, cur_embed: Tensor, err_embed: Tensor) -> Tensor:
        """Hidden states [b, t, d] of `tokens` int64 [b, t] (below 0: padding), embeddings [b, d] and error [b, 3].

        Raises ValueError for sequences longer than the positions learned.
        """
        steps = tokens.shape[1]
        if steps > len(self.position):
            raise ValueError(f"{steps} steps, the model has {len(self.position)}")
        start = tokens.new_full((len(tokens), 1), self.embed.num_embeddings - 1)
        history = torch.cat([start, tokens[:, :-1].clamp_min(0)], 1)
        x = self.embed(history) + self.position[:steps] + (gt_embed + cur_embed + self.from_error(err_embed))[:, None]
        ahead = torch.ones(steps, steps, dtype=torch.bool, device=x.device).triu(1)
        return self.blocks(x, mask=ahead)
