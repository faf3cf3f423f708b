"""Rims of many equal teeth, as those of gears, splines and knobs: a disc, and one drawn tooth repeated on a circle.

A search that counts curves draws such a rim as it can: a hundred flanks are too many for it. A section of the mesh has each tooth exactly,
and turning it by one tooth tells that all are alike. What is found so takes the place of the leaf that stood for the rim.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from manifold3d import CrossSection, Manifold

from imdim.deadline import Deadline
from imdim.geometry.rotations import euler_from_matrix
from imdim.geometry.solid import exact_rotation
from imdim.numbers.outline_coordinates import center_leaf
from imdim.program.outline import Loop, Outline, circle, regions
from imdim.program.plain_outlines import to_simple
from imdim.program.roles import signs
from imdim.program.tree import OPS, Combine, Primitive, Program, combine_all, fold, leaves

LEAST, MOST = 8, 120  # teeth
LEVELS = (0.0, -0.35, 0.35)  # of a leaf's height, where a section may be free of other features
ALIKE = 2e-3  # of a section's area, by which it may change where it is turned by a tooth
STRAIGHT = 2e-6  # of its extent, by which corners are off the line between their neighbours that triangles leave there
ROOTS = 1e-3  # of it, by which roots may be off a circle: where flanks cut its facets they are on chords
HIGH = 0.02  # of the radius of a rim, that teeth stand out at least: facets of a cylinder do less
SUNK = 0.1  # of that radius, by which teeth begin within the disc
ROUND_DEG, NEARLY_DEG = 0.5, 0.05  # degrees, to which the angle of the first tooth is rounded, and by how much at most


@dataclass(frozen=True)
class _Rim:
    """`count` teeth about `center` [2], the first at an `angle` in degrees, on a disc of a `radius`; `tooth` is a loop about that centre,
    with its middle on the x axis."""

    center: np.ndarray
    radius: float
    count: int
    angle: float
    tooth: Loop


def draw_teeth(program: Program, solid: Manifold, deadline: Deadline) -> Iterator[Program]:
    """The program of a `solid` with a disc and its teeth in the place of a leaf that adds, for each that stands for such a rim."""
    for number, (leaf, sign) in enumerate(zip(leaves(program), signs(program), strict=True)):
        if sign < 0 or leaf.kind not in ("extrude", "cylinder") or deadline.has_passed():
            continue
        rim = next(filter(None, map(_find_rim, _sections(leaf, solid))), None)
        if rim is not None:
            part = _with_teeth(leaf, rim)
            yield fold(program, lambda i, old, n=number, p=part: p if i == n else old, {op: partial(Combine, op) for op in OPS})


def _sections(leaf: Primitive, solid: Manifold) -> Iterator[np.ndarray]:
    """The largest outer loops [n, 2] of a solid across a leaf, in the plane of its outline."""
    rotation = exact_rotation(leaf)
    local = solid.transform(np.column_stack([rotation.T, -rotation.T @ np.array(leaf.center)]))
    for level in LEVELS:
        loops = local.slice(level * leaf.size[-1]).to_polygons()
        if loops:
            yield max(loops, key=_area)


def _area(ring: np.ndarray) -> float:
    x, y = ring.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def _find_rim(ring: np.ndarray) -> _Rim | None:
    """The rim that a counter-clockwise loop [n, 2] is; None where it is none, or its teeth are not alike."""
    center = _centroid(ring)
    ring = _without_straight(ring - center, STRAIGHT * float(np.ptp(ring, axis=0).max()))
    away = np.linalg.norm(ring, axis=1)
    low, high = float(away.min()), float(away.max())
    if len(ring) < 2 * LEAST or high - low < HIGH * high:
        return None
    outside = away > (low + high) / 2
    count = int((outside & ~np.roll(outside, 1)).sum())
    if not LEAST <= count <= MOST:
        return None
    area = CrossSection([ring])
    if (area.rotate(360.0 / count) ^ area).area() < (1 - ALIKE) * area.area():
        return None
    roots = away[away < low + (high - low) / 3]
    slack = ROOTS * 2 * high
    radius = float(roots.max()) if np.ptp(roots) <= slack else low
    return _read_tooth(ring, radius, slack, count, center)


def _read_tooth(ring: np.ndarray, radius: float, slack: float, count: int, center: np.ndarray) -> _Rim | None:
    """The rim with the tooth that is nearest to the x axis, of a loop about the origin; None where teeth and roots do not take turns."""
    away = np.linalg.norm(ring, axis=1)
    is_root = np.abs(away - radius) <= slack
    if not is_root.any():
        return None
    ring, is_root = (np.roll(a, -int(np.argmax(is_root)), axis=0) for a in (ring, is_root))
    starts = np.flatnonzero(is_root & ~np.roll(is_root, -1))
    teeth = []
    for start in starts:
        run = [int(start)]
        while len(run) == 1 or not is_root[run[-1] % len(ring)]:
            run.append(run[-1] + 1)
        teeth.append(ring[np.array(run) % len(ring)])
    if len(teeth) != count:
        return None
    angles = [math.degrees(math.atan2(*tooth[:, ::-1].mean(axis=0))) for tooth in teeth]
    first = min(range(count), key=lambda k: (round(abs(angles[k]), 3), angles[k]))
    angle, tooth = angles[first], teeth[first]
    # flanks that are images of each other have their middle between the ends
    ends = np.degrees(np.arctan2(tooth[[0, -1], 1], tooth[[0, -1], 0]))
    middle = float(ends.mean()) if abs(float(np.diff(ends)[0])) < 180.0 else angle
    angle = middle if abs(middle - angle) < NEARLY_DEG else angle
    rounded = round(angle / ROUND_DEG) * ROUND_DEG
    angle = rounded if abs(rounded - angle) < NEARLY_DEG else angle
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    upright = tooth @ np.array([[c, -s], [s, c]])
    inner = [upright[k] * (1 - SUNK) * radius / np.linalg.norm(upright[k]) for k in (-1, 0)]
    loop = tuple((float(x), float(y), 0.0) for x, y in (*upright, *inner))
    return _Rim(center, radius, count, angle, loop)


def _centroid(ring: np.ndarray) -> np.ndarray:
    following = np.roll(ring, -1, axis=0)
    cross = ring[:, 0] * following[:, 1] - ring[:, 1] * following[:, 0]
    return ((ring + following) * cross[:, None]).sum(axis=0) / (3 * cross.sum())


def _without_straight(ring: np.ndarray, slack: float) -> np.ndarray:
    """The loop without the corners that are within `slack` of the line between those beside them, which triangles leave."""
    before, after = np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0)
    along = after - before
    length = np.maximum(np.linalg.norm(along, axis=1), 1e-300)
    off = np.abs(along[:, 0] * (ring - before)[:, 1] - along[:, 1] * (ring - before)[:, 0]) / length
    straight = off <= slack
    return ring[~straight] if (~straight).sum() > 2 else ring


def _with_teeth(leaf: Primitive, rim: _Rim) -> Program:
    """The leaf with a disc in the place of its outer loop, and the teeth."""
    height, rotation, center = leaf.size[-1], exact_rotation(leaf), np.array(leaf.center)
    holes = regions(leaf.outline)[0][1:] if leaf.outline is not None else ()
    base = Primitive("extrude", (height,), leaf.center, leaf.rotation, Outline((circle(rim.radius, *rim.center.tolist()), *holes)))
    x, y, z = (center + rotation @ np.array([*rim.center, 0.0])).tolist()
    teeth = []
    for k in range(rim.count):
        angle = math.radians(rim.angle + 360.0 * k / rim.count)
        spin = np.array([[math.cos(angle), -math.sin(angle), 0.0], [math.sin(angle), math.cos(angle), 0.0], [0.0, 0.0, 1.0]])
        turns = euler_from_matrix(rotation @ spin)
        teeth.append(center_leaf(Primitive("extrude", (height,), (x, y, z), turns, Outline((rim.tooth,)))))
    disc = center_leaf(base)
    return combine_all("union", [to_simple(disc) or disc, *teeth])
