"""The better design: a policy that writes, executes and looks.

Against `seed`: local point tokens of target and current cloud that know how far the other cloud is, the executed primitives themselves as
history, and each primitive as a short sequence of binned numbers, every one conditioned on those before, so that the distribution over
primitives has as many modes as the shape has next steps. The state is the executed one: one step is one sample, and undone steps leave
no trace. Both learn from the data's canonical order and parameters.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from imdim.data.solids import CYLINDER, PAD, Solids, from_sequences
from imdim.data.synthesize import Samples
from imdim.learn.codes import BINS, SLOTS, decode, encode, from_bins, to_bins, used
from imdim.learn.patches import PatchTokens, gaps
from imdim.learn.policy import VOCAB, Move, Policy, chosen_tokens, drawn


@dataclass
class BaseConfig:
    """`gt_points` and `cur_points` are how many points of each cloud are used; patches are the tokens made of them."""

    d_model: int = 128
    encoder_layers: int = 2
    decoder_layers: int = 2
    heads: int = 4
    gt_points: int = 768
    cur_points: int = 384
    gt_patches: int = 48
    cur_patches: int = 24
    neighbours: int = 20
    offset_weight: float = 2.0


class BasePolicy(Policy):
    def __init__(self, config: BaseConfig, max_seq_len: int) -> None:
        super().__init__()
        self.config, self.max_seq_len = config, max_seq_len
        d = config.d_model
        self.gt_tokens = PatchTokens(d, config.gt_patches, config.neighbours)
        self.cur_tokens = PatchTokens(d, config.cur_patches, config.neighbours)
        self.history = nn.Linear(SLOTS + VOCAB + 1, d)
        self.roles = nn.Parameter(0.02 * torch.randn(3, d))
        self.order = nn.Parameter(0.02 * torch.randn(max_seq_len, d))
        shape = {"dropout": 0.0, "activation": "gelu", "batch_first": True, "norm_first": True}
        encoder = nn.TransformerEncoderLayer(d, config.heads, 2 * d, **shape)
        self.encoder = nn.TransformerEncoder(encoder, config.encoder_layers, nn.LayerNorm(d), enable_nested_tensor=False)
        self.start = nn.Parameter(0.02 * torch.randn(1, 1, d))
        self.token_embed, self.sign_embed = nn.Embedding(VOCAB, d), nn.Embedding(2, d)
        self.value_embed = nn.Embedding(SLOTS * BINS, d)
        self.slot = nn.Parameter(0.02 * torch.randn(SLOTS + 2, d))
        decoder = nn.TransformerDecoderLayer(d, config.heads, 2 * d, **shape)
        self.decoder = nn.TransformerDecoder(decoder, config.decoder_layers, nn.LayerNorm(d))
        self.to_token, self.to_sign = nn.Linear(d, VOCAB), nn.Linear(d, 2)
        self.to_bins, self.to_offsets = (nn.Parameter(torch.randn(SLOTS, d, BINS) * scale) for scale in (d**-0.5, 0.01))

    def losses(self, batch: Samples) -> dict[str, Tensor]:
        """Cross-entropies (nats) of the step after the prefix that `cur_points` shows; `values`, `offsets`: means over used slots."""
        rows = torch.arange(len(batch.steps), device=batch.steps.device)
        column = torch.arange(batch.gt_tokens.shape[1], device=rows.device)
        written = from_sequences(torch.where(column < batch.steps[:, None], batch.gt_tokens, PAD), batch.gt_params)
        tokens = batch.gt_tokens[rows, batch.steps]
        adds = tokens <= CYLINDER
        part = from_sequences(tokens[:, None].clamp_max(CYLINDER), batch.gt_params[rows, batch.steps][:, None])
        mask = used(part.kinds[:, 0]) & adds[:, None]
        index, offset = to_bins(encode(part)[:, 0])
        # as in `propose`, where slots without a meaning are not drawn
        index = torch.where(mask, index, 0)
        hidden = self._slots(self._memory(batch.gt_points, batch.cur_points, written), tokens, part.positive[:, 0].long(), index)
        logits, sign = self.to_token(hidden[:, 0]), self.to_sign(hidden[:, 1])
        bins = torch.einsum("bsd,sdk->bsk", hidden[:, 2:], self.to_bins)
        shift = torch.einsum("bsd,sdk->bsk", hidden[:, 2:], self.to_offsets).gather(2, index[..., None])[..., 0]
        parts = {
            "token": F.cross_entropy(logits, tokens),
            "sign": (F.cross_entropy(sign, part.positive[:, 0].long(), reduction="none") * adds).sum() / adds.sum().clamp_min(1),
            "values": (F.cross_entropy(bins.mT, index, reduction="none") * mask).sum() / mask.sum().clamp_min(1),
            "offsets": ((shift - offset.clamp(-0.5, 0.5)).square() * mask).sum() / mask.sum().clamp_min(1),
        }
        # a primitive is a handful of numbers: their mean is weighted as several tokens
        loss = parts["token"] + parts["sign"] + 4 * parts["values"] + self.config.offset_weight * parts["offsets"]
        return {"loss": loss, **parts, "token_accuracy": (logits.argmax(-1) == tokens).float().mean()}

    def propose(
        self,
        gt_points: Tensor,
        cur_points: Tensor,
        solids: Solids,
        generator: torch.Generator | None = None,
        may_undo: Tensor | None = None,
    ) -> Move:
        memory = self._memory(gt_points, cur_points, solids)
        index = torch.zeros(len(gt_points), SLOTS, dtype=torch.long, device=gt_points.device)
        numbers = torch.zeros(len(gt_points), SLOTS, device=gt_points.device)
        zero = index[:, 0]
        hidden = self._slots(memory, zero, zero, index, 1)[:, -1]
        tokens, log_p = chosen_tokens(self.to_token(hidden), solids.lengths, self.max_seq_len - 1, generator, may_undo)
        adds = tokens <= CYLINDER
        hidden = self._slots(memory, tokens, zero, index, 2)[:, -1]
        first = torch.tensor([-torch.inf, 0.0], device=hidden.device)
        sign_logits = torch.where((solids.lengths == 0)[:, None], first, self.to_sign(hidden))
        sign, log_sign = drawn(sign_logits, generator)
        log_p = log_p + log_sign * adds
        means = used(tokens.clamp_max(CYLINDER)) & adds[:, None]
        for slot in range(SLOTS):
            if not means[:, slot].any():
                continue
            hidden = self._slots(memory, tokens, sign, index, slot + 3)[:, -1]
            value, log_value = drawn(hidden @ self.to_bins[slot], generator)
            index[:, slot] = torch.where(means[:, slot], value, 0)
            shift = (hidden @ self.to_offsets[slot]).gather(1, value[:, None])[:, 0].clamp(-0.5, 0.5)
            numbers[:, slot] = from_bins(value, shift, slot)
            log_p = log_p + log_value * means[:, slot]
        part = decode(tokens[:, None].clamp_max(CYLINDER), sign[:, None].bool(), numbers[:, None])
        return Move(tokens, part, log_p)

    def _memory(self, gt_points: Tensor, cur_points: Tensor, written: Solids) -> tuple[Tensor, Tensor]:
        """Encoded tokens [b, s, d] of both clouds and the history, and which of them are padding [b, s]."""
        gt, current = gt_points[:, : self.config.gt_points], cur_points[:, : self.config.cur_points]
        there = current.flatten(1).any(1)
        gt_gap, cur_gap = gaps(gt, current, there)
        sign = torch.where(written.positive, 1.0, -1.0)[..., None]
        kinds = F.one_hot(written.kinds.clamp_min(0), VOCAB)
        past = self.history(torch.cat([encode(written) * used(written.kinds), kinds, sign], -1)) + self.order[: written.kinds.shape[1]]
        groups = (self.gt_tokens(gt, gt_gap), self.cur_tokens(current, cur_gap), past)
        tokens = torch.cat([g + role for g, role in zip(groups, self.roles, strict=True)], 1)
        count = [g.shape[1] for g in groups]
        padding = torch.cat(
            [torch.zeros_like(there)[:, None].expand(-1, count[0]), ~there[:, None].expand(-1, count[1]), ~written.present], 1
        )
        return self.encoder(tokens, src_key_padding_mask=padding), padding

    def _slots(self, memory: tuple[Tensor, Tensor], tokens: Tensor, sign: Tensor, index: Tensor, count: int = SLOTS + 2) -> Tensor:
        """Hidden states [b, count, d] of the first slots (token, sign, numbers), each seeing those before it; later inputs are ignored."""
        values = self.value_embed(index + BINS * torch.arange(SLOTS, device=index.device))
        before = [self.start.expand(len(tokens), 1, -1), self.token_embed(tokens)[:, None], self.sign_embed(sign)[:, None], values[:, :-1]]
        x = (torch.cat(before, 1) + self.slot)[:, :count]
        ahead = torch.ones(count, count, dtype=torch.bool, device=x.device).triu(1)
        return self.decoder(x, memory[0], tgt_mask=ahead, memory_key_padding_mask=memory[1])
