"""Whether a rigid motion takes one part of a program to another, whatever their numbers and the order of what they unite or cut."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, TypeVar

from imdim.program.motions import Motion
from imdim.program.nary import fold_nary
from imdim.program.patterns.outlined import anchor_of, is_outlined_moved, lengths_of
from imdim.program.rewrite.containment import axes
from imdim.program.tree import OPS, Op, Primitive, Program, Vec3
from imdim.program.vectors import times

T = TypeVar("T")
Layout = int | tuple[Any, ...]


@dataclass(eq=False)
class Node:
    """A leaf with its number, or an n-ary operation; the first part of a difference is kept, the others are cut from it."""

    op: Op | None
    parts: list[Node]
    leaf: Primitive | None = None
    number: int = 0

    @cached_property
    def leaves(self) -> list[tuple[int, Primitive]]:
        """The leaves with their numbers, in order."""
        return [(self.number, self.leaf)] if self.leaf is not None else [leaf for part in self.parts for leaf in part.leaves]

    @property
    def layout(self) -> Layout:
        """What stands where: the numbers of the leaves under their operations."""
        return self.number if self.leaf is not None else (self.op, *(part.layout for part in self.parts))

    @property
    def size(self) -> int:
        """How many leaves there are."""
        return len(self.leaves)

    @property
    def writing(self) -> int:
        """What there is to write, in leaves: an outline is as much again as the leaf that it is of."""
        return sum(1 + (leaf.outline is not None) for _, leaf in self.leaves)

    @cached_property
    def depth(self) -> int:
        """Operations inside each other."""
        return 1 + max(part.depth for part in self.parts) if self.parts else 0

    @cached_property
    def anchor(self) -> Vec3:
        """The mean of the leaves' centres, of outlined ones that of their vertices, which moves along."""
        at = [p.center if p.outline is None else anchor_of(p, p.outline) for _, p in self.leaves]
        x, y, z = (math.fsum(center[a] for center in at) / self.size for a in range(3))
        return x, y, z

    @cached_property
    def shape(self) -> list[tuple[str, tuple[float, ...]]]:
        """Kinds and sizes, wherever they are."""
        return sorted((f"{self.op} {len(self.parts)} {p.kind}{_curves(p)}", _shape(p)) for _, p in self.leaves)


def node_of(program: Program) -> Node:
    """The program in n-ary operations."""
    return fold_nary(program, lambda number, leaf: Node(None, [], leaf, number), {op: partial(Node, op) for op in OPS})


def _shape(p: Primitive) -> tuple[float, ...]:
    return _SHAPES.get(p.kind, tuple)(p.size) if p.outline is None else lengths_of(p, p.outline)


def _curves(p: Primitive) -> str:
    """How many curves the loops have; lengths are compared leaf by leaf, so that there have to be as many."""
    return "" if p.outline is None else f" {sorted(map(len, p.outline.loops))}"


# what does not tell one way of writing a primitive from another
_SHAPES: Mapping[str, Callable[[tuple[float, ...]], tuple[float, ...]]] = {
    "box": lambda s: tuple(sorted(s)),
    "ellipsoid": lambda s: tuple(sorted(s)),
    "cone": lambda s: (min(s[:2]), max(s[:2]), s[2]),
}


def same_shape(a: Node, b: Node, tolerance: float) -> bool:
    """Whether both have the same operation at the top, and the same primitives but for their places."""
    if [kind for kind, _ in a.shape] != [kind for kind, _ in b.shape]:
        return False
    return all(_close(u, v, 2 * tolerance) for (_, u), (_, v) in zip(a.shape, b.shape, strict=True))


def group_by_fit(items: Iterable[T], fits: Callable[[list[T], T], bool]) -> list[list[T]]:
    """Each item in the first group that it fits, else in one of its own."""
    out: list[list[T]] = []
    for item in items:
        home = next((group for group in out if fits(group, item)), None)
        if home is None:
            out.append([item])
        else:
            home.append(item)
    return out


def match(a: Node, b: Node, motion: Motion, tolerance: float) -> list[int] | None:
    """The numbers of the leaves of `b` in the order of those of `a` that the motion takes there; None if it does not."""
    if a.op != b.op or len(a.parts) != len(b.parts):
        return None
    if a.leaf is not None:
        assert b.leaf is not None
        return [b.number] if _is_moved(a.leaf, b.leaf, motion, tolerance) else None
    out: list[int] = []
    left = list(b.parts)
    for n, part in enumerate(a.parts):
        among = left[:1] if n == 0 and a.op == "difference" else left
        found = next(((other, numbers) for other in among if (numbers := match(part, other, motion, tolerance)) is not None), None)
        if found is None:
            return None
        left.remove(found[0])
        out += found[1]
    return out


def _is_moved(a: Primitive, b: Primitive, motion: Motion, tolerance: float) -> bool:
    if a.kind != b.kind:
        return False
    if a.outline is not None:
        return is_outlined_moved(a, b, motion, tolerance)
    if math.dist(motion.point(a.center), b.center) > tolerance:
        return False
    arms, others = [motion.direction(v) for v in _arms(a)], _arms(b)
    if a.kind == "cone":
        ends = (b.size, arms[0]), ((b.size[1], b.size[0], b.size[2]), _negate(arms[0]))
        return any(_close(a.size, size, tolerance) and math.dist(arm, others[0]) <= tolerance for size, arm in ends)
    lengths = a.kind in ("box", "ellipsoid") or _close(a.size, b.size, tolerance)
    return lengths and all(any(min(math.dist(u, v), math.dist(_negate(u), v)) <= tolerance for v in others) for u in arms)


def _close(a: tuple[float, ...], b: tuple[float, ...], tolerance: float) -> bool:
    return all(abs(s - t) <= tolerance for s, t in zip(a, b, strict=True))


def _arms(p: Primitive) -> list[Vec3]:
    """Vectors from the centre that show how the primitive lies: half edges, semi-axes, half the axis."""
    if p.kind == "sphere":
        return []
    frame = axes(p)
    if p.kind in ("box", "ellipsoid"):
        scale = 0.5 if p.kind == "box" else 1.0
        return [times(axis, scale * s) for axis, s in zip(frame, p.size, strict=True)]
    return [times(frame[2], p.size[0] if p.kind == "torus" else p.size[-1] / 2)]


def _negate(a: Vec3) -> Vec3:
    return -a[0], -a[1], -a[2]
