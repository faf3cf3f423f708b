"""The active zone of a primitive (Rossignac & Voelcker 1989): where the solid of a program depends on it.

A few points of the region are asked first: where one of them shows that the primitive matters, no boolean need. Otherwise exact booleans
in the region decide.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from manifold3d import Manifold

from imdim.geometry import kernels
from imdim.geometry.finish.posed import INSCRIBED, PosedPrimitive, apart, diagonal, holds, side_of_ball
from imdim.geometry.finish.section import extent
from imdim.geometry.finish.tolerances import NOTHING
from imdim.geometry.lowering import Lowered, Outlines, postfix
from imdim.geometry.solid import SEGMENTS, bounds_of, exact_rotation
from imdim.program.tree import KINDS, Combine, Op, Primitive, Program, fold, leaves

PROBES = 64  # points of a region that are asked first


def matters(program: Program, placed: list[PosedPrimitive], index: int, region: Primitive) -> bool:
    """Whether the program's solid inside `region`, a part of primitive `index` or its prolongation, depends on that primitive."""
    return _shows_at_probes(program, placed, index, region) or _decides(program, placed, index, PosedPrimitive(region))


def matters_at(program: Program, placed: list[PosedPrimitive], index: int, points: np.ndarray, held: bool = False) -> np.ndarray:
    """Whether the program's solid depends at `points` [n, 3] on primitive `index`, bool [n]; the others are taken by their true surfaces,
    or by those that their polyhedra have at least (`held`)."""
    size, k = diagonal(placed), int(held)
    kinds = np.array([KINDS.index(part.leaf.kind) for part in placed])
    kinds[index] = KINDS.index("sphere")
    centers = np.array([part.leaf.center for part in placed], float)
    rotations = np.stack([part.rotation for part in placed])
    sizes, outlines = np.stack([part.sizes[k] for part in placed]), Outlines.pack([part.outlines[k] for part in placed])
    reach = size + np.ptp(points, axis=0).sum() if len(points) else size
    # a ball that holds everything in the primitive's place, and one that holds nothing
    both, code = [], postfix(program)
    for radius in (4 * reach, 1e-9 * reach):
        sizes[index], centers[index] = radius, (points[0] if len(points) else 0.0) + (0.0 if radius > reach else 2 * reach)
        both.append(kernels.inside(Lowered(code, kinds, sizes, centers, rotations, outlines), points))
    return both[0] != both[1]


def _shows_at_probes(program: Program, placed: list[PosedPrimitive], index: int, region: Primitive) -> bool:
    """Whether a point of the region shows it, by the primitives' true surfaces and by those that their polyhedra have at least."""
    points = probes(region)
    shown = matters_at(program, placed, index, points) if len(points) else np.zeros(0, bool)
    return bool(shown.any() and (shown & matters_at(program, placed, index, points, held=True)).any())


def probes(region: Primitive) -> np.ndarray:
    """At most PROBES points [n, 3] strewn evenly over a box, cylinder, cone or drawing, away from its rim (after Roberts 2018)."""
    u = (np.arange(1, PROBES + 1)[:, None] * np.array([0.8191725134, 0.6710436067, 0.5497004779])) % 1.0
    if region.kind == "box":
        local = (u - 0.5) * region.size
    elif region.outline is not None:
        low, high = np.array(region.outline.bounds)
        flat = low + (high - low) * u[:, :2]
        inner = kernels.outline_sdf(Outlines.of([region]).curves, flat) < -(1 - INSCRIBED) * extent(region.outline)
        if region.kind == "revolve":
            turn = np.radians(region.size[0]) * u[:, 2]
            local = np.column_stack([flat[:, 0] * np.cos(turn), flat[:, 0] * np.sin(turn), flat[:, 1]])[inner]
        else:
            local = np.column_stack([flat, (u[:, 2] - 0.5) * region.size[-1]])[inner]
    else:
        bottom, top = region.size[0], region.size[-2]
        rho = INSCRIBED * np.sqrt(u[:, 0]) * (bottom + (top - bottom) * u[:, 2])
        turn = 2 * np.pi * u[:, 1]
        local = np.column_stack([rho * np.cos(turn), rho * np.sin(turn), (u[:, 2] - 0.5) * region.size[-1]])
    return local @ exact_rotation(region).T + region.center


def _decides(program: Program, placed: list[PosedPrimitive], index: int, region: PosedPrimitive) -> bool:
    """`matters` by exact booleans."""
    least = NOTHING * region.solid.volume()
    return zone_within(program, placed, index, region, region.solid, least).volume() > least


def change_with(program: Program, index: int, larger: Primitive) -> float:
    """Volume in which the solid of `program` changes where `larger`, which holds primitive `index`, takes its place."""
    return find_change(program, index, larger, SEGMENTS).volume()


def find_change(program: Program, index: int, larger: Primitive, segments: int) -> Manifold:
    """Where the solid of `program` changes if `larger`, which holds primitive `index`, takes its place. What does not reach there is not
    asked: a tenth of the time of making the solid anew."""
    placed, new = [PosedPrimitive(leaf, segments) for leaf in leaves(program)], PosedPrimitive(larger, segments)
    return zone_within(program, placed, index, new, new.solid - placed[index].solid)


def zone_within(
    program: Program, placed: list[PosedPrimitive], index: int, held_by: PosedPrimitive, region: Manifold, least: float = 0.0
) -> Manifold:
    """Where in a `region`, which the box of `held_by` holds, the solid depends on primitive `index`. It is what is left of the region after
    each operation above the primitive, from the nearest on: the fewer primitives reach into what is left, the fewer are asked, and none
    once no more than the volume `least` is left."""
    zone, boxes = region, [held_by]
    for op, first, beside in _operations_above(program, index):
        within = _within(beside, placed[first:], boxes, region)
        if within is (op == "intersection"):
            continue
        zone = _cut(zone, within) if op == "intersection" else _without(zone, within)
        if zone.volume() <= least:
            return Manifold()
        boxes = [held_by, _box_of(zone)]
    return zone


class _Operation(NamedTuple):
    """What is done to a leaf, as far as the result depends on it: it is cut to what stands `beside` it ("intersection"), or that is taken
    from it ("difference"); with the number of the first leaf of that."""

    op: Op
    first: int
    beside: Program


def _operations_above(program: Program, index: int) -> Iterator[_Operation]:
    """What is done to leaf `index`, from the nearest on."""
    above: list[_Operation] = []
    counts, node, first = _count_leaves(program), program, 0
    while isinstance(node, Combine):
        middle = first + counts[id(node.left)]
        if index < middle:
            above.append(_Operation("intersection" if node.op == "intersection" else "difference", middle, node.right))
            node = node.left
        else:
            above.append(_Operation("difference" if node.op == "union" else "intersection", first, node.left))
            node, first = node.right, middle
    while above:
        op, first, node = above.pop()
        middle = 0 if isinstance(node, Primitive) else first + counts[id(node.left)]
        if isinstance(node, Combine) and op == "difference" and node.op == "union":
            above += [_Operation(op, middle, node.right), _Operation(op, first, node.left)]
        elif isinstance(node, Combine) and op == "intersection" and node.op != "union":
            above += [_Operation(node.op, middle, node.right), _Operation(op, first, node.left)]
        else:
            yield _Operation(op, first, node)


def _count_leaves(program: Program) -> dict[int, int]:
    """How many leaves each node has, by its id; without recursion, since a flat union of thousands is a tree as deep."""
    counts: dict[int, int] = {}
    todo = [program]
    while todo:
        node = todo[-1]
        parts = (node.left, node.right) if isinstance(node, Combine) else ()
        missing = [part for part in parts if id(part) not in counts]
        if missing:
            todo += missing
            continue
        todo.pop()
        counts[id(node)] = sum(counts[id(part)] for part in parts) or 1
    return counts


def _box_of(zone: Manifold) -> PosedPrimitive:
    low, high = bounds_of(zone)
    size = (high - low) + NOTHING * float(np.linalg.norm(high - low))  # of a sliver too
    return PosedPrimitive(Primitive("box", tuple(size.tolist()), tuple(((low + high) / 2).tolist())))


# A part of the program inside one small region: everywhere (True), nowhere (False), or a solid inside it.
_Local = bool | Manifold


def _within(program: Program, placed: Sequence[PosedPrimitive], boxes: Sequence[PosedPrimitive], region: Manifold) -> _Local:
    """A part of the program inside what each of the `boxes` holds: a primitive as it is, since what was cut to a region has faces in common
    with it, and booleans of such solids come to slivers of slivers; of what is combined, each part inside the `region`."""
    if isinstance(program, Primitive):
        within = _restrict(placed[0], boxes)
        return placed[0].solid if within is None else within
    plain: Mapping[Op, Callable[[_Local, _Local], _Local]] = {
        "union": _union,
        "intersection": _intersection,
        "difference": lambda keep, cut: _difference(keep, cut, region),
    }

    def restricted(i: int, _: Primitive) -> _Local:
        within = _restrict(placed[i], boxes)
        # booleans are put off until somebody asks for their volume
        return placed[i].solid ^ region if within is None else within

    return fold(program, restricted, plain)


def _cut(zone: Manifold, within: _Local) -> Manifold:
    return zone ^ within if isinstance(within, Manifold) else zone if within else Manifold()


def _without(zone: Manifold, within: _Local) -> Manifold:
    return zone - within if isinstance(within, Manifold) else Manifold() if within else zone


def _restrict(part: PosedPrimitive, boxes: Sequence[PosedPrimitive]) -> bool | None:
    """Whether a primitive holds all that each of the boxes holds, or nothing of it; None where it may hold some."""
    for box in boxes:
        if apart(part, box):
            return False
        if holds(part, box):
            return True
        if side := side_of_ball(part, box):
            return side < 0
    return None


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
