"""`Solids`: a batch of signed sequences as tensors, the form in which programs are drawn, checked and sampled.

A point belongs to the left fold of unions and differences exactly when the last primitive that holds it is positive: later
primitives overwrite earlier ones. All questions of membership here are that one rule.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import torch
from torch import Tensor

from imdim.geometry.sdf import rotation_matrices
from imdim.program.sequence import SignedSequence
from imdim.program.state import (
    ADD_BOX,
    ADD_CONE,
    ADD_CYLINDER,
    ADD_SPHERE,
    ADD_TORUS,
    END,
    KIND_OF,
    PARAM_COUNT,
    UNDO_LAST,
    ShapeState,
    Token,
)
from imdim.program.tree import Primitive

BOX, SPHERE, CYLINDER, CONE, TORUS = (int(token) for token in (ADD_BOX, ADD_SPHERE, ADD_CYLINDER, ADD_CONE, ADD_TORUS))
ABSENT = -1
ADDING = tuple(int(token) for token in KIND_OF)
PAD = -1  # stands after END where a batch is wider than a sequence; no token


@dataclass(frozen=True)
class Solids:
    """`kinds` int64 [b, t] (the id of the token that adds it, or ABSENT), `positive` bool [b, t], `centers` [b, t, 3], `sizes` [b, t, 3]
    (box edges; ball r, 0, 0; ellipsoid semi-axes; cylinder r, h, 0; cone bottom and top radius, h; torus R, r, 0), `rotations` [b, t, 3, 3]
    (local to world). An ellipsoid is a sphere with three sizes, as in `ShapeState`."""

    kinds: Tensor
    positive: Tensor
    centers: Tensor
    sizes: Tensor
    rotations: Tensor

    @property
    def present(self) -> Tensor:
        """bool [b, t]."""
        return self.kinds != ABSENT

    @property
    def ellipsoids(self) -> Tensor:
        """Which are spheres with three semi-axes, bool [b, t]."""
        return (self.kinds == SPHERE) & (self.sizes[..., 1] > 0)

    @property
    def lengths(self) -> Tensor:
        """Number of primitives, int64 [b]."""
        return self.present.sum(1)

    def __getitem__(self, rows: Tensor | slice) -> Solids:
        return Solids(*(getattr(self, f.name)[rows] for f in fields(self)))

    def take(self, order: Tensor) -> Solids:
        """The columns `order` int64 [b, u] of each row."""
        rows = torch.arange(len(order), device=order.device)[:, None]
        return Solids(*(getattr(self, f.name)[rows, order] for f in fields(self)))

    def compact(self) -> Solids:
        """Present primitives first, in their order, as wide as the longest row."""
        order = torch.argsort((~self.present).to(torch.uint8), dim=1, stable=True)
        return self.take(order[:, : max(1, int(self.lengths.max()) if len(self.kinds) else 1)])


def adds_primitive(tokens: Tensor) -> Tensor:
    """Which `tokens` int64 [...] add a primitive, bool [...]."""
    return torch.isin(tokens, tokens.new_tensor(ADDING))


class Sequences(NamedTuple):
    """`tokens` int64 [b, t] (ends with END, then PAD) and `params` [b, t, 10], zeros except on ADD_* steps."""

    tokens: Tensor
    params: Tensor


def empty(rows: int, width: int, device: torch.device | str = "cpu") -> Solids:
    """`rows` sequences of nothing, `width` columns wide."""
    kinds = torch.full((rows, width), ABSENT, device=device)
    zeros = torch.zeros(rows, width, 3, device=device)
    return Solids(kinds, torch.zeros_like(kinds, dtype=torch.bool), zeros, zeros, torch.eye(3, device=device).expand(rows, width, 3, 3))


def concatenate(parts: list[Solids], width: int) -> Solids:
    """Rows of all `parts`, each padded with absent primitives to `width` columns."""
    padded = [_pad(p, width) for p in parts]
    return Solids(*(torch.cat([getattr(p, f.name) for p in padded]) for f in fields(Solids)))


def to_sequences(solids: Solids, steps: int | None = None) -> Sequences:
    """Tokens and parameters of compact `solids`, `steps` columns wide (as many as the longest needs if None).

    Raises ValueError when a sequence with its END does not fit.
    """
    needed = int(solids.lengths.max()) + 1
    steps = needed if steps is None else steps
    if needed > steps:
        raise ValueError(f"{needed - 1} primitives and END do not fit in {steps} steps")
    wide = _pad(solids, steps)
    column = torch.arange(wide.kinds.shape[1], device=solids.kinds.device)
    tokens = torch.where(column == solids.lengths[:, None], int(END), torch.where(wide.present, wide.kinds, PAD))
    sign = torch.where(wide.positive, 1.0, -1.0)[..., None]
    params = torch.cat([wide.centers, wide.sizes, euler_from_matrices(wide.rotations), sign], -1)
    return Sequences(tokens[:, :steps], torch.where(wide.present[..., None], params, 0.0)[:, :steps])


def from_sequences(tokens: Tensor, params: Tensor) -> Solids:
    """Execute `tokens` [b, t] with `params` [b, t, 10], UNDO_LAST included; END and PAD add nothing. Sizes are read by magnitude.

    Raises ValueError for an unknown token.
    """
    known = (tokens < len(Token)) & (tokens >= PAD)
    if not known.all():
        raise ValueError(f"unknown token {int(tokens[~known][0])}; known are 0 to {len(Token) - 1}")
    adds = adds_primitive(tokens)
    rows = torch.arange(len(tokens), device=tokens.device)
    top = torch.zeros_like(rows)
    order = torch.full_like(tokens, -1)
    for step in range(tokens.shape[1]):
        added = adds[:, step]
        order[rows[added], top[added]] = step
        top = (top + added.long() - (tokens[:, step] == int(UNDO_LAST)).long()).clamp_min(0)
        order = torch.where(torch.arange(order.shape[1], device=tokens.device) < top[:, None], order, -1)
    chosen = params[rows[:, None], order.clamp_min(0)]
    kinds = torch.where(order >= 0, tokens.gather(1, order.clamp_min(0)), ABSENT)
    rotations = rotation_matrices(chosen[..., 6:9])
    return Solids(kinds, chosen[..., 9] >= 0, chosen[..., 0:3], chosen[..., 3:6].abs(), rotations).compact()


def to_states(tokens: Tensor, params: Tensor) -> list[ShapeState]:
    """Each row applied to its own `ShapeState`; PAD is skipped."""
    states = []
    round_ones = ((tokens == SPHERE) & (params[..., 4:6] != 0).any(-1)).any(1)
    for row, numbers, ellipsoids in zip(tokens.tolist(), params.double().tolist(), round_ones.tolist(), strict=True):
        state = ShapeState(ellipsoids=ellipsoids)
        for token, vector in zip(row, numbers, strict=True):
            if token != PAD and not state.done:
                state.apply_action(token, vector)
        states.append(state)
    return states


def to_signed(solids: Solids) -> list[SignedSequence[Primitive]]:
    """Each row from its first positive primitive on; empty where there is none."""
    return [state.to_sequence() for state in to_states(*to_sequences(solids.compact()))]


def from_signed(sequences: Sequence[SignedSequence[Primitive]]) -> Solids:
    """Sequences of primitives as rows, in double precision; KeyError for an intersection, ValueError for an outline."""
    states = [ShapeState.from_sequence(sequence) for sequence in sequences]
    tokens = torch.full((len(sequences), max(map(len, sequences)) + 1), PAD)
    params = torch.zeros(*tokens.shape, PARAM_COUNT, dtype=torch.float64)
    for row, state in enumerate(states):
        for step, (token, vector) in enumerate(state.actions()):
            tokens[row, step], params[row, step] = int(token), torch.tensor(vector, dtype=torch.float64)
    return from_sequences(tokens, params)


def levels(solids: Solids, points: Tensor) -> Tensor:
    """[b, t, n]: negative inside primitive t, zero on it, positive outside, infinite where absent; `points` [b, n, 3].

    The zero set is exact; off it the value is the largest violated bound, which is a distance on faces only.
    """
    rows, t = solids.kinds.shape
    # one product per row, with the points along the contiguous axis: [b, 3t, 3] @ [b, 3, n]
    inverse = solids.rotations.permute(0, 3, 1, 2).reshape(rows, 3 * t, 3)
    origin = (solids.centers[..., None, :] @ solids.rotations)[..., 0, :].permute(0, 2, 1).reshape(rows, 3 * t, 1)
    x, y, z = torch.baddbmm(-origin, inverse, points.mT).view(rows, 3, t, -1).unbind(1)
    return _level(_shapes(solids), x, y, z)


class _Shapes(NamedTuple):
    """The numbers [b, t, 1] of one formula for all kinds: a box of half edges `wide`, `deep` and `half` or, where not `square`, within
    `half` of the middle either what is nearer than `thick` to a circle of radius `ring` (where `ball`), or what is nearer to the axis than
    `radius` + `slope` z. Coordinates are multiplied by `stretch` first."""

    square: Tensor
    ball: Tensor
    wide: Tensor
    deep: Tensor
    half: Tensor
    stretch: tuple[Tensor, Tensor, Tensor]
    ring: Tensor
    thick: Tensor
    radius: Tensor
    slope: Tensor


def _shapes(solids: Solids) -> _Shapes:
    a, b, c = (s[..., None] for s in solids.sizes.unbind(-1))
    kinds, oval = solids.kinds[..., None], solids.ellipsoids[..., None]
    box, ball, torus, cone = (kinds == kind for kind in (BOX, SPHERE, TORUS, CONE))
    least = torch.where(oval, torch.minimum(torch.minimum(a, b), c), a)
    stretch = [torch.where(oval, least / size.clamp_min(1e-12), 1.0) for size in (a, b, c)]
    # a ball and a ring have no ends, nothing is inside of what is absent
    half = torch.where(box | cone, c / 2, b / 2)
    half = torch.where(ball | torus, torch.inf, torch.where(kinds == ABSENT, -torch.inf, half))
    slope = torch.where(cone, (b - a) / c.clamp_min(1e-12), 0.0)
    radius = torch.where(cone, (a + b) / 2, a)
    ring, thick = torch.where(torus, a, 0.0), torch.where(torus, b, least)
    return _Shapes(box, ball | torus, a / 2, b / 2, half, (stretch[0], stretch[1], stretch[2]), ring, thick, radius, slope)


def _level(s: _Shapes, x: Tensor, y: Tensor, z: Tensor) -> Tensor:
    u, v, w = (c * k for c, k in zip((x, y, z), s.stretch, strict=True))
    rho = torch.sqrt(u * u + v * v)
    ball = torch.sqrt((rho - s.ring).square() + w * w) - s.thick
    side = (rho - s.radius - s.slope * z) * torch.rsqrt(1 + s.slope.square())
    across = torch.where(s.ball, ball, side)
    across = torch.where(s.square, torch.maximum(x.abs() - s.wide, y.abs() - s.deep), across)
    return torch.maximum(across, z.abs() - s.half)


def inside(solids: Solids, held: Tensor) -> Tensor:
    """Membership bool [b, n] in the left fold, from that in the primitives, `held` bool [b, t, n]."""
    return last_two(solids, held)[1]


def last_two(solids: Solids, held: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """The last holder of each point int64 [b, n] (-1: none), whether it is positive, and whether the one before it is (bool [b, n])."""
    rank = torch.arange(1, held.shape[1] + 1, device=held.device, dtype=torch.int16)[:, None] * held
    last = rank.amax(1)
    before = torch.where(rank == last[:, None], 0, rank).amax(1)
    sign = torch.cat([torch.zeros_like(solids.positive[:, :1]), solids.positive], 1)
    return last.long() - 1, sign.gather(1, last.long()), sign.gather(1, before.long())


def euler_from_matrices(rotations: Tensor) -> Tensor:
    """Euler degrees [..., 3] of rotations [..., 3, 3]; at the gimbal lock (ry = +-90) rx is 0."""
    sy = -rotations[..., 2, 0]
    lock = sy.abs() > 1 - 1e-6
    rx = torch.where(lock, 0.0, torch.atan2(rotations[..., 2, 1], rotations[..., 2, 2]))
    level = torch.atan2(rotations[..., 1, 0], rotations[..., 0, 0])
    rz = torch.where(lock, torch.atan2(-rotations[..., 0, 1], rotations[..., 1, 1]), level)
    # asin is ill-conditioned near a right angle, atan2 is not
    ry = torch.atan2(sy, torch.hypot(rotations[..., 2, 1], rotations[..., 2, 2]))
    return torch.rad2deg(torch.stack([rx, ry, rz], -1))


def _pad(solids: Solids, width: int) -> Solids:
    extra = width - solids.kinds.shape[1]
    if extra <= 0:
        return solids
    tail = empty(len(solids.kinds), extra, solids.kinds.device)
    return Solids(*(torch.cat([getattr(solids, f.name), getattr(tail, f.name)], 1) for f in fields(Solids)))
