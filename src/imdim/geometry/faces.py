"""The carriers of a primitive's named faces."""

from __future__ import annotations

import math
from itertools import product

import numpy as np

from imdim.geometry.lowering import Lowered
from imdim.geometry.surface import Surface, vec
from imdim.program.drafting import inset_at_top
from imdim.program.edges import Face, wall_curve, wall_place
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Curve, arc_center, arc_middle, arc_radius, loop_curves
from imdim.program.tree import PLANE_ENDS, Primitive, top_of

LEVEL = 1e-12  # of a line's length, by which it may leave a right angle and still be plane, or a cylinder


def carrier(face: Face, leaf: Primitive, numbers: Lowered) -> Surface | None:
    """The surface that a face of `leaf` lies on, in the world; None where the leaf has no such face. Which way it faces is not told.

    `numbers` are those of the program that `leaf` belongs to.
    """
    turn, center = numbers.rotations[face.leaf], numbers.centers[face.leaf]
    if face.name[0] in "+-":
        axis = "xyz".index(face.name[1])
        half = leaf.size[PLANE_ENDS[leaf.kind][axis]] / 2
        side = half if face.name[0] == "+" else -half
        return Surface("plane", vec(center + turn[:, axis] * side), vec(turn[:, axis]))
    if face.name == "side":
        return _side(leaf, turn, center)
    curve = wall_curve(leaf, face.name)
    if curve is None:
        return None
    if leaf.kind == "drafted":
        return _drafted(leaf, curve, turn, center)
    return (_extruded if leaf.kind == "extrude" else _turned)(curve, turn, center)


def corners(face: Face, leaf: Primitive, numbers: Lowered) -> np.ndarray:
    """Points [n, 3] that tell how far a face goes, in the world: the corners of a flat face of a box, or of a flat wall of an extrusion; of
    a wall that is an arc the two ends and the middle of that, at the foot of one that leans; none of other faces."""
    turn, center = numbers.rotations[face.leaf], numbers.centers[face.leaf]
    local: list[tuple[float, float, float]] = []
    if leaf.kind == "box":
        axis, side = "xyz".index(face.name[1]), 1 if face.name[0] == "+" else -1
        signs = [s for s in product((-1, 1), repeat=3) if s[axis] == side]
        local = [(x * leaf.size[0] / 2, y * leaf.size[1] / 2, z * leaf.size[2] / 2) for x, y, z in signs]
    elif leaf.kind in ("extrude", "drafted") and (curve := wall_curve(leaf, face.name)) is not None:
        x, y, u, v, bulge = curve
        foot = -leaf.size[0] / 2
        if bulge:
            level = foot if leaf.kind == "drafted" else 0.0
            return center + np.array([(x, y, level), (u, v, level), (*arc_middle(curve), level)]) @ turn.T
        i, k = wall_place(face.name)
        top = loop_curves(top_of(leaf).loops[i])[k]
        assert not isinstance(top, Ellipse)
        local = [(x, y, foot), (u, v, foot), (*top[:2], -foot), (*top[2:4], -foot)]
    return center + np.array(local).reshape(-1, 3) @ turn.T


def _side(leaf: Primitive, turn: np.ndarray, center: np.ndarray) -> Surface | None:
    axis, at = vec(turn[:, 2]), vec(center)
    if leaf.kind == "cylinder":
        return Surface("cylinder", at, axis, (leaf.size[0],))
    if leaf.kind == "cone":
        bottom, top, height = leaf.size
        return _cone(bottom, -height / 2, top, height / 2, turn, center)
    if leaf.kind == "sphere":
        return Surface("sphere", at, (0.0, 0.0, 1.0), leaf.size)
    if leaf.kind == "torus":
        return Surface("torus", at, axis, leaf.size)
    return None


def _extruded(curve: tuple[float, ...], turn: np.ndarray, center: np.ndarray) -> Surface:
    x, y, u, v, bulge = curve
    if bulge:
        (cx, cy), radius = arc_center((x, y, u, v, bulge)), arc_radius((x, y, u, v, bulge))
        return Surface("cylinder", vec(center + turn[:, 0] * cx + turn[:, 1] * cy), vec(turn[:, 2]), (radius,))
    length = math.hypot(u - x, v - y)
    normal = turn[:, 0] * (v - y) / length - turn[:, 1] * (u - x) / length
    return Surface("plane", vec(center + turn[:, 0] * x + turn[:, 1] * y), vec(normal))


def _drafted(leaf: Primitive, curve: Curve, turn: np.ndarray, center: np.ndarray) -> Surface:
    """A plane that leans inward by the draft, or a cone."""
    x, y, u, v, bulge = curve
    height, draft = leaf.size
    if bulge:
        (cx, cy), radius = arc_center(curve), arc_radius(curve)
        narrower = radius - math.copysign(inset_at_top(height, draft), bulge)  # an arc that turns left has what is inside on its side
        return _cone(radius, -height / 2, narrower, height / 2, turn, center + turn[:, 0] * cx + turn[:, 1] * cy)
    length, cosine, sine = math.hypot(u - x, v - y), math.cos(math.radians(draft)), math.sin(math.radians(draft))
    normal = turn @ ((v - y) / length * cosine, (x - u) / length * cosine, sine)
    return Surface("plane", vec(center + turn @ (x, y, -height / 2)), vec(normal))


def _turned(curve: tuple[float, ...], turn: np.ndarray, center: np.ndarray) -> Surface | None:
    r, z, s, w, bulge = curve
    if bulge:
        (cr, cz), radius = arc_center((r, z, s, w, bulge)), arc_radius((r, z, s, w, bulge))
        at = vec(center + turn[:, 2] * cz)
        if abs(cr) < LEVEL * radius:
            return Surface("sphere", at, (0.0, 0.0, 1.0), (radius,))
        return Surface("torus", at, vec(turn[:, 2]), (cr, radius))
    if abs(w - z) < LEVEL * math.hypot(s - r, w - z):
        return Surface("plane", vec(center + turn[:, 2] * z), vec(turn[:, 2]))
    return _cone(r, z, s, w, turn, center)


def _cone(r: float, z: float, s: float, w: float, turn: np.ndarray, center: np.ndarray) -> Surface:
    """The cylinder or cone through the circles of radius `r` at height `z` and `s` at `w`."""
    if abs(s - r) < LEVEL * abs(w - z):
        return Surface("cylinder", vec(center), vec(turn[:, 2]), (r,))
    apex = z - r * (w - z) / (s - r)
    way = math.copysign(1.0, (z if r > s else w) - apex)
    return Surface("cone", vec(center + turn[:, 2] * apex), vec(turn[:, 2] * way), (math.atan(abs((s - r) / (w - z))),))
