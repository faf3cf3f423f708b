"""Pairs that say one thing of several features become one constraint."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from imdim.program.constraints import WORLD, Constraint, Ref

TRANSITIVE = ("parallel", "equal", "coaxial", "concentric")
ORDER = ("parallel", "perpendicular", "equal", "coaxial", "concentric")


def merged(constraints: Iterable[Constraint]) -> tuple[Constraint, ...]:
    """The same relations, transitive ones as one per connected group of features, in the order of their first pair."""
    out: list[Constraint] = []
    for constraint in constraints:
        if constraint.kind not in TRANSITIVE:
            out.append(constraint)
            continue
        # a ball may lie on several lines, which do not become one by that
        shared = {ref for ref in constraint.of if ref.feature or constraint.kind == "concentric"}
        touching = [o for o in out if o.kind == constraint.kind and set(o.of) & shared]
        for other in touching:
            out.remove(other)
        together = {ref: None for c in [*touching, constraint] for ref in c.of}
        out.append(replace(constraint, of=_ordered(list(together))))
    return tuple(sorted(out, key=lambda c: ORDER.index(c.kind) if c.kind in ORDER else len(ORDER)))


def _ordered(refs: list[Ref]) -> tuple[Ref, ...]:
    """By leaf, those of the frame first; the line of a coaxial group needs an axis in front."""
    return tuple(sorted(refs, key=lambda r: (r.leaf != WORLD, not r.feature, r.leaf, r.feature)))
