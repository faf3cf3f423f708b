"""Blends as OpenSCAD draws them: ordinary statements whose numbers follow the names that move their edges.

How a blend's numbers depend on a name is not known in closed form: the edge lies where two faces meet, and ends where others are. So each
name is moved by a little, and its blends are placed again; where twice as far moves them twice as much, the number is a sum of names.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.export.drawn_vertex import DrawnVertex
from imdim.export.edge_pieces import gather_pieces
from imdim.export.numbers import Expression, Term, simple_fraction
from imdim.export.parameters import Parameters
from imdim.geometry.edge_solids import BlendSolid, sweep_blends
from imdim.geometry.edges import NearbyEdges
from imdim.program.cost import count
from imdim.program.edges import EdgeFeature, with_sizes
from imdim.program.tree import Primitive, Program, leaves, longest

STEP = 1e-3  # of a value, by which it is moved
STRAIGHT = 1e-4  # of a step, by which twice as far may not be twice as much, and a factor not be a simple one
FAINT = 1e-6  # of a factor, which is none
FACTOR_DIGITS = 9  # of others
EIGHTHS = 8  # parts of one, of which simple factors are so many
MATTERS = 1e-2  # of the volume: a search by volume would see them, and so does who looks at the part

Read = Callable[[Mapping[str, float]], Program]


@dataclass(frozen=True)
class DrawnEdges:
    """What a text draws of edge features: their `pieces`, and the expressions of the numbers of these, leaf after leaf. `stuck` are names
    that move blends, or may, in a way that the expressions do not say. `shown` says whether they are drawn unless told otherwise."""

    features: tuple[EdgeFeature, ...]
    pieces: tuple[BlendSolid, ...]
    named: Parameters
    stuck: tuple[str, ...]
    shown: bool


def do_edges_matter(sharp: float, blended: float) -> bool:
    """Whether a part of so much volume differs from the sharp one by more than MATTERS of that."""
    return abs(blended - sharp) > MATTERS * sharp


def draw_edges(
    features: Sequence[EdgeFeature],
    values: Mapping[str, float],
    read: Read,
    matter: bool,
    deadline: Deadline = NEVER,
) -> DrawnEdges:
    """The blends of a program, which `read` gives for `values` of its names, other than the text's. They are shown where they `matter`, and
    where they take no more statements than the program without them. Past the `deadline` (by default never) no more names are tried."""
    program = read({})  # with the numbers of the text: rounding may have moved where an edge ends
    near = NearbyEdges(program, features)
    pieces = gather_pieces(sweep_blends(near.found.edges))
    base = _numbers(pieces)
    slopes: dict[str, np.ndarray] = {}
    stuck: list[str] = []
    for name in values:
        try:
            if deadline.has_passed():
                raise _UnfollowedError
            slopes[name] = _slope(program, near, features, values, name, read, pieces, base)
        except _UnfollowedError:
            stuck.append(name)
    slopes = {name: slope for name, slope in slopes.items() if slope.any()}
    sums = [Expression(tuple(_terms(slopes, i)), v - sum(slopes[n][i] * values[n] for n in slopes)) for i, v in enumerate(base)]
    sizes, centers, outlines = [], [], []
    rest = iter(sums)
    for leaf in _leaves(pieces):
        sizes.append(tuple(next(rest) for _ in leaf.size))
        centers.append(tuple(next(rest) for _ in range(3)))
        assert leaf.outline is not None
        outlines.append(tuple(tuple(DrawnVertex(next(rest), next(rest), b) for _, _, b in ring) for ring in leaf.outline.rings))
    named = Parameters(dict(values), tuple(sizes), tuple(centers), outlines=tuple(outlines))
    shown = matter or len(sizes) <= count(program).primitives
    return DrawnEdges(tuple(features), tuple(pieces), named, tuple(stuck), shown)


class _UnfollowedError(Exception):
    """How blends follow a name cannot be said."""


def _terms(slopes: Mapping[str, np.ndarray], i: int) -> list[Term]:
    return [Term(name, simple_fraction(float(slope[i]))) for name, slope in slopes.items() if abs(slope[i]) > FAINT]


def _slope(
    program: Program,
    near: NearbyEdges,
    features: Sequence[EdgeFeature],
    values: Mapping[str, float],
    name: str,
    read: Read,
    pieces: Sequence[BlendSolid],
    base: np.ndarray,
) -> np.ndarray:
    """By how much each number of the blends moves with a name. Raises _UnfollowedError where that is not straight, or there are other
    blends then."""
    step = STEP * (abs(values[name]) or longest(leaves(program)))
    first = simple = None
    for times in (1, 2):
        changed = {name: values[name] + times * step}
        try:
            other, resized = read(changed), with_sizes(features, changed)
        except ValueError:
            raise _UnfollowedError from None
        if not _moves(program, other, features) and tuple(resized) == tuple(features):
            return np.zeros(len(base))
        found = gather_pieces(sweep_blends(near.at(other, resized).edges))
        if [_shape(p) for p in found] != [_shape(p) for p in pieces]:
            raise _UnfollowedError
        moved = (_numbers(found) - base) / step
        if first is None:
            first, simple = moved, np.round(moved * EIGHTHS) / EIGHTHS
            if (np.abs(moved - simple) < STRAIGHT).all():
                return simple  # what moves by a simple fraction goes on to
        elif (np.abs(moved - 2 * first) > STRAIGHT * np.maximum(np.abs(first), 1.0)).any():
            raise _UnfollowedError
    assert first is not None
    assert simple is not None
    return np.where(np.abs(first - simple) < STRAIGHT, simple, np.round(first, FACTOR_DIGITS))


def _moves(one: Program, two: Program, features: Sequence[EdgeFeature]) -> bool:
    """Whether a leaf whose edges are blended differs between two programs."""
    of_edges = {face.leaf for f in features for edge in f.edges for face in edge}
    return any(a != b for i, (a, b) in enumerate(zip(leaves(one), leaves(two), strict=True)) if i in of_edges)


def _leaves(pieces: Sequence[BlendSolid]) -> list[Primitive]:
    return [leaf for piece in pieces for leaf in leaves(piece.solid)]


def _shape(piece: BlendSolid) -> tuple[object, ...]:
    """What has to stay for the numbers of two blends to be compared."""
    drawn = [(leaf.kind, [len(loop) for loop in leaf.outline.loops] if leaf.outline else []) for leaf in leaves(piece.solid)]
    return piece.feature, piece.edge, piece.cuts, drawn


def _numbers(pieces: Sequence[BlendSolid]) -> np.ndarray:
    """Sizes, centre and vertices of each leaf, in the order of the leaves."""
    out: list[float] = []
    for leaf in _leaves(pieces):
        assert leaf.outline is not None
        out += [*leaf.size, *leaf.center, *(c for ring in leaf.outline.rings for x, y, _ in ring for c in (x, y))]
    return np.array(out)


def with_edge_sizes(named: Parameters, features: Sequence[EdgeFeature]) -> Parameters:
    """The names of a text with those of edge features' sizes."""
    sizes = {name: size for f in features for name, size in zip(f.size_names, f.sizes, strict=True)}
    return replace(named, values={**named.values, **sizes})
