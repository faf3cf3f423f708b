"""What was chosen, as one would say it: nothing twice, and pairs that say one thing of several features as one constraint."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from imdim.geometry.lowering import Lowered
from imdim.program.constraints import WORLD, Constraint, Ref
from imdim.relations.residuals import rows_of

TRANSITIVE = ("parallel", "equal", "coaxial", "concentric")
ORDER = ("parallel", "perpendicular", "equal", "coaxial", "concentric")


SPANNED = 1e-6  # weights in combinations of rows that vanish


def prune_implied(constraints: Sequence[Constraint], numbers: Lowered) -> list[Constraint]:
    """Without single equations that the others imply at `numbers`: what was said first may be said again by what came later."""
    kept = list(constraints)
    while kept:
        rows = rows_of(kept, numbers)
        scaled = rows.jacobian / np.maximum(np.linalg.norm(rows.jacobian, axis=1), 1e-300)[:, None]
        values, vectors = np.linalg.eigh(scaled @ scaled.T)
        weight = np.abs(vectors[:, values < SPANNED**2 * len(values)]).max(1, initial=0.0)
        single = np.bincount(rows.owner, minlength=len(kept))[rows.owner] == 1
        spare = np.flatnonzero(single & (weight > SPANNED**0.5))
        if not len(spare):
            break
        kept.pop(int(rows.owner[spare[np.argmax(weight[spare])]]))
    return kept


def merge_transitive(constraints: Iterable[Constraint]) -> tuple[Constraint, ...]:
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
        out.append(replace(constraint, of=_order_refs(list(together))))
    return tuple(sorted(out, key=lambda c: ORDER.index(c.kind) if c.kind in ORDER else len(ORDER)))


def _order_refs(refs: list[Ref]) -> tuple[Ref, ...]:
    """By leaf, those of the frame first; the line of a coaxial group needs an axis in front."""
    return tuple(sorted(refs, key=lambda r: (r.leaf != WORLD, not r.feature, r.leaf, r.feature)))
