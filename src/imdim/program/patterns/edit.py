"""Repeats of a program whose numbers or counts have changed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import count, product

from imdim.program.constraints import RULES, WORLD, Constraint, Ref
from imdim.program.edges import EdgeFeature, Face
from imdim.program.repeats import Folded, Group, Repeat, rebuilt, size
from imdim.program.tree import Primitive, Program, Vec3, leaves
from imdim.program.vectors import cross, dot, minus, round_vector

Key = tuple[object, ...]


def refit_repeats(folded: Folded, program: Program, decimals: int) -> Folded:
    """The repeats as the first copies in `program` have them, which has the leaves of the expanded program with other sizes and places.

    Steps and centres keep `decimals` decimals.
    """
    parts = list(leaves(program))

    def refit(first: int, repeat: Repeat) -> Repeat:
        own = size(repeat.part)
        strides = {"grid": (own * repeat.counts[-1], own)}.get(repeat.kind, (own,))
        at, others = parts[first].center, [parts[first + stride].center for stride in strides]
        if repeat.kind in ("linear", "grid"):
            return replace(repeat, steps=tuple(round_vector(minus(other, at), decimals) for other in others))
        return replace(repeat, point=round_vector(_center(repeat, at, others[0]), decimals))

    return rebuilt(folded, lambda first, _: parts[first], refit)


def _center(repeat: Repeat, a: Vec3, b: Vec3) -> Vec3:
    """The point of the axis that turns `a` to `b`, or of the plane that mirrors one to the other."""
    n, chord = repeat.axis, minus(b, a)
    middle = tuple((p + q) / 2 for p, q in zip(a, b, strict=True))
    if repeat.kind == "mirror":
        x, y, z = (dot(middle, n) * c for c in n)  # type: ignore[arg-type]
        return x, y, z
    factor = 0.5 / math.tan(math.radians(repeat.angle) / 2)
    off = tuple(m + factor * c for m, c in zip(middle, cross(n, chord), strict=True))
    along = dot(minus(repeat.point, off), n)  # type: ignore[arg-type]
    x, y, z = (o + along * c for o, c in zip(off, n, strict=True))
    return x, y, z


def recount_repeats(folded: Folded, counts: Mapping[int, tuple[int, ...]]) -> Folded:
    """With other counts for some repeats, by their numbers in the order of `repeats`; full circles stay full."""
    number = count()

    def recount(_: int, repeat: Repeat) -> Repeat:
        new = counts.get(next(number), repeat.counts)
        return replace(repeat, counts=new, angle=repeat.angle * repeat.counts[0] / new[0] if repeat.is_full else repeat.angle)

    return rebuilt(folded, lambda _, leaf: leaf, recount)


def recount_constraints(constraints: Sequence[Constraint], before: Folded, after: Folded) -> tuple[Constraint, ...]:
    """The constraints among leaves that are still there."""
    number = {key: i for i, key in enumerate(_keys(after))}
    moved = {i: number.get(key) for i, key in enumerate(_keys(before))} | {WORLD: WORLD}
    out: list[Constraint] = []
    for c in constraints:
        of = tuple(Ref(new, ref.feature) for ref in c.of if (new := moved[ref.leaf]) is not None)
        about = None if c.about is None else moved[c.about.leaf]
        enough = len(of) >= (2 if RULES[c.kind].most > 3 else len(c.of)) and len(of) >= RULES[c.kind].least
        if enough and (c.about is None or about is not None):
            out.append(replace(c, of=of, about=None if c.about is None or about is None else Ref(about, c.about.feature)))
    return tuple(out)


def recount_edges(edges: Sequence[EdgeFeature], before: Folded, after: Folded) -> tuple[EdgeFeature, ...]:
    """The edge features among leaves that are still there; where all copies have an edge, new ones have it too."""
    keys, number = _keys(before), {key: i for i, key in enumerate(_keys(after))}
    out = (replace(f, edges=tuple(_recount_pairs(f.edges, keys, number))) for f in edges if _recount_pairs(f.edges, keys, number))
    return tuple(out)


def _recount_pairs(edges: Sequence[tuple[Face, Face]], keys: Sequence[Key], number: Mapping[Key, int]) -> list[tuple[Face, Face]]:
    there: dict[tuple[tuple[Key, str], ...], set[tuple[Key, ...]]] = {}
    for edge in edges:
        written = tuple((_written(keys[face.leaf]), face.name) for face in edge)
        there.setdefault(written, set()).add(tuple(_copy(keys[face.leaf]) for face in edge))
    out: list[tuple[Face, Face]] = []
    for sides, copies in there.items():
        # the copy that an edge is of: both its faces are of that, or one of none
        own = {next((c for c in pair if c), ()) for pair in copies}
        alike = all({c for c in pair if c} <= {o} for pair in copies for o in [next((c for c in pair if c), ())])
        every = {_copy(key) for key in keys for written, _ in sides if _written(key) == written and _copy(key)}
        is_repeated = [any(pair[k] for pair in copies) for k in range(2)]
        if alike and own == every:
            fresh = {_copy(key) for key in number for written, _ in sides if _written(key) == written and _copy(key)}
            copies = {tuple(copy if repeated else () for repeated in is_repeated) for copy in fresh}
        for pair in sorted(copies):
            places = [_join(written, copy, number) for (written, _), copy in zip(sides, pair, strict=True)]
            if None not in places:
                one, two = (Face(i, name) for i, (_, name) in zip(places, sides, strict=True) if i is not None)
                out.append((one, two))
    return out


def _written(key: Key) -> Key:
    """Where a leaf is written, whichever copy it is of."""
    return tuple(() if isinstance(e, tuple) else e for e in key)


def _copy(key: Key) -> Key:
    return tuple(e for e in key if isinstance(e, tuple))


def _join(written: Key, copy: Key, number: Mapping[Key, int]) -> int | None:
    """The number of the leaf that is written there, of a copy; None where there is none."""
    rest = iter(copy)
    return number.get(tuple(next(rest, ()) if e == () else e for e in written))


def _keys(folded: Folded) -> list[Key]:
    """For each leaf of the expanded program where it is written and which copy it is of."""
    if isinstance(folded, Primitive):
        return [()]
    if isinstance(folded, Group):
        return [(n, *key) for n, part in enumerate(folded.parts) for key in _keys(part)]
    return [(copy, *key) for copy in product(*map(range, folded.counts)) for key in _keys(folded.part)]
