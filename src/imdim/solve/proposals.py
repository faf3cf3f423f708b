"""From a handful of imperfect signed sequences to the best one that their primitives, and what they lack, can make of a cloud.

Numbers are fitted (`refine`), all primitives go into one pool, and a local search over the pool drops what does not pay, lends a sequence
what another one has, turns signs and changes the order (`pool`). Points that stay unexplained offer further primitives (`missing`). The
ranking looks at the cloud alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.geometry import kernels
from imdim.geometry.axes import SYMMETRIES
from imdim.geometry.rotations import euler_from_matrix, frame_from_axis, matrix_from_euler
from imdim.program.tree import Primitive, Program
from imdim.solve.missing import alternatives, hollows, missing, trimmed, whole
from imdim.solve.pool import Choice, Cloud, Pool, PoolConfig, Signed, best_choice, distinct, to_program, with_numbers
from imdim.solve.refine import RefineConfig, refine

HOLLOW = ("box", "sphere", "cylinder")


@dataclass(frozen=True)
class ProposalConfig:
    """`finalists` sequences are repaired, in at most `rounds` rounds each; lengths are shares of the cloud's diagonal."""

    finalists: int = 2
    rounds: int = 6
    seen: int = 768  # points of the quick fits and of the pool
    most: int = 2048  # points of the last fit
    pool_limit: int = 48
    level_deg: float = 12.0  # a primitive this near to the part's directions is also tried along them
    first: RefineConfig = field(default_factory=lambda: RefineConfig(adam_steps=0, newton_steps=14, start_scale=0.06))
    again: RefineConfig = field(default_factory=lambda: RefineConfig(adam_steps=0, newton_steps=14, start_scale=0.03))
    last: RefineConfig = field(default_factory=lambda: RefineConfig(adam_steps=0, newton_steps=40, start_scale=0.02))
    pool: PoolConfig = field(default_factory=PoolConfig)


@dataclass(frozen=True)
class Proposal:
    """A sequence with its cost (see `pool`)."""

    signed: Signed
    cost: float

    @property
    def program(self) -> Program:
        return to_program(self.signed)


def settle(
    candidates: Sequence[Signed],
    points: np.ndarray,
    axes: np.ndarray | None = None,
    config: ProposalConfig | None = None,
    deadline: Deadline = NEVER,
) -> list[Proposal]:
    """The best sequences for the surface `points` [n, 3], cheapest first.

    Candidates that begin with a cut are left out; single primitives fitted to the whole cloud are added, so there is always an answer
    unless the cloud has no extent. `axes` [3, 3] has the part's main directions as columns (default: the coordinate axes).
    Past the `deadline` (by default never) numbers and sequences stay as they are by then.
    """
    config = config or ProposalConfig()
    cloud = Cloud.of(points[:: max(1, len(points) // config.most)])
    axes = np.eye(3) if axes is None else axes
    given = [c for c in candidates if c and c[0][1]]
    level = [tuple((_levelled(p, axes, config.level_deg), s) for p, s in c) for c in given]
    starts = list(dict.fromkeys([*level, *given, *(((p, True),) for p in whole(cloud, axes))]))
    fitted = [_fitted(s, cloud, config.first, config.seen, deadline) for s in starts]
    if not fitted:
        return []
    everything = [p for s in fitted for p, _ in s]
    ranked = _ranked(fitted, everything, cloud, config)
    lent = distinct([p for r in ranked for p, _ in r.signed], cloud)[: config.pool_limit]
    done = [_repaired(r, lent, axes, cloud, config, deadline) for r in ranked[: config.finalists]]
    return sorted(done, key=lambda d: d.cost)


def _fitted(signed: Signed, cloud: Cloud, config: RefineConfig, count: int, deadline: Deadline) -> Signed:
    return with_numbers(signed, refine(to_program(signed), cloud.thinned(count), config=config, deadline=deadline).program)


def _ranked(sequences: Sequence[Signed], primitives: Sequence[Primitive], cloud: Cloud, config: ProposalConfig) -> list[Proposal]:
    """The different sequences over one pool, cheapest first."""
    unique = list(dict.fromkeys(primitives))
    place = {p: i for i, p in enumerate(unique)}
    pool = Pool.of(unique, cloud, config.pool, config.seen)
    costs = [(pool.cost(tuple((place[p], s) for p, s in signed)), signed) for signed in dict.fromkeys(sequences)]
    return [Proposal(signed, cost) for cost, signed in sorted(costs, key=lambda c: c[0])]


def _repaired(
    start: Proposal,
    lent: Sequence[Primitive],
    axes: np.ndarray,
    cloud: Cloud,
    config: ProposalConfig,
    deadline: Deadline,
) -> Proposal:
    """Choose, fit, guess what is missing, and again, until the cost no longer falls."""
    best = start
    for _ in range(config.rounds):
        if deadline.passed():
            return best
        guesses = missing(best.program, cloud, axes, _off(best.program, cloud))
        varied = _varied(best, axes, cloud, config)
        chosen = _chosen(best.signed, [*varied, *lent, *(p for p, _ in guesses)], cloud, config)
        fitted = _fitted(chosen, cloud, config.again, config.seen, deadline)
        after = _ranked([fitted, chosen], [p for s in (fitted, chosen) for p, _ in s], cloud, config)[0]
        if after.cost >= best.cost - 1e-4:
            break
        best = after
    last = _fitted(best.signed, cloud, config.last, config.most, deadline)
    return _ranked([last, best.signed], [p for s in (last, best.signed) for p, _ in s], cloud, config)[0]


def _varied(proposal: Proposal, axes: np.ndarray, cloud: Cloud, config: ProposalConfig) -> list[Primitive]:
    """The primitives levelled, trimmed to the points that they explain, and exchanged for others that explain these."""
    leaf, value, _, _ = kernels.program_tangent(proposal.program, cloud.points)
    near = np.abs(value) < _off(proposal.program, cloud)
    out = [_levelled(p, axes, config.level_deg) for p, _ in proposal.signed]
    for i, (primitive, positive) in enumerate(proposal.signed):
        own = near & (leaf == i)
        out += trimmed(primitive, cloud.points[own]) + alternatives(cloud.points[own], axes, cloud)
        if positive and own.any() and primitive.kind in HOLLOW:
            out += hollows(primitive, float(np.median(np.abs(value[own]))), cloud)
    return out


def _levelled(primitive: Primitive, axes: np.ndarray, most_deg: float) -> Primitive:
    """Turned into the nearest directions of the part, where these are no further than `most_deg`."""
    rotation = matrix_from_euler(primitive.rotation)
    if primitive.kind == "box":
        near = max((axes @ s for s in SYMMETRIES), key=lambda f: float((f * rotation).sum()))
        cosine = (float((near * rotation).sum()) - 1) / 2
    else:
        along = rotation[:, 2] @ axes
        k = int(np.abs(along).argmax())
        near, cosine = frame_from_axis(axes[:, k]), abs(float(along[k]))
    return replace(primitive, rotation=euler_from_matrix(near)) if cosine > np.cos(np.radians(most_deg)) else primitive


def _off(program: Program, cloud: Cloud) -> float:
    """Beyond this a point is not explained: several times the noise of those that are."""
    distance = np.abs(kernels.program_sdf(program, cloud.points))
    return float(np.clip(4 * np.median(distance), 0.01 * cloud.diagonal, 0.04 * cloud.diagonal))


def _chosen(signed: Signed, others: Sequence[Primitive], cloud: Cloud, config: ProposalConfig) -> Signed:
    own = [p for p, _ in signed]
    primitives = [*own, *(p for p in distinct([*own, *others], cloud) if p not in set(own))]
    pool = Pool.of(primitives, cloud, config.pool, config.seen)
    start: Choice = tuple((i, s) for i, (_, s) in enumerate(signed))
    return pool.signed(best_choice(pool, start, config.pool)[0])
