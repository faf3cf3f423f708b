"""From a handful of imperfect signed sequences to the best one that their primitives, and what they lack, can make of a cloud.

Numbers are fitted (`refine`), all primitives go into one pool, and a local search over the pool drops what does not pay, lends a sequence
what another one has, turns signs and changes the order (`primitive_selection`). Points that stay unexplained offer further primitives
(`candidates.residual`). The ranking looks at the cloud alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.geometry import kernels
from imdim.geometry.axes import SYMMETRIES
from imdim.geometry.rotations import euler_from_matrix, frame_from_axis, matrix_from_euler
from imdim.geometry.sampling import subsample
from imdim.numbers.refine import RefineConfig, refine
from imdim.program.sequence import SignedSequence, Step, map_terms, to_program, with_leaves
from imdim.program.tree import Primitive, Program
from imdim.search.mdl.candidates.residual import alternatives, hollows, missing, trim, whole
from imdim.search.mdl.local_search import Choice, FittingStage, search_locally
from imdim.search.mdl.primitive_selection import Cloud, PoolConfig, PrimitivePool, best_choice, distinct

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
    first: RefineConfig = field(default_factory=lambda: RefineConfig(newton_steps=14, start_scale=0.06))
    again: RefineConfig = field(default_factory=lambda: RefineConfig(newton_steps=14, start_scale=0.03))
    last: RefineConfig = field(default_factory=lambda: RefineConfig(newton_steps=40, start_scale=0.02))
    pool: PoolConfig = field(default_factory=PoolConfig)


@dataclass(frozen=True)
class Proposal:
    """A sequence with its cost (see `primitive_selection`)."""

    signed: Signed
    cost: float

    @property
    def program(self) -> Program:
        return to_program(self.signed)


def settle(
    candidates: Sequence[Signed],
    points: np.ndarray,
    sigma: float,
    axes: np.ndarray | None = None,
    config: ProposalConfig | None = None,
    deadline: Deadline = NEVER,
) -> list[Proposal]:
    """The best sequences for the surface `points` [n, 3] with noise of deviation `sigma`, cheapest first.

    Candidates that begin with a cut, and those with intersections, are left out; single primitives fitted to the whole cloud are added, so
    there is always an answer unless the cloud has no extent. `axes` [3, 3] has the part's main directions as columns (default: the
    coordinate axes). Past the `deadline` (by default never) numbers and sequences stay as they are by then.
    """
    config = config or ProposalConfig()
    cloud = Cloud.of(subsample(points, config.most), sigma)
    given = [c for c in candidates if c and c[0].positive and all(step.op != "intersection" for step in c)]
    return _Repairs(cloud, np.eye(3) if axes is None else axes, config, deadline).settle(given)


@dataclass(frozen=True)
class _Repairs:
    cloud: Cloud
    axes: np.ndarray
    config: ProposalConfig
    deadline: Deadline

    def settle(self, given: Sequence[Signed]) -> list[Proposal]:
        cloud, config = self.cloud, self.config
        level = [map_terms(sequence, self._level) for sequence in given]
        starts = dict.fromkeys([*level, *given, *((Step("union", p),) for p in whole(cloud, self.axes))])
        ranked = self._rank([self._fit(s, config.first, config.seen) for s in starts])
        extra = distinct([p for r in ranked for _, p in r.signed], cloud)[: config.pool_limit]
        return sorted((self._repair(r, extra) for r in ranked[: config.finalists]), key=lambda r: r.cost)

    def _fit(self, signed: Signed, config: RefineConfig, count: int) -> Signed:
        found = refine(to_program(signed), subsample(self.cloud.points, count), config=config, deadline=self.deadline)
        return with_leaves(signed, found.program)

    def _rank(self, sequences: Sequence[Signed]) -> list[Proposal]:
        """The different sequences, cheapest first."""
        unique = list(dict.fromkeys(sequences))
        return sorted(map(Proposal, unique, self._costs(unique)), key=lambda p: p.cost)

    def _costs(self, sequences: Sequence[Signed]) -> list[float]:
        """Over one pool of all their primitives."""
        place = {p: i for i, p in enumerate(dict.fromkeys(p for signed in sequences for _, p in signed))}
        pool = PrimitivePool.of([*place], self.cloud, self.config.pool, self.config.seen)
        return pool.costs([map_terms(signed, place.__getitem__) for signed in sequences]).tolist()

    def _repair(self, start: Proposal, extra: Sequence[Primitive]) -> Proposal:
        """Choose, fit, guess what is missing, and again, until the cost no longer falls."""
        config = self.config
        stage = FittingStage[Signed](lambda signed: [self._fit(signed, config.again, config.seen), signed], 1)
        best, cost = search_locally(
            (start.signed, start.cost),
            lambda signed: [self._choose(signed, extra)],
            [stage],
            self._costs,
            lambda *_: WORTH,
            config.rounds,
            self.deadline,
        )
        return Proposal(best, cost) if self.deadline.has_passed() else self._rank([self._fit(best, config.last, config.most), best])[0]

    def _choose(self, signed: Signed, extra: Sequence[Primitive]) -> Signed:
        """The cheapest that single changes lead to, over its primitives, variants of them, `extra` ones and guesses of what is missing."""
        program, cloud, config = to_program(signed), self.cloud, self.config
        # beyond this a point is not explained: several times the noise of those that are
        middle = np.median(np.abs(kernels.program_sdf(program, cloud.points)))
        off = float(np.clip(4 * middle, 0.01 * cloud.diagonal, 0.04 * cloud.diagonal))
        guesses = missing(program, cloud, self.axes, off)
        own, others = [p for _, p in signed], [*self._vary(signed, off), *extra, *guesses]
        primitives = [*own, *(p for p in distinct([*own, *others], cloud) if p not in set(own))]
        pool = PrimitivePool.of(primitives, cloud, config.pool, config.seen)
        start: Choice = tuple(Step(op, i) for i, (op, _) in enumerate(signed))
        return map_terms(best_choice(pool, start, config.pool)[0], pool.primitives.__getitem__)

    def _vary(self, signed: Signed, off: float) -> list[Primitive]:
        """The primitives levelled, trimmed to the points that they explain, and exchanged for others that explain these."""
        cloud = self.cloud
        leaf, value, _, _ = kernels.program_tangent(to_program(signed), cloud.points)
        near = np.abs(value) < off
        out = [self._level(p) for _, p in signed]
        for i, (op, primitive) in enumerate(signed):
            own = near & (leaf == i)
            out += trim(primitive, cloud.points[own]) + alternatives(cloud.points[own], self.axes, cloud)
            if op == "union" and own.any():
                out += hollows(primitive, float(np.median(np.abs(value[own]))), cloud)
        return out

    def _level(self, primitive: Primitive) -> Primitive:
        """Turned into the nearest directions of the part, where these are near; an outline keeps its turn about its axis, and stays."""
        if primitive.outline is not None:
            return primitive
        rotation, axes = matrix_from_euler(primitive.rotation), self.axes
        if primitive.kind == "box":
            near = max((axes @ s for s in SYMMETRIES), key=lambda f: float((f * rotation).sum()))
            cosine = (float((near * rotation).sum()) - 1) / 2
        else:
            along = rotation[:, 2] @ axes
            k = int(np.abs(along).argmax())
            near, cosine = frame_from_axis(axes[:, k]), abs(float(along[k]))
        level = cosine > np.cos(np.radians(self.config.level_deg))
        return replace(primitive, rotation=euler_from_matrix(near)) if level else primitive
