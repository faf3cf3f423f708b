"""Places in a tree: a path leads from the root to a node, 0 for left and 1 for right. Changing a node makes a new tree."""

from __future__ import annotations

from collections.abc import Collection

from imdim.program.tree import Combine, Primitive, Program

Path = tuple[int, ...]


def nodes(program: Program) -> list[tuple[Path, Program]]:
    """Every node with its path, parents before children, left before right."""
    out: list[tuple[Path, Program]] = []
    stack: list[tuple[Path, Program]] = [((), program)]
    while stack:
        path, node = stack.pop()
        out.append((path, node))
        if isinstance(node, Combine):
            stack += (((*path, 1), node.right), ((*path, 0), node.left))
    return out


def leaf_counts(program: Program) -> dict[Path, int]:
    """The number of primitives in every node, in the order of `nodes`."""
    every = nodes(program)
    counts = dict.fromkeys((path for path, _ in every), 1)
    for path, node in reversed(every):
        if isinstance(node, Combine):
            counts[path] = counts[(*path, 0)] + counts[(*path, 1)]
    return counts


def leaf_paths(program: Program) -> list[tuple[Path, Primitive]]:
    """The primitives with their paths, from left to right."""
    return [(path, node) for path, node in nodes(program) if isinstance(node, Primitive)]


def at(program: Program, path: Path) -> Program:
    """The node at `path`; raises ValueError where the path leaves the tree."""
    for turn in path:
        if not isinstance(program, Combine):
            raise ValueError(f"path {path} leaves the tree")
        program = program.right if turn else program.left
    return program


def replace_at(program: Program, path: Path, node: Program) -> Program:
    """The tree with `node` at `path`."""
    spine = [program]
    for turn in path:
        parent = spine[-1]
        if not isinstance(parent, Combine):
            raise ValueError(f"path {path} leaves the tree")
        spine.append(parent.right if turn else parent.left)
    for parent, turn in zip(reversed(spine[:-1]), reversed(path), strict=True):
        assert isinstance(parent, Combine)
        node = Combine(parent.op, parent.left, node) if turn else Combine(parent.op, node, parent.right)
    return node


def without(program: Program, gone: Collection[Path]) -> Program | None:
    """The tree without some nodes: an operation keeps its other part, what is cut out of nothing is nothing."""
    built: dict[Path, Program | None] = {}
    for path, node in reversed(nodes(program)):
        if path in gone:
            built[path] = None
        elif isinstance(node, Primitive):
            built[path] = node
        else:
            left, right = built.pop((*path, 0)), built.pop((*path, 1))
            if left and right:
                same = left is node.left and right is node.right
                built[path] = node if same else Combine(node.op, left, right)
            else:
                built[path] = right if left is None and node.op != "difference" else left
    return built[()]


def polarity(program: Program, path: Path) -> int:
    """+1 where filling the node can only fill the solid, -1 where it can only empty it."""
    sign = 1
    for turn in path:
        assert isinstance(program, Combine)
        sign = -sign if turn and program.op == "difference" else sign
        program = program.right if turn else program.left
    return sign
