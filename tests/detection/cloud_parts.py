"""Parts sampled face by face in closed form: points uniform by area, outward normals, carriers, and who is inside."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.detection.cloud_surfaces import detect_cloud
from imdim.detection.noise import measure_noise
from imdim.geometry.surface import Patch

Face = tuple[float, Callable[[np.random.Generator, int], tuple[np.ndarray, np.ndarray]]]


@dataclass(frozen=True)
class Part:
    """`carriers` are (kind, sorted sizes) of every surface that a detector should find; `inside` is exact."""

    faces: list[Face]
    carriers: list[tuple[str, tuple[float, ...]]]
    inside: Callable[[np.ndarray], np.ndarray]

    def sample(self, rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
        area = np.array([a for a, _ in self.faces])
        counts = rng.multinomial(n, area / area.sum())
        drawn = [draw(rng, int(m)) for (_, draw), m in zip(self.faces, counts, strict=True)]
        return np.vstack([p for p, _ in drawn]), np.vstack([q for _, q in drawn])


def rectangle(corner, u, v, normal, keep=lambda p: np.ones(len(p), bool), holes: float = 0.0) -> Face:
    """A parallelogram of orthogonal edges, less what `keep` rejects (of area `holes`)."""
    corner, u, v, normal = (np.array(a, float) for a in (corner, u, v, normal))

    def draw(rng, n):
        points = np.zeros((0, 3))
        while len(points) < n:
            s, t = rng.random((2, 2 * n + 10))
            more = corner + s[:, None] * u + t[:, None] * v
            points = np.vstack([points, more[keep(more)]])
        return points[:n], np.tile(normal, (n, 1))

    return float(np.linalg.norm(u) * np.linalg.norm(v)) - holes, draw


def ring(inner: float, outer: float, z: float, up: float, center=(0.0, 0.0)) -> Face:
    def draw(rng, n):
        r, t = np.sqrt(rng.uniform(inner**2, outer**2, n)), rng.uniform(0, 2 * np.pi, n)
        return np.stack([center[0] + r * np.cos(t), center[1] + r * np.sin(t), np.full(n, z)], 1), np.tile([0.0, 0.0, up], (n, 1))

    return math.pi * (outer**2 - inner**2), draw


def wall(radius: float, low: float, high: float, outward: float, center=(0.0, 0.0)) -> Face:
    def draw(rng, n):
        t, z = rng.uniform(0, 2 * np.pi, n), rng.uniform(low, high, n)
        normal = np.stack([np.cos(t), np.sin(t), 0 * t], 1)
        return radius * normal + np.stack([0 * t + center[0], 0 * t + center[1], z], 1), outward * normal

    return 2 * math.pi * radius * (high - low), draw


def slope(bottom: float, top: float, low: float, high: float) -> Face:
    """A cone's wall between two radii."""

    def draw(rng, n):
        r, t = np.sqrt(rng.uniform(min(bottom, top) ** 2, max(bottom, top) ** 2, n)), rng.uniform(0, 2 * np.pi, n)
        z = low + (high - low) * (r - bottom) / (top - bottom)
        out = np.array([high - low, bottom - top]) / math.hypot(high - low, bottom - top)
        normal = np.stack([out[0] * np.cos(t), out[0] * np.sin(t), np.full(n, out[1])], 1)
        return np.stack([r * np.cos(t), r * np.sin(t), z], 1), normal

    return math.pi * (bottom + top) * math.hypot(bottom - top, high - low), draw


def dome(radius: float) -> Face:
    """The upper half of a sphere."""

    def draw(rng, n):
        t, z = rng.uniform(0, 2 * np.pi, n), rng.random(n)
        normal = np.stack([np.sqrt(1 - z * z) * np.cos(t), np.sqrt(1 - z * z) * np.sin(t), z], 1)
        return radius * normal, normal

    return 2 * math.pi * radius**2, draw


def _tube(q: np.ndarray) -> np.ndarray:
    return np.hypot(q[:, 0], q[:, 1])


HOLES = [(-1.5, 0.0, 0.3), (1.5, 0.8, 0.3), (1.5, -0.8, 0.2)]


def plate() -> Part:
    """4 x 3 x 0.4 with three holes."""

    def solid(p):
        return np.all([np.hypot(p[:, 0] - x, p[:, 1] - y) > r for x, y, r in HOLES], axis=0)

    lost = sum(math.pi * r * r for _, _, r in HOLES)
    faces = [rectangle((-2, -1.5, z), (4, 0, 0), (0, 3, 0), (0, 0, np.sign(z)), solid, lost) for z in (-0.2, 0.2)]
    faces += [rectangle((x, -1.5, -0.2), (0, 3, 0), (0, 0, 0.4), (np.sign(x), 0, 0)) for x in (-2, 2)]
    faces += [rectangle((-2, y, -0.2), (4, 0, 0), (0, 0, 0.4), (0, np.sign(y), 0)) for y in (-1.5, 1.5)]
    faces += [wall(r, -0.2, 0.2, -1.0, (x, y)) for x, y, r in HOLES]
    carriers = [("plane", ())] * 6 + [("cylinder", (r,)) for *_, r in HOLES]
    return Part(faces, carriers, lambda q: (np.abs(q) < (2, 1.5, 0.2)).all(1) & solid(q))


def thin_tube() -> Part:
    """Radius 1, height 2, wall 0.04: 1.2 % of the diagonal, and less than the spacing of 8,192 points."""
    faces = [wall(1.0, -1, 1, 1.0), wall(0.96, -1, 1, -1.0), ring(0.96, 1.0, 1, 1.0), ring(0.96, 1.0, -1, -1.0)]
    carriers = [("plane", ())] * 2 + [("cylinder", (1.0,)), ("cylinder", (0.96,))]
    return Part(faces, carriers, lambda q: (np.abs(_tube(q) - 0.98) < 0.02) & (np.abs(q[:, 2]) < 1))


def lamp() -> Part:
    """A dome on a cone on a disc's rim."""
    faces = [dome(0.8), slope(1.2, 0.8, -1.0, 0.0), ring(0.0, 1.2, -1.0, -1.0)]
    carriers = [("plane", ()), ("sphere", (0.8,)), ("cone", (math.atan(0.4),))]

    def inside(q):
        up = (q[:, 2] >= 0) & (np.linalg.norm(q, axis=1) < 0.8)
        return up | ((q[:, 2] > -1) & (q[:, 2] < 0) & (_tube(q) < 0.8 - 0.4 * q[:, 2]))

    return Part(faces, carriers, inside)


PARTS = {"plate": plate, "thin_tube": thin_tube, "lamp": lamp}


def detected(points: np.ndarray, normals: np.ndarray | None, rng: np.random.Generator, deadline: Deadline = NEVER) -> list[Patch]:
    """The surfaces of a cloud with the noise that it shows."""
    return detect_cloud(points, normals, measure_noise(points, rng)[0], rng, deadline=deadline)[0]
