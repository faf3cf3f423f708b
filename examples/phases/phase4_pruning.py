"""Phase 4, complexity and curvature. ``python examples/phases/phase4_pruning.py [picture.png] [seed]``

The complexity penalty prunes ten constraints on four points to five, the rank a cube's 42 to 18; virtual anchors, control points off the
cloud, turn a circle and an arc into two and three points where a polygon needs many.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
from cloud_fit import Distances, fit
from outlines import polygon_error, to_arc, to_circle
from phase3_evolution import rectangle_cloud
from theory_evolution import Generation, TheoryEvolution, complexity, evolve, free_polygon

from imdim.sketch import named
from imdim.sketch.freedom import freedom
from imdim.sketch.theory import SketchConstraint, Theory
from sketch import ANCHOR, CLOUD, POINT, Panel, write

CIRCLE = Theory(2, (), 2)  # the anchor and a point on the rim
ARC = Theory(3, (SketchConstraint("equal_length", (0, 1, 0, 2)),), 2)  # the anchor and both ends
NOISE, PENALTY = 0.01, 4.0


@dataclass(frozen=True)
class Curve:
    """`f` is F = sum of squared distances / (2 noise^2) + penalty * complexity; `polygon_f` the least of polygons with 3 to 8 corners."""

    points: np.ndarray
    radius: float
    rms: float
    violation: float
    f: float
    polygon_f: float


def over_constrained(corners: np.ndarray) -> Theory:
    """Four points, the six distances between them and the four angles at corners [4, 3]."""
    distances = [SketchConstraint("distance", (a, b), float(np.linalg.norm(corners[a] - corners[b]))) for a, b in combinations(range(4), 2)]
    angles = []
    for b in range(4):
        a, c = sorted(((b - 1) % 4, (b + 1) % 4))
        u, v = corners[a] - corners[b], corners[c] - corners[b]
        angles.append(SketchConstraint("angle", (a, b, c), math.acos(u @ v / (np.linalg.norm(u) * np.linalg.norm(v)))))
    return Theory(4, (*distances, *angles), 2)


def prune(cloud: np.ndarray, full: Theory, rng: np.random.Generator, penalty: float = PENALTY) -> Generation:
    """The last generation of an evolution that starts from the full theory alone."""
    return list(
        evolve(cloud, rng=rng, config=TheoryEvolution(penalty=penalty, population=32, strangers=8, corners=(4, 4)), seeds=[full] * 32)
    )[-1]


def full_cube() -> Theory:
    """12 edges, 24 right angles and six coplanar faces, of which 18 constraints suffice."""
    edges = [SketchConstraint("distance", pair, 1.0) for pair in named.CUBE_EDGES]
    right = [SketchConstraint("angle", (f[i - 1], f[i], f[(i + 1) % 4]), named.RIGHT) for f in named.CUBE_FACES for i in range(4)]
    return Theory(8, (*edges, *right, *(SketchConstraint("plane_distance", f) for f in named.CUBE_FACES)))


def arc_cloud(center: Sequence[float], radius: float, begin: float, sweep: float, rng: np.random.Generator, count: int = 300) -> np.ndarray:
    """Points [count, 3] along an arc counterclockwise from `begin`, radians, with normal radial noise."""
    a, r = begin + sweep * rng.uniform(size=count), radius + NOISE * rng.normal(size=count)
    return np.column_stack([center[0] + r * np.cos(a), center[1] + r * np.sin(a), np.zeros(count)])


def fit_curve(cloud: np.ndarray, theory: Theory) -> Curve:
    """CIRCLE or ARC, from the algebraic circle of Kasa 1976 and the widest gap of the cloud about its centre."""
    a = np.column_stack([2 * cloud[:, :2], np.ones(len(cloud))])
    x, y, _ = np.linalg.lstsq(a, (cloud[:, :2] ** 2).sum(axis=1), rcond=None)[0]
    turn = np.arctan2(cloud[:, 1] - y, cloud[:, 0] - x)
    order = np.argsort(turn)
    gaps = np.diff(turn[order], append=turn[order[0]] + 2 * np.pi)
    last = int(np.argmax(gaps))
    ends = cloud[order[[(last + 1) % len(cloud), last]]]
    start = np.vstack([[x, y, 0.0], ends[: theory.n_points - 1]])
    model: Distances = to_circle(cloud) if theory is CIRCLE else to_arc(cloud)
    points, rms, violation = fit(theory, start, model)
    radius = float(np.linalg.norm(points[1] - points[0]))
    sized = Theory(theory.n_points, (*theory.constraints, SketchConstraint("distance", (0, 1), radius)), 2)

    def score(square: float, size: float) -> float:
        return len(cloud) * square / (2 * NOISE**2) + PENALTY * size

    polygons = [score(polygon_error(cloud, free_polygon(cloud, n)[None])[0], n + 2 * (2 * n - 3)) for n in range(3, 9)]
    return Curve(points, radius, rms, violation, score(rms**2, complexity(sized)), min(polygons))


def run(picture: Path, seed: int = 0) -> tuple[Generation, Curve, Curve]:
    """The pruned rectangle, a circle of radius 1.3 about (0.4, -0.2), and an arc of 200 degrees of the same circle."""
    rng = np.random.default_rng(seed)
    cloud = rectangle_cloud(rng).cloud
    full = over_constrained(free_polygon(cloud, 4))
    pruned = prune(cloud, full, rng)
    panel = Panel(f"{len(full.constraints)} constraints pruned to {len(pruned.theory.constraints)}", cloud)
    panel.dots(cloud, 2, CLOUD)
    panel.path(np.vstack([pruned.points, pruned.points[:1]]))
    panel.dots(pruned.points, 5, POINT)
    panels, curves = [panel], []
    for theory, sweep in ((CIRCLE, 2 * np.pi), (ARC, np.radians(200))):
        cloud = arc_cloud((0.4, -0.2), 1.3, 0.5, sweep, rng)
        curve = fit_curve(cloud, theory)
        panels.append(_drawn(cloud, curve))
        curves.append(curve)
    write(panels, picture)
    return pruned, curves[0], curves[1]


def _drawn(cloud: np.ndarray, curve: Curve) -> Panel:
    panel = Panel(f"virtual anchor: r {curve.radius:.4f}, F {curve.f:.0f}; best polygon F {curve.polygon_f:.0f}", cloud)
    panel.dots(cloud, 2, CLOUD)
    spokes = curve.points[1:] - curve.points[0]
    begin, end = np.arctan2(spokes[[0, -1], 1], spokes[[0, -1], 0])
    sweep = (end - begin) % (2 * np.pi) if len(spokes) > 1 else 2 * np.pi
    a = begin + sweep * np.linspace(0, 1, 200)
    panel.path(curve.points[0] + curve.radius * np.column_stack([np.cos(a), np.sin(a), 0 * a]))
    panel.dots(curve.points[1:], 5, POINT)
    panel.dots(curve.points[:1], 5, ANCHOR)
    return panel


def main() -> None:
    picture = Path(sys.argv[1] if len(sys.argv) > 1 else "out/phases/phase4_pruning.png")
    pruned, *curves = run(picture, int(sys.argv[2]) if len(sys.argv) > 2 else 0)
    print(f"10 constraints pruned to {len(pruned.theory.constraints)}: {'; '.join(map(str, pruned.theory.constraints))}")
    cube, corners = full_cube(), np.array([[b & 1, b >> 1 & 1, b >> 2] for b in range(8)], float)
    free = freedom(cube, corners)
    print(f"cube of {len(cube.constraints)} constraints: {free.verdict}, {len(free.redundant)} redundant, {free.rank} needed")
    for name, curve in zip(("circle", "arc"), curves, strict=True):
        where = curve.points[0, :2].round(4).tolist()
        print(f"{name}: anchor {where}, radius {curve.radius:.4f}, F {curve.f:.0f} against {curve.polygon_f:.0f} of the best polygon")
    print(picture)


if __name__ == "__main__":
    main()
