"""Sketches and skeletons built point by point, so that their degrees of freedom are known without any Jacobian.

A new point in the plane is held by two independent constraints, one in space by three (Henneberg steps): the whole is rigid. Each
constraint left out then frees one motion, and each measured again on the finished points says nothing new.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from imdim.sketch.theory import SketchConstraint, Theory


@dataclass(frozen=True)
class Planted:
    theory: Theory
    points: np.ndarray  # [n, 3], at which every constraint holds
    dof: int
    redundant: tuple[int, ...]


def unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v)


def measure(kind: str, indices: tuple[int, ...], x: np.ndarray) -> SketchConstraint:
    """The constraint with the value that it has at x [n, 3], in closed forms other than the solver's: acos, Heron, a determinant."""
    p = x[list(indices)]
    if kind == "distance":
        return SketchConstraint(kind, indices, float(np.linalg.norm(p[0] - p[1])))
    if kind == "angle":
        return SketchConstraint(kind, indices, float(np.arccos(unit(p[0] - p[1]) @ unit(p[2] - p[1]))))
    a, b, c = (float(np.linalg.norm(p[i] - p[j])) for i, j in ((0, 1), (1, 2), (2, 0)))
    s = (a + b + c) / 2
    area = float(np.sqrt(max(s * (s - a) * (s - b) * (s - c), 0)))
    if kind == "line_distance":
        return SketchConstraint(kind, indices, 2 * area / a)
    volume = abs(float(np.linalg.det(np.stack([p[1] - p[0], p[2] - p[0], p[3] - p[0]]))))
    return SketchConstraint(kind, indices, volume / (2 * area))


def sketch(n: int, free: int, extra: int, rng: np.random.Generator) -> Planted:
    """In the plane: distances, angles, distances from lines and points on lines."""
    x = np.zeros((n, 3))
    x[1, :2] = rng.uniform(1, 1.5, 2)
    constraints = [measure("distance", (0, 1), x)]
    for new in range(2, n):
        choice = rng.integers(4)
        (a, b), x[new] = place(x[:new], 2, rng)
        if choice == 3:
            x[new] = x[a] + rng.uniform(1.3, 1.8) * (x[b] - x[a])
            constraints += [SketchConstraint("line_distance", (a, b, new), 0.0), measure("distance", (a, new), x)]
        else:
            second = [("distance", (b, new)), ("angle", (b, a, new)), ("line_distance", (a, b, new))][choice]
            constraints += [measure("distance", (a, new), x), measure(*second, x)]
    return finished(constraints, x, 2, free, extra, rng)


def skeleton(n: int, free: int, extra: int, rng: np.random.Generator) -> Planted:
    """In space: the same, and distances from planes."""
    x = np.zeros((n, 3))
    x[1:3] = np.array([[1.5, 0, 0], [0, 1.5, 0]]) + rng.uniform(-0.4, 0.4, (2, 3))
    constraints = [measure("distance", pair, x) for pair in ((0, 1), (0, 2), (1, 2))]
    for new in range(3, n):
        choice = rng.integers(4)
        (a, b, c), x[new] = place(x[:new], 3, rng)
        third = [("distance", (c, new)), ("angle", (c, a, new)), ("line_distance", (a, c, new)), ("plane_distance", (a, b, c, new))]
        constraints += [measure("distance", (a, new), x), measure("distance", (b, new), x), measure(*third[choice], x)]
    return finished(constraints, x, 3, free, extra, rng)


def place(x: np.ndarray, dimension: int, rng: np.random.Generator) -> tuple[list[int], np.ndarray]:
    """References and a point that they hold firmly, about as far from them as they are from each other."""
    while True:
        near = [int(i) for i in rng.choice(len(x), dimension, replace=False)]
        base = x[near]
        size = max(np.linalg.norm(p - q) for p, q in combinations(base, 2))
        spot = base.mean(axis=0) + np.append(rng.normal(size=dimension), [0] * (3 - dimension)) * 0.8 * size
        spokes = np.stack([unit(spot - p) for p in base])[:, :dimension]
        if abs(np.linalg.det(spokes)) > 0.15 and 0.5 < size < 4:
            return near, spot


def finished(
    constraints: list[SketchConstraint], x: np.ndarray, dimension: int, free: int, extra: int, rng: np.random.Generator
) -> Planted:
    gone = set(rng.choice(len(constraints), free, replace=False).tolist())
    kept = [c for i, c in enumerate(constraints) if i not in gone]
    held = {frozenset(c.indices) for c in constraints if c.kind == "distance"}
    absent = [pair for pair in combinations(range(len(x)), 2) if frozenset(pair) not in held]
    again = [absent[i] for i in rng.choice(len(absent), extra, replace=False)] if extra else []
    everything = kept + [measure("distance", pair, x) for pair in again]
    return Planted(Theory(len(x), tuple(everything), dimension), x, free, tuple(range(len(kept), len(everything))))


def planted_forty() -> list[Planted]:
    """20 sketches and 20 skeletons of 4 to 30 points: in turn rigid, with 1 to 5 freedoms, and rigid with 1 to 3 redundant distances."""
    out = []
    for number in range(40):
        rng = np.random.default_rng(1000 + number)
        build, n = (sketch, skeleton)[number % 2], int(np.linspace(4, 30, 20)[number // 2])
        n = max(n, 5)
        mode = number // 2 % 3
        free, extra = (0, int(rng.integers(1, 6)), 0)[mode], (0, 0, int(rng.integers(1, 4)))[mode]
        out.append(build(n, free, extra, rng))
    return out
