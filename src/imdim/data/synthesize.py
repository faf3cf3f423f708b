"""Synthetic samples: programs of which every step counts, their clouds and the clouds of their prefixes.

Programs come from `families`. Steps that no sampled volume depends on are removed, so nothing is hidden, undone or idle; what
remains is posed, made canonical and scaled to the frame of its cloud (box centre 0, box diagonal 1).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import torch
from torch import Tensor

from imdim.data.augment import AugmentConfig, augment
from imdim.data.canonical import box_symmetries, canonical_order, canonical_primitives
from imdim.data.dice import Dice
from imdim.data.families import FAMILIES
from imdim.data.solids import (
    BOX,
    CONE,
    CYLINDER,
    EXTRUDE,
    PAD,
    REVOLVE,
    SIGN,
    TORUS,
    Solids,
    adds_primitive,
    concatenate,
    from_sequences,
    holds,
    inside,
    last_two,
    to_sequences,
)
from imdim.data.surfaces import bounds, surface_clouds
from imdim.data.views import fit_frame, hide_unseen
from imdim.geometry.sdf import rotation_matrices
from imdim.program.state import UNDO_LAST

MAX_PRIMITIVES = 12
APPEND = -1  # the place of a primitive that replaces none
DRAWS = 40


@dataclass
class SynthesisConfig:
    """What is drawn. `smallest_change` is the least share of the sampled volume that must depend on each step; `free_rotation` the
    share of programs in any pose (the others have their axes along the coordinate axes, any of 24 ways); `p_undo` the share of samples
    whose prefix ends with a wrong primitive that the next token takes back; `p_shaken` the share whose prefix is a little wrong throughout,
    as what a policy writes is, by `shake` of the diagonal; `p_replace` the share whose prefix has a wrong primitive somewhere that the next
    token replaces; `p_hidden` the share of the others of whose prefix only the solid is known, as of programs that no sequence can say;
    `tilt` how many degrees the aligned poses are off (standard deviation); `prefixes` how many samples of a batch share a program. Without
    `canonical_numbers` boxes and cylinders keep the one of their equal rotations that they were drawn with, without `canonical_order`
    primitives come in the order drawn."""

    n_min: int = 1
    n_max: int = MAX_PRIMITIVES
    gt_points: int = 2048
    cur_points: int = 512
    free_rotation: float = 0.2
    smallest_change: float = 0.004
    p_undo: float = 0.0
    p_shaken: float = 0.0
    shake: float = 0.01
    p_replace: float = 0.0
    p_hidden: float = 0.0
    tilt: float = 0.0
    prefixes: int = 1
    canonical_numbers: bool = True
    canonical_order: bool = True
    volume_samples: int = 4096
    families: tuple[str, ...] = tuple(FAMILIES)
    augment: AugmentConfig = field(default_factory=AugmentConfig)


class TrainingSamples(NamedTuple):
    """A batch: `gt_points` [b, n, 3], `cur_points` [b, m, 3] (zeros: the empty prefix), `gt_tokens` int64 [b, t] (END, then PAD),
    `gt_params` [b, t, WIDE_COUNT], and `steps` int64 [b], the length of the prefix that `cur_points` shows. The step after it takes the
    place of the primitive `at` int64 [b] of the prefix, or stands behind all of them (APPEND). Of those `hidden`, bool [b], a policy is to
    see the prefix' solid alone."""

    gt_points: Tensor
    cur_points: Tensor
    gt_tokens: Tensor
    gt_params: Tensor
    steps: Tensor
    at: Tensor
    hidden: Tensor

    @property
    def written(self) -> Solids:
        """The prefixes."""
        column = torch.arange(self.gt_tokens.shape[1], device=self.steps.device)
        return from_sequences(torch.where(column < self.steps[:, None], self.gt_tokens, PAD), self.gt_params)

    @property
    def following(self) -> tuple[Tensor, Solids]:
        """The true next tokens [b], and their primitives [b, 1] (meaningless unless the token adds one)."""
        rows = torch.arange(len(self.steps), device=self.steps.device)
        tokens = self.gt_tokens[rows, self.steps]
        kinds = torch.where(adds_primitive(tokens), tokens, BOX)
        return tokens, from_sequences(kinds[:, None], self.gt_params[rows, self.steps][:, None])


def synthesize(n: int, config: SynthesisConfig, generator: torch.Generator) -> TrainingSamples:
    """`n` samples on the generator's device, `config.n_max` + 1 steps wide, each with a random prefix.

    Raises ValueError for bounds that cannot be met and RuntimeError when the families do not yield programs within them.
    """
    solids, clouds = draw_programs(-(-n // config.prefixes), config, generator)
    if config.augment.p_views > 0:
        seen = hide_unseen(solids, clouds, config.augment.p_views, config.augment.views, generator)
        solids, clouds = fit_frame(solids, seen)
        solids = _canonicalise(solids, config)
    tokens, params = to_sequences(solids, config.n_max + 1)
    rows = torch.arange(n, device=tokens.device) % len(tokens)
    return with_prefixes(augment(clouds[rows], config.augment, generator), tokens[rows], params[rows], config, generator)


def with_prefixes(
    gt_points: Tensor, tokens: Tensor, params: Tensor, config: SynthesisConfig, generator: torch.Generator
) -> TrainingSamples:
    """Samples of given targets and sequences without UNDO_LAST: a random prefix of each is rendered, some after a mistake."""
    dice = Dice(generator, len(tokens))
    steps = (dice.uniform(0.0, 1.0) * (tokens != PAD).sum(1)).long()
    if config.p_undo > 0:
        tokens, params, steps = _insert_mistakes(tokens, params, steps, dice.coin(config.p_undo), dice)
    if config.p_shaken > 0:
        column = torch.arange(tokens.shape[1], device=tokens.device)
        off = dice.coin(config.p_shaken)[:, None] & (column < steps[:, None])
        params = torch.where(off[..., None], _shake(params, config.shake, dice), params)
    at = torch.full_like(steps, APPEND)
    if config.p_replace > 0:
        rows = torch.arange(len(steps), device=steps.device)
        where = dice.coin(config.p_replace) & (steps > 0) & (tokens[rows, steps] != int(UNDO_LAST))
        tokens, params, at = _insert_replacements(tokens, params, steps, where, dice)
    hidden = dice.coin(config.p_hidden) & (at == APPEND) if config.p_hidden > 0 else torch.zeros_like(at, dtype=torch.bool)
    samples = TrainingSamples(gt_points, gt_points[:, :0], tokens, params, steps, at, hidden)
    return samples._replace(cur_points=surface_clouds(samples.written, config.cur_points, generator)[0])


def join_samples(a: TrainingSamples, b: TrainingSamples) -> TrainingSamples:
    """The rows of both, sequences padded to the longer ones', clouds cut to the smaller ones'."""
    width = max(a.gt_tokens.shape[1], b.gt_tokens.shape[1])
    parts = []
    for s in (a, b):
        tail = width - s.gt_tokens.shape[1]
        tokens = torch.nn.functional.pad(s.gt_tokens, (0, tail), value=PAD)
        parts.append(s._replace(gt_tokens=tokens, gt_params=torch.nn.functional.pad(s.gt_params, (0, 0, 0, tail))))
    clouds = {name: min(getattr(p, name).shape[1] for p in parts) for name in ("gt_points", "cur_points")}
    cut = (p._replace(**{name: getattr(p, name)[:, :n] for name, n in clouds.items()}) for p in parts)
    return TrainingSamples(*(torch.cat(rows) for rows in zip(*cut, strict=True)))


def _shake(params: Tensor, size: float, dice: Dice) -> Tensor:
    """Parameters [b, t, 10] whose centres are off by `size` (standard deviation) and whose sizes by at most as much, and by a tenth."""
    noise = size * dice.normal(params.shape[1], 6)
    edges = params[..., 3:6] + torch.minimum(noise[..., 3:].abs(), 0.1 * params[..., 3:6]) * noise[..., 3:].sign()
    return torch.cat([params[..., :3] + noise[..., :3], edges, params[..., 6:]], -1)


def _insert_mistakes(tokens: Tensor, params: Tensor, steps: Tensor, where: Tensor, dice: Dice) -> tuple[Tensor, Tensor, Tensor]:
    """Two columns wider; in rows `where` a mistake and UNDO_LAST stand at `steps`, which counts the former.

    A mistake is the first primitive of the next row or, as often, the right primitive in a wrong place.
    """
    column = torch.arange(tokens.shape[1] + 2, device=tokens.device)
    shift = torch.where(where[:, None] & (column >= steps[:, None] + 2), 2, 0)
    source = (column - shift).clamp_max(tokens.shape[1] - 1)
    beyond = column - shift >= tokens.shape[1]
    wide = torch.where(beyond, PAD, tokens.gather(1, source))
    numbers = torch.where(beyond[..., None], 0.0, params.gather(1, source[..., None].expand(-1, -1, params.shape[2])))
    mistake, undo = (where[:, None] & (column == steps[:, None] + i) for i in (0, 1))
    rows = torch.arange(len(tokens), device=tokens.device)
    right, astray = tokens[rows, steps], params[rows, steps].clone()
    astray[:, :3] += 0.1 * dice.normal(3)
    near = (dice.coin(0.5) & adds_primitive(right))[:, None]
    wrong, error = torch.where(near, right[:, None], tokens[:, :1].roll(-1, 0)), torch.where(near, astray, params[:, 0].roll(-1, 0))
    wide = torch.where(mistake, wrong, torch.where(undo, int(UNDO_LAST), wide))
    numbers = torch.where(mistake[..., None], error[:, None], torch.where(undo[..., None], 0.0, numbers))
    return wide, numbers, steps + where


def _insert_replacements(tokens: Tensor, params: Tensor, steps: Tensor, where: Tensor, dice: Dice) -> tuple[Tensor, Tensor, Tensor]:
    """One column wider; in rows `where` a primitive of the prefix is wrong, and the right one stands behind the prefix. Also its place.

    A wrong one is a plainer shape that fills the same room, as a search finds it first, the right one in a wrong place or size, or
    sometimes the first of the next row.
    """
    rows, column = torch.arange(len(tokens), device=tokens.device), torch.arange(tokens.shape[1] + 1, device=tokens.device)
    at = torch.where(where, torch.minimum((dice.uniform(0.0, 1.0) * steps).long(), steps - 1), APPEND)
    source = (column - (where[:, None] & (column > steps[:, None])).long()).clamp_max(tokens.shape[1] - 1)
    last = (column == tokens.shape[1]) & ~where[:, None]
    wide = torch.where(last, PAD, tokens.gather(1, source))
    numbers = torch.where(last[..., None], 0.0, params.gather(1, source[..., None].expand(-1, -1, params.shape[2])))
    place = at.clamp_min(0)
    right, its = tokens[rows, place], params[rows, place]
    astray = its.clone()
    astray[:, :3] += 0.05 * dice.normal(3)
    astray[:, 3:6] *= torch.exp(0.25 * dice.normal(3))
    plainer, plain = _plainer(right, its, dice.coin(0.5))
    chance = dice.uniform(0.0, 1.0)
    simpler, other = chance < 0.45, chance > 0.85
    wrong = torch.where(simpler, plainer, torch.where(other, tokens[:, 0].roll(-1, 0), right))
    error = torch.where(simpler[:, None], plain, torch.where(other[:, None], params[:, 0].roll(-1, 0), astray))
    error[:, SIGN] = its[:, SIGN]
    error[:, -1] = its[:, -1]
    here, behind = (where[:, None] & (column == place[:, None])), (where[:, None] & (column == steps[:, None]))
    wide = torch.where(here, wrong[:, None], torch.where(behind, right[:, None], wide))
    numbers = torch.where(here[..., None], error[:, None], torch.where(behind[..., None], its[:, None], numbers))
    return wide, numbers, at


def _plainer(kinds: Tensor, params: Tensor, flip: Tensor) -> tuple[Tensor, Tensor]:
    """Boxes or cylinders, tokens [b] with numbers [b, WIDE_COUNT], that fill what primitives of `kinds` [b] do; where these are boxes or
    cylinders, or `flip`, the other one of the two."""
    a, b, c = params[:, 3:6].unbind(1)
    boxy = (kinds == BOX) | (kinds == EXTRUDE)
    wide = torch.where(boxy, (a + b) / 4, torch.where(kinds == TORUS, a + b, torch.where(kinds == CONE, torch.maximum(a, b), a)))
    flat = (kinds == CYLINDER) | (kinds == REVOLVE)
    tall = torch.where(boxy | (kinds == CONE), c, torch.where(flat, b, torch.where(kinds == TORUS, 2 * b, 2 * a)))
    to_box = torch.where(kinds == BOX, False, torch.where(kinds == CYLINDER, True, boxy != flip))
    edges = torch.where(boxy[:, None], torch.stack([a, b], 1), 2 * wide[:, None])
    box, cylinder = torch.cat([edges, tall[:, None]], 1), torch.stack([wide, tall, torch.zeros_like(wide)], 1)
    sizes = torch.where(to_box[:, None], box, cylinder)
    plain = torch.cat([params[:, :3], sizes, params[:, 6:10], torch.zeros_like(params[:, 10:])], 1)
    tokens = torch.where(to_box, BOX, CYLINDER)
    # as all that is written: the other kind may have another one of its equal rotations
    return tokens, to_sequences(canonical_primitives(from_sequences(tokens[:, None], plain[:, None])), 2).params[:, 0]


def draw_programs(n: int, config: SynthesisConfig, generator: torch.Generator) -> tuple[Solids, Tensor]:
    """`n` programs of `n_min` to `n_max` primitives, canonical as far as `config` says, in the frame of their clouds [n, gt_points, 3],
    which are exact."""
    _check(config)
    found: list[Solids] = []
    missing = n
    for _ in range(DRAWS):
        drawn = _draw(max(16, missing + missing // 4), config, generator)
        found.append(drawn[: min(missing, len(drawn.kinds))])
        missing -= len(found[-1].kinds)
        if not missing:
            solids, clouds, whole = frame_clouds(concatenate(found, MAX_PRIMITIVES).compact(), config.gt_points, generator)
            if whole.all():
                return _canonicalise(solids, config), clouds
            found, missing = [concatenate(found, MAX_PRIMITIVES)[whole]], int((~whole).sum())
    raise RuntimeError(f"{missing} of {n} programs of {config.n_min} to {config.n_max} primitives not found in {DRAWS} draws")


def _canonicalise(solids: Solids, config: SynthesisConfig) -> Solids:
    solids = canonical_primitives(solids) if config.canonical_numbers else solids
    return canonical_order(solids) if config.canonical_order else solids


def _check(config: SynthesisConfig) -> None:
    if not 1 <= config.n_min <= config.n_max <= MAX_PRIMITIVES:
        raise ValueError(f"programs have 1 to {MAX_PRIMITIVES} primitives, got n_min={config.n_min}, n_max={config.n_max}")
    unknown = set(config.families) - set(FAMILIES)
    if unknown or not config.families:
        raise ValueError(f"unknown families {sorted(unknown)}; known are {', '.join(FAMILIES)}")


def _draw(n: int, config: SynthesisConfig, generator: torch.Generator) -> Solids:
    """At most `n` programs in a random pose, of which every step counts."""
    share = -(-n // len(config.families))
    drawn = concatenate([FAMILIES[f](Dice(generator, share)) for f in config.families], MAX_PRIMITIVES)
    shuffled = drawn[torch.randperm(len(drawn.kinds), generator=generator, device=generator.device)]
    kept, valid = without_idle_steps(shuffled, config, generator)
    fitting = valid & (kept.lengths >= config.n_min) & (kept.lengths <= config.n_max)
    return pose_randomly(kept[fitting], config, generator)


def without_idle_steps(solids: Solids, config: SynthesisConfig, generator: torch.Generator) -> tuple[Solids, Tensor]:
    """Compact programs whose every step passes `contributions` >= `smallest_change`, and which rows [b] are such programs.

    A removed step may have been what another one changed: rows are checked again, and fail if idle steps are left.
    """
    first = contributions(solids, config.volume_samples, generator) >= config.smallest_change
    kept = replace(solids, kinds=torch.where(first, solids.kinds, -1)).compact()
    again = contributions(kept, config.volume_samples, generator) >= config.smallest_change
    opens = kept.present[:, 0] & kept.positive[:, 0]
    return kept, opens & (again | ~kept.present).all(1)


def contributions(solids: Solids, samples: int, generator: torch.Generator) -> Tensor:
    """Share [b, t] of the final volume that would differ if the step were left out, by `samples` points of the solid's box.

    A point depends on its last holder alone, and only where the one before has the other sign. Hidden steps, idle steps and steps undone
    later all count 0.
    """
    low, high = bounds(solids)
    u = torch.rand(len(low), samples, 3, generator=generator, device=low.device)
    points = low[:, None] + u * (high - low)[:, None]
    last, now, before = last_two(solids, holds(solids, points))
    counts = torch.zeros(len(low), solids.kinds.shape[1] + 1, device=low.device)
    counts.scatter_add_(1, last + 1, (now != before).float())
    return counts[:, 1:] / now.sum(1, keepdim=True).clamp_min(1)


def pose_randomly(solids: Solids, config: SynthesisConfig, generator: torch.Generator) -> Solids:
    """Each program turned as a whole: anyhow with probability `free_rotation`, else by one of the 24 turns of the axes, and tilted."""
    dice = Dice(generator, len(solids.kinds))
    straight = box_symmetries().to(solids.rotations)[dice.integers(0, 23)]
    if config.tilt > 0:
        straight = rotation_matrices(config.tilt * dice.normal(3)) @ straight
    turn = torch.where(dice.coin(config.free_rotation)[:, None, None], dice.rotations(), straight)
    return replace(solids, centers=solids.centers @ turn.mT, rotations=turn[:, None] @ solids.rotations)


def frame_clouds(solids: Solids, n: int, generator: torch.Generator) -> tuple[Solids, Tensor, Tensor]:
    """Programs and clouds [b, n, 3] in the frame of the cloud (box centre 0, box diagonal 1), and which rows have a proper cloud."""
    points, _, count = surface_clouds(solids, n, generator)
    return *fit_frame(solids, points), count == n


def estimate_iou(a: Solids, b: Solids, samples: int, generator: torch.Generator, alike: int = 1) -> Tensor:
    """Volume IoU [b] estimated with `samples` points in the box of both; 0 where both are empty. Standard error below 0.5 / sqrt(hits).

    Every `alike` rows, one after another, share their random numbers: they are compared with less error than each has.
    """
    (low_a, high_a), (low_b, high_b) = bounds(a), bounds(b)
    low, high = torch.minimum(low_a, low_b), torch.maximum(high_a, high_b)
    u = torch.rand(len(low) // alike, samples, 3, generator=generator, device=low.device).repeat_interleave(alike, 0)
    points = low[:, None] + u * (high - low)[:, None]
    in_a, in_b = (inside(s, holds(s, points)) for s in (a, b))
    return (in_a & in_b).sum(1) / (in_a | in_b).sum(1).clamp_min(1)
