"""From a cloud to a program: write, execute, look, until the policy ends; greedy or sampled."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import torch
from torch import Tensor

from imdim.data.solids import ABSENT, Solids, adds_primitive, empty
from imdim.data.surfaces import surface_clouds
from imdim.data.synthesize import APPEND
from imdim.learn.policy import Move, Policy, Sight
from imdim.program.state import END, UNDO_LAST


@dataclass
class DecodeConfig:
    """`beam` states per target, each tried `expand` ways per step; `points` of the cloud judge them; a primitive must lower the distance by
    `price` to be worth it; `undo_limit` steps may be spent on taking back."""

    beam: int = 16
    expand: int = 2
    points: int = 1024
    cur_points: int = 256
    price: float = 1e-4
    max_primitives: int = 12
    undo_limit: int = 4


class DecodeStep(NamedTuple):
    """A move of the `rows` int64 [r] that have not ended: what was `seen` there, the `move`, and the programs [b] of all
    rows `after` it."""

    rows: Tensor
    seen: Sight
    move: Move
    after: Solids


@torch.no_grad()
def steps(
    policy: Policy, gt_points: Tensor, config: DecodeConfig, render: torch.Generator, chance: torch.Generator | None = None
) -> Iterator[DecodeStep]:
    """The moves by which programs for clouds [b, n, 3] of diagonal 1 are written: greedy ones, or samples with `chance`. `render` draws
    the prefixes' clouds."""
    most = min(config.max_primitives, policy.max_seq_len - 1)
    solids = empty(len(gt_points), most, gt_points.device)
    rows = torch.arange(len(gt_points), device=gt_points.device)
    undone = torch.zeros_like(rows)
    # as many as a row can take: it adds, takes back up to the limit, adds again, and ends
    for _ in range(most + 2 * config.undo_limit + 1):
        if not len(rows):
            break
        written = solids[rows]
        current = surface_clouds(written, config.cur_points, render)[0]
        seen = Sight(gt_points[rows], current, written, undone[rows] < config.undo_limit)
        move = policy.propose(seen, chance)
        after = apply_move(written, move)
        solids = Solids(*(getattr(solids, f.name).index_copy(0, rows, getattr(after, f.name)) for f in fields(Solids)))
        yield DecodeStep(rows, seen, move, solids)
        undone[rows] += takes_back(move)
        rows = rows[move.tokens != int(END)]


def decode(
    policy: Policy, gt_points: Tensor, config: DecodeConfig, render: torch.Generator, chance: torch.Generator | None = None
) -> Solids:
    """One program for each cloud; arguments as in `steps`."""
    solids = empty(len(gt_points), 1, gt_points.device)
    for step in steps(policy, gt_points, config, render, chance):
        solids = step.after
    return solids


def takes_back(move: Move) -> Tensor:
    """Which moves undo something that was written, bool [b]."""
    return (move.tokens == int(UNDO_LAST)) | (adds_primitive(move.tokens) & (move.at != APPEND))


def apply_move(solids: Solids, move: Move) -> Solids:
    """The sequences after the move."""
    rows = torch.arange(len(move.tokens), device=move.tokens.device)
    width, length = solids.kinds.shape[1], solids.lengths
    place = torch.where(move.at == APPEND, length, move.at)
    adds = adds_primitive(move.tokens) & (place < width)
    at = rows[adds], place[adds]
    after = Solids(*(getattr(solids, f.name).index_put(at, getattr(move.part, f.name)[adds, 0]) for f in fields(Solids)))
    back = move.tokens == int(UNDO_LAST)
    last = torch.arange(width, device=rows.device) == (length - 1)[:, None]
    return replace(after, kinds=torch.where(back[:, None] & last, ABSENT, after.kinds))
