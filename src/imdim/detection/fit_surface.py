"""Least-squares fits of carrier surfaces to points: closed-form starts, then damped Gauss-Newton on orthogonal distances."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from imdim.detection.fit_ellipsoid import ellipsoid_residual, make_ellipsoid, move_ellipsoid
from imdim.detection.fit_kernels import CODES, UNKNOWNS, descend_surface
from imdim.detection.fit_start import starts
from imdim.geometry.sampling import subsample
from imdim.geometry.surface import FRAMED, SURFACE_KINDS, Surface, make_elliptic, signed_distance, vec

MIN_POINTS = {"plane": 3, "sphere": 4, "cylinder": 5, "cone": 6, "torus": 7, "ellipsoid": 9, "elliptic": 7}
UPRIGHT = np.eye(3)
# columns of the step that each way of holding the axis leaves out
_FROZEN: dict[str, tuple[int, ...]] = {"": (), "axis": (2, 3), "line": (0, 1, 2, 3)}
_FROZEN_FRAME: dict[str, dict[str, tuple[int, ...]]] = {
    "ellipsoid": {"": (), "axis": (3, 4, 5)},  # which has no line
    "elliptic": {"": (), "axis": (3, 4), "line": (0, 1, 2, 3, 4)},
}


@dataclass(frozen=True)
class _SurfaceState:
    """Moving frame of the iteration: a point, an axis and the kind's numbers; a cone is (radius at `point`, half angle of either sign).

    An ellipsoid and an elliptic cylinder have a `frame` [3, 3], their semi-axes, the third `sizes` of the latter being infinite.
    """

    kind: str
    point: np.ndarray
    axis: np.ndarray
    sizes: np.ndarray
    frame: np.ndarray = field(default_factory=lambda: UPRIGHT)


def fit_surface(
    kind: str,
    points: np.ndarray,
    normals: np.ndarray | None = None,
    start: Surface | None = None,
    *,
    scale: float | None = None,
    iterations: int = 30,
    hold: str = "",
) -> tuple[Surface, float]:
    """The surface of `kind` with the least squared orthogonal distances to `points` [n, 3], and the rms distance.

    `normals` [n, 3] (unit, of either sign) give the start; without them, and without `start`, a sweep of axis directions does.
    With `scale` the fit is robust: Tukey's biweight that ignores points farther than 3 `scale`, and the rms is the weighted one.
    With `hold` of "axis" the start's direction (an ellipsoid's three) is kept, with "line" the start's whole axis of revolution (a torus
    still slides along it).
    Raises ValueError for an unknown kind, too few points or numbers that are not finite, and for an elliptic cylinder without a start.
    """
    points = np.asarray(points, float)
    _check(kind, points)
    middle = points.mean(0)
    size = float(np.sqrt(((points - middle) ** 2).sum(1).mean())) or 1.0
    local = (points - middle) / size
    begin, reach = _scale(start, middle, size) if start else None, scale / size if scale else None
    if kind == "plane":
        surface, rms = _fit_plane(local, begin, reach, hold)
    else:
        frozen = _FROZEN_FRAME.get(kind, _FROZEN)[hold]
        surface, rms = _best_of([begin] if begin else starts(kind, local, normals), local, reach, iterations, frozen)
    return _unscale(surface, middle, size), rms * size


def _check(kind: str, points: np.ndarray) -> None:
    if kind not in SURFACE_KINDS:
        raise ValueError(f"unknown surface kind {kind!r}; known are {', '.join(SURFACE_KINDS)}")
    if points.ndim != 2 or points.shape[1] != 3 or len(points) < MIN_POINTS[kind]:
        raise ValueError(f"{kind} needs points [n >= {MIN_POINTS[kind]}, 3], got {list(points.shape)}")
    if not np.isfinite(points).all():
        raise ValueError(f"{kind} needs finite points, {int((~np.isfinite(points)).any(1).sum())} are not")


def _scale(surface: Surface, middle: np.ndarray, size: float) -> Surface:
    sizes = surface.sizes if surface.kind == "cone" else tuple(s / size for s in surface.sizes)
    return replace(surface, point=vec((np.asarray(surface.point) - middle) / size), sizes=sizes)


def _unscale(surface: Surface, middle: np.ndarray, size: float) -> Surface:
    sizes = surface.sizes if surface.kind == "cone" else tuple(float(s * size) for s in surface.sizes)
    return replace(surface, point=vec(np.asarray(surface.point) * size + middle), axis=vec(np.asarray(surface.axis)), sizes=sizes)


def _tukey(distance: np.ndarray, scale: float | None) -> np.ndarray:
    if scale is None:
        return np.ones(len(distance))
    return np.maximum(1 - (distance / (3 * scale)) ** 2, 0.0) ** 2


def _rms(distance: np.ndarray, weight: np.ndarray) -> float:
    total = weight.sum()
    return float(np.sqrt((weight * distance**2).sum() / total)) if total > 0 else math.inf


def _fit_plane(local: np.ndarray, start: Surface | None, scale: float | None, hold: str) -> tuple[Surface, float]:
    """Principal components; repeated with new weights when robust."""
    axis = np.asarray(start.axis) if start is not None and hold else None
    weight = np.ones(len(local)) if start is None else _tukey(signed_distance(start, local), scale)
    surface = _fit_weighted_plane(local, weight, axis)
    for _ in range(10 if scale is not None else 0):
        weight = _tukey(signed_distance(surface, local), scale)
        surface = _fit_weighted_plane(local, weight, axis)
    if start is not None and np.dot(surface.axis, start.axis) < 0:
        surface = Surface("plane", surface.point, vec(-np.asarray(surface.axis)))
    return surface, _rms(signed_distance(surface, local), weight)


def _fit_weighted_plane(local: np.ndarray, weight: np.ndarray, axis: np.ndarray | None) -> Surface:
    if np.count_nonzero(weight) < 3:
        weight = np.ones(len(local))
    center = weight @ local / weight.sum()
    if axis is not None:
        return Surface("plane", vec(center), vec(axis))
    q = local - center
    return Surface("plane", vec(center), vec(np.linalg.eigh((q * weight[:, None]).T @ q)[1][:, 0]))


def _best_of(
    begin: list[Surface], local: np.ndarray, scale: float | None, iterations: int, frozen: tuple[int, ...]
) -> tuple[Surface, float]:
    """Polish the start that a few steps on a thinned set bring nearest."""
    if len(begin) > 1:
        thin = subsample(local, 300)
        trial = [_descend(_state(s), thin, scale, 6, frozen) for s in begin]
        state = min(trial, key=lambda pair: pair[1])[0]
    else:
        state = _state(begin[0])
    state, rms = _descend(state, local, scale, iterations, frozen)
    return _surface(state, local), rms


def _state(surface: Surface) -> _SurfaceState:
    point, axis = np.asarray(surface.point, float), np.asarray(surface.axis, float)
    if surface.kind in FRAMED:
        return _SurfaceState(surface.kind, point, axis, surface.semi_axes, surface.frame)
    if surface.kind != "cone":
        return _SurfaceState(surface.kind, point, axis, np.asarray(surface.sizes, float))
    # the points' middle is the origin: a reference circle at its height keeps slender cones well conditioned
    height = -(point @ axis)
    return _SurfaceState("cone", point + height * axis, axis, np.array([height * math.tan(surface.sizes[0]), surface.sizes[0]]))


def _surface(state: _SurfaceState, local: np.ndarray) -> Surface:
    if state.kind == "ellipsoid":
        return make_ellipsoid(state.point, state.frame, state.sizes)
    if state.kind == "elliptic":
        along = state.frame[:, 2]
        return make_elliptic(state.point - (state.point @ along) * along, along, state.frame[:, 0], state.sizes)
    sizes = tuple(float(abs(s)) for s in state.sizes)
    if state.kind != "cone":
        point = state.point
        if state.kind == "cylinder":
            point = point - (point @ state.axis) * state.axis
        return Surface(state.kind, vec(point), vec(state.axis), sizes)
    radius, angle = state.sizes
    angle = math.copysign(min(max(abs(angle), 1e-9), math.pi / 2 - 1e-9), angle)
    apex = state.point - state.axis * (radius / math.tan(angle))
    axis = state.axis * math.copysign(1.0, angle)
    if ((local - apex) @ axis).mean() < 0:
        axis = -axis
    return Surface("cone", vec(apex), vec(axis), (abs(angle),))


def _descend(
    state: _SurfaceState, local: np.ndarray, scale: float | None, iterations: int, frozen: tuple[int, ...]
) -> tuple[_SurfaceState, float]:
    """Levenberg-Marquardt; the weights are renewed after every accepted step."""
    if state.kind in FRAMED:
        return _descend_framed(state, local, scale, iterations, frozen)
    held = np.zeros(UNKNOWNS[CODES[state.kind]], bool)
    held[list(() if state.kind == "sphere" else frozen)] = True
    start = np.concatenate([state.point, state.axis, state.sizes, np.zeros(2 - len(state.sizes))])
    found, rms = descend_surface(CODES[state.kind], start, np.require(local, np.float64, ["C", "W"]), scale or 0.0, iterations, held)
    return _SurfaceState(state.kind, found[:3], found[3:6], found[6 : 6 + len(state.sizes)]), rms


def _descend_framed(
    state: _SurfaceState, local: np.ndarray, scale: float | None, iterations: int, frozen: tuple[int, ...]
) -> tuple[_SurfaceState, float]:
    """As `_descend`, of an ellipsoid or an elliptic cylinder."""
    damping = 1e-3
    distance, jacobian = ellipsoid_residual(state.point, state.frame, state.sizes, local)
    weight = _tukey(distance, scale)
    cost = _loss(distance, scale)
    normal, slope = _equations(distance, jacobian, weight, frozen)
    for _ in range(iterations):
        if np.abs(slope).max() < 1e-14 * len(local):
            break
        damped, size = normal.copy(), normal.diagonal()
        damped.ravel()[:: len(slope) + 1] += damping * (size + 1e-9 * (1 + size.sum()))
        point, frame, sizes = move_ellipsoid(state.point, state.frame, state.sizes, np.linalg.solve(damped, -slope))
        trial = _SurfaceState(state.kind, point, frame[:, 2], sizes, frame)
        new_distance, jacobian = ellipsoid_residual(point, frame, sizes, local)
        new_cost = _loss(new_distance, scale)
        if not new_cost < cost:
            damping *= 8
            if damping > 1e6:
                break
            continue
        gain = cost - new_cost
        state, distance, cost = trial, new_distance, new_cost
        weight = _tukey(distance, scale)
        damping = max(damping / 6, 1e-12)
        if gain < 1e-11 * cost:
            break
        normal, slope = _equations(distance, jacobian, weight, frozen)
    return state, _rms(distance, weight)


def _equations(distance: np.ndarray, jacobian: np.ndarray, weight: np.ndarray, frozen: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """The normal equations of a step, [p, p] and [p], without the columns that are `frozen`."""
    jacobian[:, frozen] = 0.0
    weighted = jacobian * weight[:, None]
    return weighted.T @ jacobian, weighted.T @ distance


def _loss(distance: np.ndarray, scale: float | None) -> float:
    if scale is None:
        return float(distance @ distance)
    return float((1 - np.maximum(1 - (distance / (3 * scale)) ** 2, 0.0) ** 3).sum())
