"""A repeat that is borne out by the parts themselves."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from imdim.program.patterns.congruence import Node, match, same_shape
from imdim.program.repeats import Repeat
from imdim.program.rewrite.containment import dot
from imdim.program.tree import Primitive, Vec3
from imdim.program.vectors import minus

NUMBERS = 9  # of a primitive: sizes, place, and what it is
COSTS = {"linear": 5, "grid": 9, "circular": 11, "mirror": 7}


@dataclass(frozen=True)
class RepeatCandidate:
    """A repeat of the parts `members[0]`, each with its copies; `orders` has the leaf numbers of each copy of each, as the first's are."""

    repeat: Repeat
    members: tuple[tuple[int, ...], ...]
    orders: tuple[tuple[list[int], ...], ...]
    saved: float


@dataclass(frozen=True)
class Bench:
    """What parts are measured by: lengths agree within `tolerance`, and within `exact` they are the same."""

    tolerance: float
    exact: float

    def verify(self, parts: list[Node], members: tuple[int, ...], repeat: Repeat, bonus: float) -> Iterator[RepeatCandidate]:
        """The repeat, if each of its copies is one of the members."""
        first, left = parts[members[0]], list(members)
        taken: list[int] = []
        orders: list[list[int]] = []
        for motion in repeat.motions():
            found = next(((i, o) for i in left if (o := match(first, parts[i], motion, self.tolerance)) is not None), None)
            if found is None:
                return
            left.remove(found[0])
            taken.append(found[0])
            orders.append(found[1])
        saved = (len(taken) - 1) * first.size * NUMBERS - COSTS[repeat.kind] + bonus
        yield RepeatCandidate(repeat, (tuple(taken),), (tuple(orders),), saved)

    def same_motions(self, a: Repeat, b: Repeat) -> bool:
        """Whether both repeats make copies in the same places."""
        if (a.kind, a.counts, a.axis, a.angle) != (b.kind, b.counts, b.axis, b.angle):
            return False
        off = minus(a.point, b.point)
        along = dot(off, a.axis) if a.kind == "circular" else 0.0
        gaps = [math.dist(off, (along * a.axis[0], along * a.axis[1], along * a.axis[2]))]
        return max(gaps + [math.dist(s, t) for s, t in zip(a.steps, b.steps, strict=True)]) <= self.exact

    def tidy(self, v: Vec3) -> Vec3:
        """Without what is far below the tolerance."""
        decimals = 2 - math.floor(math.log10(self.exact))
        x, y, z = (round(c, decimals) + 0.0 for c in v)
        return x, y, z


def classes(parts: list[Node], among: Sequence[int], tolerance: float) -> list[list[int]]:
    """Parts of one shape, two or more."""
    out: list[list[int]] = []
    for i in among:
        home = next((group for group in out if same_shape(parts[group[0]], parts[i], tolerance)), None)
        if home is None:
            out.append([i])
        else:
            home.append(i)
    return [group for group in out if len(group) > 1]


def first_leaf(node: Node) -> Primitive:
    """Stands for the part until that is folded itself."""
    return node.leaves[0][1]
