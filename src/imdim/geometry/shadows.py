"""What scanners at known places could not see: what lies behind the points of a cloud for all of them.

A ray that reached a point has passed through air, so that a surface before the points would have been seen. A surface behind them, as seen
from every scanner, bears no points whether it is there or not, nor does one that turns away from all of them, however near points lie; one
that they would have grazed may bear none. Each scanner's points make a map of depths (Curless & Levoy 1996, section 4,
carve the space before them in the same way).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from imdim.geometry.rotations import frame_from_axis
from imdim.geometry.sampling import EIGHTH, subsample, surface_spacing

CELL = 1.5  # spacings of the points, the side of a map's cell
ABOUT = 1.5  # cells about the middle of one in which points are asked: at the edge of a sheet only half of it has some
ASKED = 24  # of them at most, of several sheets behind one another
BLOCKING = 3  # of them must lie before a place: a stray throws no shadow
BEHIND = 3.0  # deviations of the noise, and one spacing, from which a place lies behind a point
BARE = 2.0  # spacings, and deviations of the noise, from the nearest point, from which a place has none
MOST_CELLS = 512  # of a map's side
AHEAD = 0.2  # least cosine to the middle of the view; points farther aside are not on the map
GRAZING = 0.17  # cosine to a scanner from which surfaces may send nothing back (80 degrees): without points they may be there


@dataclass(frozen=True, eq=False)
class DepthMap:
    """How far off the points lie for one scanner: `frame` [3, 3] has its right, its up and its line of sight as columns; `depth` [a, b] is
    over cells of side `cell` from `low` [2] on, both in a plane at depth 1; infinite where it saw none."""

    scanner: np.ndarray
    frame: np.ndarray
    low: np.ndarray
    cell: float
    depth: np.ndarray

    @staticmethod
    def of(points: np.ndarray, scanner: np.ndarray, spacing: float) -> DepthMap:
        """Of `points` [n, 3] that lie `spacing` apart."""
        way = points.mean(0) - scanner
        frame = frame_from_axis(way / max(float(np.linalg.norm(way)), 1e-300))
        places, depth = _project(points, scanner, frame)
        places, depth = places[depth > 0], depth[depth > 0]
        if not len(depth):
            return DepthMap(scanner, frame, np.zeros(2), 1.0, np.full((1, 1), np.inf))
        low, extent = places.min(0), float(np.ptp(places, axis=0).max())
        cell = max(CELL * spacing / float(np.median(depth)), extent / MOST_CELLS, 1e-300)
        shape = np.floor((places.max(0) - low) / cell).astype(int) + 1
        middles = low + cell * (np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), -1).reshape(-1, 2) + 0.5)
        near = KDTree(places).query(middles, k=min(ASKED, len(depth)), distance_upper_bound=ABOUT * cell)[1].reshape(len(middles), -1)
        behind = np.sort(np.append(depth, np.inf)[near], axis=1)
        return DepthMap(scanner, frame, low, cell, behind[:, min(BLOCKING, behind.shape[1]) - 1].reshape(shape))

    def blocks(self, places: np.ndarray, behind: float) -> np.ndarray:
        """Which of `places` [m, 3] lie more than `behind` the points that the scanner saw there."""
        at, depth = _project(places, self.scanner, self.frame)
        cell = np.floor((at - self.low) / self.cell).astype(int)
        on = (depth > 0) & (cell >= 0).all(1) & (cell < self.depth.shape).all(1)
        blocked = np.zeros(len(places), bool)
        blocked[on] = depth[on] > self.depth[tuple(cell[on].T)] + behind
        return blocked


@dataclass(frozen=True, eq=False)
class Shadows:
    """What no scanner could see, by its depth `maps`; `tree` holds the points, beyond `bare` of which a place has none."""

    maps: tuple[DepthMap, ...]
    tree: KDTree
    behind: float
    bare: float

    @staticmethod
    def of(points: np.ndarray, scanners: Sequence[np.ndarray] | np.ndarray, sigma: float) -> Shadows:
        """Of a cloud of `points` [n, 3], whose noise has the deviation `sigma`, as `scanners` [k, 3] saw it."""
        tree = KDTree(points)
        eighth = tree.query(subsample(points, 512), k=min(EIGHTH + 1, len(points)))[0][:, -1]
        spacing = surface_spacing(eighth)
        maps = tuple(DepthMap.of(points, np.asarray(scanner, float), spacing) for scanner in scanners)
        return Shadows(maps, tree, BEHIND * sigma + spacing, BARE * float(np.hypot(spacing, sigma)))

    def hide(self, places: np.ndarray, normals: np.ndarray | None = None) -> np.ndarray:
        """Which of `places` [m, 3] have no point near and lie behind points for every scanner, or, with their `normals` [m, 3], along its
        line of sight."""
        hidden = np.isinf(self.tree.query(places, distance_upper_bound=self.bare)[0])
        for map_ in self.maps:
            some = places[hidden]
            blocked = map_.blocks(some, self.behind)
            if normals is not None:
                blocked |= np.abs(slants(some, normals[hidden], map_.scanner[None])[0]) < GRAZING
            hidden[hidden] = blocked
        return hidden

    def hide_surface(self, places: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Which of the `places` of a solid's surface no scanner could see: hidden ones, and those whose outward `normals` [m, 3] turn away
        from every scanner, so that no point near them can be theirs."""
        return self.hide(places, normals) | ~self.face(places, normals)

    def face(self, places: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Whether surfaces at `places` with outward `normals` [m, 3] are turned towards a scanner."""
        return np.asarray((slants(places, normals, np.array([map_.scanner for map_ in self.maps])) > 0).any(0))


def slants(places: np.ndarray, normals: np.ndarray, scanners: np.ndarray) -> np.ndarray:
    """The cosines [k, m] between `normals` at `places` [m, 3] and the ways to `scanners` [k, 3]."""
    ways = np.asarray(scanners, float)[:, None] - places
    return np.einsum("kmi,mi->km", ways, normals) / np.maximum(np.linalg.norm(ways, axis=2), 1e-300)


def _project(points: np.ndarray, scanner: np.ndarray, frame: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where points [n, 3] stand in the scanner's plane at depth 1 [n, 2], and their depths [n]; 0 for what is not before it."""
    local = (points - scanner) @ frame
    depth = np.where(local[:, 2] > AHEAD * np.linalg.norm(local, axis=1), local[:, 2], 0.0)
    return local[:, :2] / np.where(depth > 0, depth, 1.0)[:, None], depth
