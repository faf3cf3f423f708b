"""How far the ends of gathered parts may stand from where they do, and the same length for those that are alike but for it.

A cutter has to reach as far as it removes something, and may reach on until it meets the solid. An added part has to reach as far as it
adds something, and may reach on as long as it stays inside. Parts of one cross-section get the ends that most of them may have.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from manifold3d import Manifold

from imdim.geometry.finish.extend import between
from imdim.geometry.finish.section import CHECK_SEGMENTS, extent, inset
from imdim.geometry.finish.tolerances import NOTHING
from imdim.geometry.solid import bounds_of, corners_of, exact_rotation, primitive_to_manifold
from imdim.program.outline import are_near
from imdim.program.patterns.congruence import group_by_fit
from imdim.program.tree import FLAT_ENDS, Primitive, Program

SAME = 2e-4  # of the solid's diagonal, by which sizes and ends may differ
THIN = 4.0  # of the slack: nothing is made as short as that
NARROWER = 4e-3  # of a width
DIGITS = 9  # of a size, that computed ends are rounded to


class LastOperand(NamedTuple):
    """What is cut last, or added last."""

    node: Program
    cuts: bool


@dataclass(frozen=True)
class Rest:
    """The whole solid, and what is there without the gathered parts."""

    solid: Manifold
    core: Manifold

    @property
    def bounds(self) -> np.ndarray:
        """Low and high corner [2, 3]."""
        return bounds_of(self.solid)

    @property
    def diagonal(self) -> float:
        """Of the bounds."""
        return float(np.linalg.norm(np.ptp(self.bounds, axis=0)))


class _Span(NamedTuple):
    """Part `number` along an axis: it reaches from `ends[0]` to `ends[1]`, and each of these may lie between two places."""

    number: int
    ends: tuple[float, float]
    low: tuple[float, float]
    high: tuple[float, float]


def even_lengths(parts: Sequence[LastOperand], rest: Rest) -> list[LastOperand]:
    """The parts, with one length for as many as may have it."""
    out, slack = list(parts), SAME * rest.diagonal
    for axis in range(3):
        for group in _alike(out, axis, slack):
            if (np.ptp([ends_of(out[i].node, axis) for i in group], axis=0) <= slack).all():  # type: ignore[arg-type]
                continue
            spans = [_span(i, out[i], axis, rest) for i in group]
            for span, ends in _common(spans, slack):
                leaf = out[span.number].node
                assert isinstance(leaf, Primitive)
                out[span.number] = out[span.number]._replace(node=stretch(leaf, axis, ends))
    return out


def ends_of(leaf: Primitive, axis: int) -> tuple[float, float]:
    """From where to where a primitive reaches along a local axis or its opposite, whichever points forward in the world."""
    middle, length = float(direction_of(leaf, axis) @ leaf.center), leaf.size[FLAT_ENDS[leaf.kind][axis]]
    return middle - length / 2, middle + length / 2


def stretch(leaf: Primitive, axis: int, ends: tuple[float, float]) -> Primitive:
    """With these ends along a local axis, as `ends_of` gives them."""
    old = ends_of(leaf, axis)[1]
    return between(leaf, (axis, _forward(leaf, axis)), float(ends[0] - old), float(ends[1] - old))


def reach(solid: Manifold, leaf: Primitive, axis: int, of: float) -> tuple[float, float] | None:
    """From where to where a solid reaches along the leaf's axis; None if it has next to nothing of the volume `of`."""
    if solid.volume() <= NOTHING * of:
        return None
    places = corners_of(solid) @ direction_of(leaf, axis)
    return float(places.min()), float(places.max())


def round_reach(solid: Manifold, leaf: Primitive, axis: int, size: float) -> tuple[float, float]:
    """As `reach`, of a solid that has a volume, to as many digits of a `size` as computed ends have."""
    decimals = DIGITS - math.ceil(math.log10(size))
    places = corners_of(solid) @ direction_of(leaf, axis)
    return round(float(places.min()), decimals), round(float(places.max()), decimals)


def direction_of(leaf: Primitive, axis: int) -> np.ndarray:
    """The local axis [3] or its opposite, whichever points forward."""
    return exact_rotation(leaf)[:, axis] * _forward(leaf, axis)


def narrow(leaf: Primitive, axis: int) -> Primitive:
    """A little less across an axis, where what lies against it leaves slivers."""
    if leaf.outline is not None:
        return inset(leaf, NARROWER / 2 * extent(leaf.outline))
    along = {"box": axis, "cylinder": 1, "cone": 2}[leaf.kind]
    return replace(leaf, size=tuple(s if i == along else s * (1 - NARROWER) for i, s in enumerate(leaf.size)))


def _forward(leaf: Primitive, axis: int) -> int:
    direction = exact_rotation(leaf)[:, axis]
    return 1 if direction[np.abs(direction).argmax()] > 0 else -1


def _span(number: int, part: LastOperand, axis: int, rest: Rest) -> _Span:
    leaf = part.node
    assert isinstance(leaf, Primitive)
    ends = ends_of(leaf, axis)
    thin = primitive_to_manifold(narrow(leaf, axis), CHECK_SEGMENTS)
    needed = reach(thin ^ rest.core if part.cuts else thin - rest.core, leaf, axis, thin.volume()) or ends
    far = float(np.abs(rest.bounds - leaf.center).sum(axis=1).max()) + ends[1] - ends[0]
    free = []
    for side, new in ((-1, (ends[0] - far, ends[0])), (1, (ends[1], ends[1] + far))):
        region = primitive_to_manifold(narrow(stretch(leaf, axis, new), axis), CHECK_SEGMENTS)
        stop = reach(region ^ rest.solid if part.cuts else region - rest.solid, leaf, axis, thin.volume())
        free.append(side * math.inf if stop is None else stop[(1 - side) // 2])
    return _Span(number, ends, (min(free[0], ends[0]), max(needed[0], ends[0])), (min(needed[1], ends[1]), max(free[1], ends[1])))


def _alike(parts: Sequence[LastOperand], axis: int, slack: float) -> list[list[int]]:
    """Numbers of parts with the same cross-section along the same direction, two or more."""
    kinds = ("box", "cylinder", "extrude") if axis == 2 else ("box",)
    prisms = [i for i, part in enumerate(parts) if isinstance(part.node, Primitive) and part.node.kind in kinds]
    groups = group_by_fit(prisms, lambda group, i: _same_section(parts[group[0]], parts[i], axis, slack))
    return [group for group in groups if len(group) > 1]


def _same_section(a: LastOperand, b: LastOperand, axis: int, slack: float) -> bool:
    p, q = a.node, b.node
    assert isinstance(p, Primitive)
    assert isinstance(q, Primitive)
    if (a.cuts, p.kind) != (b.cuts, q.kind):
        return False
    if p.outline is not None:  # drawn sections have no symmetry that is known
        return are_near(p.outline, q.outline, slack) and bool((exact_rotation(p) * exact_rotation(q)).sum(axis=0).min() > 1 - 1e-9)
    along = axis if p.kind == "box" else 1
    same = all(abs(s - t) <= slack for i, (s, t) in enumerate(zip(p.size, q.size, strict=True)) if i != along)
    turned = np.abs((exact_rotation(p) * exact_rotation(q)).sum(axis=0))
    return same and bool((turned[[axis]] if p.kind == "cylinder" else turned).min() > 1 - 1e-9)


def _common(group: list[_Span], slack: float) -> Iterator[tuple[_Span, tuple[float, float]]]:
    """Parts with the ends that most of them may have, then most of the others."""
    while group:
        low = _most_common_place([s.low for s in group], [s.ends[0] for s in group], slack)
        same = [s for s in group if _holds(s.low, low, slack)]
        high = _most_common_place([s.high for s in same], [s.ends[1] for s in same], slack)
        same = [s for s in same if _holds(s.high, high, slack)]
        if len(same) > 1 and high - low > THIN * slack:
            yield from ((s, (low, high)) for s in same)
        group = [s for s in group if s not in same]


def _most_common_place(ranges: list[tuple[float, float]], now: list[float], slack: float) -> float:
    """A place that lies in most ranges, and where most ends are already."""
    offered = now + [end for ends in ranges for end in ends if math.isfinite(end)]
    return max(offered, key=lambda at: (sum(_holds(r, at, slack) for r in ranges), sum(abs(n - at) <= slack for n in now)))


def _holds(ends: tuple[float, float], at: float, slack: float) -> bool:
    return ends[0] - slack <= at <= ends[1] + slack
