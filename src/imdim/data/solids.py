"""`Solids`: a batch of signed sequences as tensors, the form in which programs are drawn, checked and sampled.

A point belongs to the left fold exactly when the last primitive that holds it is positive: later primitives overwrite earlier ones. What an
intersection holds is all that is outside of its primitive, and it is not positive. All questions of membership here are that one rule.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import dropwhile
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from imdim.data.outlines import NO_FORM, SHARES, from_outline, outline_levels, to_outline
from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.sdf import rotation_matrices
from imdim.program.plain_outlines import to_simple
from imdim.program.sequence import SignedSequence, Step
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
    ZERO_SIZE,
    ShapeState,
    Token,
)
from imdim.program.tree import FULL_TURN, Primitive

BOX, SPHERE, CYLINDER, CONE, TORUS = (int(token) for token in (ADD_BOX, ADD_SPHERE, ADD_CYLINDER, ADD_CONE, ADD_TORUS))
# drawn from a simple outline: beyond what a `ShapeState` knows, whose vectors have no room for one
EXTRUDE, REVOLVE = len(Token), len(Token) + 1
VOCABULARY = (*(token.name for token in Token), "ADD_EXTRUDE", "ADD_REVOLVE")
NAMES: Mapping[int, str] = {**{int(token): kind for token, kind in KIND_OF.items()}, EXTRUDE: "extrude", REVOLVE: "revolve"}
ABSENT = -1
ADDING = tuple(NAMES)
PAD = -1  # stands after END where a batch is wider than a sequence; no token
SIGN = PARAM_COUNT - 1  # the place of a step's sign among its numbers
WIDE_COUNT = PARAM_COUNT + 1 + SHARES + 1  # numbers of a step with its form, the shares of its box, and whether it is an intersection


@dataclass(frozen=True)
class Solids:
    """`kinds` int64 [b, t] (the id of the token that adds it, or ABSENT), `positive` bool [b, t], `centers` [b, t, 3], `sizes` [b, t, 3]
    (box edges; ball r, 0, 0; ellipsoid semi-axes; cylinder r, h, 0; cone bottom and top radius, h; torus R, r, 0; of what is extruded the
    edges of its box, of what is turned its outer radius and h), `rotations` [b, t, 3, 3] (local to world). An ellipsoid is a sphere with
    three sizes, as in `ShapeState`. `forms` int64 [b, t] and `shares` [b, t, 3] are of the outlines of what is extruded or turned (see
    `outlines`), which lie across z or in the half plane of x and z. What is `common`, bool [b, t], is neither united nor cut but
    intersected with, and not positive."""

    kinds: Tensor
    positive: Tensor
    centers: Tensor
    sizes: Tensor
    rotations: Tensor
    forms: Tensor
    shares: Tensor
    common: Tensor

    @staticmethod
    def plain(kinds: Tensor, positive: Tensor, centers: Tensor, sizes: Tensor, rotations: Tensor) -> Solids:
        """Without outlines and intersections."""
        forms, zeros = torch.full_like(kinds, NO_FORM), torch.zeros(*kinds.shape, SHARES, dtype=sizes.dtype, device=kinds.device)
        return Solids(kinds, positive, centers, sizes, rotations, forms, zeros, torch.zeros_like(kinds, dtype=torch.bool))

    @property
    def present(self) -> Tensor:
        """bool [b, t]."""
        return self.kinds != ABSENT

    @property
    def ellipsoids(self) -> Tensor:
        """Which are spheres with three semi-axes, bool [b, t]."""
        return (self.kinds == SPHERE) & (self.sizes[..., 1] > 0)

    @property
    def drawn(self) -> Tensor:
        """Which are extruded or turned outlines, bool [b, t]."""
        return self.kinds >= EXTRUDE

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
    """`tokens` int64 [b, t] (ends with END, then PAD) and `params` [b, t, WIDE_COUNT], zeros except on ADD_* steps: the ten numbers of a
    `ShapeState`, the form, its shares, and 1 for an intersection."""

    tokens: Tensor
    params: Tensor


def empty(rows: int, width: int, device: torch.device | str = "cpu") -> Solids:
    """`rows` sequences of nothing, `width` columns wide."""
    kinds = torch.full((rows, width), ABSENT, device=device)
    zeros = torch.zeros(rows, width, 3, device=device)
    turns = torch.eye(3, device=device).expand(rows, width, 3, 3)
    return Solids.plain(kinds, torch.zeros_like(kinds, dtype=torch.bool), zeros, zeros, turns)


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
    plain = [wide.centers, wide.sizes, euler_from_matrices(wide.rotations), sign]
    params = torch.cat([*plain, wide.forms[..., None].to(sign), wide.shares, wide.common[..., None].to(sign)], -1)
    return Sequences(tokens[:, :steps], torch.where(wide.present[..., None], params, 0.0)[:, :steps])


def from_sequences(tokens: Tensor, params: Tensor) -> Solids:
    """Execute `tokens` [b, t] with `params` [b, t, 10 or WIDE_COUNT], UNDO_LAST included; END and PAD add nothing. Sizes are read by
    magnitude.

    Raises ValueError for an unknown token.
    """
    known = (tokens < len(VOCABULARY)) & (tokens >= PAD)
    if not known.all():
        raise ValueError(f"unknown token {int(tokens[~known][0])}; known are 0 to {len(VOCABULARY) - 1}")
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
    plain = Solids.plain(kinds, chosen[..., 9] >= 0, chosen[..., 0:3], chosen[..., 3:6].abs(), rotations)
    if params.shape[2] == PARAM_COUNT:
        return plain.compact()
    form, shares, common = chosen[..., PARAM_COUNT], chosen[..., PARAM_COUNT + 1 : -1], chosen[..., -1] > 0
    return replace(plain, forms=form.long(), shares=shares, common=common, positive=plain.positive & ~common).compact()


def to_states(tokens: Tensor, params: Tensor) -> list[ShapeState]:
    """Each row applied to its own `ShapeState`, which knows of no more than ten numbers a step; PAD is skipped."""
    states, params = [], params[..., :PARAM_COUNT]
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
    rows = solids.compact()
    drawn, common = rows.drawn.tolist(), rows.common.tolist()
    out = []
    for row, state in enumerate(to_states(*_as_plain(rows))):
        ellipsoids = state.ellipsoids
        steps = []
        for i, primitive in enumerate(state.to_primitives()):
            part = to_drawn(rows, row, i) if drawn[row][i] else primitive.solid(ellipsoids)
            steps.append(Step("intersection" if common[row][i] else "union" if primitive.sign > 0 else "difference", part))
        out.append(tuple(dropwhile(lambda step: not step.positive, steps)))
    return out


def _as_plain(solids: Solids) -> Sequences:
    """The sequences with boxes for what a `ShapeState` does not know."""
    return to_sequences(replace(solids, kinds=torch.where(solids.drawn, BOX, solids.kinds)))


def to_drawn(solids: Solids, row: int, column: int) -> Primitive:
    """One extruded or turned outline."""
    numbers = (solids.centers, solids.sizes, euler_from_matrices(solids.rotations.double()), solids.shares)
    center, size, rotation, shares = (tuple(v[row, column].double().clamp_min(-1e9).tolist()) for v in numbers)
    form, place = int(solids.forms[row, column]), (center[0], center[1], center[2])
    turn = rotation[0], rotation[1], rotation[2]
    if int(solids.kinds[row, column]) == EXTRUDE:
        width, depth, height = (max(v, ZERO_SIZE) for v in size)
        return Primitive("extrude", (height,), place, turn, to_outline(form, shares, (width / 2, depth / 2)))
    radius, height = (max(v, ZERO_SIZE) for v in size[:2])
    inner = shares[2] * radius
    outline = to_outline(form, shares, ((radius - inner) / 2, height / 2), (radius + inner) / 2)
    return Primitive("revolve", (FULL_TURN,), place, turn, outline)


def from_signed(sequences: Sequence[SignedSequence[Primitive]]) -> Solids:
    """Sequences of primitives as rows, in double precision; ValueError for an outline that is none of the simple ones."""
    tokens = torch.full((len(sequences), max(map(len, sequences)) + 1), PAD)
    params = torch.zeros(*tokens.shape, WIDE_COUNT, dtype=torch.float64)
    for row, sequence in enumerate(sequences):
        for step, (op, part) in enumerate(sequence):
            simple = to_simple(part)
            token, vector = _drawn_row(part) if simple is None else _plain_row(simple)
            tokens[row, step], params[row, step, : len(vector)] = token, torch.tensor(vector, dtype=torch.float64)
            params[row, step, SIGN], params[row, step, -1] = 1.0 if op == "union" else -1.0, float(op == "intersection")
    return from_sequences(tokens, params)


def _plain_row(part: Primitive) -> tuple[int, Sequence[float]]:
    """Token and ten numbers of one of the six kinds."""
    ((token, vector),) = itertools.islice(ShapeState.from_sequence((Step("union", part),)).actions(), 1)
    return int(token), vector


def _drawn_row(part: Primitive) -> tuple[int, Sequence[float]]:
    """Token and numbers of an extruded or turned outline, without the last; ValueError for one that is no simple form."""
    found = None if part.outline is None else from_outline(part.outline)
    whole = part.kind == "extrude" or (part.kind == "revolve" and part.size[0] == FULL_TURN)
    if found is None or not whole:
        raise ValueError(f"{part.kind}: not one of the simple outlines that sequences know")
    form, shares, half, (x, y) = found
    turned = part.kind == "revolve"
    shift = np.array([0.0, 0.0, y] if turned else [x, y, 0.0])
    center = np.array(part.center) + matrix_from_euler(part.rotation) @ shift
    radius = x + half[0]
    size = (radius, 2 * half[1], 0.0) if turned else (2 * half[0], 2 * half[1], part.size[0])
    inner = max(x - half[0], 0.0) / radius if turned else 0.0
    return (REVOLVE if turned else EXTRUDE), (*center, *size, *part.rotation, 1.0, float(form), *shares[:2], inner)


def levels(solids: Solids, points: Tensor) -> Tensor:
    """[b, t, n]: negative inside primitive t, zero on it, positive outside, infinite where absent; `points` [b, n, 3].

    The zero set is exact; off it the value is the largest violated bound, which is a distance on faces only.
    """
    rows, t = solids.kinds.shape
    # one product per row, with the points along the contiguous axis: [b, 3t, 3] @ [b, 3, n]
    inverse = solids.rotations.permute(0, 3, 1, 2).reshape(rows, 3 * t, 3)
    origin = (solids.centers[..., None, :] @ solids.rotations)[..., 0, :].permute(0, 2, 1).reshape(rows, 3 * t, 1)
    x, y, z = torch.baddbmm(-origin, inverse, points.mT).view(rows, 3, t, -1).unbind(1)
    level = _level(_shapes(solids), x, y, z)
    drawn = solids.drawn.nonzero(as_tuple=True)
    return level.index_put(drawn, _drawn_levels(solids, drawn, x[drawn], y[drawn], z[drawn])) if len(drawn[0]) else level


def _drawn_levels(solids: Solids, at: tuple[Tensor, ...], x: Tensor, y: Tensor, z: Tensor) -> Tensor:
    """Levels [m, n] of the extruded and turned outlines `at` rows and columns, at points [m, n] in their frames."""
    half, beside, turned = outline_boxes(solids.kinds[at], solids.sizes[at], solids.shares[at])
    u = torch.where(turned[:, None], torch.hypot(x, y) - beside[:, None], x)
    v = torch.where(turned[:, None], z, y)
    level = outline_levels(solids.forms[at], solids.shares[at], half, u, v, turned & (solids.shares[at][:, 2] <= 0))
    ends = torch.where(turned, torch.inf, solids.sizes[at][:, 2] / 2)[:, None]
    return torch.maximum(level, z.abs() - ends)


def outline_boxes(kinds: Tensor, sizes: Tensor, shares: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Half edges [..., 2] of the boxes of outlines of primitives [...], how far beside their axis they are [...], and which are turned."""
    turned = kinds == REVOLVE
    radius, inner = sizes[..., 0], shares[..., 2] * sizes[..., 0]
    wide = torch.where(turned, (radius - inner) / 2, sizes[..., 0] / 2)
    return torch.stack([wide, sizes[..., 1] / 2], -1), torch.where(turned, (radius + inner) / 2, 0.0), turned


def holds(solids: Solids, points: Tensor) -> Tensor:
    """Which steps decide on which points [b, n, 3], bool [b, t, n]: those within a primitive, those outside of an intersection's."""
    return (levels(solids, points) < 0) != (solids.common & solids.present)[..., None]


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
    """Membership bool [b, n] in the left fold, from what each step `holds`, bool [b, t, n]."""
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
