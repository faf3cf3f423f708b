"""What a policy that learns from rewards writes, and how much better than its siblings each move was.

Two ways to credit moves. "program": several whole programs for each target, every move of a program is worth what its program is. "move":
several moves from each state of one program, each worth the solid that it leads to. The second looks one step ahead only, but a state
costs one look at its cloud however many moves are tried, and no move answers for what others did.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import NamedTuple

import torch
from torch import Tensor

from imdim.data.solids import Solids, concatenate, empty, from_sequences
from imdim.data.surfaces import surface_clouds
from imdim.data.synthesize import TrainingSamples, estimate_iou
from imdim.learn.decode import DecodeConfig, DecodeStep, apply_move, steps, takes_back
from imdim.learn.policy import Move, Policy, Sight
from imdim.program.state import END

ALIKE = 0.03  # standard deviations of rewards below this are counted as this: sampled IoUs of equal solids differ by a third of it
Facts = dict[str, float]


@dataclass(frozen=True)
class RewardConfig:
    """IoU by `iou_samples` points, minus `price` for each move; `group` siblings are compared."""

    group: int
    price: float
    iou_samples: int


class Written(NamedTuple):
    """States, one after another: what was seen [s], the moves [s * ways] made from them and the `advantage` [s * ways] of each."""

    seen: Sight
    move: Move
    advantage: Tensor

    @property
    def states(self) -> int:
        return len(self.seen.may_undo)

    @property
    def ways(self) -> int:
        return len(self.advantage) // self.states

    def of(self, rows: Tensor) -> Written:
        """Some states with their moves."""
        ways = self.ways
        moves = (rows[:, None] * ways + torch.arange(ways, device=rows.device)).flatten()
        return Written(self.seen.of(rows), self.move.of(moves), self.advantage[moves])


@torch.no_grad()
def whole_programs(
    policy: Policy, targets: TrainingSamples, config: RewardConfig, decoding: DecodeConfig, chance: torch.Generator
) -> tuple[Written, Facts]:
    """`config.group` programs for each target; means of reward, IoU and moves, and the spread of rewards within a group."""
    clouds = targets.gt_points.repeat_interleave(config.group, 0)
    made = list(steps(policy, clouds, decoding, chance, chance))
    count = moves_of(made, len(clouds))
    truth = from_sequences(targets.gt_tokens, targets.gt_params)
    origin = torch.arange(len(truth.kinds), device=clouds.device).repeat_interleave(config.group)
    iou = estimate_iou(made[-1].after, truth[origin], config.iou_samples, chance, config.group)
    reward = iou - config.price * count
    facts = _facts(reward, iou, count, config.group)
    return _flat(made, advantages(reward, config.group)), facts


@torch.no_grad()
def branches(
    policy: Policy, targets: TrainingSamples, config: RewardConfig, decoding: DecodeConfig, chance: torch.Generator
) -> tuple[Written, Facts]:
    """`config.group` moves from each state of one program for each target, which goes on with one of them, whichever.

    States whose moves all lead to the same teach nothing and are left out, unless all are.
    """
    truth, n, group = from_sequences(targets.gt_tokens, targets.gt_params), len(targets.gt_points), config.group
    most = min(decoding.max_primitives, policy.max_seq_len - 1)
    solids, rows = empty(n, most, targets.gt_points.device), torch.arange(n, device=targets.gt_points.device)
    undone, iou, seen, rewards = torch.zeros_like(rows), torch.zeros(n, device=rows.device), [], []
    for _ in range(most + 2 * decoding.undo_limit + 1):
        if not len(rows):
            break
        written = solids[rows]
        current = surface_clouds(written, decoding.cur_points, chance)[0]
        sight = Sight(targets.gt_points[rows], current, written, undone[rows] < decoding.undo_limit)
        move = policy.propose(sight, chance, group)
        each = torch.arange(len(rows), device=rows.device).repeat_interleave(group)
        after = apply_move(written[each], move)
        worth = estimate_iou(after, truth[rows][each], config.iou_samples, chance, group)
        rewards.append(worth - config.price * (move.tokens != int(END)))
        seen.append(Written(sight, move, advantages(rewards[-1], group)))
        chosen = torch.randint(group, (len(rows),), generator=chance, device=rows.device) + group * each[::group]
        solids = Solids(*(getattr(solids, f.name).index_copy(0, rows, getattr(after, f.name)[chosen]) for f in fields(Solids)))
        iou[rows], token = worth[chosen], move.tokens[chosen]
        undone[rows] += takes_back(move.of(chosen))
        rows = rows[token != int(END)]
    reward = torch.cat(rewards)
    made = _join(seen, most)
    different = made.advantage.view(-1, group).abs().amax(1) > 0.5
    facts = _facts(reward, iou, reward.new_tensor([len(reward) / group / n]), group)
    return made.of((different if different.any() else ~different).nonzero()[:, 0]), facts


CREDIT: Mapping[str, Callable[[Policy, TrainingSamples, RewardConfig, DecodeConfig, torch.Generator], tuple[Written, Facts]]] = {
    "program": whole_programs,
    "move": branches,
}


def advantages(reward: Tensor, group: int) -> Tensor:
    """Rewards [b * group] as standard deviations from the mean of their group; 0 where all of a group are equal."""
    grouped = reward.view(-1, group)
    return ((grouped - grouped.mean(1, keepdim=True)) / grouped.std(1, keepdim=True).clamp_min(ALIKE)).flatten()


def moves_of(made: list[DecodeStep], n: int) -> Tensor:
    """How many moves each of `n` rows made."""
    return torch.cat([step.rows for step in made]).bincount(minlength=n).float()


def _facts(reward: Tensor, iou: Tensor, count: Tensor, group: int) -> Facts:
    spread = reward.view(-1, group).std(1).mean().item()
    return {"reward": reward.mean().item(), "iou": iou.mean().item(), "moves": count.mean().item(), "spread": spread}


def _flat(made: list[DecodeStep], advantage: Tensor) -> Written:
    """One move from each state, with the advantage [b] of its row."""
    parts = [Written(s.seen, s.move, advantage[s.rows]) for s in made]
    return _join(parts, made[0].seen.written.kinds.shape[1])


def _join(parts: list[Written], width: int) -> Written:
    draws = [p.move.draws for p in parts if p.move.draws is not None]
    move = Move(
        torch.cat([p.move.tokens for p in parts]),
        concatenate([p.move.part for p in parts], 1),
        torch.cat([p.move.log_p for p in parts]),
        torch.cat([p.move.at for p in parts]),
        torch.cat(draws) if draws else None,
    )
    clouds, current, written, may_undo = zip(*(p.seen[:4] for p in parts), strict=True)
    seen = Sight(torch.cat(clouds), torch.cat(current), concatenate(list(written), width), torch.cat(may_undo))
    return Written(seen, move, torch.cat([p.advantage for p in parts]))
