"""A program beside the part that it is of: which feature made what of its surface, and how far both lie apart. Each is measured once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import trimesh
from manifold3d import Manifold
from scipy.spatial import KDTree

from imdim.delivery.evaluate import Scores, evaluate_solid, target_iou
from imdim.delivery.verdict import EXACT, SurfaceVerdict, judge
from imdim.export.delivered import Delivered
from imdim.export.edit import solid_of
from imdim.geometry.edge_solids import blend_solids, surface_with_blends
from imdim.geometry.kernels import program_sdf
from imdim.geometry.metrics import diagonal, nearest_distances
from imdim.geometry.refine import split_edges
from imdim.geometry.solid import to_trimesh
from imdim.geometry.triangles import distances, triangle_tree
from imdim.geometry.winding import winding_number
from imdim.program.tree import leaves
from imdim.target.target import Target

FINENESS = 60  # pieces of the program's surface along its diagonal
MOST_PIECES = 60_000
SAMPLES = 4000  # of a surface, for scores
INSIDE = 0.5  # winding number


class FeatureEvidence(NamedTuple):
    """The share of the part's surface that a feature explains, and how far the feature's own surface lies from the part."""

    explains: float
    off_mean: float
    off_max: float


@dataclass(frozen=True, eq=False)
class MeasuredProgram:
    """See the module. Features are counted as in the lab: primitives, and after them the edge features."""

    delivered: Delivered
    target: Target | None

    @cached_property
    def size(self) -> int:
        """How many features there are."""
        return sum(1 for _ in leaves(self.delivered.program)) + len(self.delivered.edges)

    @cached_property
    def names(self) -> list[str]:
        """What each feature is called, as the names of its numbers begin."""
        d = self.delivered
        return [*d.labels, *(feature.name for feature in d.edges)]

    @cached_property
    def solid(self) -> Manifold:
        """The exact solid; raises EditError where there is none."""
        return solid_of(self.delivered)

    @cached_property
    def iou(self) -> float | None:
        """The volume IoU with the part; None without a part and where that bounds no solid."""
        return None if self.target is None else target_iou(self.solid, self.target)[0]

    @cached_property
    def _pieces(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The program's surface in small pieces: middles [n, 3], areas [n], and the features [n] that made them."""
        d = self.delivered
        surface, owners = surface_with_blends(d.program, blend_solids(d.program, d.edges), d.segments)
        at = np.asarray(surface.vertices)
        vertices, faces, parents = split_edges(at, np.asarray(surface.faces), diagonal(at) / FINENESS, MOST_PIECES)
        corners = vertices[faces]
        areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
        return corners.mean(axis=1), areas, owners[parents]

    def owners_of(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The features [n] that made the program's surface next to `points` [n, 3], and the distances [n] to the middles of its pieces."""
        middles, _, owners = self._pieces
        far, nearest = KDTree(middles).query(points)
        return owners[nearest], far

    @cached_property
    def surface(self) -> trimesh.Trimesh:
        """The surface of the solid."""
        return to_trimesh(self.solid)

    def far(self, points: np.ndarray) -> np.ndarray:
        """Distances [n] of `points` [n, 3] to the program's surface."""
        return distances(triangle_tree(self.surface), points)

    def is_inside(self, point: np.ndarray) -> bool:
        """Whether a point [3] lies in the program without its blends."""
        return bool(program_sdf(self.delivered.program, point[None])[0] <= 0)

    # --- beside the part -----------------------------------------------------------------------------------------------

    @property
    def part(self) -> Target:
        """The part; raises ValueError without one."""
        if self.target is None:
            raise ValueError("there is no part to measure against: open a mesh or a cloud, and then the program")
        return self.target

    @cached_property
    def verdict(self) -> SurfaceVerdict:
        """What became of each region of the part's surface."""
        return judge(self.part, self.surface, self.delivered.segments, self.delivered.program)

    @cached_property
    def scores(self) -> Scores:
        """Exact IoU and distances."""
        return evaluate_solid(self.solid, self.part, SAMPLES)

    @cached_property
    def evidence(self) -> list[FeatureEvidence]:
        """What speaks for each feature."""
        elements, codes = self.verdict.elements, self.verdict.codes
        explained, _ = self.owners_of(elements.points)
        shares = np.bincount(explained, elements.areas * (codes == EXACT), self.size) / elements.areas.sum()
        middles, areas, owners = self._pieces
        off = self.part_distances(middles)
        total, worst = np.bincount(owners, areas, self.size), np.zeros(self.size)
        np.maximum.at(worst, owners, off)
        mean = np.bincount(owners, areas * off, self.size) / np.maximum(total, 1e-300)
        return [FeatureEvidence(*row) for row in zip(shares.tolist(), mean.tolist(), worst.tolist(), strict=True)]

    def part_distances(self, points: np.ndarray) -> np.ndarray:
        """Distances [n] of `points` [n, 3] to the part's surface, or to the nearest of its points."""
        part = self.part
        return nearest_distances(points, part.points) if part.mesh is None else distances(triangle_tree(part.mesh), points)

    def is_in_part(self, point: np.ndarray) -> bool | None:
        """Whether a point [3] lies in the part; None where that bounds no solid."""
        if self.target is None or self.target.mesh is None or not self.target.is_solid:
            return None
        return bool(winding_number(self.target.mesh, point[None])[0] > INSIDE)
