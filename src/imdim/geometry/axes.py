"""The main directions of a bare cloud: a rotation in which most of its faces and axes lie along the coordinate axes.

Every face of a part whose directions are the columns of a rotation has its normal along one of them; every wall of a cylinder along
one has its normals across it. A direction's worth is therefore the share of normals, of either sign, that lie along or across it:
it needs no faces of known extent, and holds for turned parts, which have one direction, as for boxes.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import permutations, product

import numpy as np
from numba import njit
from scipy.spatial import KDTree

from imdim.geometry.rotations import skew
from imdim.geometry.sampling import subsample

MOST = 768  # points whose normals are taken
SHARPENED = 2048  # points whose piles are sought
NEIGHBOURS = (8, 32)  # few show thin walls, many see through noise
TRIALS = 1000  # directions on the half sphere, 5 degrees apart
WIDTHS = (0.10, 0.05, 0.025, 0.012)  # of the kernels, in radians, from the search to the last adjustment
SHARPENING = ((0.03, 0.02), (0.01, 0.015), (0.003, 0.01))  # turns in radians, and how wide a pile of points is, of the diagonal
EXACT = 0.5  # of the worth under a wide kernel is left under the narrowest where normals are exact
CLEARLY = 0.9  # of the other frame's piles, that the first one must have to be kept
OFF_DEG = 2.0  # by which a direction may be off an axis that it lies along
STAY = 0.97  # the given axes are kept when they are worth as much as this share of the best ones


def main_axes(points: np.ndarray) -> np.ndarray:
    """A rotation [3, 3] whose columns are the main directions of `points` [n, 3], of the 24 equal ones the nearest to none.

    The identity where the given axes explain the normals nearly as well, and where nothing is better (spheres).
    """
    points = np.ascontiguousarray(points, float)
    normals, trust = local_normals(points)
    if not trust.any():
        return np.eye(3)
    found = [_adjust_frame(f, normals, trust) for f in _search_frames(normals, trust)]
    best = _finish_frame(max(found, key=lambda f: _worth(f, normals, trust, WIDTHS[1])), points, normals, trust)
    if _worth(np.eye(3), normals, trust, WIDTHS[1]) >= STAY * _worth(best, normals, trust, WIDTHS[1]):
        return np.eye(3)
    return nearest_equal(best)


def find_shared_axes(directions: Sequence[Sequence[float]], weights: Sequence[float]) -> np.ndarray:
    """The rotation [3, 3] along whose columns most of the weighted `directions` [n, 3] lie; the given axes where they do nearly as well.

    For faces and axes that were fitted to many points each, which say more than the normals of a noisy cloud.
    """
    unit = np.asarray(directions, float).reshape(-1, 3)
    frames = [np.eye(3)]
    for i, a in enumerate(unit):
        for b in (*unit[i + 1 :], *np.eye(3)):
            across = b - (b @ a) * a
            length = np.linalg.norm(across)
            if length > np.cos(np.radians(OFF_DEG)) or (length > 0.1 and not (abs(unit @ a) < np.sin(np.radians(OFF_DEG))).any()):
                across /= length
                frames.append(np.column_stack([a, across, np.cross(a, across)]))

    def worth(frame: np.ndarray) -> float:
        along = np.abs(unit @ frame).max(1) > np.cos(np.radians(OFF_DEG))
        return float(np.dot(along, weights))

    best = max(frames, key=worth)
    return np.eye(3) if worth(frames[0]) >= STAY * worth(best) else nearest_equal(best)


def clearest_axes(points: np.ndarray, frames: Sequence[np.ndarray], width: float) -> np.ndarray:
    """The first of the rotations `frames` [3, 3], or another in which `points` [n, 3] clearly pile up more in squares of `width`.

    They do in the shadows along the part's directions, where walls become lines, and in the profile about the axis of a turned part. Where
    the given axes are worth as much they are kept: about its axis any turn of a turned part is as good, but what is small on it was drawn
    along them.
    """
    worth = [_crowding(points @ f, width) for f in frames]
    best = int(np.argmax(worth))
    chosen = best if worth[0] < CLEARLY * worth[best] else 0
    return np.eye(3) if _crowding(points, width) >= STAY * worth[chosen] else frames[chosen]


def _crowding(local: np.ndarray, width: float) -> float:
    """Points that share a point's square, summed over three shadows, and in the best of three profiles about the middle."""
    shadows = [np.delete(local, k, axis=1) for k in range(3)]
    middles = [np.quantile(s, (0.02, 0.98), axis=0).mean(0) for s in shadows]
    profiles = [
        np.column_stack([np.linalg.norm(s - m, axis=1), local[:, k]]) for k, (s, m) in enumerate(zip(shadows, middles, strict=True))
    ]
    return sum(map(partial(_sharing, width), shadows)) + max(map(partial(_sharing, width), profiles))


def _sharing(width: float, places: np.ndarray) -> float:
    count = np.unique(np.floor(places / width), axis=0, return_counts=True)[1]
    return float((count.astype(float) ** 2).sum()) / len(places)


def local_normals(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals [m, 3] of either sign at every so-manieth point, and how flat the cloud is there, [m] in 0..1."""
    picked = subsample(points, MOST)
    near = np.asarray(KDTree(points).query(picked, k=min(max(NEIGHBOURS), len(points)))[1])
    normals, trust = zip(*(_flattest(points[near[:, :k]]) for k in NEIGHBOURS), strict=True)
    return np.concatenate(normals), np.concatenate(trust)


def _flattest(groups: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least principal directions [m, 3] of groups [m, k, 3] and how flat these are."""
    around = groups - groups.mean(1, keepdims=True)
    spread, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", around, around))
    least, second = np.maximum(spread[:, 0], 0.0), spread[:, 1]
    # points in one place, or in a row, show no plane
    flat = np.where(second > 1e-12 * spread[:, 2], 1 - least / np.maximum(second, 1e-300), 0.0)
    return axes[:, :, 0], np.clip(flat, 0.0, 1.0) ** 4


def _search_frames(normals: np.ndarray, trust: np.ndarray) -> list[np.ndarray]:
    """Frames [3, 3] about the best directions of a grid; the second axis is the best one across the first."""
    directions = np.concatenate([half_sphere(TRIALS), np.eye(3)])
    worth = _direction_worths(directions, normals, trust, WIDTHS[0])
    frames: list[np.ndarray] = []
    for i in np.argsort(-worth, kind="stable").tolist():
        if any(np.abs(f.T @ directions[i]).max() > 0.98 for f in frames):
            continue
        frames.append(_complete_frame(directions[i], normals, trust))
        if len(frames) == 3:
            break
    return frames


def _complete_frame(first: np.ndarray, normals: np.ndarray, trust: np.ndarray) -> np.ndarray:
    seed = np.eye(3)[np.abs(first).argmin()]
    u = seed - (seed @ first) * first
    u /= np.linalg.norm(u)
    v = np.cross(first, u)
    angles = np.radians(np.arange(0.0, 90.0, 2.0))[:, None]
    second = np.cos(angles) * u + np.sin(angles) * v
    third = np.cross(first, second)
    worth = _direction_worths(second, normals, trust, WIDTHS[0]) + _direction_worths(third, normals, trust, WIDTHS[0])
    best = int(worth.argmax())
    return np.stack([second[best], third[best], first], 1)


def _worth(frame: np.ndarray, normals: np.ndarray, trust: np.ndarray, width: float) -> float:
    return float(_direction_worths(np.ascontiguousarray(frame.T), normals, trust, width).sum())


@njit(cache=True)
def _direction_worths(directions, normals, trust, width):  # pragma: no cover - compiled
    out = np.zeros(len(directions))
    for i in range(len(directions)):
        a, b, c = directions[i]
        total = 0.0
        for j in range(len(normals)):
            along = abs(normals[j, 0] * a + normals[j, 1] * b + normals[j, 2] * c)
            across2 = max(1.0 - along * along, 0.0)
            s = 1.0 / (1.0 + along * along / (width * width))
            t = 1.0 / (1.0 + across2 / (width * width))
            total += trust[j] * max(s, t)
        out[i] = total
    return out


def _adjust_frame(frame: np.ndarray, normals: np.ndarray, trust: np.ndarray) -> np.ndarray:
    """Gauss-Newton steps on the residuals of the kernels, ever narrower: components of a normal that should be 0."""
    for width in np.repeat(WIDTHS, 4):
        local = normals @ frame
        square = local**2
        lead = square.argmax(1)
        matrix, gradient = np.zeros((3, 3)), np.zeros(3)
        for k in range(3):
            # across axis k: its component should vanish; along it, both others should
            i, j = (k + 1) % 3, (k + 2) % 3
            along = (lead == k) & (square[:, k] > 0.5)
            residual = square[:, i] + square[:, j]
            weight = trust * along / (1 + residual / width**2) ** 2
            cross = trust * ~along / (1 + square[:, k] / width**2) ** 2
            for component, share in ((i, weight), (j, weight), (k, cross)):
                # the component of a normal along column c changes with a turn w by (n x e_c) . w
                slope = np.cross(local, np.eye(3)[component]) * -1.0
                matrix += (share[:, None] * slope).T @ slope
                gradient += (share * local[:, component]) @ slope
        turn = -np.linalg.solve(matrix + 1e-6 * np.trace(matrix) * np.eye(3), gradient)
        frame = frame @ _exponential(turn)
    return frame


def _finish_frame(frame: np.ndarray, points: np.ndarray, normals: np.ndarray, trust: np.ndarray) -> np.ndarray:
    """Where normals are exact they have the last word, where they are noisy the places of the points."""
    sharp = _sharpen_frame(frame, points)
    exact = max((frame, _adjust_frame(sharp, normals, trust)), key=lambda f: _worth(f, normals, trust, WIDTHS[-1]))
    clear = _worth(exact, normals, trust, WIDTHS[-1]) > EXACT * _worth(exact, normals, trust, WIDTHS[1])
    return exact if clear else sharp


def _sharpen_frame(frame: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Turned a little so that the coordinates of the points pile up where faces are; a pattern search, ever finer."""
    points = subsample(points, SHARPENED)
    points = (points - points.mean(0)) / float(np.linalg.norm(np.ptp(points, axis=0)))
    for step, width in SHARPENING:
        best = _pile_density(points @ frame, width)
        for _ in range(12):
            turned = [frame @ _exponential(sign * step * axis) for axis in np.eye(3) for sign in (1, -1)]
            piled = [_pile_density(points @ t, width) for t in turned]
            k = int(np.argmax(piled))
            if piled[k] <= best:
                break
            frame, best = turned[k], piled[k]
    return frame


@njit(cache=True)
def _pile_density(local, width):  # pragma: no cover - compiled
    """Sum over the axes of the squared density of one coordinate, seen through triangles of `width`."""
    total = 0.0
    for axis in range(3):
        low = local[:, axis].min()
        bins = int((local[:, axis].max() - low) / width) + 3
        density = np.zeros(bins)
        for j in range(len(local)):
            at = (local[j, axis] - low) / width
            k = int(at)
            density[k] += k + 1 - at
            density[k + 1] += at - k
        smooth = 0.0
        for k in range(bins - 1):
            smooth += density[k] ** 2 + density[k] * density[k + 1]
        total += smooth
    return total


def _exponential(turn: np.ndarray) -> np.ndarray:
    angle = float(np.linalg.norm(turn))
    if angle == 0:
        return np.eye(3)
    cross = skew(turn / angle)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def nearest_equal(frame: np.ndarray) -> np.ndarray:
    """Of the 24 rotations with the axes of `frame` [3, 3], the one that turns least."""
    return max((frame @ g for g in SYMMETRIES), key=np.trace)


def _symmetries() -> list[np.ndarray]:
    signed = (np.eye(3)[list(order)] * signs for order in permutations(range(3)) for signs in product((1.0, -1.0), repeat=3))
    return [m for m in signed if np.linalg.det(m) > 0]


SYMMETRIES = _symmetries()


def half_sphere(count: int) -> np.ndarray:
    """A Fibonacci half sphere [count, 3]."""
    i = np.arange(count) + 0.5
    z, turn = i / count, np.pi * (1 + np.sqrt(5)) * i
    side = np.sqrt(1 - z * z)
    return np.column_stack([side * np.cos(turn), side * np.sin(turn), z])
