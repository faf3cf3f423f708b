"""How likely a noisy cloud is for many choices among the same parts: what depends on one part alone is computed once.

The density is that of `likelihood`, over coarser samples. Which of a part's samples lie within every other part is kept in bits, and how
near each point lies to them as densities, so that a choice costs a pass over bits and a sum: a thousand choices take about a second.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.spatial import KDTree

from imdim.geometry import kernels
from imdim.geometry.sampling import even_surface
from imdim.geometry.surface_map import surface_area
from imdim.program.tree import Combine, Program, leaves
from imdim.solve.likelihood import GAP, WIDE, Noise
from imdim.solve.parsimony import SKIN, numbers
from imdim.solve.pool import Choice

SAMPLES = 2048  # of the program's surface
STEP = 1e-5  # from a surface to either side, of the cloud's diagonal
MOST = 6144  # of one part's surface
NEIGHBOURS = 14  # samples of one part near a point
LOOSE = 1.5  # times the noise: parts that were not fitted yet lie a little off

Steps = tuple[tuple[Program, bool], ...]


def to_steps(program: Program) -> Steps:
    """The signed sequence of which `program` is the left fold.

    Unions on the right are taken apart; what else is no primitive stays whole, and so does what is below intersections.
    """
    steps: Steps = ()
    while isinstance(program, Combine) and program.op != "intersection":
        parts, positive = to_steps(program.right), program.op == "union"
        united = all(sign for _, sign in parts)
        steps = (*(((part, positive) for part, _ in parts) if united else ((program.right, positive),)), *steps)
        program = program.left
    return ((program, True), *steps)


def folded(steps: Steps) -> Program:
    """The left fold of a sequence that begins with something positive."""
    program = steps[0][0]
    for part, positive in steps[1:]:
        program = Combine("union" if positive else "difference", program, part)
    return program


@dataclass(frozen=True)
class Sampled:
    """A part seen alone: samples of its surface with outward `normals` [s, 3], of which `near` [n, k] lie near a point (-1 for none), and
    the `density` [n, k] that they lend it."""

    points: np.ndarray
    normals: np.ndarray
    near: np.ndarray
    density: np.ndarray


class Scene:
    """The points [n, 3] that parts are judged by, with what was computed for single parts. `area`: of the surface that gets SAMPLES.

    They may stand for a cloud of `count` points: the more, the less a number of a program weighs.
    """

    def __init__(self, points: np.ndarray, noise: Noise, area: float, count: int | None = None):
        self.points, self.gap, self.count = points, GAP * noise.sigma, count or len(points)
        self.noise = Noise(LOOSE * noise.sigma, noise.clutter)
        self.spacing = math.sqrt(area / SAMPLES)
        self.wide = max(self.noise.sigma, WIDE * self.spacing)
        self.step = STEP * float(np.linalg.norm(np.ptp(points, axis=0)))
        self.box = float(np.prod(np.maximum(np.ptp(points, axis=0), self.noise.sigma)))
        self._seen: dict[Program, Sampled] = {}

    def sampled(self, part: Program) -> Sampled:
        """The part's samples and densities, computed when first asked for."""
        if part not in self._seen:
            places, normals = _samples(part, self.spacing, self.step)
            self._seen[part] = Sampled(places, normals, *_near(places, normals, self.points, self.noise.sigma, self.wide))
        return self._seen[part]


@dataclass(frozen=True)
class Mixture:
    """Tables over `parts` (p) for the points of a scene: samples of part i are `starts[i]` to `starts[i + 1]`; `own` [p] is how many
    numbers a part has. Only the first parts, the settled ones, may stand together; of the others a choice has one at most.

    Which parts hold the places just behind and ahead of a sample, and those a gap away, is in `sides` [settled, s, 4] for the settled,
    in `over` [others, s of the settled, 4] for the others, and in `selves` [s, 4] for the sample's own part.
    """

    scene: Scene
    parts: tuple[Program, ...]
    starts: np.ndarray
    sides: np.ndarray
    over: np.ndarray
    selves: np.ndarray
    near: np.ndarray
    density: np.ndarray
    own: np.ndarray

    @staticmethod
    def of(scene: Scene, settled: Sequence[Program], others: Sequence[Program]) -> Mixture:
        parts = (*settled, *others)
        drawn = [scene.sampled(p) for p in parts]
        starts = np.cumsum([0, *(len(d.points) for d in drawn)])
        places, normals = np.concatenate([d.points for d in drawn]), np.concatenate([d.normals for d in drawn])
        offsets = np.array([-scene.step, scene.step, -scene.gap, scene.gap])
        probes = (places[:, None] + offsets[:, None] * normals[:, None]).reshape(-1, 3)
        known = 4 * starts[len(settled)]
        sides, over = _sides(settled, probes), _sides(others, probes[:known])
        spans = zip(parts, 4 * starts[:-1], 4 * starts[1:], strict=True)
        selves = np.concatenate([kernels.inside(part, probes[a:b]) for part, a, b in spans]).reshape(-1, 4)
        near, density = np.stack([d.near for d in drawn]), np.stack([d.density for d in drawn])
        return Mixture(scene, parts, starts, sides, over, selves, near, density, np.array([numbers(p) for p in parts]))

    def lengths(self, choices: Sequence[Choice], every: int = 1) -> np.ndarray:
        """Nats per point of the message that tells the points by each choice (see `parsimony`); infinite where nothing is left.

        Only each so-manieth point is looked at.
        """
        width = max(map(len, choices), default=0)
        both = np.array([[*c, *((-1, False),) * (width - len(c))] for c in choices], np.int64).reshape(len(choices), width, 2)
        scene, clutter = self.scene, self.scene.noise.clutter
        lattice = 1.5 * math.log(2 * math.pi) + math.log(scene.noise.sigma) + 2 * math.log(scene.wide)
        arrays = self.starts, self.sides, self.over, self.selves, self.near, self.density
        nll, skin = _lengths(both[..., 0], both[..., 1] > 0, *arrays, every, clutter / scene.box, math.log1p(-clutter) - lattice)
        n = scene.count
        own = np.array([sum(self.own[i] for i, _ in c) for c in choices])
        return nll + 0.5 * own * math.log(n) / n + SKIN * skin

    def steps(self, choice: Choice) -> Steps:
        return tuple((self.parts[i], sign) for i, sign in choice)


def _sides(parts: Sequence[Program], probes: np.ndarray) -> np.ndarray:
    """Which of the parts [p] hold which of the probes, four of each sample: [p, s, 4]."""
    out = np.zeros((len(parts), len(probes) // 4, 4), bool)
    for held, part in zip(out, parts, strict=True):
        held[:] = kernels.inside(part, probes).reshape(-1, 4)
    return out


def _samples(part: Program, spacing: float, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Points and outward normals [s, 3] of a part's own surface, one per square of the spacing, within limits."""
    drawn = []
    for leaf in leaves(part):
        count = int(np.clip(math.ceil(surface_area(leaf.kind, leaf.size) / spacing**2), 16, MOST))
        drawn.append(even_surface(leaf, count))
    points, normals = (np.concatenate(c) for c in zip(*drawn, strict=True))
    if not isinstance(part, Combine):
        return points, normals
    behind, ahead = (kernels.inside(part, points + side * normals) for side in (-step, step))
    normals = np.where(behind, 1.0, -1.0)[:, None] * normals
    return points[behind != ahead], normals[behind != ahead]


def _near(places: np.ndarray, normals: np.ndarray, points: np.ndarray, sigma: float, wide: float) -> tuple[np.ndarray, np.ndarray]:
    """Of each point the nearest samples [n, k] and their densities, relative to that of a sample at its own place."""
    if not len(places):
        return np.full((len(points), NEIGHBOURS), -1, np.int32), np.zeros((len(points), NEIGHBOURS), np.float32)
    found = np.asarray(KDTree(places).query(points, k=NEIGHBOURS, distance_upper_bound=3 * wide)[1]).reshape(len(points), -1)
    none = found >= len(places)
    found = np.where(none, 0, found)
    away = points[:, None] - places[found]
    along = np.einsum("nkc,nkc->nk", away, normals[found])
    across = np.maximum((away**2).sum(-1) - along**2, 0.0)
    density = np.exp(-0.5 * ((along / sigma) ** 2 + across / wide**2))
    return np.where(none, -1, found).astype(np.int32), density.astype(np.float32)


@njit(nogil=True, cache=True)
def _lengths(index, sign, starts, sides, over, selves, near, density, every, strewn, held):  # pragma: no cover - compiled
    count, n = len(index), near.shape[1]
    nll, skin = np.full(count, np.inf), np.zeros(count)
    visible = np.zeros(starts[-1], np.bool_)
    for c in range(count):
        k = 0
        while k < index.shape[1] and index[c, k] >= 0:
            k += 1
        shown, thin = _show(index[c, :k], sign[c, :k], starts, sides, over, selves, visible)
        if shown == 0:
            continue
        peak = held - math.log(shown)
        clutter = strewn / math.exp(peak)
        log = 0.0
        for i in range(0, n, every):
            total = clutter
            for t in range(k):
                e = index[c, t]
                for j in range(near.shape[2]):
                    q = near[e, i, j]
                    if q < 0:
                        break
                    if visible[starts[e] + q]:
                        total += density[e, i, j]
            log += math.log(total)
        nll[c] = -(log / ((n + every - 1) // every) + peak)
        skin[c] = thin / shown
    return nll, skin


@njit(nogil=True, cache=True)
def _show(index, sign, starts, sides, over, selves, visible):  # pragma: no cover - compiled
    """Marks the samples of the fold's surface, but those that face it across a gap; how many, and how many of them have a thin wall."""
    shown, thin = 0, 0
    for e in index:
        for s in range(starts[e], starts[e + 1]):
            behind, ahead, deep, far = False, False, False, False
            for u in range(len(index)):
                o = index[u]
                held = selves[s] if o == e else sides[o, s] if o < len(sides) else over[o - len(sides), s]
                if held[0]:
                    behind = sign[u]
                if held[1]:
                    ahead = sign[u]
                if held[2]:
                    deep = sign[u]
                if held[3]:
                    far = sign[u]
            if ahead:
                deep, far = far, deep
            visible[s] = behind != ahead and not far
            if visible[s]:
                shown += 1
                if not deep:
                    thin += 1
    return shown, thin
