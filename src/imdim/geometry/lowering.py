"""Programs as flat arrays: the form that the numeric backends read.

`params` [k, 9] holds one row per leaf in the order of `tree.leaves`: the sizes padded with zeros to three, the centre, the Euler
degrees. The structure is a postfix instruction list: a number >= 0 pushes that leaf, -1, -2, -3 take two values off the stack and
push their union, intersection, difference. Outlines are one list of curves, of which each leaf has a span.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from imdim.geometry.rotations import matrix_from_euler
from imdim.program.drafting import steps_of
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Curve, Outline, arc_center, arc_radius, has_ellipse, loop_curves, nesting
from imdim.program.tree import KINDS, OPS, SIZE_NAMES, Op, Primitive, Program, fold, leaves, map_leaves

NO_CURVES = np.empty((0, 8))
KEPT = 256  # outlines: of one program again and again the same
OP_CODES: dict[Op, int] = {op: -1 - i for i, op in enumerate(OPS)}


def pack(program: Program) -> tuple[np.ndarray, np.ndarray]:
    """Kind ids int64 [k] (indices into KINDS) and parameters float64 [k, 9] of the leaves."""
    return pack_all([*leaves(program)])


def pack_all(parts: Sequence[Primitive]) -> tuple[np.ndarray, np.ndarray]:
    """As `pack`, of primitives that are no program."""
    kinds = np.array([KINDS.index(p.kind) for p in parts], np.int64)
    rows = [(*p.size, *(0.0,) * (3 - len(p.size)), *p.center, *p.rotation) for p in parts]
    return kinds, np.array(rows, float)


@dataclass(frozen=True)
class Outlines:
    """`curves` [c, 8] of all leaves: start x and y, end x and y, bulge, and an arc's centre and radius; leaf i has `spans` [k, 2].

    An ellipse has both ends of its first axis, the ratio of the second semi-axis to the first one in place of the bulge, negative where it
    bounds a hole, its centre, and minus the first semi-axis in place of the radius.
    """

    curves: np.ndarray
    spans: np.ndarray

    @staticmethod
    def of(parts: Sequence[Primitive]) -> Outlines:
        return Outlines.pack([p.outline for p in parts])

    @staticmethod
    def pack(outlines: Sequence[Outline | None]) -> Outlines:
        """One entry a leaf, None for one that is not drawn."""
        lists = [NO_CURVES if outline is None else _rows(outline) for outline in outlines]
        ends = np.cumsum([0, *map(len, lists)])
        return Outlines(np.concatenate([NO_CURVES, *lists]), np.stack([ends[:-1], ends[1:]], axis=1).astype(np.int64))


@lru_cache(KEPT)
def _rows(outline: Outline) -> np.ndarray:
    """The curves [c, 8] of one; not to be changed."""
    if not has_ellipse(outline):
        return np.array([_row(curve) for curve in outline.curves], float).reshape(-1, 8)
    # other curves say by the way that they run where a hole is
    sides = zip(outline.loops, nesting(outline.loops), strict=True)
    return np.array([_ellipse_row(c, side) if isinstance(c, Ellipse) else _row(c) for loop, side in sides for c in loop_curves(loop)])


def _ellipse_row(e: Ellipse, side: int) -> tuple[float, ...]:
    (c, s), (rx, x, y) = e.along, (e.rx, e.x, e.y)
    return x - rx * c, y - rx * s, x + rx * c, y + rx * s, side * e.ry / rx, x, y, -rx


def _row(curve: Curve | Ellipse) -> tuple[float, ...]:
    assert not isinstance(curve, Ellipse)
    return (*curve, *(arc_center(curve) if curve[4] else (0.0, 0.0)), arc_radius(curve) if curve[4] else 0.0)


def row_curve(row: np.ndarray) -> Curve | Ellipse:
    """The curve that a row [8] of `Outlines` stands for."""
    x, y, u, v, bulge, cx, cy, radius = row.tolist()
    if radius < 0:
        return Ellipse(-radius, abs(bulge) * -radius, cx, cy, math.degrees(math.atan2(v - y, u - x)))
    return x, y, u, v, bulge


def follow_curves(curves: np.ndarray) -> np.ndarray:
    """The number [c] of the curve that begins where each of the curves [c, 4 and more] of closed loops, one after the other, ends."""
    following, first = np.arange(1, len(curves) + 1), 0
    for k in range(len(curves)):
        if k + 1 == len(curves) or (curves[k, 2:4] != curves[k + 1, :2]).any():
            following[k], first = first, k + 1
    return following


def draft_motions(curves: np.ndarray) -> np.ndarray:
    """How the curves [c, 8] of a drafted outline move per unit of inset, [c, 8]; see `program/drafting.py`."""
    out, follows = np.zeros((len(curves), 8)), follow_curves(curves)
    starts = np.flatnonzero(np.append(True, follows[:-1] != np.arange(1, len(curves))))
    for ring in np.split(np.arange(len(curves)), starts[1:]):
        x, y, b = curves[ring][:, [0, 1, 4]].T.tolist()
        out[ring, :2] = steps_of(0, tuple(zip(x, y, b, strict=True)))
    out[:, 2:4] = out[follows, :2]
    out[:, 7] = -np.sign(curves[:, 4])
    return out


NO_OUTLINES = Outlines(NO_CURVES, np.empty((0, 2), np.int64))


def unpack(program: Program, params: np.ndarray) -> Program:
    """The same structure with the numbers of `params` [k, 9]; raises ValueError for sizes that `check_size` refuses."""
    rows = np.asarray(params, float).tolist()

    def read(i: int, p: Primitive) -> Primitive:
        row = rows[i]
        return Primitive(p.kind, tuple(row[: len(SIZE_NAMES[p.kind])]), tuple(row[3:6]), tuple(row[6:9]), p.outline)

    return map_leaves(program, read)


def postfix(program: Program) -> np.ndarray:
    """The instruction list int64 [2k - 1]."""
    # flat lists are joined at every node: quadratic for a chain, yet cheap at the few hundred leaves that a program has
    return np.array(
        fold(program, lambda i, _: [i], {op: lambda a, b, code=code: [*a, *b, code] for op, code in OP_CODES.items()}), np.int64
    )


@dataclass(frozen=True)
class Lowered:
    """`code` int64 [2k-1], `kinds` int64 [k], `sizes` [k, 3], `centers` [k, 3], `rotations` [k, 3, 3] (local to world), `outlines`."""

    code: np.ndarray
    kinds: np.ndarray
    sizes: np.ndarray
    centers: np.ndarray
    rotations: np.ndarray
    outlines: Outlines = NO_OUTLINES


def lower(program: Program) -> Lowered:
    """All arrays that the compiled kernels need."""
    kinds, params = pack(program)
    return Lowered(postfix(program), kinds, *split_params(params), Outlines.of([*leaves(program)]))


def split_params(params: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sizes [k, 3], centres [k, 3] and rotations [k, 3, 3] of parameters [k, 9]."""
    params = np.asarray(params, float).reshape(-1, 9)
    rows = [tuple(row) for row in params[:, 6:9].tolist()]
    known = {row: matrix_from_euler(row) for row in set(rows)}  # what stands together mostly points one way
    rotations = np.array([known[row] for row in rows]).reshape(-1, 3, 3)
    return params[:, :3].copy(), params[:, 3:6].copy(), rotations
