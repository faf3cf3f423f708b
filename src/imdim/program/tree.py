"""The central type: a CSG program as an immutable tree of primitives and boolean operations.

Every other form (ShapeState, tokens, CSG-Stump matrices, JSON, OpenSCAD, the leaf table) lowers to it or is lifted from it.
A program is a value: frozen, hashable, made of plain floats. Changing it makes a new one.

A primitive sits in its local frame, centred at the origin with its axis along local z, and is placed by
``world = R @ local + center`` with ``R = Rz(rz) @ Ry(ry) @ Rx(rx)``, which is OpenSCAD's ``rotate([rx, ry, rz])``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal, TypeVar

from imdim.program.drafting import foot_of, inset_at_top, shrink
from imdim.program.outline import Outline

Op = Literal["union", "intersection", "difference"]
Vec3 = tuple[float, float, float]
T = TypeVar("T")

OPS: tuple[Op, ...] = ("union", "intersection", "difference")

# Full edge lengths for a box, semi-axes for an ellipsoid, full heights for cylinder, cone and extrusions, degrees for a turned outline and
# for the angle by which the walls of a drafted one lean inward.
SIZE_NAMES: Mapping[str, tuple[str, ...]] = {
    "box": ("sx", "sy", "sz"),
    "sphere": ("r",),
    "cylinder": ("r", "h"),
    "cone": ("r_bottom", "r_top", "h"),
    "torus": ("r_major", "r_minor"),
    "ellipsoid": ("rx", "ry", "rz"),
    "extrude": ("h",),
    "revolve": ("angle",),
    "drafted": ("h", "draft"),
}
KINDS: tuple[str, ...] = tuple(SIZE_NAMES)
OUTLINED = ("extrude", "revolve", "drafted")  # drawn from an outline
SIMPLE: tuple[str, ...] = tuple(kind for kind in KINDS if kind not in OUTLINED)  # the six that numbers alone describe
ACROSS = ("extrude", "drafted")  # whose outline lies across their axis, and does not turn about it
ANGLED = ("revolve", "drafted")  # whose last size is an angle, in degrees
ANGLES = ("angle", "draft")  # the sizes that are degrees
PRISMS = ("box", "cylinder", "extrude")  # which keep their section from end to end
# The local axes across which a kind has two plane ends, each with the place in `size` of the length between them.
FLAT_ENDS: Mapping[str, Mapping[int, int]] = {"box": {0: 0, 1: 1, 2: 2}, "cylinder": {2: 1}, "cone": {2: 2}, "extrude": {2: 0}}
# Also of what is another solid with an end elsewhere: where the foot of a drafted outline moves, so does what is drawn there.
PLANE_ENDS: Mapping[str, Mapping[int, int]] = {**FLAT_ENDS, "drafted": {2: 0}}
FULL_TURN = 360.0
UPRIGHT_TO_FLAT = 90.0  # degrees
ROUNDING = 1e-12  # of the radius, by which an arc that ends on the axis may seem to cross it


def check_size(kind: str, size: tuple[float, ...]) -> None:
    """Raise ValueError unless `size` is a proper size of `kind`; a cone may have one zero radius, a torus needs r_minor <= r_major."""
    if kind not in SIZE_NAMES:
        raise ValueError(f"unknown primitive kind {kind!r}; known are {', '.join(KINDS)}")
    names = SIZE_NAMES[kind]
    if len(size) != len(names):
        raise ValueError(f"{kind} needs {len(names)} sizes {names}, got {size}")
    free = {"r_bottom", "r_top"} if kind == "cone" else set()
    for name, value in zip(names, size, strict=True):
        if not math.isfinite(value) or value < 0 or (value == 0 and name not in free):
            raise ValueError(f"{kind} needs positive {name}, got {value}")
    if kind == "cone" and size[0] == size[1] == 0:
        raise ValueError(f"cone needs one positive radius, got {size}")
    if kind == "torus" and size[1] > size[0]:
        raise ValueError(f"torus needs r_minor <= r_major, got {size}")
    if kind == "drafted" and size[1] >= UPRIGHT_TO_FLAT:
        raise ValueError(f"drafted needs a draft below {UPRIGHT_TO_FLAT:g} degrees, got {size[1]}")
    if kind == "revolve" and size[0] > FULL_TURN:
        raise ValueError(f"revolve needs an angle of at most {FULL_TURN:g}, got {size[0]}")


@dataclass(frozen=True, slots=True)
class Primitive:
    """One solid: `kind`, `size` in the order of SIZE_NAMES[kind], `center`, `rotation` in Euler degrees.

    The OUTLINED kinds have an `outline`. An extrusion's lies in the local xy plane and is swept from -h/2 to h/2 along local z; a turned
    one's lies in the half plane (x >= 0, z) and is turned about local z, from the x axis counter-clockwise. The bounding box of an
    outline is best kept about the origin (for a turned one about z = 0): it is then as small as the box that the solid is taken to fill.
    A drafted one is an extrusion whose outline is that at -h/2, and whose walls lean inward by `draft` degrees on the way up;
    its loops are kept with what is inside on their left, holes behind what they are in.
    """

    kind: str
    size: tuple[float, ...]
    center: Vec3 = (0.0, 0.0, 0.0)
    rotation: Vec3 = (0.0, 0.0, 0.0)
    outline: Outline | None = None

    def __post_init__(self) -> None:
        check_size(self.kind, self.size)
        if (self.outline is None) == (self.kind in OUTLINED):
            raise ValueError(f"{self.kind} needs {'an' if self.outline is None else 'no'} outline")
        if self.kind == "revolve" and self.outline is not None:
            low, high = self.outline.bounds
            if low[0] < -ROUNDING * high[0]:
                raise ValueError(f"revolve needs an outline at x >= 0, got one that crosses its axis to x = {low[0]:g}")
        if self.kind == "drafted" and self.outline is not None:
            object.__setattr__(self, "outline", foot_of(self.outline))
            shrink(self.outline, inset_at_top(*self.size))
        for name, values in (("center", self.center), ("rotation", self.rotation)):
            if len(values) != 3 or not all(math.isfinite(v) for v in values):
                raise ValueError(f"{self.kind} needs three finite numbers as {name}, got {values}")


@dataclass(frozen=True, slots=True)
class Combine:
    """A boolean operation on two programs; `difference` keeps `left` and cuts `right`."""

    op: Op
    left: Program
    right: Program

    def __post_init__(self) -> None:
        if self.op not in OPS:
            raise ValueError(f"unknown operation {self.op!r}; known are {', '.join(OPS)}")

    # a flat union of thousands is a tree as deep: where Python's stack ends, the same is done without recursion
    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Combine):
            return NotImplemented
        try:
            return self.op == other.op and self.left == other.left and self.right == other.right
        except RecursionError:
            return _same(self, other)

    def __hash__(self) -> int:
        try:
            return hash((self.op, hash(self.left), hash(self.right)))
        except RecursionError:
            return fold(self, lambda _, leaf: hash(leaf), {op: (lambda a, b, op=op: hash((op, a, b))) for op in OPS})  # type: ignore[misc]


Program = Primitive | Combine


def leaves(program: Program) -> Iterator[Primitive]:
    """The primitives from left to right: row i of the leaf table is the i-th of these."""
    stack: list[Program] = [program]
    while stack:
        node = stack.pop()
        if isinstance(node, Primitive):
            yield node
        else:
            stack += (node.right, node.left)


def fold(program: Program, leaf: Callable[[int, Primitive], T], combine: Mapping[Op, Callable[[T, T], T]]) -> T:
    """Evaluate bottom-up without recursion: `leaf(i, primitive)` per leaf in order, then `combine[op](left, right)`."""
    todo: list[tuple[Program, bool]] = [(program, False)]
    values: list[T] = []
    count = 0
    while todo:
        node, ready = todo.pop()
        if isinstance(node, Primitive):
            values.append(leaf(count, node))
            count += 1
        elif ready:
            right = values.pop()
            values.append(combine[node.op](values.pop(), right))
        else:
            todo += ((node, True), (node.right, False), (node.left, False))
    return values[0]


def _same(one: Program, other: Program) -> bool:
    todo = [(one, other)]
    while todo:
        a, b = todo.pop()
        if isinstance(a, Combine) and isinstance(b, Combine):
            if a.op != b.op:
                return False
            todo += ((a.right, b.right), (a.left, b.left))
        elif a != b:
            return False
    return True


def map_lengths(leaf: Primitive, change: Callable[[float], float], center: Vec3) -> Primitive:
    """A leaf at `center` with all its lengths changed by one factor."""
    size = tuple(s if name in ANGLES else change(s) for name, s in zip(SIZE_NAMES[leaf.kind], leaf.size, strict=True))
    return Primitive(leaf.kind, size, center, leaf.rotation, leaf.outline and leaf.outline.map_lengths(change))


def envelope(leaf: Primitive) -> Primitive:
    """The leaf where numbers alone describe it; of an extrusion the box, of a turned outline the cylinder about its frame that holds it."""
    if leaf.outline is None:
        return leaf
    (left, low), (right, high) = leaf.outline.bounds
    across, reach = 2 * max(-left, right), 2 * max(-low, high)
    if leaf.kind != "revolve":
        return Primitive("box", (across, reach, leaf.size[0]), leaf.center, leaf.rotation)
    return Primitive("cylinder", (across / 2, reach), leaf.center, leaf.rotation)


def top_of(leaf: Primitive) -> Outline:
    """The outline at the upper end of an extruded leaf, drafted or not."""
    assert leaf.outline is not None
    return shrink(leaf.outline, inset_at_top(*leaf.size)) if leaf.kind == "drafted" else leaf.outline


def longest(parts: Iterable[Primitive]) -> float:
    """The largest length of some leaves: a size, or what an outlined leaf measures along or across its frame."""
    return max(max(envelope(leaf).size) for leaf in parts)


def map_leaves(program: Program, change: Callable[[int, Primitive], Primitive]) -> Program:
    """The same tree with each primitive replaced by `change(i, primitive)`."""
    return fold(program, lambda i, p: change(i, p), {op: (lambda a, b, op=op: Combine(op, a, b)) for op in OPS})  # type: ignore[arg-type, return-value]


def replace_leaves(program: Program, new: Mapping[int, Primitive]) -> Program:
    """The same tree with other primitives in the place of some, by their numbers."""
    return map_leaves(program, lambda i, leaf: new.get(i, leaf))


def combine_all(op: Op, programs: list[Program]) -> Program:
    """A left fold of one operation over one or more programs."""
    if not programs:
        raise ValueError(f"{op} of no programs")
    out = programs[0]
    for part in programs[1:]:
        out = Combine(op, out, part)
    return out
