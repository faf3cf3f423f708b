"""Whether a part is written as few drawings or as more and plainer features.

One outline may stand for a dozen primitives, and a search that counts features always draws. But a plate with two holes is a box and two
cylinders to those who edit it: each has its own numbers, and moves by itself. So a program of plainer features is taken where there is
hardly more to read in it - or, where it has more than a dozen of them, clearly less - and the part is the same. What is to read is counted
as in a minimum description length (Rissanen 1978), with one for each feature and number and half of one for the kind of a curve. A row,
grid or circle of copies is read once, with its counts and steps: sixty holes of a grid are no more than one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Set
from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np

from imdim.geometry.lowering import lower
from imdim.geometry.solid import exact_rotation
from imdim.program.cost import count
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Loop, Outline, arc_center, arc_radius, has_ellipse, line_of, ring_curves
from imdim.program.patterns.weigh import take_first_copies
from imdim.program.regular_polygon import RegularPolygon, regular_of
from imdim.program.rewrite.cells import count_runs
from imdim.program.roles import signs
from imdim.program.tree import ACROSS, PLANE_ENDS, Primitive, Program, leaves
from imdim.reconstruction.observation import Observation
from imdim.reconstruction.preserve import COARSE, is_same

FEW = 12  # features, which are read one by one
MANY = 24  # features, copies counted once, more than which nobody reads where FEW drawings say the same
MORE, LESS = 1.25, 0.85  # times as much to read as in the drawings: what few plain features, and what more of them, may have
CLEARLY = 0.95  # times as much to read, copies read once, as walls and bars have: what more than FEW cells in their place may have
FAR_LESS, SLIGHTLY = 0.75, 0.9  # the same where copies are read once, however many they are: of a dozen drawings, and of more
PER_DIRECTION = 2  # numbers that say how copies go on one way: a count and a step
SAME = 0.8  # of a primitive's price: by how much less of the part they may be
PER_RIM = 3  # numbers that a cone shares with what it ends at, two of its place and a radius: one corner of a drawing says all
SHORT = 0.6  # of its larger radius: the height of a cone that is a chamfer or a countersink
CURVE_KIND = 0.5  # of a number: that a curve is a line or an arc
AXES_OF = {"box": (0, 1, 2), "extrude": (0, 1, 2), "ellipsoid": (0, 1, 2), "sphere": ()}  # of others the third
ONE_WAY = 1e-6  # of the cosine between two directions, from which they are two
ONE_NUMBER = 1e-4  # of the part's size, within which two numbers are one
HALF_DEG, ODD_DEG = 0.5, 0.02  # of angles that are typed, and how far others are from these: by more than a fit misses
OUTSIDE = 1e-3  # of the part's size, beyond it: where a cutter ends there nothing is to be read


def may_be_plain(drawn: Program, low: np.ndarray, high: np.ndarray) -> bool:
    """Whether a program has drawings, and primitives may tell the part, which fills a box from `low` [3] to `high` [3]: not where even as
    many as its walls need at least are too many."""
    counts = count(drawn)
    if not has_drawings(drawn):
        return False
    fewest = sum(map(_fewest_primitives, leaves(drawn)))
    # round walls of one radius may be copies of one hole
    if counts.primitives <= FEW and sum(_fewest_primitives(leaf, of_copies=1) for leaf in leaves(drawn)) > MANY:
        return False
    length = reading_length(drawn, low, high)
    return length - counts.primitives - CURVE_KIND * _count_kinds(drawn) + fewest <= _most(fewest) * length


def has_drawings(program: Program) -> bool:
    """Whether a program has outlines other than an ellipse or a regular polygon of more than four sides alone: those read as a circle
    does, and three boxes are no plainer than the hexagon of a nut."""
    drawings = [leaf.outline.loops for leaf in leaves(program) if leaf.outline]
    return not all(len(loops) == 1 and _reads_as_circle(loops[0]) for loops in drawings)


def _reads_as_circle(loop: Loop) -> bool:
    return isinstance(loop, Ellipse) or (len(loop) > 4 and _regular(loop) is not None)


def is_plainer(plain: Program, drawn: Program, seen: Observation) -> bool:
    """Whether a program of plainer features is to be preferred to drawings."""
    low, high = seen.families.arrangement.bounds
    if plain == drawn or not is_hardly_longer(plain, drawn, low, high):
        return False
    if seen.solid is None:
        return False
    slack = SAME * seen.size_weight
    # few facets are quickest, and the mesh, which has the most, is asked only where they do not tell
    if is_same(plain, drawn, slack, (COARSE,)):
        return True
    have, had = seen.iou(plain), seen.iou(drawn)
    # arcs end between the corners of the circles that they are of
    return (have is not None and had is not None and have >= had - slack) or is_same(plain, drawn, slack)


def repeats_plainly(cells: Program, walls: Program, low: np.ndarray, high: np.ndarray) -> bool:
    """Whether a program of repeated cells is to be preferred to one of the same solid, which fills a box from `low` [3] to `high` [3], with
    the walls between them: with copies read once, and the runs of what is united and cut, it reads shorter; clearly so where it has more
    than FEW features."""
    share = 1.0 if count(cells).primitives <= FEW else CLEARLY
    after, before = (length_read_once(program, low, high) + count_runs(program) for program in (cells, walls))
    return after < share * before


def is_hardly_longer(plain: Program, drawn: Program, low: np.ndarray, high: np.ndarray, more: float = MORE) -> bool:
    """Whether there is hardly more to read in plainer features than in what they stand for, at most so many times as much - or, where they
    are many, clearly less - in the program of a part that fills a box from `low` [3] to `high` [3]. Blocks that lean at odd angles are
    never plainer: a line of a drawing leans because it goes from here to there, or touches two circles. Nor are added ones that lean out of
    the part, held back by what they have in common with another: a brace is a line of its bracket's drawing."""
    if count_odd_directions(plain) > count_odd_directions(drawn) or _count_held_back(plain, low, high) > _count_held_back(drawn, low, high):
        return False
    if count(drawn).primitives <= FEW and count(take_first_copies(plain)[0]).primitives > MANY:
        return False
    if reading_length(plain, low, high) <= _most(count(plain).primitives, more) * reading_length(drawn, low, high):
        return True
    # where even the drawings are many features, no more of them are to be feared
    share = FAR_LESS if count(drawn).primitives <= FEW else SLIGHTLY
    return length_read_once(plain, low, high) <= share * length_read_once(drawn, low, high)


def _most(features: float, more: float = MORE) -> float:
    return more if features <= FEW else LESS


def _fewest_primitives(leaf: Primitive, of_copies: int = 3) -> float:
    """How many of the six kinds at least have the walls of a leaf: a round wall, or four straight ones of an extrusion, is of one. Round
    walls that have the last `of_copies` of the numbers of their centre and radius in common count once."""
    if leaf.outline is None:
        return 1
    if has_ellipse(leaf.outline) or any(map(_reads_as_circle, leaf.outline.loops)):
        return math.inf  # ellipses and the hexagons of nuts, which none of the six kinds has
    curves = [curve for ring in leaf.outline.rings for curve in ring_curves(ring)]
    arcs = {(*arc_center(curve), arc_radius(curve))[-of_copies:] for curve in curves if curve[4]}
    lines = {line_of(curve) for curve in curves if not curve[4]}
    extent = np.abs([curve[:4] for curve in curves]).max()
    round_walls = _distinct(arcs, ONE_NUMBER * extent)
    if leaf.kind == "revolve":
        return max(1, round_walls + _distinct({line for line in lines if abs(line[0]) > ONE_WAY}, ONE_NUMBER * extent))
    return max(1, round_walls + -(-_distinct(lines, ONE_NUMBER * extent) // 4))


class _RoundSide(NamedTuple):
    """The wall of a cone or a cylinder that adds or not: a middle [3] and an axis [3], half of its height, and the radii at both ends."""

    sign: int
    middle: np.ndarray
    axis: np.ndarray
    half: float
    radii: tuple[float, float]

    def radius(self, height: float) -> float:
        """So high above the middle."""
        low, high = self.radii
        return (low + high) / 2 + (high - low) * height / (2 * self.half)


def count_shared_rims(program: Program, tolerance: float) -> int:
    """How many walls of cones meet, within a tolerance, a wall about their axis of another cone or of a cylinder that adds or cuts as they
    do: each ends where the other goes on. Chamfers and countersinks, which are short, are read as such."""
    both = zip(leaves(program), signs(program), strict=True)
    round_ones = [(p, sign) for p, sign in both if p.kind == "cylinder" or (p.kind == "cone" and p.size[2] > SHORT * max(p.size[:2]))]
    sides = [
        _RoundSide(sign, np.array(p.center), exact_rotation(p)[:, 2], p.size[-1] / 2, (p.size[0], p.size[-2])) for p, sign in round_ones
    ]
    return sum(_share_rim(a, b, tolerance) for a, b in combinations(sides, 2))


def _share_rim(a: _RoundSide, b: _RoundSide, tolerance: float) -> bool:
    apart = b.middle - a.middle
    off, way = float(apart @ a.axis), float(b.axis @ a.axis)
    if a.sign != b.sign or (a.radii[0] == a.radii[1] and b.radii[0] == b.radii[1]):
        return False
    if abs(way) < 1 - ONE_WAY or np.abs(apart - off * a.axis).max() > tolerance:
        return False
    low, high = max(-a.half, off - b.half), min(a.half, off + b.half)
    wider = [a.radius(height) - b.radius(math.copysign(1.0, way) * (height - off)) for height in (low, high)]
    return low <= high + tolerance and (min(map(abs, wider)) <= tolerance or wider[0] * wider[1] < 0)


def _distinct(rows: Set[tuple[float, ...]], tolerance: float) -> int:
    return len({tuple(round(v / tolerance) for v in row) for row in rows})


def reading_length(program: Program, low: np.ndarray, high: np.ndarray) -> float:
    """How much there is to read in the program of a part that fills a box from `low` [3] to `high` [3], in numbers: its leaves, their
    numbers and their directions, the kind of each curve, and that cones end at the rims of others."""
    read = count(program).primitives + count_numbers(program, low, high) + count_directions(program)
    rims = count_shared_rims(program, ONE_NUMBER * float(np.linalg.norm(high - low)))
    return read + CURVE_KIND * _count_kinds(program) + PER_RIM * rims


def length_read_once(program: Program, low: np.ndarray, high: np.ndarray) -> float:
    """`reading_length` of a program whose repeated parts are written once."""
    first, directions = take_first_copies(program)
    return reading_length(first, low, high) + PER_DIRECTION * directions


def _count_kinds(program: Program) -> int:
    """Curves of all outlines, a regular polygon, which is told by its count of sides, as one. An ellipse alone is the kind of its feature,
    as a circle is that of a cylinder."""
    drawings = [leaf.outline.loops for leaf in leaves(program) if leaf.outline]
    alone = sum(len(loops) == 1 and isinstance(loops[0], Ellipse) for loops in drawings)
    sides = sum(regular.sides - 1 for loops in drawings for loop in loops if (regular := _regular(loop)))
    return count(program).curves - alone - sides


def _regular(loop: Loop) -> RegularPolygon | None:
    return None if isinstance(loop, Ellipse) else regular_of(loop, ONE_NUMBER * max(abs(v) for vertex in loop for v in vertex[:2]))


def count_directions(program: Program) -> int:
    """How many different directions, of either sense, the axes of a program's leaves have: three of what has corners, one of what is round,
    none of a ball. Slanted walls are lines of a drawing, but tilted boxes without one."""
    return len(_directions(program))


def count_odd_directions(program: Program) -> int:
    """How many of these are at angles to the axes of the world that are no halves of a degree."""
    angles = [np.degrees(np.arccos(np.minimum(np.abs(axis), 1.0))) / HALF_DEG for axis in _directions(program)]
    return sum(bool((np.abs(angle - np.round(angle)) * HALF_DEG > ODD_DEG).any()) for angle in angles)


def _count_held_back(program: Program, low: np.ndarray, high: np.ndarray) -> int:
    """How many boxes that add, and lean, reach out of the box from `low` [3] to `high` [3] by more than half of their least size."""
    solid = lower(program)
    found = 0
    for i, (leaf, sign) in enumerate(zip(leaves(program), signs(program), strict=True)):
        turn = np.abs(solid.rotations[i])
        if leaf.kind == "box" and sign > 0 and turn.max(axis=0).min() < 1 - ONE_WAY:
            reach = turn @ np.array(leaf.size) / 2
            beyond = np.maximum(low - (solid.centers[i] - reach), solid.centers[i] + reach - high)
            found += bool(beyond.max() > min(leaf.size) / 2)
    return found


def _directions(program: Program) -> list[np.ndarray]:
    turns = lower(program).rotations
    axes = [turn[:, k] for turn, leaf in zip(turns, leaves(program), strict=True) for k in AXES_OF.get(leaf.kind, (2,))]
    known: list[np.ndarray] = []
    for axis in axes:
        if all(abs(float(axis @ other)) < 1 - ONE_WAY for other in known):
            known.append(axis)
    return known


def count_numbers(program: Program, low: np.ndarray, high: np.ndarray) -> int:
    """How many different numbers say where the faces of a program are: radii, levels and vertices, from the middle of the box that its part
    fills, whatever their sign, but for zeros and for levels outside of the part."""
    size = float(np.linalg.norm(high - low))
    values = sorted(abs(v) for v in _numbers(program, (low + high) / 2, (high - low) / 2, OUTSIDE * size) if abs(v) > ONE_NUMBER * size)
    return sum(b - a > ONE_NUMBER * size for a, b in pairwise([0.0, *values]))


def _numbers(program: Program, middle: np.ndarray, half: np.ndarray, slack: float) -> Iterator[float]:
    solid = lower(program)
    for i, leaf in enumerate(leaves(program)):
        turn = solid.rotations[i]
        at, reach = turn.T @ (solid.centers[i] - middle), np.abs(turn.T) @ half + slack
        yield from (v for axis, v in face_levels(leaf, at) if abs(v) < reach[axis])
        yield from place_numbers(leaf, at)


def face_levels(leaf: Primitive, at: np.ndarray) -> Iterator[tuple[int, float]]:
    """The axes of a leaf's plane faces, and where these are on them."""
    for axis, column in PLANE_ENDS.get(leaf.kind, {}).items():
        yield from ((axis, float(at[axis]) + side * leaf.size[column] / 2) for side in (-1, 1))


def place_numbers(leaf: Primitive, at: np.ndarray) -> Iterator[float]:
    """Radii, vertices, and where a leaf's axis or middle is."""
    x, y, z = map(float, at)
    if leaf.kind in ACROSS:
        assert leaf.outline is not None
        yield from (v for u, w in _places(leaf.outline) for v in (x + u, y + w))
        yield from (*_radii(leaf.outline), *leaf.size[1:])
    elif leaf.kind == "revolve":
        assert leaf.outline is not None
        yield from (x, y, *(v for r, h in _places(leaf.outline) for v in (r, z + h)), *_radii(leaf.outline))
    elif leaf.kind in ("cylinder", "cone"):
        yield from (x, y, *leaf.size[:-1])
    elif leaf.kind != "box":
        yield from (x, y, z, *leaf.size)


def _places(outline: Outline) -> list[tuple[float, float]]:
    """Vertices, and the centres of ellipses and regular polygons."""
    out: list[tuple[float, float]] = []
    for loop in outline.loops:
        if isinstance(loop, Ellipse):
            out.append((loop.x, loop.y))
        elif regular := _regular(loop):
            out.append(regular.center)
        else:
            out += [vertex[:2] for vertex in loop]
    return out


def _radii(outline: Outline) -> Iterator[float]:
    """Of ellipses and regular polygons."""
    for loop in outline.loops:
        if isinstance(loop, Ellipse):
            yield from (loop.rx, loop.ry)
        elif regular := _regular(loop):
            yield regular.radius
