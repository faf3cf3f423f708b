"""One rotation of the many that describe the same solid, and the round rotations near a given one.

A box or ellipsoid looks the same in 24 frames with its sizes permuted, a cylinder, cone (with its radii swapped) or torus may point
either way along its axis and spin about it, as an ellipsoid with two equal semi-axes may about the third, a sphere has no rotation at
all. An outline keeps the frame that it is drawn in, but a fully turned one points up its axis, as a cone does.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np

from imdim.geometry.axes import SYMMETRIES
from imdim.geometry.rotations import euler_from_matrix, frame_from_axis, matrix_from_euler, shortest_turn, turn_about
from imdim.program.ellipse import Ellipse
from imdim.program.motions import is_round
from imdim.program.outline import Loop, Outline, reverse_ring
from imdim.program.tree import Primitive, Vec3

AXIAL = ("cylinder", "cone", "torus")
# Cosines of right angles carry errors of this size.
EXACT = 1e-12
# Cosine of five degrees: what stands nearly upright is tilted about x and y. About z it would spin by any angle, for a tilt of a hair, and
# with it the facets of its mesh, which then lie across those of what stands upright beside it.
UPRIGHT = math.cos(math.radians(5.0))
# Degrees are kept to this many decimals, which turns a unit of length by less than 1e-11.
DECIMALS = 9


def canonical(primitive: Primitive) -> Primitive:
    """The same solid with its simplest rotation: aligned boxes have none, aligned axes turn by one right angle at most."""
    if primitive.kind == "sphere" or (primitive.kind == "ellipsoid" and len(set(primitive.size)) == 1):
        return replace(primitive, rotation=(0.0, 0.0, 0.0))
    if is_round(primitive):
        return along_axis(primitive, matrix_from_euler(primitive.rotation)[:, 2])
    frame = matrix_from_euler(primitive.rotation)
    if primitive.kind == "ellipsoid" and len(set(primitive.size)) == 2:
        frame = _unspin(frame, primitive.size)
    return in_frame(primitive, frame)


def _unspin(frame: np.ndarray, size: tuple[float, ...]) -> np.ndarray:
    """The frame [3, 3] of an ellipsoid of revolution without a spin about its axis, which is the one of its own length."""
    odd = next(i for i in range(3) if size.count(size[i]) == 1)
    turned = frame_from_axis(np.where(np.abs(frame[:, odd]) < EXACT, 0.0, frame[:, odd]))
    return np.roll(turned, odd + 1, axis=1)


def along_axis(primitive: Primitive, axis: np.ndarray) -> Primitive:
    """`primitive` turned so that its axis is along `axis` (unit); a cone or an outline may come back upside down."""
    x, y, z = np.where(np.abs(axis) < EXACT, 0.0, axis)
    # the half space z > 0, of its rim the half plane x > 0, of that one's rim the direction that rotate([90, 0, 0]) gives
    flip = (z, x, -y) < (0.0, 0.0, 0.0)
    if flip:
        x, y, z = -x, -y, -z
    if z > UPRIGHT:
        rotation = (math.degrees(math.asin(-y)), math.degrees(math.atan2(x, z)), 0.0)
    elif x == 0:
        rotation = (math.degrees(math.atan2(-y, z)), 0.0, 0.0)
    else:
        side = math.copysign(1.0, x)
        rotation = (0.0, math.degrees(math.atan2(side * math.hypot(x, y), z)), math.degrees(math.atan2(side * y, side * x)))
    size = primitive.size
    if primitive.kind == "cone" and flip:
        size = (size[1], size[0], size[2])
    outline = _upside_down(primitive.outline) if primitive.outline is not None and flip else primitive.outline
    return replace(primitive, size=size, rotation=_tidy(rotation), outline=outline)


def turn_over(primitive: Primitive) -> Primitive:
    """The same solid, of a kind that is round about its axis, with that pointing the other way."""
    frame = matrix_from_euler(primitive.rotation) * np.array([1.0, -1.0, -1.0])
    size = (primitive.size[1], primitive.size[0], primitive.size[2]) if primitive.kind == "cone" else primitive.size
    outline = None if primitive.outline is None else _upside_down(primitive.outline)
    return replace(primitive, size=size, rotation=euler_from_matrix(frame), outline=outline)


def _upside_down(outline: Outline) -> Outline:
    return Outline(tuple(_flip(loop) for loop in outline.loops))


def _flip(loop: Loop) -> Loop:
    if isinstance(loop, Ellipse):
        return replace(loop, y=-loop.y + 0.0, angle=-loop.angle + 0.0)
    return reverse_ring(tuple((x, -y + 0.0, -b + 0.0) for x, y, b in loop))


def in_frame(primitive: Primitive, frame: np.ndarray) -> Primitive:
    """`primitive` turned into `frame` [3, 3]; a box or ellipsoid is written in the equal frame that turns least."""
    if primitive.outline is not None:
        return replace(primitive, rotation=_turn(frame))
    best = _simplest(np.ascontiguousarray(frame, float).tobytes())
    turn = np.rint(frame.T @ matrix_from_euler(best)).astype(int)
    size = tuple(float(v) for v in np.abs(turn).T @ np.array(primitive.size))
    return replace(primitive, size=size, rotation=best)


@lru_cache(4096)
def _simplest(frame: bytes) -> Vec3:
    """The simplest of the equal frames of a box; most boxes of a part share theirs."""
    return min((_turn(np.frombuffer(frame).reshape(3, 3) @ turn) for turn in SYMMETRIES), key=_simplicity)


def _turn(frame: np.ndarray) -> Vec3:
    return _tidy(euler_from_matrix(np.where(np.abs(frame) < EXACT, 0.0, frame)))


def _simplicity(rotation: Vec3) -> tuple[float, int, tuple[float, ...]]:
    """Smaller is simpler: the angle of the whole turn, then the number of angles, then positive ones first."""
    angle = math.acos(min(1.0, max(-1.0, (np.trace(matrix_from_euler(rotation)) - 1) / 2)))
    return round(angle, 6), sum(a != 0 for a in rotation), tuple(-a for a in rotation)


def _tidy(rotation: tuple[float, ...]) -> Vec3:
    rx, ry, rz = (round(a, DECIMALS) + 0.0 for a in rotation)
    return rx, ry, rz


def round_turns(primitive: Primitive, max_deg: float) -> Iterator[Primitive]:
    """The same primitive in rounder rotations within `max_deg` of its own, the roundest first.

    They are: along the world's axes; one axis along the world's and a round angle about it (of a solid of revolution, the axis in a
    plane of the world's axes); round Euler degrees.
    """
    if primitive.kind == "sphere":
        return
    before = matrix_from_euler(primitive.rotation)
    axial = is_round(primitive)
    seen = {canonical(primitive)}
    for frame in _round_axes(before[:, 2]) if axial else _round_frames(before):
        if axial:
            near, axis = along_axis(primitive, frame), before[:, 2]
            angle = math.atan2(float(np.linalg.norm(np.cross(axis, frame))), abs(float(axis @ frame)))
        else:
            near, angle = in_frame(primitive, frame), math.acos(np.clip((float((before * frame).sum()) - 1) / 2, -1, 1))
        if math.degrees(angle) <= max_deg and near not in seen:
            seen.add(near)
            yield near


STEPS = (45.0, 15.0, 5.0, 1.0)


def _round_axes(axis: np.ndarray) -> Iterator[np.ndarray]:
    """Directions near `axis`: the world's axes, round angles in a coordinate plane, any angle in it, round polar angles."""
    largest = int(np.abs(axis).argmax())
    yield np.eye(3)[largest] * np.sign(axis[largest])
    flat = int(np.abs(axis).argmin())
    u, v = (i for i in range(3) if i != flat)
    angle = math.degrees(math.atan2(axis[v], axis[u]))
    for step in (*STEPS, 0.0):
        turned = math.radians(_to_step(angle, step))
        yield np.eye(3)[u] * math.cos(turned) + np.eye(3)[v] * math.sin(turned)
    polar, around = math.degrees(math.acos(np.clip(axis[2], -1, 1))), math.degrees(math.atan2(axis[1], axis[0]))
    for step in (15.0, 5.0, 1.0, 0.1, 0.01):
        yield matrix_from_euler((0.0, _to_step(polar, step), _to_step(around, step)))[:, 2]


def _round_frames(frame: np.ndarray) -> Iterator[np.ndarray]:
    """Frames near `frame`: a signed permutation, one axis along the world's with a round or any angle about it, round Euler degrees."""
    yield max(SYMMETRIES, key=lambda m: float((m * frame).sum()))
    world, local = np.unravel_index(np.abs(frame).argmax(), (3, 3))
    fixed = np.eye(3)[world] * np.sign(frame[world, local])
    level = shortest_turn(frame[:, local], fixed) @ frame
    first = (local + 1) % 3
    u, v = (world + 1) % 3, (world + 2) % 3
    angle = math.degrees(math.atan2(level[v, first], level[u, first]))
    for step in (*STEPS, 0.0):
        turned = math.radians(_to_step(angle, step) - angle)
        yield turn_about(np.eye(3)[world], turned) @ level
    euler = euler_from_matrix(frame)
    for step in (15.0, 5.0, 1.0, 0.1, 0.01):
        yield matrix_from_euler((_to_step(euler[0], step), _to_step(euler[1], step), _to_step(euler[2], step)))


def _to_step(angle: float, step: float) -> float:
    return round(angle / step) * step if step else angle
