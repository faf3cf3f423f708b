"""The same solid with what is united and what is cut in as few alternating layers as its parts allow.

``(X - c) | a`` is ``(X | a) - c`` where a and c are apart, so that unions and cuts along the spine of a program form a trace: two of them
trade places unless they meet. Every one goes into the first layer that those it has to stay behind leave open (the normal form of
Cartier and Foata 1969). Equal parts that were found one by one then stand together.
"""

from __future__ import annotations

from imdim.program.patterns.congruence import Node
from imdim.program.rewrite.containment import disjoint
from imdim.program.tree import Op, Primitive


def to_layers(node: Node, late: bool = False) -> Node:
    """The node with every spine in layers, each part as early or as late as can be; leaves keep their numbers."""
    if node.op not in ("union", "difference"):
        return node if node.leaf is not None else Node(node.op, [to_layers(part, late) for part in node.parts])
    base, steps = _spine(node)
    layers: dict[int, list[Node]] = {}
    placed: dict[bool, list[tuple[int, list[Primitive]]]] = {False: [] if late else [(0, _covering_leaves(base))], True: []}
    for cuts, part in reversed(steps) if late else steps:
        reach = _covering_leaves(part)
        # what is united is in layers 0, 2, 4 .., what is cut in 1, 3, 5 ..
        layer = 1 + max((n for n, others in placed[not cuts] if not _apart(reach, others)), default=0 if cuts else -1)
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


def _covering_leaves(node: Node) -> list[Primitive]:
    """Primitives that together hold the node."""
    if node.leaf is not None:
        return [node.leaf]
    if node.op == "difference":
        return _covering_leaves(node.parts[0])
    if node.op == "intersection":
        return min((_covering_leaves(part) for part in node.parts), key=len)
    return [leaf for part in node.parts for leaf in _covering_leaves(part)]


def _apart(a: list[Primitive], b: list[Primitive]) -> bool:
    return all(disjoint(p, q) for p in a for q in b)
