"""Films in a delivered solid: sheets far thinner than anything that was measured, where the target has nothing.

A film weighs nothing in a volume, yet it closes an opening: what is far from the target's surface and has both sides of the solid within a
hair of each other is one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh

from imdim.geometry.finish.cutter_walls import FILM
from imdim.geometry.metrics import diagonal
from imdim.geometry.triangles import distances, triangle_tree
from imdim.geometry.winding import Interior
from imdim.target.target import Target

FAR = 5.0  # of FILM: what lies no farther from the target stands for something of it
SAMPLES = 4000  # points of a solid's surface
LEAST = 2.5e-3  # share of the surface: tips of wedges are thin too
DEPTHS = 24  # steps in which a film's thickness is measured, each 3/4 of the one before


@dataclass(frozen=True)
class Film:
    """The `share` of a solid's surface that lies on films, their median `thickness`, and the `low` and `high` corner of their box, in
    model units."""

    share: float
    thickness: float
    low: tuple[float, ...]
    high: tuple[float, ...]

    def __str__(self) -> str:
        size = " x ".join(f"{b - a:.4g}" for a, b in zip(self.low, self.high, strict=True))
        place = ", ".join(f"{(a + b) / 2 + 0.0:.4g}" for a, b in zip(self.low, self.high, strict=True))
        share = f"{100 * self.share:.1f} % of its surface"
        return f"the result has a film {self.thickness:.1g} thick where the target is open, {share}, within {size} at ({place})"


def find_film(surface: trimesh.Trimesh, target: Target, furthest: float) -> Film | None:
    """What of the closed `surface` of a result is film, for a target that is solid; None where next to nothing is.

    `furthest` is the largest distance from the surface to the target.
    """
    if target.mesh is None or not target.is_solid or not len(surface.faces):
        return None
    size = diagonal(np.asarray(target.mesh.vertices))
    thick, far = FILM * size, FAR * FILM * size
    if furthest <= far:
        return None
    drawn = trimesh.sample.sample_surface(surface, SAMPLES, seed=0)
    points, inward = drawn[0], -surface.face_normals[drawn[1]]
    solid, away = Interior(surface), np.flatnonzero(distances(triangle_tree(target.mesh), points) > far)
    thin = away[~solid.contains(points[away] + thick * inward[away])] if len(away) else away
    if len(thin) < LEAST * SAMPLES:
        return None
    depths = thick * 0.75 ** np.arange(DEPTHS)
    out = ~solid.contains((points[thin] + depths[:, None, None] * inward[thin]).reshape(-1, 3)).reshape(DEPTHS, -1)
    # the least depth from which the film is left behind
    left = np.where(out.all(0), DEPTHS - 1, out.argmin(0) - 1)
    low, high = points[thin].min(0), points[thin].max(0)
    return Film(len(thin) / SAMPLES, float(np.median(depths[left])), tuple(low.tolist()), tuple(high.tolist()))
