"""From a handful of imperfect signed sequences to the best one that their primitives, and what they lack, can make of a cloud.

Numbers are fitted (`refine`), all primitives go into one pool, and a local search over the pool drops what does not pay, lends a sequence
what another one has, turns signs and changes the order (`pool`). Points that stay unexplained offer further primitives (`missing`). The
ranking looks at the cloud alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from imdim.geometry import kernels
from imdim.geometry.axes import SYMMETRIES
from imdim.geometry.rotations import euler_from_matrix, frame_from_axis, matrix_from_euler
from imdim.program.sequence import SignedSequence, Step, map_terms, to_program, with_leaves
from imdim.program.tree import Primitive, Program
from imdim.solve.local_search import Choice, Stage, search_locally
from imdim.solve.missing import alternatives, hollows, missing, trimmed, whole
from imdim.solve.pool import Cloud, Pool, PoolConfig, best_choice, distinct
from imdim.solve.refine import RefineConfig, refine

WORTH = 1e-4  # by which a repair must lower the cost

Signed = SignedSequence[Primitive]


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
    out_of_time: Callable[[], bool] = bool,
) -> list[Proposal]:
    """The best sequences for the surface `points` [n, 3], cheapest first.

    Candidates that begin with a cut are left out; single primitives fitted to the whole cloud are added, so there is always an answer
    unless the cloud has no extent. `axes` [3, 3] has the part's main directions as columns (default: the coordinate axes).
    Once `out_of_time` (by default never) numbers and sequences stay as they are by then.
    """
    config = config or ProposalConfig()
    cloud = Cloud.of(points[:: max(1, len(points) // config.most)])
    axes = np.eye(3) if axes is None else axes
    given = [c for c in candidates if c and c[0].positive]
    level = [tuple(Step(op, _levelled(p, axes, config.level_deg)) for op, p in c) for c in given]
    starts = list(dict.fromkeys([*level, *given, *((Step("union", p),) for p in whole(cloud, axes))]))
    fitted = [_fitted(s, cloud, config.first, config.seen, out_of_time) for s in starts]
    if not fitted:
        return []
    ranked = _ranked(fitted, cloud, config)
    lent = distinct([p for r in ranked for _, p in r.signed], cloud)[: config.pool_limit]
    done = [_repaired(r, lent, axes, cloud, config, out_of_time) for r in ranked[: config.finalists]]
    return sorted(done, key=lambda d: d.cost)


def _fitted(signed: Signed, cloud: Cloud, config: RefineConfig, count: int, out_of_time: Callable[[], bool]) -> Signed:
    return with_leaves(signed, refine(to_program(signed), cloud.thinned(count), config=config, out_of_time=out_of_time).program)


def _ranked(sequences: Sequence[Signed], cloud: Cloud, config: ProposalConfig) -> list[Proposal]:
    """The different sequences, cheapest first."""
    unique = list(dict.fromkeys(sequences))
    return sorted(map(Proposal, unique, _costs(unique, cloud, config)), key=lambda p: p.cost)


def _costs(sequences: Sequence[Signed], cloud: Cloud, config: ProposalConfig) -> list[float]:
    """Over one pool of all their primitives."""
    place = {p: i for i, p in enumerate(dict.fromkeys(p for signed in sequences for _, p in signed))}
    pool = Pool.of([*place], cloud, config.pool, config.seen)
    return pool.costs([map_terms(signed, place.__getitem__) for signed in sequences]).tolist()


def _repaired(
    start: Proposal,
    lent: Sequence[Primitive],
    axes: np.ndarray,
    cloud: Cloud,
    config: ProposalConfig,
    out_of_time: Callable[[], bool],
) -> Proposal:
    """Choose, fit, guess what is missing, and again, until the cost no longer falls."""

    def chosen(best: Signed) -> list[Signed]:
        program = to_program(best)
        off = _off(program, cloud)
        guesses = missing(program, cloud, axes, off)
        others = [*_varied(best, off, axes, cloud, config), *lent, *(p for p, _ in guesses)]
        return [_chosen(best, others, cloud, config)]

    def fit(signed: Signed) -> list[Signed]:
        return [_fitted(signed, cloud, config.again, config.seen, out_of_time), signed]

    def costs(tried: Sequence[Signed]) -> list[float]:
        return _costs(tried, cloud, config)

    best, cost = search_locally((start.signed, start.cost), chosen, [Stage(fit, 1)], costs, lambda *_: WORTH, config.rounds, out_of_time)
    if out_of_time():
        return Proposal(best, cost)
    return _ranked([_fitted(best, cloud, config.last, config.most, out_of_time), best], cloud, config)[0]


def _varied(signed: Signed, off: float, axes: np.ndarray, cloud: Cloud, config: ProposalConfig) -> list[Primitive]:
    """The primitives levelled, trimmed to the points that they explain, and exchanged for others that explain these."""
    leaf, value, _, _ = kernels.program_tangent(to_program(signed), cloud.points)
    near = np.abs(value) < off
    out = [_levelled(p, axes, config.level_deg) for _, p in signed]
    for i, (op, primitive) in enumerate(signed):
        own = near & (leaf == i)
        out += trimmed(primitive, cloud.points[own]) + alternatives(cloud.points[own], axes, cloud)
        if op == "union" and own.any():
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
    own = [p for _, p in signed]
    primitives = [*own, *(p for p in distinct([*own, *others], cloud) if p not in set(own))]
    pool = Pool.of(primitives, cloud, config.pool, config.seen)
    start: Choice = tuple(Step(op, i) for i, (op, _) in enumerate(signed))
    return map_terms(best_choice(pool, start, config.pool)[0], pool.primitives.__getitem__)
