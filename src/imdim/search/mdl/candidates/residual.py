"""Primitives that a sequence lacks, guessed from points that its surface does not explain and from surface without points.

Points inside the solid lie on walls of cuts that are missing, points outside on parts that are missing. Each connected group of them
offers a box, a sphere, and a cylinder, a cone and a turned box along each axis of the part. Surface without points is where a cut has
taken it away: each such region offers a box and a cylinder that go through the part. What guesses are worth is for the caller to find out.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from imdim.geometry import kernels
from imdim.geometry.components import components
from imdim.geometry.rotations import euler_from_matrix, frame_from_axis, matrix_from_euler
from imdim.geometry.rows import lengths
from imdim.geometry.sampling import surface_points
from imdim.geometry.surface import vec
from imdim.program.tree import FLAT_ENDS, Primitive, Program
from imdim.search.mdl.primitive_selection import Cloud

LEAST = 8  # points of a group
MOST_GROUPS = 6
LINKED = 2.2  # spacings between neighbours of a group
LOOK = 0.03  # of the diagonal: how far an end looks, and how much longer it becomes
SAMPLED = 6000  # points of the program's surface that are looked at
BARE = 1.2  # spacings to the nearest point
WALLS = (0.03, 0.06)  # of the diagonal
THINNEST = 3.0  # deviations of the noise, the least half thickness of a wall: nearer skins are one blurred surface
SKINS = {"box": (2, 2, 2), "cylinder": (1, 2), "sphere": (1,)}  # walls within a size
TRIALS = 60  # circles and balls through random points
OUTER = 1.5  # deviations of the noise by which the outermost of a face's points lie off it
BLURRED = 8.0  # deviations of the noise between outermost points, below which two faces are one blur
ROUND_SPREAD = 0.5  # of the longer of two spreads, from which points lie in no direction
ALONG = math.cos(math.radians(4.0))  # of an axis, along which points lie
SETTLED, WIDE = 8, 8.0  # steps to a cone, and by how much more the first of them forgives than the last
FLATTEST, STEEPEST = 0.15, 6.0  # slopes of cones: others are cylinders, and ends
SEED = 0  # the same points always suggest the same primitives


def missing(program: Program, cloud: Cloud, axes: np.ndarray, off: float) -> list[Primitive]:
    """Guesses; `axes` [3, 3] has the part's directions as columns, points further than `off` are unexplained."""
    value = kernels.program_sdf(program, cloud.points)
    out: list[Primitive] = []
    for positive, here in ((True, value > off), (False, value < -off)):
        points = cloud.points[here]
        for group in _group_connected(points, LINKED * cloud.spacing):
            for guess in _guesses(points[group], axes, off, cloud):
                out += _reaching(guess, program, positive, cloud.diagonal)
    return out + _through(program, cloud, axes)


def whole(cloud: Cloud, axes: np.ndarray) -> list[Primitive]:
    """What the whole cloud would be as one primitive."""
    return _guesses(cloud.points, axes, 0.03 * cloud.diagonal, cloud)


def alternatives(points: np.ndarray, axes: np.ndarray, cloud: Cloud) -> list[Primitive]:
    """Other primitives for the `points` [m, 3] that one explains."""
    return _guesses(points, axes, 0.01 * cloud.diagonal, cloud) if len(points) >= LEAST else []


def hollows(primitive: Primitive, wall: float, cloud: Cloud) -> list[Primitive]:
    """Cavities of a part: itself with walls taken off, open at the ends that bear no points. `wall` is a guess of their half thickness:
    a part that was fitted to both skins of a thin wall runs between them."""
    if primitive.kind not in SKINS:
        return []
    rotation, center = matrix_from_euler(primitive.rotation), np.array(primitive.center)
    slots = FLAT_ENDS.get(primitive.kind, {})
    bare = bare_ends(primitive, cloud)
    out = []
    for thick in (max(wall, THINNEST * cloud.noise), *(w * cloud.diagonal for w in WALLS)):
        size = np.array(primitive.size) - np.array(SKINS[primitive.kind]) * thick
        middle = center.copy()
        for k, sign in bare:
            size[slots[k]] += thick + LOOK * cloud.diagonal
            middle += sign * (thick + LOOK * cloud.diagonal) / 2 * rotation[:, k]
        if size.min() > cloud.spacing:
            out.append(place(primitive.kind, size, middle, np.eye(3), rotation))
    return out


def bare_ends(primitive: Primitive, cloud: Cloud) -> list[tuple[int, int]]:
    """The flat ends, by axis and sign, most of whose middle lies off the cloud."""
    return [(k, sign) for k in FLAT_ENDS.get(primitive.kind, ()) for sign in (-1, 1) if _is_bare(primitive, k, sign, cloud)]


def _is_bare(primitive: Primitive, axis: int, sign: int, cloud: Cloud) -> bool:
    steps = np.linspace(-0.7, 0.7, 6)
    grid = np.stack(np.meshgrid(steps, steps), -1).reshape(-1, 2)
    if primitive.kind == "box":
        half = np.array(primitive.size) / 2
    else:
        radius = 0.7 * primitive.size[1 if primitive.kind == "cone" and sign > 0 else 0]
        half = np.array([radius, radius, primitive.size[-1] / 2])
    local = np.insert(grid, axis, sign, axis=1) * half
    away = cloud.tree.query(local @ matrix_from_euler(primitive.rotation).T + primitive.center)[0]
    return bool((away > BARE * cloud.spacing).mean() > 0.6)


def trim(primitive: Primitive, points: np.ndarray) -> list[Primitive]:
    """The primitive made as short, and as slim, as the `points` [m, 3] that it explains: a face beyond them has nothing to hold it."""
    if primitive.outline is not None or primitive.kind not in FLAT_ENDS or len(points) < LEAST:
        return []
    rotation = matrix_from_euler(primitive.rotation)
    local = (points - primitive.center) @ rotation
    out = []
    for k, slot in FLAT_ENDS[primitive.kind].items():
        low, high = np.quantile(local[:, k], (0.003, 0.997))
        size, middle = [*primitive.size], np.array(primitive.center) + (low + high) / 2 * rotation[:, k]
        if primitive.kind == "cone":  # of the same slope
            bottom, top, height = primitive.size
            size[:2] = [max(bottom + (top - bottom) * (z / height + 0.5), 0.0) for z in (float(low), float(high))]
            if not max(size[:2]) > 0:
                continue
        size[slot] = max(float(high - low), 1e-3 * size[slot])
        out.append(replace(primitive, size=tuple(size), center=vec(middle)))
    if primitive.kind == "cylinder":
        radius = float(np.quantile(np.hypot(local[:, 0], local[:, 1]), 0.995))
        out.append(replace(primitive, size=(radius, primitive.size[1])))
    return out


def _group_connected(points: np.ndarray, reach: float) -> list[np.ndarray]:
    """Indices of the largest connected groups of `points` [n, 3]."""
    if len(points) < LEAST:
        return []
    a, b = KDTree(points).query_pairs(reach, output_type="ndarray").T
    label = components(a, b, len(points))[1]
    sizes = np.bincount(label)
    return [np.flatnonzero(label == i) for i in np.argsort(-sizes, kind="stable")[:MOST_GROUPS] if sizes[i] >= LEAST]


def _through(program: Program, cloud: Cloud, axes: np.ndarray) -> list[Primitive]:
    """Cuts where the surface of `program` bears no points, through the whole part and from there to its middle."""
    points, normals = surface_points(program, SAMPLED, np.random.default_rng(SEED))
    if not len(points):
        return []
    bare = cloud.tree.query(points, distance_upper_bound=2 * cloud.spacing)[0] > BARE * cloud.spacing
    points, normals = points[bare], normals[bare]
    low, high = (cloud.points @ axes).min(0) - LOOK * cloud.diagonal, (cloud.points @ axes).max(0) + LOOK * cloud.diagonal
    out: list[Primitive] = []
    for group in _group_connected(points, LINKED * cloud.spacing):
        local, normal = points[group] @ axes, (normals[group] @ axes).mean(0)
        k = int(np.abs(normal).argmax())
        # the rim of the region has points nearby
        bottom, top = local.min(0) - 0.7 * cloud.spacing, local.max(0) + 0.7 * cloud.spacing
        for ends in ((low[k], high[k]), (bottom[k], high[k]) if normal[k] > 0 else (low[k], top[k])):
            bottom[k], top[k] = ends
            if (top <= bottom).any():
                continue
            size, middle = top - bottom, (bottom + top) / 2
            out.append(place("box", size, middle, axes))
            radius = float(np.delete(size, k).mean()) / 2
            out.append(place("cylinder", (radius, size[k]), middle, axes, frame_from_axis(axes[:, k])))
    return out


def _guesses(points: np.ndarray, axes: np.ndarray, off: float, cloud: Cloud) -> list[Primitive]:
    local = points @ axes
    thin = 0.5 * cloud.spacing
    found = [_box_about(local, axes, cloud)]
    for k in range(3):
        u, v = (k + 1) % 3, (k + 2) % 3
        found += _turned_box(local, k, axes, cloud)
        found += _cone(local, k, axes, off)
        circle = _round(np.ascontiguousarray(local[:, [u, v]]), off)
        if circle is None:
            continue
        center, radius, on = circle
        ends = local[on, k].min(), local[on, k].max()
        middle = np.zeros(3)
        middle[[u, v]], middle[k] = center, sum(ends) / 2
        found.append(place("cylinder", (radius, max(ends[1] - ends[0], thin)), middle, axes, frame_from_axis(axes[:, k])))
    ball = _round(local, off)
    if ball is not None:
        found.append(place("sphere", (ball[1],), ball[0], axes))
    return found


def _box_about(local: np.ndarray, axes: np.ndarray, cloud: Cloud) -> Primitive:
    """The box about points [n, 3] in the frame `axes` whose faces noise has blurred: a thin one is as thick as the points spread more than
    noise does, and the outermost of many points lie off the face of a thick one."""
    low, high, sigma = local.min(0), local.max(0), cloud.noise
    half = np.maximum((high - low) / 2 - OUTER * sigma, 0.0)
    middle = np.where(high - low > BLURRED * sigma, (low + high) / 2, local.mean(0))
    spread = np.sqrt(np.maximum(local.var(0) - sigma**2, (sigma / 2) ** 2))
    half = np.where(high - low > BLURRED * sigma, half, np.minimum(spread, (high - low) / 2))
    return place("box", np.maximum(2 * half, 0.5 * cloud.spacing), middle, axes)


def _turned_box(local: np.ndarray, k: int, axes: np.ndarray, cloud: Cloud) -> list[Primitive]:
    """The box about points [n, 3] in the frame `axes` whose sides lie as the points do, turned about axis k; none where they lie along the
    axes, or in no direction: the part's own directions are any about the axis of a turned part, and a rib in it has its own."""
    spread, ways = np.linalg.eigh(np.cov(np.delete(local, k, 1).T))
    if spread[0] > ROUND_SPREAD * spread[1] or np.abs(ways).max() > ALONG:
        return []
    up, long = np.eye(3)[k], np.insert(ways[:, 1], k, 0.0)
    turn = np.column_stack([long, np.cross(up, long), up])
    return [_box_about(local @ turn, axes @ turn, cloud)]


def _cone(local: np.ndarray, k: int, axes: np.ndarray, off: float) -> list[Primitive]:
    """The cone along axis k through most of the points [n, 3] in the frame `axes`; none where they show none.

    It starts from the axis that least squares tell as Kasa (1976) has it for circles: with the radius r + s z, x^2 + y^2 is
    2 a x + 2 b y + (r^2 - a^2 - b^2) + 2 r s z + s^2 z^2, which is linear.
    """
    if len(local) < 2 * LEAST:
        return []
    middle = local.mean(0)
    flat, z = np.delete(local - middle, k, 1), local[:, k] - middle[k]
    begin = np.linalg.lstsq(np.column_stack([2 * flat, np.ones(len(z)), z, z**2]), (flat**2).sum(1), rcond=None)[0]
    a, b, radius, slope = _settle_cone(flat, z, begin[:2], off)
    low, high = float(z.min()), float(z.max())
    ends = [max(radius + slope * end, 0.0) for end in (low, high)]
    on = np.abs(np.hypot(*(flat - (a, b)).T) - radius - slope * z) < 0.5 * off * math.hypot(1.0, slope)
    if not (FLATTEST < abs(slope) < STEEPEST and max(ends) < np.ptp(local, axis=0).max() and on.mean() > 0.5):
        return []
    center = middle + np.insert((a, b), k, (low + high) / 2)
    return [place("cone", (*ends, high - low), center, axes, frame_from_axis(axes[:, k]))]


def _settle_cone(flat: np.ndarray, z: np.ndarray, at: np.ndarray, off: float) -> tuple[float, float, float, float]:
    """Where the axis of a cone crosses the plane of `flat` [n, 2], its radius there and its slope, by Gauss-Newton steps that leave points
    at heights `z` [n] out of account the more the farther they lie from it."""
    radius, slope = float(np.median(np.hypot(*(flat - at).T))), 0.0
    for wide in np.geomspace(WIDE, 1.0, SETTLED):
        arm = flat - at
        rho = np.maximum(np.hypot(*arm.T), 1e-12)
        rest = (rho - radius - slope * z) / math.hypot(1.0, slope)
        weight = 1 / (1 + (rest / (wide * 0.5 * off)) ** 2) ** 2
        rows = np.column_stack([arm / rho[:, None], np.ones(len(z)), z])
        normal = (rows * weight[:, None]).T @ rows
        step = np.linalg.solve(normal + 1e-9 * np.trace(normal) * np.eye(4), (rows * weight[:, None]).T @ (rho - radius - slope * z))
        at, radius, slope = at + step[:2], radius + float(step[2]), slope + float(step[3])
    return float(at[0]), float(at[1]), radius, slope


def _round(points: np.ndarray, off: float) -> tuple[np.ndarray, float, np.ndarray] | None:
    """Centre, radius and points [m] of the circle or ball through most of `points` [n, 2 or 3], None where it is far larger than they."""
    n, d = points.shape
    rng = np.random.default_rng(SEED)
    picks = rng.integers(n, size=(TRIALS, d + 1))
    chosen = points[picks]
    matrix = 2 * (chosen[:, 1:] - chosen[:, :1])
    square = (chosen**2).sum(-1)
    proper = np.abs(np.linalg.det(matrix)) > 1e-12
    if not proper.any():
        return None
    centers = np.linalg.solve(matrix[proper], (square[:, 1:] - square[:, :1])[proper][..., None])[..., 0]
    radii = np.linalg.norm(chosen[proper, 0] - centers, axis=1)
    largest = 1.5 * float(np.linalg.norm(np.ptp(points, axis=0)))
    small = radii < largest
    if not small.any():
        return None

    def borne(center: np.ndarray, radius: float) -> np.ndarray:
        return np.abs(lengths(points - center) - radius) < 0.5 * off

    center, radius = max(zip(centers[small], radii[small], strict=True), key=lambda found: np.count_nonzero(borne(*found)))
    for _ in range(2):
        on = borne(center, radius)
        if on.sum() <= d + 1:
            return None
        # Kasa (1976): |p|^2 = 2 p.c + (r^2 - |c|^2) is linear
        solution = np.linalg.lstsq(np.column_stack([2 * points[on], np.ones(on.sum())]), (points[on] ** 2).sum(1), rcond=None)[0]
        squared = solution[d] + (solution[:d] ** 2).sum()
        if not 0 < squared < largest**2:
            return None
        center, radius = solution[:d], float(np.sqrt(squared))
    return center, radius, on


def _reaching(guess: Primitive, program: Program, positive: bool, diagonal: float) -> list[Primitive]:
    """The guess, and the guess made longer where it opens: ends of a cut that look out of the solid, ends of a part that look into it.

    Openings bear no points, so the group of a hole ends before the face that the hole pierces.
    """
    if guess.kind == "sphere":
        return [guess]
    axes, sizes, center = matrix_from_euler(guess.rotation), np.array(guess.size), np.array(guess.center)
    ends = [(sign * axes[:, k], slot) for k, slot in FLAT_ENDS.get(guess.kind, {}).items() for sign in (-1.0, 1.0)]
    probes = np.array([center + (sizes[slot] / 2 + LOOK * diagonal) * way for way, slot in ends])
    beyond = kernels.program_sdf(program, probes)
    longer_size, longer_center = sizes.copy(), center.copy()
    for (way, slot), value in zip(ends, beyond, strict=True):
        if (value > 0) != positive:
            longer_size[slot] += 2 * LOOK * diagonal
            longer_center += LOOK * diagonal * way
    longer = resize(guess, longer_size, longer_center)
    return [longer] if longer == guess else [longer, guess]


def place(kind: str, size: Iterable[float], local: np.ndarray, axes: np.ndarray, turn: np.ndarray | None = None) -> Primitive:
    """A primitive centred at `local` in the frame `axes`, whose own axes are the columns of `turn` (default: of `axes`)."""
    return Primitive(kind, tuple(float(s) for s in size), vec(axes @ local), euler_from_matrix(axes if turn is None else turn))


def resize(part: Primitive, size: np.ndarray, center: np.ndarray) -> Primitive:
    """A primitive that is turned like `part`."""
    return replace(part, size=tuple(size.tolist()), center=vec(center))
