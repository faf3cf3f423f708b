"""The heads of the first design: next token, and ten numbers. Source: the project's design, sections 5.3 and 5.4."""

from __future__ import annotations

from torch import Tensor, nn

from imdim.program.state import PARAM_COUNT


class TokenHead(nn.Module):
    """Logits [b, t, vocab] of hidden states [b, t, d]."""

    def __init__(self, d_model: int, vocab: int) -> None:
        super().__init__()
        self.fc = nn.Linear(d_model, vocab)

    def forward(self, hidden: Tensor) -> Tensor:
        return self.fc(hidden)


class ParamHead(nn.Module):
    """Nine numbers and a sign logit [..., 10] of the concatenated inputs [..., d_total]."""

    def __init__(self, d_total: int, hidden: int) -> None:
        super().__init__()
        self.mlp = nn.Sequential(nn.Linear(d_total, hidden), nn.ReLU(), nn.Linear(hidden, PARAM_COUNT))

    def forward(self, x: Tensor) -> Tensor:
        return self.mlp(x)
