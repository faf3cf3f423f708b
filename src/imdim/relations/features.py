"""Features of leaves as numbers with variances, and which of them may be equal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from imdim.geometry.pose import Pose, Vector
from imdim.program.constraints import Ref
from imdim.relations.belief import DeterminedFaces
from imdim.relations.directions import Directions

LOOK = 4.5  # deviations within which a pair is a candidate
NEIGHBOURS = 4  # with which a feature is paired


@dataclass(frozen=True)
class KnownFeatures:
    """Features [n] as numbers with their variances and rows [n, 9 k]; hidden ones are left out."""

    refs: list[Ref]
    values: np.ndarray
    rows: np.ndarray
    variances: np.ndarray

    def pairs(self) -> Iterator[tuple[int, int]]:
        """Those that may be equal."""
        return near_pairs(self.values[:, None], self.variances)


def near_pairs(points: np.ndarray, variances: np.ndarray) -> Iterator[tuple[int, int]]:
    """Pairs of `points` [n, d] that may be equal, each point with its nearest few: what equals them equals the others too."""
    apart = np.abs(points[:, None] - points).max(2, initial=0.0) / np.sqrt(variances[:, None] + variances + 1e-300)
    np.fill_diagonal(apart, np.inf)
    nearest = np.argsort(apart, axis=1, kind="stable")[:, :NEIGHBOURS]
    found = {(min(i, j), max(i, j)) for i in range(len(points)) for j in nearest[i].tolist() if apart[i, j] <= LOOK}
    yield from sorted(found)


@dataclass(frozen=True)
class Places:
    """What the proposals read: the pose, the covariance [9 k, 9 k], what the cloud shows, the directions."""

    pose: Pose
    covariance: np.ndarray
    shown: DeterminedFaces
    directions: Directions

    def collect_known(self, refs: list[Ref], rows: list[tuple[float, np.ndarray]]) -> KnownFeatures:
        if not rows:
            return KnownFeatures([], np.zeros(0), np.zeros((0, len(self.covariance))), np.zeros(0))
        values, slopes = np.array([r[0] for r in rows]), np.array([r[1] for r in rows])
        index = np.flatnonzero(self.shown.rows(slopes))
        return KnownFeatures([refs[i] for i in index], values[index], slopes[index], self.variances(slopes[index]))

    def variances(self, slopes: np.ndarray) -> np.ndarray:
        """Those [n] of functions with the derivatives `slopes` [n, 9 k]."""
        return ((slopes @ self.covariance) * slopes).sum(1)

    def leaves(self) -> range:
        return range(len(self.pose.numbers.kinds))


def without_slope(direction: Vector) -> Vector:
    """A direction that stands, however uncertain: places along it are compared with each other, not with the origin."""
    return Vector(direction.value, np.zeros_like(direction.slope))


@dataclass(frozen=True)
class Centers:
    """Centres [n, d] of a group of leaves in the directions shown, and the deviation of each."""

    leaves: np.ndarray
    points: np.ndarray
    deviation: np.ndarray

    def without(self, leaf: int) -> Centers:
        others = self.leaves != leaf
        return Centers(self.leaves[others], self.points[others], self.deviation[others])


def centers_of(places: Places, group: Sequence[int], sides: Sequence[Vector]) -> Centers:
    """Those of `group` that are shown in all `sides`."""
    columns = [[places.pose.center(leaf).dot(without_slope(side)) for leaf in group] for side in sides]
    points = np.array([[row[0] for row in column] for column in columns]).T
    slopes = [np.array([row[1] for row in column]) for column in columns]
    deviation = np.sqrt(np.max([places.variances(s) for s in slopes], axis=0))
    shown = np.all([places.shown.rows(s) for s in slopes], axis=0)
    return Centers(np.array(group)[shown], points[shown], deviation[shown])
