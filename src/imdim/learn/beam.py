"""Beam search over programs: prefixes are executed and judged by geometry, and the best of all that were visited are kept."""

from __future__ import annotations

from dataclasses import dataclass, fields

import torch
from torch import Tensor

from imdim.data.solids import Solids, empty
from imdim.data.surfaces import surface_clouds
from imdim.learn.decode import DecodeConfig, apply_move, takes_back
from imdim.learn.policy import Policy, Sight
from imdim.learn.profile import fold_levels
from imdim.program.state import END

FAR = 0.1  # of the diagonal; a point further off weighs no more
PATIENCE, STALE = 2, 1e-5  # a target whose best answer has not gained as much in this many steps is done


@dataclass
class _Ranked:
    """States of several targets, `width` to each, row after row: solids, costs [b, width], clouds of what they show, steps taken back."""

    solids: Solids
    costs: Tensor
    shown: Tensor
    undone: Tensor

    def best(self, width: int) -> _Ranked:
        """The cheapest `width` of each target; equal ones count once. Rows that are missing cost infinity."""
        order = self.costs.argsort(1)
        costs = self.costs.gather(1, order)
        lengths = self.solids.lengths.view(costs.shape).gather(1, order)
        twin = torch.zeros_like(costs, dtype=torch.bool)
        twin[:, 1:] = (costs[:, 1:] - costs[:, :-1] < 1e-7) & (lengths[:, 1:] == lengths[:, :-1])
        costs, again = torch.where(twin, torch.inf, costs).sort(1)
        chosen = order.gather(1, again)[:, :width]
        rows = (torch.arange(len(costs), device=costs.device)[:, None] * costs.shape[1] + chosen).flatten()
        return _Ranked(self.solids[rows], costs[:, :width].contiguous(), self.shown[rows], self.undone[rows])


@torch.no_grad()
def beam_search(
    policy: Policy, gt_points: Tensor, config: DecodeConfig, render: torch.Generator, chance: torch.Generator
) -> tuple[Solids, Tensor]:
    """The `beam` best programs [b * beam] of each cloud, row after row, best first, and their costs [b, beam] (`costs_of`).

    Every step samples `expand` moves of each state, executes them, and goes on from the cheapest different ones. A program may end where
    its policy would go on: every state visited is an answer. A target is done when its answers no longer gain.
    """
    rows, device = len(gt_points), gt_points.device
    most = min(config.max_primitives, policy.max_seq_len - 1)
    nothing = empty(rows * config.beam, most, device)
    far = torch.full((rows, config.beam), torch.inf, device=device)
    blank = torch.zeros(rows * config.beam, config.cur_points, 3, device=device)
    zero = torch.zeros(rows * config.beam, dtype=torch.long, device=device)
    answers = _Ranked(nothing, far, blank, zero)
    start = far.clone()
    start[:, 0] = 0.0
    states = _Ranked(nothing, start, blank, zero)
    stale = torch.zeros(rows, 1, dtype=torch.long, device=device)
    for depth in range(most + 2 * config.undo_limit + 1):
        # the first step starts from one state, so it is tried as often as all others together
        tried = _expand(policy, gt_points, states, config, config.expand if depth else config.beam * config.expand, render, chance)
        if tried is None:
            break
        before = answers.costs[:, :1]
        answers = _join(answers, tried, rows).best(config.beam)
        states = tried.best(config.beam)
        stale = torch.where(answers.costs[:, :1] < before - STALE, 0, stale + 1)
        states.costs = torch.where(stale < PATIENCE, states.costs, torch.inf)
    return answers.solids, answers.costs


def _expand(
    policy: Policy, gt_points: Tensor, states: _Ranked, config: DecodeConfig, ways: int, render: torch.Generator, chance: torch.Generator
) -> _Ranked | None:
    """All states one move on, `ways` for each of the `beam`; None when none is left to go on from. Ended ones cost infinity."""
    beam = states.costs.shape[1]
    alive = torch.isfinite(states.costs).flatten().nonzero()[:, 0]
    if not len(alive):
        return None
    target, before = gt_points[alive // beam], states.solids[alive]
    move = policy.propose(Sight(target, states.shown[alive], before, states.undone[alive] < config.undo_limit), chance, ways)
    each = torch.arange(len(alive), device=alive.device).repeat_interleave(ways)
    ended = move.tokens == int(END)
    after = apply_move(before[each], move)
    shown = surface_clouds(after, config.cur_points, render)[0]
    costs = torch.where(ended, torch.inf, costs_of(after, target[each], shown, config))
    undone = states.undone[alive][each] + takes_back(move)
    full = len(states.costs) * beam * ways
    place = (alive[:, None] * ways + torch.arange(ways, device=alive.device)).flatten()
    scattered = [torch.zeros(full, *v.shape[1:], dtype=v.dtype, device=v.device).index_copy(0, place, v) for v in (shown, undone)]
    spread = empty(full, before.kinds.shape[1], alive.device)
    solids = Solids(*(getattr(spread, f.name).index_copy(0, place, getattr(after, f.name)) for f in fields(Solids)))
    wide = torch.full((full,), torch.inf, device=alive.device).index_copy(0, place, costs)
    return _Ranked(solids, wide.view(len(states.costs), -1), *scattered)


def _join(a: _Ranked, b: _Ranked, rows: int) -> _Ranked:
    """Both sets of states of each target."""

    def join(x: Tensor, y: Tensor) -> Tensor:
        return torch.cat([x.unflatten(0, (rows, -1)), y.unflatten(0, (rows, -1))], 1).flatten(0, 1)

    solids = Solids(*(join(getattr(a.solids, f.name), getattr(b.solids, f.name)) for f in fields(Solids)))
    return _Ranked(solids, torch.cat([a.costs, b.costs], 1), join(a.shown, b.shown), join(a.undone, b.undone))


def costs_of(solids: Solids, gt_points: Tensor, shown: Tensor, config: DecodeConfig) -> Tensor:
    """What [b] programs cost before clouds [b, n, 3], in shares of the diagonal: the mean level of the cloud's points, the mean distance of
    the points `shown` [b, m, 3] of their own surfaces to the cloud, and the price of primitives. Infinite where nothing is shown."""
    points = gt_points[:, : config.points]
    unexplained = fold_levels(solids, points).abs().clamp_max(FAR).mean(1)
    unsupported = torch.cdist(shown, points).amin(2).clamp_max(FAR).mean(1)
    there = shown.flatten(1).any(1)
    return torch.where(there, unexplained + unsupported + config.price * solids.lengths, torch.inf)
