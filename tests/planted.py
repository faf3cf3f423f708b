"""Small parts planted as programs, in millimetres as a designer would type them: what detection and search must give back.

`PARTS` maps a name to its program, `mesh_of` renders one as a solid modeller would, `carriers` lists the surfaces it was drawn with.
"""

from __future__ import annotations

import math

import numpy as np
import trimesh
from manifold3d import Manifold

from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.geometry.surface import Surface
from imdim.program.tree import Primitive, Program, Vec3, combine_all, leaves

ORIGIN = (0.0, 0.0, 0.0)
ALONG_X = (0.0, 90.0, 0.0)
ALONG_Y = (-90.0, 0.0, 0.0)


def box(sx: float, sy: float, sz: float, center: Vec3 = ORIGIN, rotation: Vec3 = ORIGIN) -> Primitive:
    return Primitive("box", (sx, sy, sz), center, rotation)


def cylinder(r: float, h: float, center: Vec3 = ORIGIN, rotation: Vec3 = ORIGIN) -> Primitive:
    return Primitive("cylinder", (r, h), center, rotation)


def cone(r_bottom: float, r_top: float, h: float, center: Vec3 = ORIGIN) -> Primitive:
    return Primitive("cone", (r_bottom, r_top, h), center)


def torus(r_major: float, r_minor: float, center: Vec3 = ORIGIN, rotation: Vec3 = ORIGIN) -> Primitive:
    return Primitive("torus", (r_major, r_minor), center, rotation)


def ellipsoid(rx: float, ry: float, rz: float, center: Vec3 = ORIGIN, rotation: Vec3 = ORIGIN) -> Primitive:
    return Primitive("ellipsoid", (rx, ry, rz), center, rotation)


def sphere(r: float, center: Vec3 = ORIGIN) -> Primitive:
    return Primitive("sphere", (r,), center)


def union(*parts: Program) -> Program:
    return combine_all("union", list(parts))


def cut(*parts: Program) -> Program:
    """The first part without all the others."""
    return combine_all("difference", list(parts))


def common(*parts: Program) -> Program:
    return combine_all("intersection", list(parts))


PLATE_WITH_HOLES = cut(box(80, 50, 6), *(cylinder(3, 8, (x, y, 0.0)) for x in (-30.0, 30.0) for y in (-15.0, 15.0)))

PARTS: dict[str, Program] = {
    "plate with four holes": PLATE_WITH_HOLES,
    "L bracket": union(box(60, 40, 5, (0.0, 0.0, 2.5)), box(5, 40, 45, (-27.5, 0.0, 22.5))),
    "tube on a flange": cut(union(cylinder(20, 5, (0.0, 0.0, 2.5)), cylinder(10, 30, (0.0, 0.0, 15.0))), cylinder(7, 40, (0.0, 0.0, 15.0))),
    "open box": cut(box(60, 40, 30, (0.0, 0.0, 15.0)), box(56, 36, 30, (0.0, 0.0, 17.0))),
    "rounded plate": union(box(60, 28, 4), box(48, 40, 4), *(cylinder(6, 4, (x, y, 0.0)) for x in (-24.0, 24.0) for y in (-14.0, 14.0))),
    "bored ball": cut(common(sphere(20), box(50, 50, 28)), *(cylinder(5, 50, rotation=r) for r in (ORIGIN, ALONG_X, ALONG_Y))),
    "countersink": cut(box(30, 30, 8), cylinder(3, 10), cone(3, 6, 3, (0.0, 0.0, 2.5))),
    "stepped shaft": union(cylinder(5, 60, (0.0, 0.0, 30.0)), cylinder(8, 20, (0.0, 0.0, 30.0)), cylinder(12, 6, (0.0, 0.0, 30.0))),
}


def mesh_of(program: Program, segments: int = 96) -> trimesh.Trimesh:
    return to_trimesh(to_manifold(program, segments))


def polar_ball(radius: float, facets: int) -> Manifold:
    """A ball as OpenSCAD's: rings half a step off the poles, which it does not reach."""
    tilts = [math.pi * (k + 0.5) / (facets // 2) for k in range(facets // 2)]
    turns = [2 * math.pi * k / facets for k in range(facets)]
    ring = [(math.sin(a) * math.cos(t), math.sin(a) * math.sin(t), math.cos(a)) for a in tilts for t in turns]
    return Manifold.hull_points(radius * np.array(ring))


def carriers(program: Program) -> list[Surface]:
    """The unbounded surfaces of all primitives, those that coincide listed once."""
    out: list[Surface] = []
    for leaf in leaves(program):
        out += [s for s in _carriers_of(leaf) if not any(same(s, other, 1e-9) for other in out)]
    return out


def _carriers_of(leaf: Primitive) -> list[Surface]:
    axes = matrix_from_euler(leaf.rotation).T
    center, z = np.array(leaf.center), axes[2]

    def at(height: float) -> Vec3:
        x, y, z_ = center + height * z
        return (float(x), float(y), float(z_))

    def plane(axis: np.ndarray, offset: float) -> Surface:
        x, y, z_ = center + offset * axis
        return Surface("plane", (float(x), float(y), float(z_)), _vec(axis))

    if leaf.kind == "box":
        return [plane(a, sign * edge / 2) for a, edge in zip(axes, leaf.size, strict=True) for sign in (-1, 1)]
    if leaf.kind == "cylinder":
        r, h = leaf.size
        return [Surface("cylinder", at(0.0), _vec(z), (r,)), plane(z, -h / 2), plane(z, h / 2)]
    if leaf.kind == "cone":
        bottom, top, h = leaf.size
        sign = 1.0 if top > bottom else -1.0
        apex = at(h / 2 - h * top / (top - bottom))
        return [Surface("cone", apex, _vec(sign * z), (math.atan(abs(top - bottom) / h),)), plane(z, -h / 2), plane(z, h / 2)]
    return [Surface(leaf.kind, at(0.0), _vec(z), leaf.size, _vec(axes[0]) if leaf.kind == "ellipsoid" else (1.0, 0.0, 0.0))]


def _vec(v: np.ndarray) -> Vec3:
    return (float(v[0]), float(v[1]), float(v[2]))


def same(a: Surface, b: Surface, tolerance: float) -> bool:
    """Whether two carriers are one, up to the sense of an axis that has none: lengths to `tolerance`, angles to 1e-4 radians."""
    if a.kind == b.kind == "ellipsoid":  # its semi-axes may be named in any order
        shapes = [(s.frame * s.sizes) @ s.frame.T for s in (a, b)]
        return bool(np.linalg.norm(np.subtract(a.point, b.point)) < tolerance and np.allclose(*shapes, rtol=0, atol=tolerance))
    if a.kind != b.kind or not np.allclose(a.sizes, b.sizes, rtol=0, atol=1e-4 if a.kind == "cone" else tolerance):
        return False
    gap, axis = np.subtract(a.point, b.point), np.array(a.axis)
    if a.kind == "sphere":
        return bool(np.linalg.norm(gap) < tolerance)
    turn = np.linalg.norm(np.cross(axis, b.axis))
    if turn > 1e-4 or (a.kind == "cone" and axis @ b.axis < 0):
        return False
    off = {"plane": abs(gap @ axis), "cylinder": np.linalg.norm(gap - (gap @ axis) * axis)}.get(a.kind, np.linalg.norm(gap))
    return bool(off < tolerance)
