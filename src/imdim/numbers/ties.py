"""Numbers that leaves share: copies have one size and one drawing, stand level with one another, and in even steps.

That numbers are equal says that they are one, as a line exactly along an axis of its plane stays along it: a fit moves them together, and a
description pays for them once. What is nearly equal is made so by `tie_alike`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from imdim.geometry.lowering import Lowered, lower
from imdim.geometry.pose import extent_of
from imdim.numbers.outline_coordinates import center_leaf, outline_coordinates
from imdim.numbers.shared_rotations import align_rotations, frames
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Loop, Outline
from imdim.program.tree import FULL_TURN, SIZE_NAMES, Primitive, Program, leaves, map_leaves

SAME = 1e-7  # of a program's extent, by which numbers that are one may differ


@dataclass(frozen=True)
class Ties:
    """`twins` are leaves and the first that has their shape; of each of `levels` the sum of weighted coordinates of leaves along an axis
    of their frame stays as it is, which is that of the leaf that `leads` it, [k]."""

    twins: tuple[tuple[int, int], ...]
    levels: tuple[tuple[int, tuple[tuple[int, float], ...]], ...]
    leads: np.ndarray

    @property
    def leaves(self) -> frozenset[int]:
        """All that are tied to others."""
        return frozenset(i for pair in self.twins for i in pair)

    def count_saved(self, parts: Sequence[Primitive]) -> np.ndarray:
        """How many numbers of each of the leaves earlier ones have, int64 [k]."""
        out = np.zeros(len(parts), np.int64)
        for i, _ in self.twins:
            out[i] += shape_numbers(parts[i])
        for _, terms in self.levels:
            out[max(i for i, _ in terms)] += 1
        return out

    def rows(self, numbers: Lowered, maps: np.ndarray, drawn: Mapping[int, tuple[int, int]], count: int) -> np.ndarray:
        """Combinations [m, count] of a fit's unknowns that stay nothing: the first of leaf i are as many as `maps` [k, 9, 9] takes to its
        sizes and shift, at 6 i, and of an outline those from `drawn` one to another."""
        out: list[np.ndarray] = []
        for i, j in self.twins:
            for slot in range(3):
                row = np.zeros(count)
                row[6 * i : 6 * i + 6], row[6 * j : 6 * j + 6] = maps[i, slot, :6], -maps[j, slot, :6]
                out.append(row)
            for a, b in zip(range(*drawn.get(i, (0, 0))), range(*drawn.get(j, (0, 0))), strict=True):
                row = np.zeros(count)
                row[a], row[b] = 1.0, -1.0
                out.append(row)
        for axis, terms in self.levels:
            row = np.zeros(count)
            for i, weight in terms:
                row[6 * i : 6 * i + 6] += weight * numbers.rotations[self.leads[i]][:, axis] @ numbers.rotations[i] @ maps[i, 3:6, :6]
            out.append(row)
        rows = np.array(out).reshape(-1, count)
        lengths = np.linalg.norm(rows, axis=1)
        return rows[lengths > 0] / lengths[lengths > 0, None]


def shape_numbers(leaf: Primitive) -> int:
    """How many numbers a leaf does without that has the shape of another: of one that is drawn those of its outline say where it lies."""
    if leaf.outline is None:
        return len(SIZE_NAMES[leaf.kind])
    turned = leaf.kind == "revolve"
    size = leaf.size[0] != FULL_TURN if turned else 1  # an angle, or a height
    placed = 1 if turned else 2  # coordinates of its middle that those of its own outline would say
    return outline_coordinates(leaf.outline, turned).count + size - placed


def find_ties(parts: Sequence[Primitive], numbers: Lowered, member: np.ndarray, twins: Sequence[tuple[int, int]] | None = None) -> Ties:
    """The ties among leaves with such `numbers`, whose directions are those of the frames [k] that they are `member` of, -1 for none."""
    same = SAME * extent_of(numbers)
    twins = [*_find_twins(parts, same)] if twins is None else twins
    frame = np.where(member < 0, 0, member)
    # of balls alone any one leads
    leads = np.array([np.flatnonzero(member == g)[0] if (member == g).any() else 0 for g in frame], int)
    groups: dict[tuple[int, int], list[int]] = {}
    for i, j in twins:
        groups.setdefault((j, int(frame[i])), [j] if frame[i] == frame[j] else []).append(i)
    levels = [
        level for group in groups.values() for level in _levels(group, numbers.centers[group] @ numbers.rotations[leads[group[0]]], same)
    ]
    return Ties(tuple(twins), tuple(levels), leads)


def ties_of(program: Program, parallel_deg: float) -> Ties:
    """The ties among the leaves of a program, of which those within `parallel_deg` are parallel."""
    numbers = lower(program)
    return find_ties([*leaves(program)], numbers, frames(numbers, parallel_deg)[0])


def _find_twins(parts: Sequence[Primitive], same: float) -> Iterator[tuple[int, int]]:
    firsts: list[int] = []
    for i, part in enumerate(parts):
        first = next((j for j in firsts if have_same_shape(part, parts[j], same)), None)
        if first is None:
            firsts.append(i)
        else:
            yield i, first


def have_same_shape(a: Primitive, b: Primitive, same: float) -> bool:
    """Whether the sizes and drawings of two leaves differ by no more than `same`."""
    if a.kind != b.kind or any(abs(s - t) > same for s, t in zip(a.size, b.size, strict=True)):
        return False
    if a.outline is None or b.outline is None:
        return a.outline is b.outline
    mine, its = ([_numbers_of(loop) for loop in leaf.outline.loops] for leaf in (a, b) if leaf.outline)
    if [len(loop) for loop in mine] != [len(loop) for loop in its]:
        return False
    return all(abs(s - t) <= same for one, other in zip(mine, its, strict=True) for s, t in zip(one, other, strict=True))


def _numbers_of(loop: Loop) -> list[float]:
    """Corners and bulges of a loop, or the middle, semi-axes and turn of an ellipse."""
    if isinstance(loop, Ellipse):
        return [loop.rx, loop.ry, loop.x, loop.y, *loop.along]
    return [number for vertex in loop for number in vertex]


def _levels(group: Sequence[int], places: np.ndarray, same: float) -> Iterator[tuple[int, tuple[tuple[int, float], ...]]]:
    """What is nothing among the coordinates `places` [g, 3] of leaves: differences of equal ones, and of steps that are even."""
    for axis in range(3):
        order = np.argsort(places[:, axis], kind="stable")
        values = places[order, axis]
        starts = [0, *(np.flatnonzero(np.diff(values) > same) + 1).tolist(), len(order)]
        for first, last in pairwise(starts):
            for k in range(first + 1, last):
                yield axis, ((group[order[k]], 1.0), (group[order[first]], -1.0))
        if len(starts) > 3 and np.ptp(np.diff(values[starts[:-1]])) <= 3 * same:
            for a, b, c in zip(starts, starts[1:], starts[2:-1], strict=False):
                yield axis, ((group[order[a]], 1.0), (group[order[b]], -2.0), (group[order[c]], 1.0))


def tie_alike(program: Program, near: float, parallel_deg: float) -> Program:
    """The program in which leaves whose shapes differ by no more than `near` have one shape, the mean of them, coordinates of theirs in
    their frame that differ by no more have one value, and steps that do are even; as it is where there are no such leaves."""
    program = map_leaves(program, lambda _, leaf: center_leaf(leaf))
    parts = [*leaves(program)]
    twins = [*_find_twins(parts, near)]
    if not twins:
        return program
    numbers = lower(program)
    numbers = replace(numbers, rotations=align_rotations(numbers, parallel_deg))
    member = frames(numbers, parallel_deg)[0]
    shaped, centers = list(parts), numbers.centers.copy()
    leads = find_ties(parts, numbers, member, twins).leads
    for first in dict.fromkeys(j for _, j in twins):
        group = [first, *(i for i, j in twins if j == first)]
        mean = _mean_shape([parts[i] for i in group])
        for i in group:
            shaped[i] = replace(parts[i], size=mean.size, outline=mean.outline)
        together = [i for i in group if leads[i] == leads[first]]
        frame = numbers.rotations[leads[first]]
        centers[together] = _levelled(centers[together] @ frame, near) @ frame.T
    placed = [replace(p, center=tuple(c.tolist())) for p, c in zip(shaped, centers, strict=True)]
    return map_leaves(program, lambda i, _: placed[i])


def _mean_shape(parts: Sequence[Primitive]) -> Primitive:
    first = parts[0]
    size = tuple(np.mean([p.size for p in parts], axis=0).tolist())
    drawings = [p.outline for p in parts if p.outline is not None]
    if not drawings or any(isinstance(loop, Ellipse) for loop in drawings[0].loops):
        return replace(first, size=size)
    loops = []
    for k in range(len(drawings[0].loops)):
        mean = np.mean([np.array(drawing.loops[k]) for drawing in drawings], axis=0)
        loops.append(tuple(map(tuple, mean.tolist())))
    return replace(first, size=size, outline=Outline(tuple(loops)))


def _levelled(places: np.ndarray, near: float) -> np.ndarray:
    """Places [g, 3] with coordinates within `near` of one another made one, and values whose steps are even to within that made so."""
    out = places.copy()
    for axis in range(3):
        order = np.argsort(places[:, axis], kind="stable")
        breaks = np.flatnonzero(np.diff(places[order, axis]) > near) + 1
        runs = np.split(order, breaks)
        values = np.array([places[run, axis].mean() for run in runs])
        if len(values) > 2:
            even = np.polyval(np.polyfit(np.arange(len(values)), values, 1), np.arange(len(values)))
            values = even if np.abs(even - values).max() <= near else values
        for run, value in zip(runs, values, strict=True):
            out[run, axis] = value
    return out
