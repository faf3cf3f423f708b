"""Find the repeated parts of a program and write each once: rows, grids, circles and mirror images among what one operation joins.

Parts repeat if a rigid motion takes one to the other, whatever their numbers: equal primitives, and equal subtrees such as a boss with its
holes. Of all ways to write the parts of an operation, the one that saves most is taken first (a description length in numbers to write);
repeats with the same motions become one. The order of what is united or cut changes, and numbers by no more than the tolerance.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from imdim.program.motions import is_round, step
from imdim.program.patterns.candidate import Circling, RepeatCandidate, RepeatLimits, classes, first_leaf, pair_mirror_images, pairs
from imdim.program.patterns.congruence import Layout, Node, group_by_fit, match, node_of
from imdim.program.patterns.linear import Lattice, lattices
from imdim.program.repeats import Folded, Group, Repeat, expand, repeats, size
from imdim.program.rewrite.containment import axes, disjoint
from imdim.program.tree import Op, Primitive, Program, Vec3, envelope, leaves
from imdim.program.vectors import dot, minus

TOLERANCE = 1e-6  # of the part's size
MOST_PARTS = 150
MOST_DEPTH = 100


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

    A repeat saves two primitives or a drawing, or more. `tolerance` is the length by which numbers may move, `TOLERANCE` of the part's size
    if None.
    """
    parts = list(leaves(program))
    exact = TOLERANCE * extent(program)
    root = node_of(program)
    if root.depth > MOST_DEPTH:
        return None
    limits = RepeatLimits(exact if tolerance is None else tolerance, exact)
    circling = Circling(limits, _body_axis(parts[0]), [p.center for p in parts])
    best: Folding | None = None
    known: dict[Layout, Node] = {}  # each layout once, however it came about
    for node in (root, to_layers(root), to_layers(root, late=True)):
        known.setdefault(node.layout, node)
    for node in known.values():
        search = _FoldSearch(limits, circling)
        folded, order = search.fold_node(node)
        if search.found and (best is None or worth(folded) > worth(best.folded)):
            best = Folding(folded, tuple(order))
    return best


def find_repeats(parts: Sequence[Primitive], tolerance: float) -> Iterator[tuple[tuple[int, ...], int]]:
    """Rows, grids, circles and mirrored pairs among parts that one operation joins: the places of their copies, and in how many ways they
    go on."""
    nodes = [Node(None, [], part, i) for i, part in enumerate(parts)]
    limits = RepeatLimits(tolerance, tolerance)
    search = _FoldSearch(limits, Circling(limits, None, [p.center for p in parts]))
    for group in classes(nodes, range(len(nodes)), tolerance):
        found = list(search.of_class(nodes, group))
        yield from ((choice.members[0], len(choice.repeat.counts)) for choice in found)
        taken = {i for choice in found for i in choice.members[0]}
        yield from ((pair.members[0], 1) for pair in pair_mirror_images(limits, nodes, [i for i in group if i not in taken]))


def worth(folded: Folded) -> int:
    """What repeats save of primitives, squared so that a few large ones are worth more than many small ones."""
    return sum(((repeat.number - 1) * size(repeat.part)) ** 2 for _, repeat in repeats(folded))


def extent(program: Program) -> float:
    """The part's size, roughly: how far apart its primitives are, and how large."""
    parts = list(leaves(program))
    low, high = ([f(p.center[a] for p in parts) for a in range(3)] for f in (min, max))
    return math.dist(low, high) + 2 * max(max(envelope(p).size) for p in parts)


def _body_axis(first: Primitive) -> tuple[Vec3, Vec3] | None:
    """Centre and axis of a body that is round."""
    return (first.center, axes(first)[2]) if is_round(first) else None


@dataclass
class _FoldSearch:
    """`found` counts repeats."""

    limits: RepeatLimits
    circling: Circling
    found: int = field(default=0)

    def fold_node(self, node: Node) -> tuple[Folded, list[int]]:
        """A node with its repeats, and the numbers of its leaves in their new order."""
        if node.leaf is not None:
            return node.leaf, [node.number]
        kept = node.parts[:1] if node.op == "difference" else []
        choices = self.choose_repeats(node.parts[len(kept) :])
        built = [self.fold_node(part) for part in kept]
        built += self._write_parts(node.parts[len(kept) :], choices, "intersection" if node.op == "intersection" else "union")
        self.found += len(choices)
        order = [number for _, numbers in built for number in numbers]
        if len(built) == 1:
            return built[0][0], order
        assert node.op is not None
        return Group(node.op, tuple(part for part, _ in built)), order

    def _write_parts(self, parts: list[Node], choices: list[RepeatCandidate], join: Op) -> Iterator[tuple[Folded, list[int]]]:
        """Single parts, and each repeat where its first part stands."""
        heads = {min(i for row in c.members for i in row): c for c in choices}
        inside = {i for c in choices for row in c.members for i in row}
        for i, part in enumerate(parts):
            if i in heads:
                yield self._repeat(parts, heads[i], join)
            elif i not in inside:
                yield self.fold_node(part)

    def _repeat(self, parts: list[Node], choice: RepeatCandidate, join: Op) -> tuple[Folded, list[int]]:
        """With what repeats among the parts of one copy inside it, as the mirror image of a mirror image."""
        first = [parts[row[0]] for row in choice.members]
        part, numbers = self.fold_node(first[0] if len(first) == 1 else Node(join, first))
        order: list[int] = []
        for copy in range(choice.repeat.number):
            of = {a: b for orders in choice.orders for a, b in zip(orders[0], orders[copy], strict=True)}
            order += [of[number] for number in numbers]
        return replace(choice.repeat, part=part, join=join), order

    def choose_repeats(self, parts: list[Node]) -> list[RepeatCandidate]:
        """Repeats that share no part, the largest savings first."""
        if len(parts) > MOST_PARTS:
            return []
        out: list[RepeatCandidate] = []
        left = list(range(len(parts)))
        for group in classes(parts, left, self.limits.tolerance):
            out += self.of_class(parts, group)
        left = [i for i in left if not any(i in row for c in out for row in c.members)]
        both = (*self._merge(out), *pairs(self.limits, parts, left))
        return [c for c in both if (c.repeat.number - 1) * sum(parts[row[0]].writing for row in c.members) >= 2]

    def of_class(self, parts: list[Node], group: list[int]) -> Iterator[RepeatCandidate]:
        while len(group) > 2:
            best = max(self._candidates(parts, group), key=lambda c: c.saved, default=None)
            if best is None:
                return
            yield best
            group = [i for i in group if i not in best.members[0]]

    def _candidates(self, parts: list[Node], group: list[int]) -> Iterator[RepeatCandidate]:
        for chain in self._find_translated(parts, group):
            for lattice in lattices([parts[i].anchor for i in chain], 4 * self.limits.tolerance):
                yield from self._lattice(parts, chain, lattice)
        yield from self.circling.circles(parts, group)

    def _find_translated(self, parts: list[Node], group: list[int]) -> list[list[int]]:
        """Members that are steps apart, three or more."""

        def follows(chain: list[int], i: int) -> bool:
            shift = minus(parts[i].anchor, parts[chain[0]].anchor)
            return match(parts[chain[0]], parts[i], step(shift), self.limits.tolerance) is not None

        return [chain for chain in group_by_fit(group, follows) if len(chain) > 2]

    def _lattice(self, parts: list[Node], chain: list[int], lattice: Lattice) -> Iterator[RepeatCandidate]:
        members = tuple(chain[i] for i in lattice.members)
        at = [parts[i].anchor for i in members]
        n, steps = lattice.counts[-1], []
        for count, stride in zip(reversed(lattice.counts), (1, n), strict=False):
            x, y, z = ((at[(count - 1) * stride][a] - at[0][a]) / (count - 1) for a in range(3))
            steps.append(self.limits.tidy((x, y, z)))
        kind = "linear" if len(steps) == 1 else "grid"
        repeat = Repeat(kind, first_leaf(parts[members[0]]), lattice.counts, tuple(reversed(steps)))
        straight = kind == "linear" or abs(dot(*steps)) <= 1e-6 * math.hypot(*steps[0]) * math.hypot(*steps[1])
        yield from self.limits.verify(parts, members, repeat, 0.5 * straight)

    def _merge(self, choices: list[RepeatCandidate]) -> list[RepeatCandidate]:
        """Repeats with the same motions as one."""
        groups = group_by_fit(choices, lambda group, choice: self.limits.same_motions(group[0].repeat, choice.repeat))
        return [
            replace(group[0], members=tuple(m for c in group for m in c.members), orders=tuple(o for c in group for o in c.orders))
            for group in groups
        ]


# --- layers ----------------------------------------------------------------------------------------------------------


def to_layers(node: Node, late: bool = False) -> Node:
    """The same solid with what is united and what is cut in as few alternating layers as its parts allow; leaves keep their numbers.

    Each part comes as early, or as `late`, as can be.

    ``(X - c) | a`` is ``(X | a) - c`` where a and c are apart, so that unions and cuts along the spine of a program form a trace: two of
    them trade places unless they meet. Every one goes into the first layer that those it has to stay behind leave open (the normal form of
    Cartier and Foata 1969). Equal parts that were found one by one then stand together.
    """
    if node.op not in ("union", "difference"):
        return node if node.leaf is not None else Node(node.op, [to_layers(part, late) for part in node.parts])
    base, steps = _spine(node)
    layers: dict[int, list[Node]] = {}
    placed: dict[bool, list[tuple[int, list[Primitive]]]] = {False: [] if late else [(0, _fill(base))], True: []}
    for cuts, part in reversed(steps) if late else steps:
        reach = _fill(part)
        # what is united is in layers 0, 2, 4 .., what is cut in 1, 3, 5 ..
        behind = (n for n, others in placed[not cuts] if not all(disjoint(p, q) for p in reach for q in others))
        layer = 1 + max(behind, default=0 if cuts else -1)
        placed[cuts].append((layer, reach))
        layers.setdefault(layer, []).append(to_layers(part, late))
    out = to_layers(base, late)
    for number in sorted(layers, reverse=late):
        op: Op = "difference" if number % 2 else "union"
        out = Node(op, [*(out.parts if out.op == op else [out]), *(reversed(layers[number]) if late else layers[number])])
    return out


def _spine(node: Node) -> tuple[Node, list[tuple[bool, Node]]]:
    """What everything is united with and cut from, and the steps in order: whether they cut, and what."""
    steps: list[tuple[bool, Node]] = []
    while node.op in ("union", "difference"):
        main = 0 if node.op == "difference" else max(range(len(node.parts)), key=lambda i: (node.parts[i].size, -i))
        steps[:0] = [(node.op == "difference", part) for i, part in enumerate(node.parts) if i != main]
        node = node.parts[main]
    return node, steps


def _fill(node: Node) -> list[Primitive]:
    """Primitives that together hold the node."""
    if node.leaf is not None:
        return [node.leaf]
    if node.op == "difference":
        return _fill(node.parts[0])
    if node.op == "intersection":
        return min((_fill(part) for part in node.parts), key=len)
    return [leaf for part in node.parts for leaf in _fill(part)]
