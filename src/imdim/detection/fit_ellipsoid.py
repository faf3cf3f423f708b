"""Ellipsoids through points: the quadric as a start, and what the descent on orthogonal distances needs to know."""

from __future__ import annotations

import numpy as np

from imdim.geometry.rotations import frame_from_axis, turn_about
from imdim.geometry.surface import Surface, ellipsoid_field, signed_distance, unit, vec

DRAWN = 1e-5  # of the diagonal, within which corners lie on the surface that they were made on, and semi-axes were drawn equal
LEAST_TURN = 0.13  # rms sine out of the plane that directions on the ball are nearest to; a cap of 15 degrees has it
_SQUARES = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))


def quadric_ellipsoid(points: np.ndarray) -> Surface | None:
    """The ellipsoid whose equation leaves the least sum of squares over `points` [n >= 9, 3]; None where the best quadric is none.

    Solved in coordinates of unit spread about the mean, since squares of far coordinates drown the rest.
    """
    middle = points.mean(0)
    size = float(np.sqrt(((points - middle) ** 2).sum(1).mean())) or 1.0
    q = (points - middle) / size
    squares = [(1 if i == j else 2) * q[:, i] * q[:, j] for i, j in _SQUARES]
    form = np.linalg.svd(np.column_stack([*squares, 2 * q, np.ones(len(q))]), full_matrices=False)[2][-1]
    square = np.empty((3, 3))
    for value, (i, j) in zip(form[:6], _SQUARES, strict=True):
        square[i, j] = square[j, i] = value
    values, axes = np.linalg.eigh(square)
    if abs(values).min() <= 1e-9 * abs(values).max() or len(set(np.sign(values))) > 1:
        return None
    center = -np.linalg.solve(square, form[6:9])
    level = float(center @ square @ center - form[9])
    if level * values[0] <= 0:
        return None
    sizes = size * np.sqrt(level / values)
    return make_ellipsoid(center * size + middle, axes, sizes)


def make_ellipsoid(center: np.ndarray, frame: np.ndarray, sizes: np.ndarray) -> Surface:
    """The surface with semi-axes `sizes` [3] along the columns of `frame` [3, 3]."""
    return Surface("ellipsoid", vec(center), vec(frame[:, 2]), vec(sizes), vec(frame[:, 0]))


def lies_on(surface: Surface, points: np.ndarray, diagonal: float, share: float = 0.5) -> bool:
    """Whether a share, by default half, of the corners [n, 3] lie on a surface to their last digits, since they were drawn there: nine
    numbers bend to many a surface that is no ellipsoid."""
    return float(np.quantile(np.abs(signed_distance(surface, points)), share)) <= DRAWN * diagonal


def shows_ellipsoid(surface: Surface, points: np.ndarray, tolerance: float) -> bool:
    """Whether points [n, 3] show that an ellipsoid is no ball, and no cylinder, whose points face directions of one plane."""
    if not len(points):
        return False
    ball = unit((points - surface.point) @ surface.frame / surface.sizes)
    turn = np.sqrt(max(float(np.linalg.eigvalsh(ball.T @ ball / len(ball))[0]), 0.0))
    return bool(turn > LEAST_TURN) and max(surface.sizes) - min(surface.sizes) > 2 * tolerance


def level_axes(surface: Surface, tolerance: float) -> Surface:
    """An ellipsoid, two of whose semi-axes are within a `tolerance`, with these equal: about the third its frame says nothing."""
    sizes, frame = np.asarray(surface.sizes), surface.frame
    for odd in range(3):
        a, b = (odd + 1) % 3, (odd + 2) % 3
        if abs(sizes[a] - sizes[b]) < tolerance:
            mean = float(sizes[a] + sizes[b]) / 2
            return make_ellipsoid(np.asarray(surface.point), frame_from_axis(frame[:, odd]), np.array([mean, mean, sizes[odd]]))
    return surface


def ellipsoid_residual(center: np.ndarray, frame: np.ndarray, sizes: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Signed distances [n] and their derivatives [n, 9] with respect to the step of `move_ellipsoid`; of an elliptic cylinder with an
    infinite third semi-axis, along which nothing changes.

    The derivatives are those on the surface, where the field is exact.
    """
    local = (points - center) @ frame
    level, slope = ellipsoid_field(local, sizes)
    slope = np.maximum(slope, 1e-12)
    facing = local / sizes**2 / slope[:, None]
    turn = -np.cross(local, facing)
    return level * (level - 1) / slope, np.column_stack([-facing @ frame.T, turn, -((local / sizes) ** 2) / slope[:, None]])


def move_ellipsoid(center: np.ndarray, frame: np.ndarray, sizes: np.ndarray, step: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A step [9]: of the centre, of a rotation in the frame (its vector, in radians), and of the logarithms of the semi-axes."""
    angle = float(np.linalg.norm(step[3:6]))
    turn = turn_about(step[3:6] / max(angle, 1e-300), angle)
    return center + step[:3], frame @ turn, sizes * np.exp(np.clip(step[6:], -0.5, 0.5))
