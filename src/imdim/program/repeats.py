"""Programs with repeated parts written once: n-ary operations, and copies in a row, in a grid, on a circle or as a mirror image.

A view beside the binary tree, which `expand` leads back to: what evaluates, searches and solves knows plain trees alone. `patterns.detect`
finds repeats; JSON, OpenSCAD, the build123d script and µcad write them. Leaves are counted as in the expanded program, copy after copy, so
that the first copy comes first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import product

from imdim.program.motions import Motion, after, mirror, move_leaf, move_program, step, turn
from imdim.program.nary import fold_nary
from imdim.program.tree import OPS, Op, Primitive, Program, Vec3, combine_all, leaves

REPEATS: Mapping[str, str] = {
    "linear": "count copies, each a step from the one before",
    "grid": "two counts of copies along two steps; the second step is taken first",
    "circular": "count copies, each turned by an angle about the line through a point along an axis",
    "mirror": "the part and its image in the plane through a point across an axis",
}

JOINS: tuple[Op, ...] = ("union", "intersection")


@dataclass(frozen=True, slots=True)
class Repeat:
    """The union of copies of `part`, or what they have in common; `counts` and `steps` have one entry each along every direction of copies.

    `steps` are those of rows and grids, `point` and unit `axis` those of circles and mirrors, `angle` degrees from copy to copy. `join` is
    "union" or "intersection".
    """

    kind: str
    part: Folded
    counts: tuple[int, ...]
    steps: tuple[Vec3, ...] = ()
    point: Vec3 = (0.0, 0.0, 0.0)
    axis: Vec3 = (0.0, 0.0, 1.0)
    angle: float = 0.0
    join: Op = "union"

    def __post_init__(self) -> None:
        if self.kind not in REPEATS:
            raise ValueError(f"unknown repeat {self.kind!r}; known are {', '.join(REPEATS)}")
        if len(self.counts) != (2 if self.kind == "grid" else 1) or any(n < 2 for n in self.counts):
            raise ValueError(f"{self.kind} needs {'two counts' if self.kind == 'grid' else 'a count'} of 2 or more, got {self.counts}")
        if self.kind == "mirror" and self.counts != (2,):
            raise ValueError(f"mirror makes 2 of a part, not {self.counts}")
        if len(self.steps) != (len(self.counts) if self.kind in ("linear", "grid") else 0) or not all(map(any, self.steps)):
            raise ValueError(f"{self.kind} of {self.counts} has steps {self.steps}")
        if self.kind in ("circular", "mirror") and abs(math.hypot(*self.axis) - 1) > 1e-9:
            raise ValueError(f"{self.kind} needs an axis of length 1, got {self.axis}")
        if self.kind == "circular" and not self.angle % 360:
            raise ValueError(f"circular needs an angle, got {self.angle}")
        if self.join not in JOINS:
            raise ValueError(f"{self.kind} joins copies by {' or '.join(JOINS)}, not {self.join!r}")

    @property
    def number(self) -> int:
        """How many copies there are."""
        return math.prod(self.counts)

    @property
    def is_full(self) -> bool:
        """Whether the copies go all the way round."""
        return self.kind == "circular" and abs(abs(self.angle) * self.counts[0] - 360) < 1e-6

    def motions(self) -> Iterator[Motion]:
        """Where each copy is from the first, the first included."""
        if self.kind == "circular":
            yield from (turn(self.point, self.axis, self.angle * i) for i in range(self.counts[0]))
        elif self.kind == "mirror":
            yield from (step((0.0, 0.0, 0.0)), mirror(self.point, self.axis))
        else:
            for numbers in product(*map(range, self.counts)):
                x, y, z = (sum(n * s[a] for n, s in zip(numbers, self.steps, strict=True)) for a in range(3))
                yield step((x, y, z))


@dataclass(frozen=True, slots=True)
class Group:
    """One operation on two or more parts; a difference keeps the first.

    Repeats stand for all their copies among what is united or cut, those that intersect theirs among what is intersected.
    """

    op: Op
    parts: tuple[Folded, ...]


Folded = Primitive | Group | Repeat


def group_up(program: Program) -> Folded:
    """A plain program with its chains of one operation as groups; nothing repeats."""
    return fold_nary(program, lambda _, leaf: leaf, {op: partial(_group, op) for op in OPS})


def _group(op: Op, parts: list[Folded]) -> Folded:
    return Group(op, tuple(parts))


def expand(folded: Folded) -> Program:
    """The plain program."""
    if isinstance(folded, Primitive):
        return folded
    if isinstance(folded, Repeat):
        return combine_all(folded.join, list(_copies(folded)))
    out: list[Program] = []
    for number, part in enumerate(folded.parts):
        joins: Op = "intersection" if folded.op == "intersection" else "union"
        spread = isinstance(part, Repeat) and part.join == joins and (number > 0 or folded.op != "difference")
        out += _copies(part) if spread else [expand(part)]  # type: ignore[arg-type]
    return combine_all(folded.op, out)


def _copies(repeat: Repeat) -> Iterator[Program]:
    inner = repeat.part
    own = list(_copies(inner)) if isinstance(inner, Repeat) and inner.join == repeat.join else [expand(inner)]
    for motion in repeat.motions():
        yield from (move_program(program, motion) for program in own)


def first_copies(folded: Folded) -> Folded:
    """What is written: of each repeat the first copy alone."""
    if isinstance(folded, Primitive):
        return folded
    if isinstance(folded, Repeat):
        return first_copies(folded.part)
    return Group(folded.op, tuple(map(first_copies, folded.parts)))


def write_out(folded: Folded, numbers: Collection[int]) -> Folded:
    """With the copies of those repeats, counted as `repeats` does, one by one, and what repeats within them too; the leaves as they are."""
    count = iter(range(sum(1 for _ in repeats(folded))))

    def write(part: Folded, all_of_them: bool) -> Folded:
        if isinstance(part, Primitive):
            return part
        if isinstance(part, Group):
            return Group(part.op, tuple(piece for n, p in enumerate(part.parts) for piece in _spread(part.op, n, write(p, all_of_them))))
        wanted = next(count) in numbers or all_of_them
        inner = write(part.part, wanted)
        if not wanted:
            return replace(part, part=inner)
        return Group(part.join, tuple(_moved(inner, motion) for motion in part.motions()))

    return write(folded, False)


def _spread(op: Op, number: int, part: Folded) -> tuple[Folded, ...]:
    """The parts of a group within a group where that says the same."""
    joins: Op = "intersection" if op == "intersection" else "union"
    spread = isinstance(part, Group) and part.op == joins and (number > 0 or op != "difference")
    return part.parts if spread else (part,)  # type: ignore[union-attr]


def _moved(folded: Folded, motion: Motion) -> Folded:
    """What holds no repeats, elsewhere."""
    return rebuilt(folded, lambda _, leaf: move_leaf(leaf, motion), lambda _, repeat: repeat)


def size(folded: Folded) -> int:
    """How many primitives the expanded program has; counts, and expands nothing."""
    if isinstance(folded, Primitive):
        return 1
    return folded.number * size(folded.part) if isinstance(folded, Repeat) else sum(size(part) for part in folded.parts)


def starts(group: Group, first: int = 0) -> Iterator[tuple[Folded, int]]:
    """Each part of a group whose first leaf is number `first`, with the number of its own first leaf."""
    for part in group.parts:
        yield part, first
        first += size(part)


def repeats(folded: Folded, first: int = 0) -> Iterator[tuple[int, Repeat]]:
    """Every repeat with the number of its first leaf, those around others before them, from left to right."""
    if isinstance(folded, Repeat):
        yield first, folded
        yield from repeats(folded.part, first)
    elif isinstance(folded, Group):
        for part, start in starts(folded, first):
            yield from repeats(part, start)


def instances(folded: Folded) -> list[tuple[int, Motion]]:
    """For each leaf of the expanded program the number of the leaf that it is a copy of (itself if of none), and the motion from that."""
    if isinstance(folded, Primitive):
        return [(0, step((0.0, 0.0, 0.0)))]
    if isinstance(folded, Repeat):
        own = instances(folded.part)
        return [(leaf, after(motion, inner)) for motion in folded.motions() for leaf, inner in own]
    out: list[tuple[int, Motion]] = []
    for part in folded.parts:
        start = len(out)
        out += [(start + leaf, motion) for leaf, motion in instances(part)]
    return out


def copies_of(folded: Folded) -> dict[int, list[tuple[int, bool]]]:
    """For each leaf of the expanded program that is no copy, itself and its copies, and whether these are mirrored."""
    out: dict[int, list[tuple[int, bool]]] = {}
    for i, (source, motion) in enumerate(instances(folded)):
        out.setdefault(source, []).append((i, motion.mirrors))
    return out


def with_leaves(folded: Folded, program: Program) -> Folded:
    """The same repeats with the first copies' leaves taken from `program`, which has the leaves of the expanded one in order."""
    parts = list(leaves(program))
    return rebuilt(folded, lambda first, _: parts[first], lambda _, repeat: repeat)


def rebuilt(folded: Folded, leaf: Callable[[int, Primitive], Primitive], change: Callable[[int, Repeat], Repeat], first: int = 0) -> Folded:
    """With ``leaf(number, primitive)`` for what is written, and ``change(number of first leaf, repeat)`` for each repeat in the order of
    `repeats`, whatever that has as its part."""
    if isinstance(folded, Primitive):
        return leaf(first, folded)
    if isinstance(folded, Repeat):
        changed = change(first, folded)
        return replace(changed, part=rebuilt(folded.part, leaf, change, first))
    return Group(folded.op, tuple(rebuilt(part, leaf, change, start) for part, start in starts(folded, first)))
