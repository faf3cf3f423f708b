"""Certain relations between two primitives, by closed forms: True is a proof, False only means that none was found.

Every convex primitive (and the hull of a torus) is the hull of a few *rounds*: discs thickened by a ball. Containment in
a convex solid is containment of the rounds; for each solid there is a bound on how far a round sticks out. Disjointness is
a separating direction among a fixed set. Lengths agree up to a relative slack, so that faces which touch count as touching.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import product

from imdim.program.ellipse import Ellipse
from imdim.program.tree import Primitive, Vec3, envelope
from imdim.program.vectors import along, cross, dot

SLACK = 1e-9  # of the smaller primitive's bounding radius
_COORDINATE_NOISE = 1e-14  # of the largest coordinate: what rotating and adding doubles loses


def contains(outer: Primitive, inner: Primitive, slack: float = SLACK) -> bool:
    """Whether `inner` surely lies in `outer`, sticking out by at most `slack` of the smaller bounding radius."""
    if outer == inner:
        return True
    # of what outlines hold nothing is known but of ellipses; what an outline is held by is its envelope
    if outer.outline is not None:
        return _elliptic_overshoot(outer, inner) <= _length(envelope(outer), envelope(inner), slack)
    return _overshoot(outer, envelope(inner)) <= _length(outer, envelope(inner), slack)


def disjoint(a: Primitive, b: Primitive, slack: float = SLACK) -> bool:
    """Whether the interiors of `a` and `b` surely do not meet, or by at most `slack` of the smaller bounding radius."""
    a, b = envelope(a), envelope(b)
    return _gap(a, b) >= -_length(a, b, slack)


def same(a: Primitive, b: Primitive, slack: float = SLACK) -> bool:
    """Whether both are surely the same set, whatever their numbers (a cylinder turned upside down, a cube by 90 degrees)."""
    return contains(a, b, slack) and contains(b, a, slack)


def axes(p: Primitive) -> tuple[Vec3, Vec3, Vec3]:
    """The local x, y and z directions in world coordinates: the columns of R = Rz Ry Rx."""
    return _axes(p.rotation)


def reach(p: Primitive, direction: Vec3) -> float:
    """Support: the largest (point - center) . direction over the solid, for a unit `direction`."""
    n = tuple(dot(direction, axis) for axis in axes(p))
    p = envelope(p)
    return _REACH[p.kind](p.size, *n)


def bounding_radius(p: Primitive) -> float:
    """Radius of the ball about the centre that holds the solid."""
    p = envelope(p)
    return _RADIUS[p.kind](p.size)


def _elliptic_overshoot(outer: Primitive, inner: Primitive) -> float:
    """A bound on how far an extruded ellipse sticks out of another one that is drawn in the same plane; infinite for anything else."""
    ellipses = [_lone_ellipse(p) for p in (outer, inner)]
    if None in ellipses or outer.rotation != inner.rotation:
        return math.inf
    a, b = (ellipse.plain for ellipse in ellipses if ellipse is not None)
    x, y, w = (dot(along(inner.center, outer.center, -1.0), axis) for axis in axes(outer))
    (c, s), dx, dy = a.along, x + b.x - a.x, y + b.y - a.y
    off = math.hypot((c * dx + s * dy) / a.rx, (c * dy - s * dx) / a.ry)
    turned = abs(math.sin(math.radians(a.angle - b.angle))) * abs(b.rx - b.ry)
    # as of a disc of radius 1, to which the outer one is shrunk
    beside = (off + max(b.rx / a.rx, b.ry / a.ry) + turned / min(a.rx, a.ry) - 1.0) * max(a.rx, a.ry)
    return max(beside, abs(w) + (inner.size[0] - outer.size[0]) / 2)


def _lone_ellipse(p: Primitive) -> Ellipse | None:
    """The only loop of an extrusion, where that is an ellipse."""
    if p.kind != "extrude" or p.outline is None:
        return None
    loop, *others = p.outline.loops
    return loop if isinstance(loop, Ellipse) and not others else None


# --- how far one sticks out of the other -----------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Round:
    """All points within `ball` of a disc: `disc` is its radius, `axis` its unit normal."""

    center: Vec3
    axis: Vec3
    disc: float
    ball: float


def _ball(center: Vec3, radius: float) -> _Round:
    return _Round(center, (0.0, 0.0, 1.0), 0.0, radius)


@lru_cache(maxsize=1 << 16)
def _overshoot(outer: Primitive, inner: Primitive) -> float:
    if outer.kind == inner.kind and outer.kind in ("torus", "ellipsoid"):
        return min(_pairing_bound(outer, inner), _cover_bound(outer, inner))
    return _cover_bound(outer, inner)


def _cover_bound(outer: Primitive, inner: Primitive) -> float:
    covers = [[_ball(inner.center, bounding_radius(inner))]] if outer.kind == "torus" else _covers(inner)
    bound = _STICKS_OUT[outer.kind]
    return min(max(bound(outer.size, *_local(outer, r), r) for r in cover) for cover in covers)


def _pairing_bound(outer: Primitive, inner: Primitive) -> float:
    """A bound by moving `inner` rigidly onto the axes of `outer` and comparing sizes there."""
    shift = math.dist(outer.center, inner.center)
    pairs = zip(axes(outer), axes(inner), strict=True)
    # an axis may point either way: both solids are symmetric
    tilt = [min(math.dist(a, b), math.dist(a, (-b[0], -b[1], -b[2]))) for a, b in pairs]
    if outer.kind == "torus":
        (big, thick), (big2, thick2) = outer.size, inner.size
        return shift + big2 * tilt[2] + abs(big - big2) + thick2 - thick
    excess = (max(b - a, 0.0) for a, b in zip(outer.size, inner.size, strict=True))
    return shift + max(inner.size) * math.hypot(*tilt) + math.hypot(*excess)


@lru_cache(maxsize=1 << 14)
def _covers(p: Primitive) -> list[list[_Round]]:
    """Lists of rounds, each of which has a hull that holds `p` (exactly `p` but for the ellipsoid)."""
    z = axes(p)[2]
    if p.kind == "sphere":
        return [[_ball(p.center, p.size[0])]]
    if p.kind == "torus":
        return [[_Round(p.center, z, *p.size)]]
    if p.kind == "cylinder":
        r, h = p.size
        return [[_Round(along(p.center, z, t), z, r, 0.0) for t in (-h / 2, h / 2)]]
    if p.kind == "cone":
        bottom, top, h = p.size
        return [[_Round(along(p.center, z, t), z, r, 0.0) for t, r in ((-h / 2, bottom), (h / 2, top))]]
    if p.kind == "box":
        return [list(_corners(p, (p.size[0] / 2, p.size[1] / 2, p.size[2] / 2)))]
    return [[_ball(p.center, max(p.size))], list(_corners(p, (p.size[0], p.size[1], p.size[2])))]


def _corners(p: Primitive, half: Vec3) -> Iterator[_Round]:
    x, y, z = axes(p)
    for i, j, k in product((-1, 1), repeat=3):
        yield _ball(along(along(along(p.center, x, i * half[0]), y, j * half[1]), z, k * half[2]), 0.0)


def _local(p: Primitive, r: _Round) -> tuple[Vec3, Vec3]:
    x, y, z = axes(p)
    q = along(r.center, p.center, -1.0)
    return (dot(q, x), dot(q, y), dot(q, z)), (dot(r.axis, x), dot(r.axis, y), dot(r.axis, z))


def _out_of_box(size: tuple[float, ...], c: Vec3, n: Vec3, r: _Round) -> float:
    # the sines from the other two components: 1 - cosine^2 would lose half of the digits
    sines = (math.hypot(n[1], n[2]), math.hypot(n[2], n[0]), math.hypot(n[0], n[1]))
    return max(abs(c[i]) + r.disc * sines[i] + r.ball - size[i] / 2 for i in range(3))


def _out_of_sphere(size: tuple[float, ...], c: Vec3, n: Vec3, r: _Round) -> float:
    height = dot(c, n)
    rho = math.hypot(*along(c, n, -height))
    return math.hypot(rho + r.disc, height) + r.ball - size[0]


def _out_of_cylinder(size: tuple[float, ...], c: Vec3, n: Vec3, r: _Round) -> float:
    side = math.hypot(c[0], c[1]) + r.disc + r.ball - size[0]
    return max(side, abs(c[2]) + r.disc * math.hypot(n[0], n[1]) + r.ball - size[1] / 2)


def _out_of_cone(size: tuple[float, ...], c: Vec3, n: Vec3, r: _Round) -> float:
    bottom, top, h = size
    slant = math.hypot(h, top - bottom)
    cosine, sine, lean = h / slant, abs(top - bottom) / slant, math.hypot(n[0], n[1])
    wall = bottom + (top - bottom) * (c[2] / h + 0.5)
    side = (math.hypot(c[0], c[1]) + r.disc - wall) * cosine + r.disc * lean * sine + r.ball
    return max(side, abs(c[2]) + r.disc * lean + r.ball - h / 2)


def _out_of_torus(size: tuple[float, ...], c: Vec3, n: Vec3, r: _Round) -> float:
    return math.hypot(math.hypot(c[0], c[1]) - size[0], c[2]) + r.disc + r.ball - size[1]


def _out_of_ellipsoid(size: tuple[float, ...], c: Vec3, n: Vec3, r: _Round) -> float:
    scaled = math.hypot(*(v / s for v, s in zip(c, size, strict=True)))
    return (scaled + (r.disc + r.ball) / min(size) - 1.0) * max(size)


_STICKS_OUT: Mapping[str, Callable[[tuple[float, ...], Vec3, Vec3, _Round], float]] = {
    "box": _out_of_box,
    "sphere": _out_of_sphere,
    "cylinder": _out_of_cylinder,
    "cone": _out_of_cone,
    "torus": _out_of_torus,
    "ellipsoid": _out_of_ellipsoid,
}

# --- separation ------------------------------------------------------------------------------------------------------

_REACH: Mapping[str, Callable[[tuple[float, ...], float, float, float], float]] = {
    "box": lambda s, x, y, z: (abs(x) * s[0] + abs(y) * s[1] + abs(z) * s[2]) / 2,
    "sphere": lambda s, x, y, z: s[0],
    "cylinder": lambda s, x, y, z: s[0] * math.hypot(x, y) + abs(z) * s[1] / 2,
    "cone": lambda s, x, y, z: max(s[0] * math.hypot(x, y) - z * s[2] / 2, s[1] * math.hypot(x, y) + z * s[2] / 2),
    "torus": lambda s, x, y, z: s[0] * math.hypot(x, y) + s[1],
    "ellipsoid": lambda s, x, y, z: math.hypot(x * s[0], y * s[1], z * s[2]),
}
_RADIUS: Mapping[str, Callable[[tuple[float, ...]], float]] = {
    "box": lambda s: math.hypot(*s) / 2,
    "sphere": lambda s: s[0],
    "cylinder": lambda s: math.hypot(s[0], s[1] / 2),
    "cone": lambda s: math.hypot(max(s[0], s[1]), s[2] / 2),
    "torus": lambda s: s[0] + s[1],
    "ellipsoid": max,
}


@lru_cache(maxsize=1 << 16)
def _gap(a: Primitive, b: Primitive) -> float:
    """The widest gap between the two along the candidate directions; negative where none separates them."""
    offset = along(b.center, a.center, -1.0)
    distance = math.hypot(*offset)
    if distance >= bounding_radius(a) + bounding_radius(b):
        return distance - bounding_radius(a) - bounding_radius(b)
    widest = -math.inf
    for n in _directions(a, b, offset):
        back = (-n[0], -n[1], -n[2])
        t = dot(offset, n)
        widest = max(widest, t - reach(a, n) - reach(b, back), -t - reach(a, back) - reach(b, n))
    return widest


def _directions(a: Primitive, b: Primitive, offset: Vec3) -> Iterator[Vec3]:
    yield from axes(a)
    yield from axes(b)
    raw = [offset]
    for u in axes(a):
        raw.append(along(offset, u, -dot(offset, u)))
        raw += (cross(u, v) for v in axes(b))
    for v in raw:
        length = math.hypot(*v)
        if length > 1e-9 * max(1.0, math.hypot(*offset)):
            yield (v[0] / length, v[1] / length, v[2] / length)


def _length(a: Primitive, b: Primitive, slack: float) -> float:
    noise = max(map(abs, (*a.center, *b.center))) + max(bounding_radius(a), bounding_radius(b))
    return slack * min(bounding_radius(a), bounding_radius(b)) + _COORDINATE_NOISE * noise


@lru_cache(maxsize=1 << 14)
def _axes(euler_deg: Vec3) -> tuple[Vec3, Vec3, Vec3]:
    (cx, cy, cz), (sx, sy, sz) = ([f(math.radians(a)) for a in euler_deg] for f in (math.cos, math.sin))
    x = (cy * cz, cy * sz, -sy)
    y = (sx * sy * cz - cx * sz, sx * sy * sz + cx * cz, sx * cy)
    z = (cx * sy * cz + sx * sz, cx * sy * sz - sx * cz, cx * cy)
    return x, y, z
