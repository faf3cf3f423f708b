"""Phase 1, the solver: eight random points snap to a perfect cube. ``python examples/phases/phase1_cube.py [picture.png] [seed]``"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from imdim.sketch import named
from imdim.sketch.freedom import freedom
from imdim.sketch.solver import Solution, random_starts, solve
from sketch import POINT, VIEW, Panel, write


def run(picture: Path, seed: int = 0) -> Solution:
    theory = named.cube()
    rng = np.random.default_rng(seed)
    start = random_starts(theory, 1, rng)[0]
    found = solve(theory, start, rng=rng)
    panels = []
    for title, points in (("random control points", start), (f"18 constraints, violation {found.violation:.0e}", found.points)):
        panel = Panel(title, points, VIEW)
        panel.lines(points, named.CUBE_EDGES)
        panel.dots(points, 5, POINT)
        panels.append(panel)
    write(panels, picture)
    return found


def main() -> None:
    picture = Path(sys.argv[1] if len(sys.argv) > 1 else "out/phases/phase1_cube.png")
    found = run(picture, int(sys.argv[2]) if len(sys.argv) > 2 else 0)
    verdict = freedom(named.cube(), found.points).verdict
    print(f"{found.stop} after {found.starts} start(s), violation {found.violation:.1e}; {verdict}; {picture}")


if __name__ == "__main__":
    main()
