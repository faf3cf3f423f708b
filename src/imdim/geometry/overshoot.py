"""Let cutters overshoot: a program with the same solid, without faces that only just meet.

Where a subtracted primitive ends exactly at a face of what it cuts, rounding leaves a skin of no thickness. Modellers therefore let the
cutter stick out, and let joined parts sink into each other. Here every planar face of a primitive is moved outward if two things hold:

- the primitive matters right up to that face: just inside it, the program's solid changes when the primitive is taken away;
- it does not matter beyond it: from a skin's thickness outward, the solid is the same with and without it.

Both are decided by exact booleans in the thin region concerned, so the solid stays the same up to skins and gaps thinner than `SKIN`.
A few points of the region are asked first: where one of them shows that the primitive matters, no boolean need.
Copies of one part stay alike: a face of all of them moves if one of them has to and all of them may.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from manifold3d import Manifold

from imdim.geometry import kernels
from imdim.geometry.lowering import Lowered, postfix
from imdim.geometry.solid import exact_rotation, primitive_to_manifold
from imdim.program.repeats import Folded, instances
from imdim.program.tree import KINDS, Op, Primitive, Program, fold, leaves, map_leaves

SKIN = 1e-4  # fraction of the diagonal: what is thinner is no feature
REACH = 2e-2  # fraction of the diagonal: the overshoot is the power of ten below it
NOTHING = 1e-6  # fraction of a region's volume that counts as unchanged
SHRINK = 2e-3  # fraction of a radius by which regions are narrower than their face, more than the sagitta at CHECK_SEGMENTS
CHECK_SEGMENTS = 64
PROBES = 64  # points of a region that are asked first
INSCRIBED = 1 - 2.5e-3  # of a radius: what polyhedra of CHECK_SEGMENTS hold in every direction

Face = tuple[int, int]  # local axis, and +1 or -1 for the end on it


def overshoot(
    program: Program, folded: Folded | None = None, reach: float | None = None, out_of_time: Callable[[], bool] = bool
) -> Program:
    """The same solid with cutters that stick out of what they cut, and joined parts that sink into each other.

    `folded`, which `program` is the expansion of, says which leaves are copies. Cutters go first, and what already sticks out stays.
    Overshoots are `reach`, else halves of it; by default round numbers: a power of ten, at most REACH of the diagonal.
    Once `out_of_time` (by default never) the other faces stay where they are.
    """
    placed = [Placed(leaf) for leaf in leaves(program)]
    signs = _signs(program)
    diagonal = _diagonal([part for part, sign in zip(placed, signs, strict=True) if sign > 0])
    rounded = [10.0 ** (math.floor(math.log10(REACH * diagonal)) - k) for k in range(2)]
    steps = rounded if reach is None else [reach / 2**k for k in range(3)]
    copies = {i: [(i, False)] for i in range(len(placed))} if folded is None else _copies(folded)
    for index in sorted(copies, key=lambda i: signs[i]):
        for face in () if out_of_time() else _faces(placed[index].leaf):
            faces = [(i, _flipped(face) if mirrored else face) for i, mirrored in copies[index]]
            step = next((s for s in steps if _may_extend(program, placed, faces, s, SKIN * diagonal)), None)
            for i, own in faces if step is not None else ():
                leaf = placed[i].leaf
                placed[i] = Placed(between(leaf, own, -_length(leaf, own), step))  # type: ignore[arg-type]
    return map_leaves(program, lambda i, _: placed[i].leaf)


def between(leaf: Primitive, face: Face, low: float, high: float) -> Primitive:
    """The part of `leaf`, prolonged past `face`, from `low` to `high` measured outward from that face; a cone keeps its slope.

    A cone ends at its apex at the latest.
    """
    axis, side = face
    length = _length(leaf, face)
    if leaf.kind == "cone":
        high = min(high, _apex(leaf, face))
    shift = side * (length + low + high) / 2
    x, y, z = (c + float(d) * shift for c, d in zip(leaf.center, exact_rotation(leaf)[:, axis], strict=True))
    return replace(leaf, size=_size_between(leaf, face, low, high), center=(x, y, z))


@dataclass(frozen=True)
class Placed:
    """A primitive with what the tests ask of it again and again."""

    leaf: Primitive

    @cached_property
    def rotation(self) -> np.ndarray:
        """World from local [3, 3]."""
        return exact_rotation(self.leaf)

    @cached_property
    def half(self) -> np.ndarray:
        """Half extents [3] of the local box."""
        return np.array(_HALF[self.leaf.kind](self.leaf.size))

    @cached_property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Low and high corner [3] of the world box."""
        reach = np.abs(self.rotation) @ self.half
        return self.leaf.center - reach, self.leaf.center + reach

    @cached_property
    def sizes(self) -> np.ndarray:
        """Sizes [2, 3], padded with zeros: the primitive's, and those of a like one that its polyhedron holds."""
        size = self.leaf.size
        held = size if self.leaf.kind == "box" else tuple(INSCRIBED * s for s in size)
        if self.leaf.kind in ("cylinder", "cone"):
            held = (*held[:-1], size[-1])
        elif self.leaf.kind == "torus":
            held = (size[0], max(size[1] - (1 - INSCRIBED) * sum(size), 1e-9 * size[1]))
        return np.array([(*s, 0.0, 0.0)[:3] for s in (size, held)])

    @cached_property
    def corners(self) -> np.ndarray:
        """The eight corners [8, 3] of the local box, in the world."""
        return (_CUBE * self.half) @ self.rotation.T + self.leaf.center

    @cached_property
    def solid(self) -> Manifold:
        """The exact solid."""
        return primitive_to_manifold(self.leaf, CHECK_SEGMENTS)


_CUBE = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])

_HALF: Mapping[str, Callable[[tuple[float, ...]], tuple[float, float, float]]] = {
    "box": lambda s: (s[0] / 2, s[1] / 2, s[2] / 2),
    "sphere": lambda s: (s[0], s[0], s[0]),
    "cylinder": lambda s: (s[0], s[0], s[1] / 2),
    "cone": lambda s: (max(s[:2]), max(s[:2]), s[2] / 2),
    "torus": lambda s: (s[0] + s[1], s[0] + s[1], s[1]),
    "ellipsoid": lambda s: (s[0], s[1], s[2]),
}

# Whether local points [n, 3] lie inside, for the convex kinds: all corners inside means the whole region inside
_CONVEX: Mapping[str, Callable[[tuple[float, ...], np.ndarray], Any]] = {
    "box": lambda s, q: (np.abs(q) <= np.array(s) / 2).all(axis=1),
    "sphere": lambda s, q: (q * q).sum(axis=1) <= s[0] ** 2,
    "cylinder": lambda s, q: (np.hypot(q[:, 0], q[:, 1]) <= s[0]) & (np.abs(q[:, 2]) <= s[1] / 2),
    "cone": lambda s, q: (np.hypot(q[:, 0], q[:, 1]) <= s[0] + (s[1] - s[0]) * (q[:, 2] / s[2] + 0.5)) & (np.abs(q[:, 2]) <= s[2] / 2),
    "ellipsoid": lambda s, q: ((q / np.array(s)) ** 2).sum(axis=1) <= 1,
}


def _copies(folded: Folded) -> dict[int, list[tuple[int, bool]]]:
    """For each leaf that is no copy, itself and its copies, and whether these are mirrored."""
    out: dict[int, list[tuple[int, bool]]] = {}
    for i, (source, motion) in enumerate(instances(folded)):
        out.setdefault(source, []).append((i, motion.mirrors))
    return out


def _flipped(face: Face) -> Face:
    """The face of a mirror image, which is turned so that its local x is the other way."""
    return (0, -face[1]) if face[0] == 0 else face


def _may_extend(program: Program, placed: list[Placed], faces: list[tuple[int, Face]], step: float, skin: float) -> bool:
    """Whether a primitive ends within `skin` of where it stops to matter, and none of the copies matters from there to `step`."""
    index, face = faces[0]
    leaf = placed[index].leaf
    skin = min(skin, _length(leaf, face) / 8)
    high = min(step, _apex(leaf, face)) if leaf.kind == "cone" else step
    if high <= 2 * skin or any(_matters(program, placed, i, _beyond(placed[i].leaf, own, skin, high)) for i, own in faces):
        return False
    return any(_matters(program, placed, i, _within(placed[i].leaf, own, skin)) for i, own in faces)


def _beyond(leaf: Primitive, face: Face, skin: float, high: float) -> Primitive:
    return _narrowed(between(leaf, face, skin, high), face, skin)


def _within(leaf: Primitive, face: Face, skin: float) -> Primitive:
    """As narrow as the face itself, although a cone is wider there: another cutter that meets the rim covers it."""
    return _narrowed(between(leaf, face, -2 * skin, -skin), face, skin * (1 + 2 * _widening(leaf, face)))


def _matters(program: Program, placed: list[Placed], index: int, region: Primitive) -> bool:
    """Whether the program's solid inside `region`, a part of primitive `index` or its prolongation, depends on that primitive."""
    return _seen_to_matter(program, placed, index, region) or _decides(program, placed, index, Placed(region))


def _seen_to_matter(program: Program, placed: list[Placed], index: int, region: Primitive) -> bool:
    """Whether a point of the region shows it, by the primitives' true surfaces and by those that their polyhedra have at least."""
    points, code, size = _probes(region), postfix(program), _diagonal(placed)
    kinds = np.array([KINDS.index(part.leaf.kind) for part in placed])
    kinds[index] = KINDS.index("sphere")
    centers = np.array([part.leaf.center for part in placed])
    rotations = np.stack([part.rotation for part in placed])
    shows = np.ones(len(points), bool)
    for sizes in (np.stack([part.sizes[k] for part in placed]) for k in (0, 1)):
        # a ball that holds everything in the primitive's place, and one that holds nothing
        both = []
        for radius in (4 * size, 1e-9 * size):
            sizes[index], centers[index] = radius, points[0] + (0.0 if radius > size else 2 * size)
            both.append(kernels.inside(Lowered(code, kinds, sizes, centers, rotations), points))
        shows &= both[0] != both[1]
    return bool(shows.any())


def _probes(region: Primitive) -> np.ndarray:
    """Points [PROBES, 3] strewn evenly over a box, cylinder or cone, away from its rim (after Roberts 2018)."""
    u = (np.arange(1, PROBES + 1)[:, None] * np.array([0.8191725134, 0.6710436067, 0.5497004779])) % 1.0
    if region.kind == "box":
        local = (u - 0.5) * region.size
    else:
        bottom, top = region.size[0], region.size[-2]
        rho = INSCRIBED * np.sqrt(u[:, 0]) * (bottom + (top - bottom) * u[:, 2])
        turn = 2 * np.pi * u[:, 1]
        local = np.column_stack([rho * np.cos(turn), rho * np.sin(turn), (u[:, 2] - 0.5) * region.size[-1]])
    return local @ exact_rotation(region).T + region.center


@dataclass(frozen=True)
class _Open:
    """A part of the program that holds the primitive asked about, which still decides the solid in `where`."""

    where: _Local


def _decides(program: Program, placed: list[Placed], index: int, region: Placed) -> bool:
    """`_matters` by exact booleans: what is left of the region after each operation above the primitive."""
    plain: Mapping[Op, Callable[[_Local, _Local], _Local]] = {
        "union": _union,
        "intersection": _intersection,
        "difference": lambda keep, cut: _difference(keep, cut, region.solid),
    }

    def combined(op: Op, a: Any, b: Any) -> _Local | _Open:
        if isinstance(a, _Open):
            return _Open(plain["intersection" if op == "intersection" else "difference"](a.where, b))
        if isinstance(b, _Open):
            return _Open(plain["difference" if op == "union" else "intersection"](b.where, a))
        return plain[op](a, b)

    values = [_Open(True) if i == index else _restricted(part, region) for i, part in enumerate(placed)]
    root = fold(program, lambda i, _: values[i], {op: partial(combined, op) for op in plain})
    left = root.where if isinstance(root, _Open) else root
    return left if isinstance(left, bool) else left.volume() > NOTHING * region.solid.volume()


# A part of the program inside one small region: everywhere (True), nowhere (False), or a solid inside it.
_Local = bool | Manifold


def _restricted(part: Placed, region: Placed) -> _Local:
    if _apart(part, region):
        return False
    contains = _CONVEX.get(part.leaf.kind)
    if contains is not None and contains(part.leaf.size, (region.corners - part.leaf.center) @ part.rotation).all():
        return True
    # booleans are put off until somebody asks for their volume
    return part.solid ^ region.solid


def _apart(a: Placed, b: Placed) -> bool:
    """Whether a face of one of the two local boxes parts them."""
    turn, gap = a.rotation.T @ b.rotation, np.subtract(b.leaf.center, a.leaf.center)
    along_a = np.abs(a.rotation.T @ gap) >= a.half + np.abs(turn) @ b.half
    along_b = np.abs(b.rotation.T @ gap) >= b.half + np.abs(turn.T) @ a.half
    return bool(along_a.any() or along_b.any())


def _union(a: _Local, b: _Local) -> _Local:
    if isinstance(a, bool):
        return True if a else b
    return (True if b else a) if isinstance(b, bool) else a + b


def _intersection(a: _Local, b: _Local) -> _Local:
    if isinstance(a, bool):
        return b if a else False
    return (a if b else False) if isinstance(b, bool) else a ^ b


def _difference(keep: _Local, cut: _Local, region: Manifold) -> _Local:
    if isinstance(cut, bool):
        return False if cut else keep
    if isinstance(keep, bool):
        return region - cut if keep else False
    return keep - cut


def _faces(leaf: Primitive) -> Iterator[Face]:
    if leaf.kind == "box":
        yield from ((axis, side) for axis in range(3) for side in (-1, 1))
    elif leaf.kind in ("cylinder", "cone"):
        yield from ((2, side) for side in (-1, 1) if leaf.kind == "cylinder" or _end_radii(leaf, side)[0] > 0)


def _length(leaf: Primitive, face: Face) -> float:
    """Size of the leaf across `face`."""
    return leaf.size[face[0]] if leaf.kind == "box" else leaf.size[-1]


def _end_radii(cone: Primitive, side: int) -> tuple[float, float]:
    """Radius at the end on `side`, and at the other."""
    bottom, top, _ = cone.size
    return (top, bottom) if side > 0 else (bottom, top)


def _slope(cone: Primitive, face: Face) -> float:
    here, other = _end_radii(cone, face[1])
    return (here - other) / cone.size[2]


def _widening(leaf: Primitive, face: Face) -> float:
    """Growth of the radius per unit of depth behind `face`."""
    return max(-_slope(leaf, face), 0.0) if leaf.kind == "cone" else 0.0


def _apex(cone: Primitive, face: Face) -> float:
    """How far outward of `face` the cone has its apex; infinite where it widens."""
    slope = _slope(cone, face)
    return _end_radii(cone, face[1])[0] / -slope if slope < 0 else math.inf


def _size_between(leaf: Primitive, face: Face, low: float, high: float) -> tuple[float, ...]:
    axis, side = face
    if leaf.kind == "box":
        return (*leaf.size[:axis], high - low, *leaf.size[axis + 1 :])
    if leaf.kind == "cylinder":
        return (leaf.size[0], high - low)
    here, slope = _end_radii(leaf, side)[0], _slope(leaf, face)
    inner, outer = max(here + slope * low, 0.0), max(here + slope * high, 0.0)
    return (inner, outer, high - low) if side > 0 else (outer, inner, high - low)


def _narrowed(region: Primitive, face: Face, rim: float) -> Primitive:
    """The region without its rim, where coarser circles and lateral skins would decide."""
    if region.kind == "box":
        return replace(region, size=tuple(s if axis == face[0] else max(s - 2 * rim, s / 2) for axis, s in enumerate(region.size)))
    radii = tuple(max(r * (1 - SHRINK) - rim, r / 2) for r in region.size[:-1])
    return replace(region, size=(*radii, region.size[-1]))


def _signs(program: Program) -> list[int]:
    """+1 for each leaf that adds, -1 for each that cuts, in order."""

    def negate(keep: list[int], cut: list[int]) -> list[int]:
        return keep + [-sign for sign in cut]

    return fold(program, lambda _, __: [1], {"union": list.__add__, "intersection": list.__add__, "difference": negate})


def _diagonal(parts: list[Placed]) -> float:
    low = np.min([part.bounds[0] for part in parts], axis=0)
    high = np.max([part.bounds[1] for part in parts], axis=0)
    return float(np.linalg.norm(high - low))
