"""Evolution of theories from a cloud in the plane: how many corners, and which constraints bring them back (design, sections 3.1, 5.3).

A theory is judged as a decoder: its control points are disturbed, the constraints pull them back, and the closed polygon through them is
compared with the cloud. What the constraints leave free stays disturbed and costs error; what they say twice costs complexity alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations

import numpy as np
from outlines import polygon_error, to_polygon

from imdim.sketch.descent import DescentConfig, polish
from imdim.sketch.solver import relax
from imdim.sketch.theory import SketchConstraint, Theory

KINDS = ("distance", "angle", "equal_length", "line_distance")
ROUND_ANGLE = math.pi / 12
SNAP = 0.05  # radians, or the share of a length, within which a value may be meant to be round or shared


@dataclass
class TheoryEvolution:
    """Settings. F = sum of squared distances / (2 noise^2) + `penalty` * complexity."""

    penalty: float = 4.0
    value_cost: float = 1.0  # of a number that is neither round nor shared; a point or a constraint costs 1
    kinds: tuple[str, ...] = ("distance", "angle")  # may also hold equal_length and line_distance
    corners: tuple[int, int] = (3, 6)
    population: int = 48
    elites: int = 8
    strangers: int = 16  # of each generation are drawn anew, as large as the best
    generations: int = 120
    review: int = 6  # generations without a better best after which all its neighbours are tried
    patience: int = 30  # generations without a better best
    decodings: int = 5
    disturb: float = 0.12  # of the cloud's extent


@dataclass(frozen=True)
class Generation:
    number: int
    theory: Theory
    points: np.ndarray  # [n, 3]: the polygon that the theory stands for, in place
    fitness: float
    stop: str | None = None  # why this is the last


def complexity(theory: Theory, value_cost: float = 1.0) -> float:
    """Points, constraints, and numbers that are neither round nor shared."""
    values = {(c.kind, c.value) for c in theory.constraints if c.value}
    return theory.n_points + len(theory.constraints) + value_cost * math.fsum(_novelty(*v) for v in values)


def _novelty(kind: str, value: float) -> float:
    """A right angle says nothing, one of 24 round angles half as much as a free number."""
    if kind != "angle" or not _is_multiple(value, ROUND_ANGLE):
        return 1.0
    return 0.0 if _is_multiple(value, math.pi / 2) else 0.5


def evolve(
    cloud: np.ndarray, *, rng: np.random.Generator, config: TheoryEvolution | None = None, seeds: Sequence[Theory] = ()
) -> Iterator[Generation]:
    """Generations, best first; the last has `stop`. The cloud [m, 3] lies along a closed polygon in the plane z = 0."""
    config = config or TheoryEvolution()
    judge = _Judge(cloud, config, rng)
    population = [*seeds] + [_random(judge, rng) for _ in range(config.population - len(seeds))]
    best, idle = math.inf, 0
    for number in range(config.generations):
        ranked = judge.ranked(population)
        score = judge.score(ranked[0])
        idle = 0 if score < best - 1e-9 else idle + 1
        best = min(best, score)
        stop = "no_progress" if idle >= config.patience else "generations_spent" if number == config.generations - 1 else None
        yield Generation(number, ranked[0], judge.place(ranked[0]), score, stop)
        if stop:
            return
        children = [_child(ranked, judge, rng) for _ in range(config.population - config.elites - config.strangers)]
        strangers = [_assembled(ranked[0], judge, rng) for _ in range(config.strangers)]
        neighbours = _swaps(ranked[0], judge) if idle and idle % config.review == 0 else []
        niches = [next((t for t in ranked if t.n_points == n), ranked[0]) for n in judge.polygons]
        population = ranked[: config.elites] + niches + children + strangers + neighbours


class _Judge:
    """Fitness of theories against one cloud, remembered; all disturbances are drawn once, so that a theory has one fitness."""

    def __init__(self, cloud: np.ndarray, config: TheoryEvolution, rng: np.random.Generator) -> None:
        self.cloud, self.config = cloud, config
        self.extent = float(np.linalg.norm(np.ptp(cloud, axis=0)))
        counts = range(config.corners[0], config.corners[1] + 1)
        self.polygons = {n: free_polygon(cloud, n) for n in counts}
        errors = [polygon_error(cloud, p[None])[0] * len(cloud) / max(len(cloud) - 2 * n, 1) for n, p in self.polygons.items()]
        self.variance = max(min(errors), (1e-6 * self.extent) ** 2)
        self.noise = {n: rng.normal(size=(config.decodings, n, 3)) * [1, 1, 0] * config.disturb * self.extent for n in counts}
        self.known: dict[Theory, float] = {}

    def score(self, theory: Theory) -> float:
        return self.known[theory]

    def ranked(self, population: Sequence[Theory]) -> list[Theory]:
        """Without doubles, best first."""
        fresh = list(dict.fromkeys(t for t in population if t not in self.known))
        for n in self.polygons:
            if group := [t for t in fresh if t.n_points == n]:
                self.known.update(zip(group, self._fitness(group, n), strict=True))
        return sorted(dict.fromkeys(population), key=self.score)

    def _fitness(self, theories: list[Theory], n: int) -> list[float]:
        many = self.config.decodings
        starts = np.tile(self.polygons[n] + self.noise[n], (len(theories), 1, 1))
        placed, worst = self._decode([t for t in theories for _ in range(many)], starts, n)
        error = polygon_error(self.cloud, placed).reshape(-1, many).mean(axis=1)
        broken = np.where(worst.reshape(-1, many).max(axis=1) < 1e-6, 0.0, 1e6)
        size = np.array([complexity(t, self.config.value_cost) for t in theories])
        return list(error * len(self.cloud) / (2 * self.variance) + broken + self.config.penalty * size)

    def _decode(self, theories: Sequence[Theory], starts: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
        scale = np.full(len(starts), self.extent)
        points, worst = relax(theories, starts, scale, DescentConfig(adam_steps=0, polish_steps=25))
        return _laid_on(points, self.polygons[n]), worst

    def place(self, theory: Theory) -> np.ndarray:
        n = theory.n_points
        return self._decode([theory], self.polygons[n][None], n)[0][0]

    def measured(self, kind: str, indices: tuple[int, ...], n: int) -> SketchConstraint:
        x = self.polygons[n][list(indices)]
        if kind == "equal_length":
            return SketchConstraint(kind, indices)
        if kind == "distance":
            return SketchConstraint(kind, indices, float(np.linalg.norm(x[0] - x[1])))
        if kind == "angle":
            u, v = x[0] - x[1], x[2] - x[1]
            return SketchConstraint(kind, indices, math.atan2(abs(u[0] * v[1] - u[1] * v[0]), float(u @ v)))
        t, w = x[1] - x[0], x[2] - x[0]
        return SketchConstraint(kind, indices, abs(t[0] * w[1] - t[1] * w[0]) / float(np.linalg.norm(t)))


def free_polygon(cloud: np.ndarray, n: int, turns: int = 5) -> np.ndarray:
    """The closed polygon [n, 3] of n corners nearest to the cloud [m, 3], from regular ones on its ellipse of inertia."""
    center = cloud.mean(axis=0)
    _, spread, axes = np.linalg.svd(cloud[:, :2] - center[:2], full_matrices=False)
    radii = 1.4 * spread / math.sqrt(len(cloud))
    distances = to_polygon(cloud)

    def evaluate(flat: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        apart, slopes = distances(np.column_stack([flat[0].reshape(-1, 2), np.zeros(n)]))
        return apart[None], slopes[..., :2].reshape(1, len(cloud), -1)

    found = []
    for turn in range(turns):
        a = 2 * np.pi * (np.arange(n) + turn / turns) / n
        start = center[:2] + (np.column_stack([np.cos(a), np.sin(a)]) * radii) @ axes
        flat = polish(evaluate, start.reshape(1, -1), DescentConfig(polish_steps=40))
        found.append((float((evaluate(flat)[0] ** 2).sum()), np.column_stack([flat.reshape(-1, 2), np.zeros(n)])))
    return min(found, key=lambda f: f[0])[1]


def _laid_on(points: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Polygons [b, n, 3], turned and shifted in the plane to lie best on the target [n, 3] (Kabsch, no reflection)."""
    p, q = points - points.mean(axis=1, keepdims=True), target - target.mean(axis=0)
    a = np.arctan2((p[..., 0] * q[:, 1] - p[..., 1] * q[:, 0]).sum(1), (p[..., :2] * q[:, :2]).sum((1, 2)))
    c, s = np.cos(a)[:, None], np.sin(a)[:, None]
    turned = np.stack([c * p[..., 0] - s * p[..., 1], s * p[..., 0] + c * p[..., 1], p[..., 2]], axis=2)
    return turned + target.mean(axis=0)


def _random(judge: _Judge, rng: np.random.Generator) -> Theory:
    theory = Theory(int(rng.integers(judge.config.corners[0], judge.config.corners[1] + 1)), (), 2)
    for _ in range(rng.integers(9)):
        theory = _add(theory, judge, rng)
    return theory


def _assembled(best: Theory, judge: _Judge, rng: np.random.Generator) -> Theory:
    theory = Theory(best.n_points, (), 2)
    for _ in best.constraints:
        theory = _add(theory, judge, rng, snapped=1.0)
    return theory


def _add(theory: Theory, judge: _Judge, rng: np.random.Generator, snapped: float = 0.7) -> Theory:
    kinds = judge.config.kinds
    options = _references(kinds[rng.integers(len(kinds))], theory.n_points)
    kind, indices = options[rng.integers(len(options))]
    if any((c.kind, c.indices) == (kind, indices) for c in theory.constraints):
        return theory
    new = judge.measured(kind, indices, theory.n_points)
    return _with(theory, [*theory.constraints, _snapped(new, theory.constraints) if rng.random() < snapped else new])


@cache
def _references(kind: str, n: int) -> list[tuple[str, tuple[int, ...]]]:
    """All constraints of a kind on n points, without their values; each once."""
    if kind == "equal_length":
        return [(kind, (*a, *b)) for a, b in combinations(combinations(range(n), 2), 2)]
    if kind == "distance":
        return [(kind, pair) for pair in combinations(range(n), 2)]
    pairs = [(a, b, c) for a, b in combinations(range(n), 2) for c in range(n) if c not in (a, b)]
    return [(kind, (a, c, b) if kind == "angle" else (a, b, c)) for a, b, c in pairs]


def _snapped(new: SketchConstraint, others: Sequence[SketchConstraint]) -> SketchConstraint:
    """A value near another of its kind takes that; an angle near a round one becomes round."""
    options = [c.value for c in others if c.kind == new.kind]
    width = SNAP * new.value
    if new.kind == "angle":
        width = SNAP
        options.append(min(round(new.value / ROUND_ANGLE), 12) * ROUND_ANGLE)
    near = [(_novelty(new.kind, v), abs(v - new.value), v) for v in options if abs(v - new.value) < width]
    return replace(new, value=min(near)[2]) if near else new


def _swaps(theory: Theory, judge: _Judge) -> list[Theory]:
    """The theory with one constraint less, and with any other in its place."""
    out = []
    for gone in range(len(theory.constraints)):
        rest = theory.only(i for i in range(len(theory.constraints)) if i != gone)
        used = {(c.kind, c.indices) for c in rest.constraints}
        options = [o for kind in judge.config.kinds for o in _references(kind, theory.n_points) if o not in used]
        news = [_snapped(judge.measured(*o, theory.n_points), rest.constraints) for o in options]
        out += [rest, *(_with(rest, [*rest.constraints, new]) for new in news)]
    return out


def _with(theory: Theory, constraints: Sequence[SketchConstraint]) -> Theory:
    return replace(theory, constraints=tuple(sorted(constraints, key=lambda c: (KINDS.index(c.kind), c.indices, c.value))))


def _remove(theory: Theory, rng: np.random.Generator) -> Theory:
    m = len(theory.constraints)
    gone = int(rng.integers(m)) if m else 0
    return theory.only(i for i in range(m) if i != gone)


def _retarget(theory: Theory, rng: np.random.Generator) -> Theory:
    """An angle becomes round, or a length takes the value of another."""
    if not theory.constraints:
        return theory
    entries = list(theory.constraints)
    k = int(rng.integers(len(entries)))
    if entries[k].kind == "angle":
        value = min(max(round(entries[k].value / ROUND_ANGLE), 0), 12) * ROUND_ANGLE
    else:
        same = [c.value for c in entries if c.kind == entries[k].kind]
        near = sorted(same, key=lambda v: abs(v - entries[k].value))[: 1 + len(same) // 2]
        value = near[rng.integers(len(near))]
        if rng.random() < 0.5:  # both move halfway
            mean = (value + entries[k].value) / 2
            entries = [replace(c, value=mean) if (c.kind, c.value) == (entries[k].kind, value) else c for c in entries]
            value = mean
    entries[k] = replace(entries[k], value=value)
    return _with(theory, entries)


def _resized(theory: Theory, judge: _Judge, rng: np.random.Generator) -> Theory:
    low, high = judge.config.corners
    n = int(np.clip(theory.n_points + rng.choice([-1, 1]), low, high))
    kept = [judge.measured(c.kind, c.indices, n) for c in theory.constraints if max(c.indices) < n]
    return _with(Theory(n, (), 2), kept)


def _crossed(a: Theory, b: Theory, rng: np.random.Generator) -> Theory:
    if a.n_points != b.n_points:
        return a
    pool = {(c.kind, c.indices): c for c in (*b.constraints, *a.constraints)}
    wanted = len(a.constraints) + int(rng.integers(-1, 2))
    keys = list(pool)
    return _with(a, [pool[keys[i]] for i in rng.permutation(len(keys))[: max(wanted, 0)]])


def _child(ranked: Sequence[Theory], judge: _Judge, rng: np.random.Generator) -> Theory:
    def parent() -> Theory:  # the best of three, at times among those with equally many corners
        n = rng.choice(list(judge.polygons))
        pool = ([t for t in ranked if t.n_points == n] if rng.random() < 0.3 else []) or ranked
        return pool[int(rng.integers(len(pool), size=3).min())]

    theory = _crossed(parent(), parent(), rng) if rng.random() < 0.3 else parent()
    for _ in range(rng.integers(1, 4)):
        choice = rng.random()
        if choice < 0.3:
            theory = _add(theory, judge, rng)
        elif choice < 0.6:
            theory = _remove(theory, rng)
        elif choice < 0.95:
            theory = _retarget(theory, rng)
        else:
            theory = _resized(theory, judge, rng)
    return theory


def _is_multiple(value: float, unit: float) -> bool:
    return abs(value / unit - round(value / unit)) < 1e-9
