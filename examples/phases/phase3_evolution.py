"""Phase 3, the evolution: what makes a cloud a rectangle? ``python examples/phases/phase3_evolution.py [picture.png] [seed]``

From a noisy outline alone, evolution finds how many corners there are and the constraints that restore them: five that fix the shape, such
as four distances and one angle.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from theory_evolution import Generation, evolve

from imdim.sketch.freedom import freedom
from sketch import CLOUD, POINT, Panel, write


@dataclass(frozen=True)
class Planted:
    sides: tuple[float, float]
    cloud: np.ndarray  # [m, 3], in the plane z = 0


def rectangle_cloud(rng: np.random.Generator, count: int = 200) -> Planted:
    """The outline of a rectangle with sides 1 to 4, anywhere and turned, with normal noise of 0.5 to 2 % of its diagonal."""
    w, h = (float(v) for v in rng.uniform(1, 4, 2))
    s = rng.uniform(0, 2 * (w + h), count)
    side = np.searchsorted([w, w + h, 2 * w + h], s)
    x = np.choose(side, [s, w, 2 * w + h - s, 0.0])
    y = np.choose(side, [0.0, s - w, h, 2 * (w + h) - s])
    flat = np.column_stack([x, y]) + rng.normal(size=(count, 2)) * rng.uniform(0.005, 0.02) * np.hypot(w, h)
    a = rng.uniform(0, 2 * np.pi)
    turned = flat @ np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]]) + rng.normal(size=2)
    return Planted((w, h), np.column_stack([turned, np.zeros(count)]))


def is_rectangle(found: Generation, sides: tuple[float, float], degrees: float = 2.0) -> bool:
    """Four points and five independent constraints, whose shape has right angles to `degrees` and the sides to 3 % of the diagonal."""
    theory, x = found.theory, found.points[:, :2]
    if (theory.n_points, len(theory.constraints)) != (4, 5) or freedom(theory, found.points).verdict != "well-constrained":
        return False
    edges = np.roll(x, -1, axis=0) - x
    lengths = np.linalg.norm(edges, axis=1)
    cosines = (edges * np.roll(edges, 1, axis=0)).sum(axis=1) / (lengths * np.roll(lengths, 1))
    apart = np.abs(np.sort(lengths) - np.sort([*sides, *sides])).max()
    return bool(np.abs(cosines).max() < np.sin(np.radians(degrees)) and apart < 0.03 * np.hypot(*sides))


def run(picture: Path, seed: int = 0) -> tuple[Generation, Planted]:
    rng = np.random.default_rng(seed)
    planted = rectangle_cloud(rng)
    generations = list(evolve(planted.cloud, rng=rng))
    panels = []
    for g in (generations[0], generations[len(generations) // 4], generations[-1]):
        size = f"{g.theory.n_points} points, {len(g.theory.constraints)} constraints"
        panel = Panel(f"generation {g.number}: {size}, F {g.fitness:.0f}", planted.cloud)
        panel.dots(planted.cloud, 2, CLOUD)
        panel.path(np.vstack([g.points, g.points[:1]]))
        panel.dots(g.points, 5, POINT)
        panels.append(panel)
    write(panels, picture)
    return generations[-1], planted


def main() -> None:
    picture = Path(sys.argv[1] if len(sys.argv) > 1 else "out/phases/phase3_evolution.png")
    best, planted = run(picture, int(sys.argv[2]) if len(sys.argv) > 2 else 0)
    print(f"planted a rectangle {planted.sides[0]:.3f} x {planted.sides[1]:.3f}; {best.theory.n_points} points and", end=" ")
    print("; ".join(map(str, best.theory.constraints)))
    verdict = freedom(best.theory, best.points).verdict
    print(f"{verdict}, rectangle: {is_rectangle(best, planted.sides)}, {best.stop} at generation {best.number}; {picture}")


if __name__ == "__main__":
    main()
