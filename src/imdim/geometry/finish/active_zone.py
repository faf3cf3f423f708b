"""The active zone of a primitive (Rossignac & Voelcker 1989): where the solid of a program depends on it.

A few points of the region are asked first: where one of them shows that the primitive matters, no boolean need. Otherwise exact booleans
in the region decide.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from manifold3d import Manifold

from imdim.geometry import kernels
from imdim.geometry.finish.posed import INSCRIBED, PosedPrimitive, apart, diagonal, holds, side_of_ball
from imdim.geometry.finish.section import extent
from imdim.geometry.finish.tolerances import NOTHING
from imdim.geometry.lowering import Lowered, Outlines, postfix
from imdim.geometry.solid import SEGMENTS, exact_rotation
from imdim.program.tree import KINDS, Op, Primitive, Program, fold, leaves

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


@dataclass(frozen=True)
class _Open:
    """A part of the program that holds the primitive asked about, which still decides the solid in `where`."""

    where: _Local


def _decides(program: Program, placed: list[PosedPrimitive], index: int, region: PosedPrimitive) -> bool:
    """`matters` by exact booleans."""
    left = zone_within(program, placed, index, region, region.solid)
    return left if isinstance(left, bool) else left.volume() > NOTHING * region.solid.volume()


def change_with(program: Program, index: int, larger: Primitive) -> float:
    """Volume in which the solid of `program` changes where `larger`, which holds primitive `index`, takes its place."""
    return find_change(program, index, larger, SEGMENTS).volume()


def find_change(program: Program, index: int, larger: Primitive, segments: int) -> Manifold:
    """Where the solid of `program` changes if `larger`, which holds primitive `index`, takes its place. What does not reach there is not
    asked: a tenth of the time of making the solid anew."""
    placed, new = [PosedPrimitive(leaf, segments) for leaf in leaves(program)], PosedPrimitive(larger, segments)
    more = new.solid - placed[index].solid
    zone = zone_within(program, placed, index, new, more)
    return zone if isinstance(zone, Manifold) else more if zone else Manifold()


def zone_within(program: Program, placed: list[PosedPrimitive], index: int, held_by: PosedPrimitive, region: Manifold) -> Manifold | bool:
    """Where in a `region`, which the box of `held_by` holds, the solid depends on primitive `index`: everywhere (True), nowhere (False), or
    in a solid. It is what is left of the region after each operation above the primitive."""
    plain: Mapping[Op, Callable[[_Local, _Local], _Local]] = {
        "union": _union,
        "intersection": _intersection,
        "difference": lambda keep, cut: _difference(keep, cut, region),
    }

    def combined(op: Op, a: Any, b: Any) -> _Local | _Open:
        if isinstance(a, _Open):
            return _Open(plain["intersection" if op == "intersection" else "difference"](a.where, b))
        if isinstance(b, _Open):
            return _Open(plain["difference" if op == "union" else "intersection"](b.where, a))
        return plain[op](a, b)

    values = [_Open(True) if i == index else _restrict(part, held_by, region) for i, part in enumerate(placed)]
    root = fold(program, lambda i, _: values[i], {op: partial(combined, op) for op in plain})
    return root.where if isinstance(root, _Open) else root


# A part of the program inside one small region: everywhere (True), nowhere (False), or a solid inside it.
_Local = bool | Manifold


def _restrict(part: PosedPrimitive, held_by: PosedPrimitive, region: Manifold) -> _Local:
    if apart(part, held_by):
        return False
    if holds(part, held_by):
        return True
    if side := side_of_ball(part, held_by):
        return side < 0
    # booleans are put off until somebody asks for their volume
    return part.solid ^ region


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
