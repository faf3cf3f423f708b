"""What the points of a cloud near an edge lie on: the sharp corner between two faces, a rolling ball's arc, or a bevel.

Across an edge the surface shows a curve: two straight faces, and between them nothing, an arc or a line. Points are that curve blurred by
the noise, at equal densities along it, and a few from anywhere; so the likelihood of each curve has a closed form, and the sizes that make
the points likeliest are found by narrowing a row of sizes. How sharply the likelihood falls off beside them is how well they are known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from imdim.detection.edge_kernels import blend_costs
from imdim.geometry.blended_edge import Track
from imdim.program.edges import EdgeKind

STEP = 1.25  # from one size to the next, of those that are tried
NARROWED = (0.2, 0.06, 0.015, 0.003)  # of a size, to either side: the rows of sizes that are tried next
MOVES = 4  # of a row of sizes, at most
BLUR = 0.3  # of a row's step, by which points may be off beside the noise, lest no size of the row meets them
SMALLEST = 1.0  # deviations of the noise: a blend's size
WIDEST = 0.85  # of the reach, up to which a blend may meet a face
STRAYS = np.array([0.003, 0.02, 0.08, 0.25])  # shares of points that lie on none of these faces
MOST = 700  # points that are asked
CURVED = 1e-3  # of a size, by which its second derivative is taken
RATIO = 1.1  # between two distances of a bevel that are not one


@dataclass(frozen=True, eq=False)
class Wedge:
    """Two faces in a section across their edge, which lies at 0: the unit normals [2, 2] into the wedge between them, and the unit vectors
    [2, 2] along either face away from the edge."""

    inward: np.ndarray
    along: np.ndarray

    @staticmethod
    def of(track: Track, sides: tuple[int, int]) -> Wedge:
        """The wedge on the `sides` of the two faces of a track."""
        inward = track.normals * np.array(sides)[:, None]
        return Wedge(inward, np.array([_across(inward[0], inward[1]), _across(inward[1], inward[0])]))

    @property
    def half(self) -> float:
        """Half the angle between the faces, in radians."""
        return math.acos(float(np.clip(self.along[0] @ self.along[1], -1, 1))) / 2


@dataclass(frozen=True)
class Profile:
    """A blend: a fillet's radius, or a bevel's distances along the first and the second face."""

    kind: EdgeKind
    sizes: tuple[float, ...]

    def scale(self, factor: float) -> Profile:
        """The same with sizes times `factor`."""
        return Profile(self.kind, tuple(size * factor for size in self.sizes))

    @property
    def either_way(self) -> tuple[Profile, ...]:
        """This, and where a bevel has two distances also that with the faces exchanged."""
        return (self,) if len(self.sizes) == 1 else (self, Profile(self.kind, self.sizes[::-1]))

    def starts(self, wedge: Wedge) -> tuple[float, float]:
        """How far from the edge it meets the first face and the second."""
        if self.kind == "chamfer":
            return self.sizes[0], self.sizes[-1]
        reach = self.sizes[0] / math.tan(wedge.half)
        return reach, reach


@dataclass(frozen=True, eq=False)
class Crossing:
    """Where points [n, 2] in the section lie on a blend: how far along it, from 0 on the first face to 1, and how far inside the wedge
    from it."""

    share: np.ndarray
    inside: np.ndarray
    length: float

    @staticmethod
    def of(points: np.ndarray, profile: Profile, wedge: Wedge) -> Crossing:
        first, second = profile.starts(wedge)
        one, two = wedge.along[0] * first, wedge.along[1] * second
        if profile.kind == "chamfer":
            way = two - one
            length = float(np.linalg.norm(way))
            way = way / length
            return Crossing((points - one) @ way / length, (points - one) @ _across(way, one + two), length)
        radius, turn = profile.sizes[0], math.pi - 2 * wedge.half
        middle = one + wedge.inward[0] * radius
        away = points - middle
        # from the first normal towards the second
        start, end = -wedge.inward[0], -wedge.inward[1]
        other = (end - start * math.cos(turn)) / math.sin(turn)
        angle = np.arctan2(away @ other, away @ start)
        return Crossing(angle / turn, radius - np.linalg.norm(away, axis=1), radius * turn)


@dataclass(frozen=True, eq=False)
class SeenEdge:
    """The points [n, 2] of a cloud about an edge in its section, no farther than `reach`, the deviation of their noise, and those of how
    far in either face lies."""

    wedge: Wedge
    points: np.ndarray
    reach: float
    sigma: float
    faces: tuple[float, float] = (0.0, 0.0)

    @cached_property
    def sharp(self) -> float:
        """The negative log-density of the points with a sharp corner."""
        return float(self._costs("chamfer", np.zeros((1, 2)), np.zeros(1))[0])

    def has_room(self, profile: Profile) -> bool:
        """Whether a blend meets both faces where they are seen."""
        return max(profile.starts(self.wedge)) <= WIDEST * self.reach

    def cost(self, profile: Profile, blur: float = 0.0) -> float:
        """The negative log-density of the points of a blend, of which those between the faces may be off by `blur` beside the noise."""
        return float(self._costs(profile.kind, np.array([[profile.sizes[0], profile.sizes[-1]]]), np.array([blur]))[0])

    def _costs(self, kind: EdgeKind, sizes: np.ndarray, blurs: np.ndarray) -> np.ndarray:
        """As `cost`, of blends of some sizes [k, 2], none where they are 0."""
        wedge = self.wedge
        return blend_costs(self.points, wedge.inward, wedge.along, self.reach, self.sigma, kind == "fillet", sizes, blurs, STRAYS)

    def likeliest(self, kind: EdgeKind, least: float = 0.0) -> tuple[Profile, float] | None:
        """The blend of one size under which the points are likeliest, and the negative log-density; None where there is no room for one, or
        the sharp corner is likelier, or no size of a coarse row is so by `least` nats."""
        room = WIDEST * self.reach * (math.tan(self.wedge.half) if kind == "fillet" else 1.0)
        first = max(SMALLEST * self.sigma, 1e-3 * self.reach)
        if room < first * STEP:
            return None
        row = first * STEP ** np.arange(int(math.log(room / first) / math.log(STEP)) + 1)
        best, cost = self._best(kind, row, BLUR * (STEP - 1))
        if cost > self.sharp - least or best == row[-1]:
            return None
        for width in NARROWED:
            best = self._narrow(kind, best, width)
        profile = Profile(kind, (float(best),))
        return profile, self.cost(profile)

    def _narrow(self, kind: EdgeKind, best: float, width: float) -> float:
        """The likeliest of a row of sizes about one, which moves along as long as that is its end."""
        for _ in range(MOVES):
            middle = best
            row = middle * (1 + width * np.linspace(-1, 1, 9))
            best, _ = self._best(kind, row, BLUR * width / 4)
            if abs(best - middle) < 0.99 * width * middle:
                break
        return best

    def _best(self, kind: EdgeKind, row: np.ndarray, blur: float) -> tuple[float, float]:
        costs = self._costs(kind, np.column_stack([row, row]), blur * row)
        return float(row[int(np.argmin(costs))]), float(costs.min())

    def unequal(self, profile: Profile) -> tuple[Profile, float]:
        """The likeliest bevel of two distances near one of equal ones, and the negative log-density."""
        best = np.array([profile.sizes[0], profile.sizes[-1]])
        for width in (0.5, 0.25, *NARROWED):
            steps = width * np.linspace(-1, 1, 7)[:, None]
            rows = np.concatenate([best * (1 + np.array(way) * steps) for way in ((1, 0), (0, 1), (1, 1), (1, -1))])
            rows = rows[(rows.min(axis=1) > 0) & (rows.max(axis=1) < WIDEST * self.reach)]
            if len(rows):
                best = rows[int(np.argmin(self._costs("chamfer", rows, BLUR * width / 3 * rows.max(axis=1))))]
        found = Profile("chamfer", tuple(best.tolist()))
        return found, self.cost(found)

    def deviation(self, profile: Profile) -> float:
        """The standard deviation of the size where the faces are, by how the likelihood falls off beside it; infinite where it does not."""
        step = self._step(profile)
        bend = (self._cost_beside(profile, step) + self._cost_beside(profile, -step) - 2 * self.cost(profile)) / step**2
        return 1 / math.sqrt(bend) if bend > 0 else math.inf

    def deviation_by_faces(self, profile: Profile) -> float:
        """The standard deviation that the size has from what is not known of where the faces are: the nearer one is, the larger is
        a fillet of the same points, by 1.7 times as much between faces at right angles."""
        step, known = self._step(profile), self.deviation(profile)
        square = 0.0
        for face, doubt in enumerate(self.faces if math.isfinite(known) else ()):
            moved = np.zeros(2)
            moved[face] = step
            shift = np.linalg.solve(self.wedge.inward, moved)
            farther, nearer = (replace(self, points=self.points + side * shift) for side in (-1, 1))
            twist = sum(
                sign * seen._cost_beside(profile, way * step)
                for seen, way, sign in ((farther, 1, 1), (farther, -1, -1), (nearer, 1, -1), (nearer, -1, 1))
            )
            square += (doubt * twist / (4 * step**2) * known**2) ** 2
        return math.sqrt(square)

    def _step(self, profile: Profile) -> float:
        return max(CURVED * max(profile.sizes), 0.1 * self.sigma)

    def _cost_beside(self, profile: Profile, by: float) -> float:
        """The cost of a blend larger by so much."""
        return self.cost(profile.scale(1 + by / max(profile.sizes)))


def see_edge(
    points: np.ndarray, wedge: Wedge, reach: float, sigma: float, offsets: tuple[float, float], faces: tuple[float, float] = (0.0, 0.0)
) -> SeenEdge:
    """An edge as `points` [n, 2] of its section show it within a reach, where the points of both faces lie inside these by `offsets`, with
    deviations of `faces`."""
    points = points - np.linalg.solve(wedge.inward, np.array(offsets))
    near = points[np.linalg.norm(points, axis=1) < reach]
    return SeenEdge(wedge, np.ascontiguousarray(near[:: len(near) // MOST + 1]), reach, sigma, faces)


def section_of(track: Track, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lengths or angles [n] along a track of points [n, 3], and their places [n, 2] in the section."""
    local = (points - track.origin) @ track.frame
    if not track.is_round:
        return local[:, 2], local[:, :2]
    return np.arctan2(local[:, 1], local[:, 0]), np.stack([np.hypot(local[:, 0], local[:, 1]) - track.radius, local[:, 2]], axis=1)


def _across(normal: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The unit vector across `normal` that leads to where `other` points."""
    way = np.array([-normal[1], normal[0]])
    return way if way @ other > 0 else -way
