"""Find the repeated parts of a program and write each once: rows, grids, circles and mirror images among what is united or cut.

Parts repeat if a rigid motion takes one to the other, whatever their numbers: equal primitives, and equal subtrees such as a boss with its
holes. Of all ways to write the parts of an operation, the one that saves most is taken first (a description length in numbers to write);
repeats with the same motions become one. The order of what is united or cut changes, and numbers by no more than the tolerance.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, islice

from imdim.program.alike import Node, match, node_of, same_shape
from imdim.program.lattices import Lattice, Ring, lattices, rings
from imdim.program.layers import layered
from imdim.program.motions import mirror, step
from imdim.program.relations import axes, dot
from imdim.program.repeats import Folded, Group, Repeat, expand, repeats, size
from imdim.program.tree import Primitive, Program, Vec3, leaves

TOLERANCE = 1e-6  # of the part's size
NUMBERS = 9  # of a primitive: sizes, place, and what it is
COSTS = {"linear": 5, "grid": 9, "circular": 11, "mirror": 7}
AT_BODY = 6  # a circle round the axis of a body that is round needs no centre
MOST_PARTS = 150
MOST_DEPTH = 100
MOST_PLANES = 10  # through three parts of one shape, across which copies may turn
SAME_AXIS = 1e-12  # of a cosine


@dataclass(frozen=True)
class Folding:
    """`order[i]` is the number in the given program of leaf i of the expanded one."""

    folded: Folded
    order: tuple[int, ...]

    @property
    def program(self) -> Program:
        """The expanded program."""
        return expand(self.folded)


def fold_repeats(program: Program, tolerance: float | None = None) -> Folding | None:
    """The program with its repeated parts written once; None where nothing repeats.

    A repeat saves two primitives or more. `tolerance` is the length by which numbers may move, `TOLERANCE` of the part's size if None.
    """
    parts = list(leaves(program))
    exact = TOLERANCE * extent(program)
    root = node_of(program)
    if root.depth > MOST_DEPTH:
        return None
    within = exact if tolerance is None else tolerance
    body, hubs = _body_axis(parts[0]), [p.center for p in parts]
    best: Folding | None = None
    for node in (root, layered(root), layered(root, late=True)):
        search = _Search(within, exact, body, hubs)
        folded, order = search.folded(node)
        if search.found and (best is None or worth(folded) > worth(best.folded)):
            best = Folding(folded, tuple(order))
    return best


def worth(folded: Folded) -> int:
    """What repeats save of primitives, squared so that a few large ones are worth more than many small ones."""
    return sum(((repeat.number - 1) * size(repeat.part)) ** 2 for _, repeat in repeats(folded))


def extent(program: Program) -> float:
    """The part's size, roughly: how far apart its primitives are, and how large."""
    parts = list(leaves(program))
    low, high = ([f(p.center[a] for p in parts) for a in range(3)] for f in (min, max))
    return math.dist(low, high) + 2 * max(max(p.size) for p in parts)


def _body_axis(first: Primitive) -> tuple[Vec3, Vec3] | None:
    """Centre and axis of a body that is round."""
    return (first.center, axes(first)[2]) if first.kind in ("cylinder", "cone", "torus") else None


@dataclass(frozen=True)
class _Found:
    """A repeat of the parts `members[0]`, each with its copies; `orders` has the leaf numbers of each copy of each, as the first's are."""

    repeat: Repeat
    members: tuple[tuple[int, ...], ...]
    orders: tuple[tuple[list[int], ...], ...]
    saved: float


@dataclass
class _Search:
    """`hubs` are points that circles may have their centre at, `found` counts repeats."""

    tolerance: float
    exact: float
    body: tuple[Vec3, Vec3] | None
    hubs: list[Vec3]
    found: int = field(default=0)

    def folded(self, node: Node) -> tuple[Folded, list[int]]:
        """A node with its repeats, and the numbers of its leaves in their new order."""
        if node.leaf is not None:
            return node.leaf, [node.number]
        kept = [] if node.op == "union" else node.parts[:1] if node.op == "difference" else node.parts
        choices = [] if node.op == "intersection" else self.chosen(node.parts[len(kept) :])
        built = [self.folded(part) for part in kept]
        built += self._written(node.parts[len(kept) :], choices)
        self.found += len(choices)
        order = [number for _, numbers in built for number in numbers]
        if len(built) == 1:
            return built[0][0], order
        assert node.op is not None
        return Group(node.op, tuple(part for part, _ in built)), order

    def _written(self, parts: list[Node], choices: list[_Found]) -> Iterator[tuple[Folded, list[int]]]:
        """Single parts, and each repeat where its first part stands."""
        heads = {min(i for row in c.members for i in row): c for c in choices}
        inside = {i for c in choices for row in c.members for i in row}
        for i, part in enumerate(parts):
            if i in heads:
                yield self._repeat(parts, heads[i])
            elif i not in inside:
                yield self.folded(part)

    def _repeat(self, parts: list[Node], choice: _Found) -> tuple[Folded, list[int]]:
        first = [self.folded(parts[row[0]]) for row in choice.members]
        part = first[0][0] if len(first) == 1 else Group("union", tuple(p for p, _ in first))
        order: list[int] = []
        for copy in range(choice.repeat.number):
            for (_, numbers), orders in zip(first, choice.orders, strict=True):
                place = {number: at for at, number in enumerate(orders[0])}
                order += [orders[copy][place[number]] for number in numbers]
        return replace(choice.repeat, part=part), order

    def chosen(self, parts: list[Node]) -> list[_Found]:
        """Repeats that share no part, the largest savings first."""
        if len(parts) > MOST_PARTS:
            return []
        out: list[_Found] = []
        left = list(range(len(parts)))
        for group in _classes(parts, left, self.tolerance):
            out += self._of_class(parts, group)
        left = [i for i in left if not any(i in row for c in out for row in c.members)]
        pairs = self._pairs(parts, left)
        merged = self._merged(out)
        return [c for c in (*merged, *pairs) if (c.repeat.number - 1) * sum(parts[row[0]].size for row in c.members) >= 2]

    def _of_class(self, parts: list[Node], group: list[int]) -> Iterator[_Found]:
        while len(group) > 2:
            best = max(self._candidates(parts, group), key=lambda c: c.saved, default=None)
            if best is None:
                return
            yield best
            group = [i for i in group if i not in best.members[0]]

    def _candidates(self, parts: list[Node], group: list[int]) -> Iterator[_Found]:
        for chain in self._translated(parts, group):
            for lattice in lattices([parts[i].anchor for i in chain], 4 * self.tolerance):
                yield from self._lattice(parts, chain, lattice)
        for axis in _directions(parts[group[0]], [parts[i].anchor for i in group]):
            yield from self._circles(parts, group, axis)

    def _translated(self, parts: list[Node], group: list[int]) -> list[list[int]]:
        """Members that are steps apart, three or more."""
        out: list[list[int]] = []
        for i in group:
            for chain in out:
                shift = _minus(parts[i].anchor, parts[chain[0]].anchor)
                if match(parts[chain[0]], parts[i], step(shift), self.tolerance) is not None:
                    chain.append(i)
                    break
            else:
                out.append([i])
        return [chain for chain in out if len(chain) > 2]

    def _lattice(self, parts: list[Node], chain: list[int], lattice: Lattice) -> Iterator[_Found]:
        members = tuple(chain[i] for i in lattice.members)
        at = [parts[i].anchor for i in members]
        n, steps = lattice.counts[-1], []
        for count, stride in zip(reversed(lattice.counts), (1, n), strict=False):
            x, y, z = ((at[(count - 1) * stride][a] - at[0][a]) / (count - 1) for a in range(3))
            steps.append(self._tidy((x, y, z)))
        kind = "linear" if len(steps) == 1 else "grid"
        repeat = Repeat(kind, _first(parts[members[0]]), lattice.counts, tuple(reversed(steps)))
        straight = kind == "linear" or abs(dot(*steps)) <= 1e-6 * math.hypot(*steps[0]) * math.hypot(*steps[1])
        yield from self._verified(parts, members, repeat, 0.5 * straight)

    def _circles(self, parts: list[Node], group: list[int], axis: Vec3) -> Iterator[_Found]:
        u, v = _across(axis)
        for level in _levels(parts, group, axis, 2 * self.tolerance):
            height = dot(parts[level[0]].anchor, axis)
            points = [(dot(parts[i].anchor, u), dot(parts[i].anchor, v)) for i in level]
            hubs = list(dict.fromkeys((round(dot(h, u), 9), round(dot(h, v), 9)) for h in self.hubs))
            for ring in rings(points, hubs, 2 * self.tolerance) if len(level) > 2 else ():
                yield from self._ring(parts, tuple(level[i] for i in ring.members), ring, (u, v, axis), height)
            yield from self._spokes(parts, level, points, axis)

    def _ring(
        self, parts: list[Node], members: tuple[int, ...], ring: Ring, frame: tuple[Vec3, Vec3, Vec3], height: float
    ) -> Iterator[_Found]:
        u, v, axis = frame
        x, y, z = (ring.center[0] * u[a] + ring.center[1] * v[a] + height * axis[a] for a in range(3))
        point = self._tidy((x, y, z))
        repeat = Repeat(
            "circular", _first(parts[members[0]]), (len(members),), point=point, axis=axis, angle=_tidy_angle(ring.angle, len(members))
        )
        yield from self._verified(parts, members, repeat, AT_BODY * self._is_at_body(point, axis) + 0.25 * repeat.is_full)

    def _spokes(self, parts: list[Node], level: list[int], points: list[tuple[float, float]], axis: Vec3) -> Iterator[_Found]:
        """Parts that all have their middle on the axis, such as the bars of a star."""
        for i in level:
            same = [j for j in level if math.dist(points[level.index(i)], points[level.index(j)]) <= 2 * self.tolerance]
            if same[0] != i or len(same) < 3:
                continue
            for angle in dict.fromkeys(whole / n for n in range(len(same), 2, -1) for whole in (360.0, 180.0)):
                repeat = Repeat("circular", _first(parts[i]), (len(same),), point=self._tidy(parts[i].anchor), axis=axis, angle=angle)
                yield from self._verified(parts, tuple(same), repeat, 0.0)

    def _is_at_body(self, point: Vec3, axis: Vec3) -> bool:
        if self.body is None:
            return False
        off = _minus(point, self.body[0])
        along = dot(off, axis)
        away = math.dist(off, (along * axis[0], along * axis[1], along * axis[2]))
        return abs(dot(axis, self.body[1])) > 1 - 1e-9 and away <= 4 * self.tolerance

    def _verified(self, parts: list[Node], members: tuple[int, ...], repeat: Repeat, bonus: float) -> Iterator[_Found]:
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
        yield _Found(repeat, (tuple(taken),), (tuple(orders),), saved)

    def _merged(self, choices: list[_Found]) -> list[_Found]:
        """Repeats with the same motions as one."""
        out: list[_Found] = []
        for choice in choices:
            for n, other in enumerate(out):
                if self._same_motions(other.repeat, choice.repeat):
                    out[n] = replace(other, members=other.members + choice.members, orders=other.orders + choice.orders)
                    break
            else:
                out.append(choice)
        return out

    def _same_motions(self, a: Repeat, b: Repeat) -> bool:
        if (a.kind, a.counts, a.axis, a.angle) != (b.kind, b.counts, b.axis, b.angle):
            return False
        off = _minus(a.point, b.point)
        along = dot(off, a.axis) if a.kind == "circular" else 0.0
        gaps = [math.dist(off, (along * a.axis[0], along * a.axis[1], along * a.axis[2]))]
        return max(gaps + [math.dist(s, t) for s, t in zip(a.steps, b.steps, strict=True)]) <= self.exact

    def _pairs(self, parts: list[Node], left: list[int]) -> list[_Found]:
        """Pairs of parts that one plane or one step takes to each other, as long as two primitives or more are saved."""
        pairs: list[_Found] = []
        for group in _classes(parts, left, self.tolerance):
            for i, j in combinations(group, 2):
                shift = _minus(parts[j].anchor, parts[i].anchor)
                length = math.hypot(*shift)
                if length > 8 * self.tolerance:
                    pairs += [
                        f for r in self._pair_repeats(parts[i], parts[j], shift, length) for f in self._verified(parts, (i, j), r, 0.0)
                    ]
        out: list[_Found] = []
        while True:
            best = max((self._largest(parts, pairs, p.repeat) for p in pairs), key=lambda c: c.saved, default=None)
            if best is None or sum(parts[row[0]].size for row in best.members) < 2:
                return out
            out.append(best)
            used = {i for row in best.members for i in row}
            pairs = [p for p in pairs if not used & set(p.members[0])]

    def _pair_repeats(self, a: Node, b: Node, shift: Vec3, length: float) -> Iterator[Repeat]:
        x, y, z = (round(s / length, 12) + 0.0 for s in shift)
        middle = tuple((p + q) / 2 for p, q in zip(a.anchor, b.anchor, strict=True))
        normal, sign = (x, y, z), 1.0 if _is_forward((x, y, z)) else -1.0
        if match(a, b, mirror(middle, normal), self.tolerance) is not None:  # type: ignore[arg-type]
            normal = (sign * x + 0.0, sign * y + 0.0, sign * z + 0.0)
            along = dot(middle, normal)  # type: ignore[arg-type]
            point = self._tidy((along * normal[0], along * normal[1], along * normal[2]))
            yield Repeat("mirror", _first(a), (2,), point=point, axis=normal)
        if sign > 0:
            yield Repeat("linear", _first(a), (2,), (self._tidy(shift),))

    def _largest(self, parts: list[Node], pairs: list[_Found], like: Repeat) -> _Found:
        """All pairs with the motion of one, none twice."""
        used: set[int] = set()
        rows: list[_Found] = []
        for pair in pairs:
            if not used & set(pair.members[0]) and self._same_motions(pair.repeat, like):
                used |= set(pair.members[0])
                rows.append(pair)
        saved = sum(parts[r.members[0][0]].size for r in rows) * NUMBERS - COSTS[like.kind]
        return _Found(like, tuple(r.members[0] for r in rows), tuple(r.orders[0] for r in rows), saved + (like.kind == "mirror") * 2.5)

    def _tidy(self, v: Vec3) -> Vec3:
        """Without what is far below the tolerance."""
        decimals = 2 - math.floor(math.log10(self.exact))
        x, y, z = (round(c, decimals) + 0.0 for c in v)
        return x, y, z


def _classes(parts: list[Node], among: Sequence[int], tolerance: float) -> list[list[int]]:
    """Parts of one shape, two or more."""
    out: list[list[int]] = []
    for i in among:
        home = next((group for group in out if same_shape(parts[group[0]], parts[i], tolerance)), None)
        if home is None:
            out.append([i])
        else:
            home.append(i)
    return [group for group in out if len(group) > 1]


def _first(node: Node) -> Primitive:
    """Stands for the part until that is folded itself."""
    return node.leaves[0][1]


def _directions(node: Node, anchors: list[Vec3]) -> list[Vec3]:
    """Axes that copies may turn about: the world's, those of the leaves, and those across planes that the copies lie in."""
    offered: list[Vec3] = [(0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)]
    for _, leaf in node.leaves[:4]:
        offered += axes(leaf) if leaf.kind in ("box", "ellipsoid") else axes(leaf)[2:] if leaf.kind != "sphere" else ()
    for a, b, c in islice(combinations(anchors, 3), MOST_PLANES):
        u, v = _minus(b, a), _minus(c, a)
        normal = _cross(u, v)
        if math.hypot(*normal) > 1e-3 * math.hypot(*u) * math.hypot(*v):
            offered.append(_unit(normal))
    out: list[Vec3] = []
    for d in offered:
        if all(abs(dot(d, e)) < 1 - SAME_AXIS for e in out):
            out.append(d if _is_forward(d) else (-d[0], -d[1], -d[2]))
    return out


def _across(axis: Vec3) -> tuple[Vec3, Vec3]:
    """Unit vectors u, v with u x v = axis."""
    helper = (1.0, 0.0, 0.0) if abs(axis[0]) < 0.9 else (0.0, 1.0, 0.0)
    along = dot(helper, axis)
    u = _unit((helper[0] - along * axis[0], helper[1] - along * axis[1], helper[2] - along * axis[2]))
    return u, _cross(axis, u)


def _levels(parts: list[Node], group: list[int], axis: Vec3, tolerance: float) -> list[list[int]]:
    """Members at one height along the axis."""
    out: list[list[int]] = []
    for i in sorted(group, key=lambda i: dot(parts[i].anchor, axis)):
        if out and dot(_minus(parts[i].anchor, parts[out[-1][0]].anchor), axis) <= tolerance:
            out[-1].append(i)
        else:
            out.append([i])
    return out


def _tidy_angle(angle: float, count: int) -> float:
    full = 360 / count
    return full if abs(angle - full) < 1e-6 else round(angle, 6)


def _is_forward(v: Vec3) -> bool:
    return next(c > 0 for c in v if abs(c) > 1e-9)


def _unit(v: Vec3) -> Vec3:
    length = math.hypot(*v)
    return v[0] / length, v[1] / length, v[2] / length


def _minus(a: Vec3, b: Vec3) -> Vec3:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _cross(a: Vec3, b: Vec3) -> Vec3:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
