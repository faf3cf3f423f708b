"""The first design, literally: one pooled vector per cloud, tokens as history, parameters by regression.

Source: the project's design, sections 4.3, 5.2 to 5.5 and 7.1. It is the yardstick for `policy_net`. Parameters are raw: Euler degrees
beside lengths of at most 1, so the angles rule the squared error.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, replace

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from imdim.data.canonical import canonical_primitives
from imdim.data.solids import BOX, SPHERE, Solids, adds_primitive, from_sequences
from imdim.data.synthesize import APPEND, TrainingSamples
from imdim.geometry.points import compute_error_embedding
from imdim.learn.pointnet import PointNet
from imdim.learn.policy import Move, Policy, Sight, choose_tokens, mask_supervised, token_log_p
from imdim.program.state import PARAM_COUNT, Token

VOCAB = len(Token)  # outlines are beyond the first design
ERROR_POINTS = 512  # the Chamfer distance of the error embedding needs no more


@dataclass
class SeedConfig:
    d_model: int = 128
    layers: int = 4
    heads: int = 4
    hidden: int = 256
    sign_weight: float = 1.0


class TokenTransformer(nn.Module):
    """Causal over the token history, conditioned on clouds and error.

    Position t sees the tokens before t, never token t itself: the design feeds and predicts the same tokens, and unshifted the head
    would read its own answer. A start symbol stands at position 0.
    """

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


@dataclass(frozen=True)
class ModelComponents:
    """The four networks of the design. `param_head` makes nine numbers and a sign logit [..., 10] of the concatenated inputs, `token_head`
    logits [b, t, vocab] of hidden states [b, t, d]."""

    pointnet: PointNet
    transformer: TokenTransformer
    param_head: nn.Module
    token_head: nn.Module


def build_cad_model(config: SeedConfig, max_seq_len: int) -> ModelComponents:
    """Fresh networks for sequences of up to `max_seq_len` steps, END included."""
    d = config.d_model
    pointnet, transformer = PointNet(d), TokenTransformer(VOCAB, d, config.layers, config.heads, max_seq_len)
    mlp = nn.Sequential(nn.Linear(4 * d + 3, config.hidden), nn.ReLU(), nn.Linear(config.hidden, PARAM_COUNT))
    # the names are those of the weights in checkpoints
    heads = nn.Sequential(OrderedDict(mlp=mlp)), nn.Sequential(OrderedDict(fc=nn.Linear(d, VOCAB)))
    return ModelComponents(pointnet, transformer, *heads)


def forward_params_only(
    components: ModelComponents, gt_points: Tensor, cur_points: Tensor, gt_tokens: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """`params_pred` [b, t, 10], `hidden_states` [b, t, d], `token_logits` [b, t, vocab], teacher-forced.

    `cur_points` of zeros, or with no points, is the empty state: its embedding and error are zero. `hidden_states` and `token_logits` at t
    depend on the tokens before t; `params_pred` at t on token t too.
    """
    gt_embed = components.pointnet(gt_points)
    there = cur_points.flatten(1).any(1, keepdim=True) if cur_points.shape[1] else cur_points.new_zeros(len(gt_points), 1, dtype=torch.bool)
    cur_embed = components.pointnet(cur_points) * there if cur_points.shape[1] else torch.zeros_like(gt_embed)
    err_embed = compute_error_embedding(gt_points[:, :ERROR_POINTS], cur_points[:, :ERROR_POINTS]) * there
    hidden = components.transformer(gt_tokens, gt_embed, cur_embed, err_embed)
    clouds = torch.cat([gt_embed, cur_embed], -1)[:, None].expand(-1, hidden.shape[1], -1)
    errors = err_embed[:, None].expand(-1, hidden.shape[1], -1)
    current = components.transformer.embed(gt_tokens.clamp_min(0))
    params = components.param_head(torch.cat([hidden, clouds, current, errors], -1))
    return params, hidden, components.token_head(hidden)


class SeedPolicy(Policy):
    def __init__(self, config: SeedConfig, max_seq_len: int) -> None:
        super().__init__()
        self.config, self.max_seq_len = config, max_seq_len
        built = build_cad_model(config, max_seq_len)
        self.parts, self.components = nn.ModuleDict(vars(built)), built

    def losses(self, batch: TrainingSamples) -> dict[str, Tensor]:
        """Means over steps that are neither padding nor taken back; `loss` is their weighted sum. ValueError for an outline."""
        if (batch.gt_tokens >= VOCAB).any():
            raise ValueError("the first design writes boxes, balls and cylinders, cones and tori; a sample has an outline")
        params, _, logits = forward_params_only(self.components, batch.gt_points, batch.cur_points, batch.gt_tokens)
        return seed_losses(params, logits, batch.gt_tokens, batch.gt_params, self.config.sign_weight)

    def propose(self, seen: Sight, generator: torch.Generator | None = None, ways: int = 1) -> Move:
        seen = seen.of(torch.arange(len(seen.may_undo), device=seen.may_undo.device).repeat_interleave(ways))
        tokens, at = self._history(seen.written)
        lengths = seen.written.lengths
        logits = forward_params_only(self.components, seen.gt_points, seen.current, tokens)[2][at]
        token, log_p = choose_tokens(logits, lengths, self.max_seq_len - 1, generator, seen.may_undo)
        tokens = tokens.index_put(at, token)
        numbers = forward_params_only(self.components, seen.gt_points, seen.current, tokens)[0][at]
        part = from_sequences(torch.where(adds_primitive(token), token, BOX)[:, None], numbers[:, None])
        # the first design knows balls alone, whatever it writes into the other two numbers
        balls = (part.kinds == SPHERE)[..., None] & (torch.arange(3, device=token.device) > 0)
        part = replace(part, positive=part.positive | (lengths == 0)[:, None], sizes=part.sizes.clamp_min(1e-3).masked_fill(balls, 0.0))
        return Move(token, canonical_primitives(part), log_p, torch.full_like(token, APPEND))

    def log_prob(self, seen: Sight, move: Move) -> Tensor:
        """Of the token alone: signs and numbers are regressed, not drawn."""
        tokens, at = self._history(seen.written)
        logits = forward_params_only(self.components, seen.gt_points, seen.current, tokens)[2][at]
        each = torch.arange(len(logits), device=logits.device).repeat_interleave(len(move.tokens) // len(logits))
        return token_log_p(logits[each], move.tokens, seen.written.lengths[each], self.max_seq_len - 1, seen.may_undo[each])

    def _history(self, solids: Solids) -> tuple[Tensor, tuple[Tensor, Tensor]]:
        """The tokens [b, t] written, padded, and the indices of the next one of each row."""
        length = solids.lengths
        steps = min(int(length.max()) + 1, self.max_seq_len)
        tokens = F.pad(solids.kinds, (0, max(0, steps - solids.kinds.shape[1])), value=-1)[:, :steps]
        return tokens, (torch.arange(len(tokens), device=tokens.device), length.clamp_max(steps - 1))


def seed_losses(params: Tensor, logits: Tensor, tokens: Tensor, targets: Tensor, sign_weight: float = 1.0) -> dict[str, Tensor]:
    """`loss` and its parts, and `token_accuracy`, with padding and steps that are taken back masked; shapes as in `forward_params_only`."""
    valid = mask_supervised(tokens)
    adds = valid & adds_primitive(tokens)
    mse = F.mse_loss(params[adds][:, :9], targets[adds][:, :9])
    sign = F.binary_cross_entropy_with_logits(params[adds][:, 9], (targets[adds][:, 9] >= 0).float())
    token = F.cross_entropy(logits[valid], tokens[valid])
    accuracy = (logits[valid].argmax(-1) == tokens[valid]).float().mean()
    return {"loss": mse + sign_weight * sign + token, "params": mse, "sign": sign, "token": token, "token_accuracy": accuracy}
