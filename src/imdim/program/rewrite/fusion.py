"""Pairs of primitives whose union, intersection or difference is again one primitive.

All rules are one idea: shorten or lengthen a primitive along one of its axes, and prove that the result is the pair.
A box has three such axes, a cylinder, a cone (its wall continued) and an extrusion their own.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

from imdim.program.rewrite import containment
from imdim.program.rewrite.containment import axes, contains, reach
from imdim.program.tree import FLAT_ENDS, Op, Primitive
from imdim.program.vectors import along, dot


@lru_cache(maxsize=1 << 16)
def fuse(op: Op, a: Primitive, b: Primitive, slack: float = containment.SLACK) -> Primitive | None:
    """One primitive that surely equals ``op(a, b)``, or None if none was found."""
    for p, q in ((a, b),) if op == "difference" else ((a, b), (b, a)):
        for axis in FLAT_ENDS.get(p.kind, ()):
            fused = _ALONG[op](p, q, axis, slack)
            if fused is not None:
                return fused
    return None


def _join(p: Primitive, q: Primitive, axis: int, slack: float) -> Primitive | None:
    """`p` lengthened to the extent of `q`: right if it holds `q` and `q` fills what was added."""
    half, (low, high) = _half(p, axis), _extent(p, q, axis)
    longer = _between(p, axis, min(low, -half), max(high, half))
    if longer is None or not contains(longer, q, slack):
        return None
    tiny = slack * half
    added = [(lo, hi) for lo, hi in ((low, -half), (half, high)) if hi - lo > tiny]
    return longer if all(_fills(q, _between(p, axis, lo, hi), slack) for lo, hi in added) else None


def _clip(p: Primitive, q: Primitive, axis: int, slack: float) -> Primitive | None:
    """`p` shortened to the extent of `q`: right if `q` holds what is left."""
    half, (low, high) = _half(p, axis), _extent(p, q, axis)
    kept = _between(p, axis, max(low, -half), min(high, half))
    return kept if _fills(q, kept, slack) else None


def _cut(p: Primitive, q: Primitive, axis: int, slack: float) -> Primitive | None:
    """`p` shortened from one end by the extent of `q`: right if `q` holds what is taken away."""
    half, (low, high) = _half(p, axis), _extent(p, q, axis)
    tiny = slack * half
    if high >= half - tiny and low > -half + tiny:
        return _between(p, axis, -half, low) if _fills(q, _between(p, axis, low, half), slack) else None
    if low <= -half + tiny and high < half - tiny:
        return _between(p, axis, high, half) if _fills(q, _between(p, axis, -half, high), slack) else None
    return None


_ALONG = {"union": _join, "intersection": _clip, "difference": _cut}


def _fills(q: Primitive, piece: Primitive | None, slack: float) -> bool:
    return piece is not None and contains(q, piece, slack)


def _half(p: Primitive, axis: int) -> float:
    return p.size[FLAT_ENDS[p.kind][axis]] / 2


def _extent(p: Primitive, q: Primitive, axis: int) -> tuple[float, float]:
    """From where to where `q` reaches along an axis of `p`, measured from the centre of `p`."""
    n = axes(p)[axis]
    middle = dot(along(q.center, p.center, -1.0), n)
    return middle - reach(q, (-n[0], -n[1], -n[2])), middle + reach(q, n)


def _between(p: Primitive, axis: int, low: float, high: float) -> Primitive | None:
    """`p` from `low` to `high` along an axis, its walls continued where that is longer; None where nothing is left."""
    if not high > low:
        return None
    center = along(p.center, axes(p)[axis], (low + high) / 2)
    if p.kind == "box":
        return Primitive("box", (*p.size[:axis], high - low, *p.size[axis + 1 :]), center, p.rotation)
    if p.kind == "cylinder":
        return Primitive("cylinder", (p.size[0], high - low), center, p.rotation)
    if p.kind == "extrude":
        return replace(p, size=(high - low,), center=center)
    bottom, top, h = p.size
    radii = [bottom + (top - bottom) * (t / h + 0.5) for t in (low, high)]
    if min(radii) < -1e-12 * max(radii) or max(radii) <= 0:
        return None
    return Primitive("cone", (max(radii[0], 0.0), max(radii[1], 0.0), high - low), center, p.rotation)
