"""Phase 2, the projector: a cube skeleton and weights W fit a noisy box cloud.

``python examples/phases/phase2_projection.py [picture.png] [seed]``

First the skeleton stays a cube and W alone adapts; then the corners may move too, as far as the right angles of a box allow.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from cloud_fit import fit
from outlines import project_on_faces, to_faces

from imdim.sketch import named
from sketch import CLOUD, POINT, VIEW, Panel, write

CORNERS = np.array([[b & 1, b >> 1 & 1, b >> 2] for b in range(8)], float)


@dataclass(frozen=True)
class Fitted:
    """Root mean squares in model units; `weights` [m, 8] project the corners [8, 3] to the cloud."""

    cube_rms: float
    rms: float
    corners: np.ndarray
    weights: np.ndarray
    violation: float


def box_cloud(sizes: np.ndarray, count: int, noise: float, rng: np.random.Generator) -> np.ndarray:
    """Points [count, 3] spread evenly over a box about the origin, turned at random, with normal noise in model units."""
    areas = np.repeat(sizes.prod() / sizes, 2)
    face = rng.choice(6, count, p=areas / areas.sum())
    points = rng.uniform(-0.5, 0.5, (count, 3))
    points[np.arange(count), face // 2] = face % 2 - 0.5
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    turn = q * np.sign(np.diag(r))
    return (points * sizes) @ turn.T + noise * rng.normal(size=(count, 3))


def fit_box(cloud: np.ndarray) -> Fitted:
    """Both steps, from a cube along the cloud's axes of inertia."""
    center = cloud.mean(axis=0)
    axes = np.linalg.svd(cloud - center, full_matrices=False)[2]
    start = center + (CORNERS - 0.5) * np.ptp((cloud - center) @ axes.T, axis=0).mean() @ axes
    still = cloud - project_on_faces(cloud, start, named.CUBE_FACES) @ start
    corners, rms, violation = fit(named.box(), start, to_faces(cloud, named.CUBE_FACES))
    weights = project_on_faces(cloud, corners, named.CUBE_FACES)
    return Fitted(float(np.sqrt((still**2).sum(axis=1).mean())), rms, corners, weights, violation)


def run(picture: Path, seed: int = 0) -> tuple[Fitted, np.ndarray]:
    """The fit, and the true sizes [3]."""
    rng = np.random.default_rng(seed)
    sizes = rng.uniform(1, 3, 3)
    cloud = box_cloud(sizes, 1500, 0.02, rng)
    fitted = fit_box(cloud)
    panel = Panel(f"box cloud, rms {fitted.rms:.3f}", cloud, VIEW)
    panel.dots(cloud, 1.2, CLOUD)
    panel.lines(fitted.corners, named.CUBE_EDGES)
    panel.dots(fitted.corners, 5, POINT)
    projected = Panel("W @ corners", cloud, VIEW)
    projected.dots(fitted.weights @ fitted.corners, 1.2, CLOUD)
    write([panel, projected], picture)
    return fitted, sizes


def main() -> None:
    picture = Path(sys.argv[1] if len(sys.argv) > 1 else "out/phases/phase2_projection.png")
    fitted, sizes = run(picture, int(sys.argv[2]) if len(sys.argv) > 2 else 0)
    edges = np.sort([np.linalg.norm(fitted.corners[a] - fitted.corners[0]) for a in (1, 2, 4)])
    print(f"rms {fitted.cube_rms:.3f} with W alone on a cube, {fitted.rms:.4f} with the corners; violation {fitted.violation:.1e}")
    print(f"sizes {edges.round(3)}, planted {np.sort(sizes).round(3)}; {picture}")


if __name__ == "__main__":
    main()
