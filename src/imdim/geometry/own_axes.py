"""The axes that a part was drawn along, read off the facets of its mesh: of a part that lies aslant they are not the world's."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from imdim.geometry.axes import SYMMETRIES
from imdim.geometry.rotations import euler_from_matrix, matrix_from_euler, shortest_turn

ALONG = 1 - 1.5e-6  # cosine from which a normal is along an axis (0.1 degrees)
RIGHT = 1.5e-3  # largest cosine of a right angle
CELL = 2e-3  # of a unit normal: those of one cell are looked at as one
LEVEL = 0.01  # of the area, that faces along the world's axes at least if these are the part's own
MOSTLY = 0.5  # of the area of faces across an axis, that face two directions at right angles
LEAST = 2e-3  # of it, that faces a direction that may be an axis
REACHES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)  # from a direction, within which facets are ever more surely of one flat
MOST = 64  # directions that are looked at
SMOOTH = np.cos(np.radians(30.0))  # between strips of one round wall
ALIKE = 3.0  # times, by which areas of such strips differ at most
AS_MUCH = 0.99  # of the most area, that the axes of several frames face as well: hexagons have three
STEPS_DEG = (45.0, 15.0, 5.0, 1.0, 0.1, 0.01)  # to which angles are typed, the roundest first
READ = np.radians(2e-4)  # by which directions are off that are read from single precision


class _Directions(NamedTuple):
    """Distinct unit vectors [k, 3] by falling area [k] that faces them or away from them."""

    vectors: np.ndarray
    areas: np.ndarray


def find_own_axes(normals: np.ndarray, areas: np.ndarray) -> np.ndarray | None:
    """The rotation [3, 3] whose columns are the axes that most of the flat area of triangles faces, by their unit `normals` [n, 3] and
    `areas` [n]; None where faces lie along the world's axes, or none are flat. Where they lie along one of these alone, and most others
    face two directions across it at right angles, the part was turned about that one.

    A part with one flat direction alone is spun so that the edges of its round walls begin at an axis, as they are drawn. Of the 24 ways
    to number and to point axes, and of frames with as much area, it is the one that turns least.
    """
    total = float(areas.sum())
    level = np.array([areas[np.abs(normals[:, k]) > ALONG].sum() >= LEVEL * total for k in range(3)])
    if not total or level.sum() > 1:
        return None
    found = _directions(normals, areas)
    frames = list(_frames(found, total))
    if level.any():
        frames = [(weight, frame) for weight, frame in frames if _is_turned_about(int(level.argmax()), frame, found)]
    if not frames:
        return None
    most = max(weight for weight, _ in frames)
    return _as_typed(max((_turn_least(frame) for weight, frame in frames if weight >= AS_MUCH * most), key=np.trace))


def _directions(normals: np.ndarray, areas: np.ndarray) -> _Directions:
    """Of the triangles, those of most area."""
    half = normals * np.sign(normals[np.arange(len(normals)), np.abs(normals).argmax(axis=1)])[:, None]
    cell = np.unique(np.round(half / CELL).astype(np.int64), axis=0, return_inverse=True)[1].reshape(-1)
    sums = np.stack([np.bincount(cell, half[:, i] * areas) for i in range(3)], axis=1)
    left = np.linalg.norm(sums, axis=1)
    means = sums / np.maximum(left, 1e-300)[:, None]
    vectors, weights = [], []
    while len(vectors) < MOST and left.max() > 0:
        side = means @ means[int(left.argmax())]
        same = (np.abs(side) > ALONG) & (left > 0)
        members = same[cell]
        vectors.append(_sharpen(half[members], areas[members]))
        weights.append(float(left[same].sum()))
        left[same] = 0.0
    order = np.argsort(-np.array(weights), kind="stable")
    return _Directions(np.array(vectors)[order], np.array(weights)[order])


def _sharpen(normals: np.ndarray, areas: np.ndarray) -> np.ndarray:
    """The direction of most triangles [n, 3] that all but face it: the largest is averaged with what is ever nearer to it, as long as that
    is most of the area, so that a few facets of a ball beside a flat do not tilt it."""
    direction, total = normals[int(areas.argmax())], areas.sum()
    for reach in REACHES:
        side = np.sign(normals @ direction)
        near = np.linalg.norm(normals * side[:, None] - direction, axis=1) < reach
        if areas[near].sum() < total / 2:
            break
        mean = (side[near] * areas[near]) @ normals[near]
        direction = mean / np.linalg.norm(mean)
    return direction


def _frames(found: _Directions, total: float) -> Iterator[tuple[float, np.ndarray]]:
    """Rotations [3, 3] with flat directions as columns, and the area of these."""
    vectors, areas = found
    cosines, beside = np.abs(vectors @ vectors.T), _strips_beside(found)
    flat = np.flatnonzero(~beside.any(axis=1) & (areas >= LEAST * total))
    for i, j in combinations(flat, 2):
        if cosines[i, j] > RIGHT:
            continue
        third = np.cross(vectors[i], vectors[j])
        k = next((k for k in flat if abs(third @ vectors[k]) > ALONG), None)
        last, share = (third, 0.0) if k is None else (vectors[k] * np.sign(third @ vectors[k]), areas[k])
        weights = np.array([areas[i], areas[j], share])
        yield float(weights.sum()), _nearest_rotation(np.column_stack([vectors[i], vectors[j], last]) * weights)
    nearest = np.where(beside, cosines, 0.0).argmax(axis=1)
    edges = [_bisect(vectors[a], vectors[nearest[a]]) for a in np.flatnonzero(beside.any(axis=1))]
    for i in flat:
        yield from ((float(areas[i]), spun) for spun in _spun_frames(vectors[i], edges))


def _strips_beside(found: _Directions) -> np.ndarray:
    """Which directions [k, k] are those of two strips of one round wall."""
    vectors, areas = found
    alike = (areas < ALIKE * areas[:, None]) & (areas[:, None] < ALIKE * areas)
    return (np.abs(vectors @ vectors.T) > SMOOTH) & alike & ~np.eye(len(areas), dtype=bool)


def _is_turned_about(k: int, frame: np.ndarray, found: _Directions) -> bool:
    """Whether one of a frame's axes is that of the world with number `k`, and most of what is flat and faces across it faces the others."""
    along = np.abs(frame[k]) > ALONG
    across = (np.abs(found.vectors[:, k]) < RIGHT) & ~_strips_beside(found).any(axis=1)
    facing = np.abs(found.vectors @ frame[:, ~along]) > ALONG
    faced = float(found.areas[across] @ facing[across].any(axis=1))
    return along.sum() == 1 and faced > MOSTLY * float(found.areas[across].sum())


def _spun_frames(axis: np.ndarray, edges: Sequence[np.ndarray]) -> Iterator[np.ndarray]:
    """Rotations [3, 3] with an `axis` as the third column and a direction, where two strips of a round wall about it meet, as the first;
    where there is no such wall, the one that turns least."""
    around = [edge - (edge @ axis) * axis for edge in edges if abs(edge @ axis) < RIGHT * np.linalg.norm(edge)]
    for edge in around:
        u = edge / np.linalg.norm(edge)
        yield np.column_stack([u, np.cross(axis, u), axis])
    if not around:
        nearest = np.eye(3)[int(np.abs(axis).argmax())]
        yield shortest_turn(nearest, axis * np.sign(axis @ nearest))


def _bisect(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a + b * np.sign(a @ b)


def _nearest_rotation(columns: np.ndarray) -> np.ndarray:
    left, _, right = np.linalg.svd(columns)
    return left @ np.diag([1.0, 1.0, float(np.sign(np.linalg.det(left @ right)))]) @ right


def _turn_least(frame: np.ndarray) -> np.ndarray:
    """The same axes, numbered and pointed so that they are nearest to the world's."""
    return max((frame @ way for way in SYMMETRIES), key=np.trace)


def _as_typed(rotation: np.ndarray) -> np.ndarray:
    """The rotation with round Euler degrees where it has them but for what reading it left."""
    angles = np.array(euler_from_matrix(rotation))
    for step in STEPS_DEG:
        x, y, z = np.round(angles / step) * step
        typed = matrix_from_euler((float(x), float(y), float(z)))
        if np.linalg.norm(typed - rotation) < READ:
            return typed
    return rotation
