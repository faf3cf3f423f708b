"""How well a noisy cloud knows each named dimension: what it measured, and the 95 % interval.

The names are the coordinates that a delivered program has left: sizes, places and vertices that are sums of names alone tell what a name
is worth where the likeliest numbers are, and how exactly. Numbers that a constant makes up for are free beside them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.delivery.finish import FinishedProgram
from imdim.export.drawn_vertex import BendRadius, Center, DrawnEllipse, DrawnPolygon, DrawnRing, Reach
from imdim.export.numbers import Expression, plain
from imdim.geometry.sampling import subsample
from imdim.numbers.design_values import is_designed
from imdim.numbers.information import Coordinates
from imdim.numbers.measured import measure
from imdim.numbers.measured_leaves import MeasuredLeaves
from imdim.program.edges import EdgeFeature
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Curve, Outline, arc_center, arc_radius, loop_curves
from imdim.program.tree import leaves
from imdim.reconstruction.edge_features import MeasuredSizes
from imdim.relations.residuals import rows_of
from imdim.target.target import Target, sample_surface

POINTS = 8192  # of a target, that tell
SAME = 1e-9  # of the largest number, within which two are one
PROBE = 1e-6  # of the part, by which an outline's coordinates are moved to see what follows
DETERMINED = 1e-6  # share of a name that may follow from numbers that are no sums of names
DIGITS = 2  # significant digits of an interval


@dataclass(frozen=True)
class StatedInterval:
    """A name's `value` in the program, what the points measured, and half of the 95 % interval about that, all in the name's unit.

    `snapped` is whether the value is a number that the interval holds, and too round to be there by chance.
    """

    value: float
    measured: float
    half: float
    snapped: bool

    def __str__(self) -> str:
        decimals = DIGITS - 1 - math.floor(math.log10(self.half)) if self.half > 0 else DIGITS
        measured, half = (plain(round(v, decimals)) for v in (self.measured, self.half))
        return f"{plain(self.value)} (measured {measured} +- {half})" if self.snapped else f"{measured} +- {half}"


@dataclass(frozen=True)
class _ReadNumber:
    """A number of the program that a name may be read from: its `value` and its derivatives `slope` [p] by the coordinates."""

    value: float
    slope: np.ndarray


@dataclass(frozen=True)
class NameReadings:
    """How the names of a program are read from its numbers.

    `slopes` [n, p] are the derivatives of each name by the coordinates of `start`, `determined` [n] whether sums of names alone tell it,
    and `bound` [m, p] the combinations of coordinates that names and relations hold together.
    """

    start: Coordinates
    slopes: np.ndarray
    determined: np.ndarray
    bound: np.ndarray

    @staticmethod
    def of(found: FinishedProgram) -> NameReadings | None:
        """None where no number of the program is a sum of names alone."""
        names, start = list(found.parameters.values), Coordinates.of(found.program)
        length = max(map(abs, found.parameters.values.values()), default=0.0)
        rows = list(_rows(found, start, names, SAME * length))
        if not rows:
            return None
        sums, slopes = (np.array(column) for column in zip(*rows, strict=True))
        left, values, right = np.linalg.svd(sums)
        rank = int((values > SAME * values[0]).sum())
        held = start.spread(rows_of(found.constraints, start.numbers).jacobian)
        # combinations of numbers that no change of names would change
        bound = np.concatenate([held, _fixed_turns(found, start), left[:, rank:].T @ slopes])
        by_name = (right[:rank].T / values[:rank]) @ left[:, :rank].T @ slopes
        return NameReadings(start, by_name, np.linalg.norm(right[rank:], axis=0) < DETERMINED, bound)


def state_intervals(found: FinishedProgram, target: Target, deadline: Deadline = NEVER) -> dict[str, StatedInterval]:
    """The interval of each name of `found` that the points of `target` show; none of what a reader would have to add up.

    Past the `deadline` (by default never) the points are asked once and not until the numbers settle.
    """
    readings = NameReadings.of(found)
    if readings is None:
        return {}
    known = measure(found.program, _points(target), readings.bound, deadline)
    half = np.where(readings.determined, known.half_widths(readings.slopes), np.inf)
    values = found.parameters.values
    measured = np.array(list(values.values())) + readings.slopes @ known.shift
    common = MeasuredLeaves.of(known).common
    numbers = zip(values.items(), measured.tolist(), half.tolist(), strict=True)
    return {n: StatedInterval(v, m, h, is_designed(v, m, h, common)) for (n, v), m, h in numbers if np.isfinite(h)}


def state_edge_intervals(edges: Sequence[EdgeFeature], measured: Sequence[MeasuredSizes]) -> dict[str, StatedInterval]:
    """The interval of each size of edge features, of which a cloud `measured` the sizes."""
    sizes = [
        (name, value, size, known.half)
        for feature, known in zip(edges, measured, strict=True)
        for name, value, size in zip(feature.size_names, feature.sizes, known.sizes, strict=True)
    ]
    return {name: StatedInterval(value, size, half, is_designed(value, size, half, half)) for name, value, size, half in sizes}


def with_remarks(text: str, intervals: Mapping[str, StatedInterval]) -> str:
    """The OpenSCAD text of a program with a comment above each name that was snapped: what was measured. It stays true when the value is
    changed."""
    for name, interval in intervals.items():
        if interval.snapped:
            text = re.sub(rf"^(?={re.escape(name)} = )", lambda _, i=interval: f"// {i}\n", text, count=1, flags=re.MULTILINE)
    return text


def _points(target: Target) -> np.ndarray:
    if target.mesh is None:
        return subsample(target.points, POINTS)
    mesh = target.mesh
    return sample_surface(np.asarray(mesh.vertices), np.asarray(mesh.faces), POINTS, np.random.default_rng(0))[0]


def _rows(found: FinishedProgram, start: Coordinates, names: Sequence[str], zero: float) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Each number that is a sum of names alone: the factors of these [names], and its derivatives [p]."""
    place = {name: i for i, name in enumerate(names)}
    for expression, readings in _readings(found, start):
        if not expression.terms or abs(expression.constant) > zero or any(t.name not in place for t in expression.terms):
            continue
        total = sum(float(t.coefficient) * found.parameters.values[t.name] for t in expression.terms)
        reading = next((r for r in readings if abs(r.value - total) <= 10 * zero), None)
        if reading is not None:
            row = np.zeros(len(names))
            for term in expression.terms:
                row[place[term.name]] += float(term.coefficient)
            yield row, reading.slope


def _readings(found: FinishedProgram, start: Coordinates) -> Iterator[tuple[Expression, list[_ReadNumber]]]:
    """The expressions of sizes, places and outlines beside the numbers that they may stand for."""
    named, drawn = found.parameters, {leaf: (own, first) for leaf, own, first in start.outlines}
    for i, part in enumerate(leaves(found.program)):
        for column, expression in enumerate(named.sizes[i]):
            yield expression, [_ReadNumber(part.size[column], _unit(start.count, 9 * i + column))]
        for axis, expression in enumerate(named.centers[i]):
            slope = np.zeros(start.count)
            slope[9 * i + 3 : 9 * i + 6] = start.numbers.rotations[i][axis]
            yield expression, [_ReadNumber(part.center[axis], slope)]
        if i in drawn and named.outlines and len(named.outlines[i]) == len(drawn[i][0].outline.loops):
            loops = _outline_readings(start, i)
            for ring, loop in zip(named.outlines[i], loops, strict=True):
                yield from _of_ring(ring, loop)


def _fixed_turns(found: FinishedProgram, start: Coordinates) -> np.ndarray:
    """The derivatives [m, p] of what arcs turn by that keep it whatever the names are: they touch the lines beside them."""
    drawn = [(i, rings) for i, rings in enumerate(found.parameters.outlines) if rings]
    out = [
        curve["bulge"].slope
        for i, rings in drawn
        for ring, loop in zip(rings, _outline_readings(start, i), strict=True)
        if isinstance(ring, tuple) and len(ring) == len(loop)
        for vertex, curve in zip(ring, loop, strict=True)
        if isinstance(vertex.bulge, int | float) and "bulge" in curve
    ]
    return np.array(out).reshape(-1, start.count)


def _unit(count: int, at: int) -> np.ndarray:
    out = np.zeros(count)
    out[at] = 1.0
    return out


_Loop = Sequence[Mapping[str, _ReadNumber]]  # of each curve of a loop: where it begins, and an arc's centre and radius


def _of_ring(ring: DrawnRing[Expression], loop: _Loop) -> Iterator[tuple[Expression, list[_ReadNumber]]]:
    """The expressions of a loop beside the numbers that they may stand for, the likeliest first: a corner that an arc rounds is none of its
    vertices, but lies on the lines through those."""
    if isinstance(ring, DrawnPolygon | DrawnEllipse):
        whole = loop[0]
        pairs = (("x", ring.x), ("y", ring.y))
        sizes = (
            (("flats" if ring.is_across_flats else "whole", ring.size),)
            if isinstance(ring, DrawnPolygon)
            else (("rx", ring.rx), ("ry", ring.ry))
        )
        if isinstance(ring, DrawnPolygon):
            pairs = (("whole_x", ring.x), ("whole_y", ring.y))
        yield from ((e, [whole[word]]) for word, e in (*pairs, *sizes) if word in whole)
        return
    for i, v in enumerate(ring if len(ring) == len(loop) else ()):
        beside = [loop[i], loop[(i + 1) % len(loop)], loop[i - 1]]
        reach = v.reach.axis if isinstance(v.reach, Reach) else None
        for axis, (word, expression) in enumerate((("x", v.x), ("y", v.y))):
            if axis != reach:
                yield expression, [c[w] for w in (word, f"center_{word}") for c in beside if w in c]
        if isinstance(v.bulge, Center):
            yield from ((e, [loop[i][w]]) for w, e in (("center_x", v.bulge.x), ("center_y", v.bulge.y)) if w in loop[i])
        if isinstance(v.bulge, BendRadius):
            yield v.bulge.radius, [c["r"] for c in beside if "r" in c]


def _outline_readings(start: Coordinates, leaf: int) -> list[_Loop]:
    """The numbers of each loop of a leaf's outline, with their derivatives by differences."""
    own, first = next((own, first) for i, own, first in start.outlines if i == leaf)
    step = PROBE * max(abs(v) for corner in own.outline.bounds for v in corner)
    at, slopes = _numbers(own.outline), [[{word: np.zeros(start.count) for word in c} for c in loop] for loop in _numbers(own.outline)]
    for column in range(own.count):
        move = step * _unit(own.count, column)
        for into, ahead, behind in zip(slopes, _numbers(own.move(move)), _numbers(own.move(-move)), strict=True):
            for slope, a, b in zip(into, ahead, behind, strict=True):
                for word, of in slope.items():
                    of[first + column] = (a[word] - b[word]) / (2 * step)
    pairs = [list(zip(loop, into, strict=True)) for loop, into in zip(at, slopes, strict=True)]
    return [[{word: _ReadNumber(value, slope[word]) for word, value in c.items()} for c, slope in loop] for loop in pairs]


def _numbers(outline: Outline) -> list[list[dict[str, float]]]:
    """What is measured of each curve of each loop; of the first one also the middle and the size of all."""
    out = []
    for loop in outline.loops:
        curves = [_numbers_of(curve) for curve in loop_curves(loop)]
        if not isinstance(loop, Ellipse):
            x, y = (float(np.mean([c[axis] for c in curves])) for axis in "xy")
            size = float(np.mean([math.hypot(c["x"] - x, c["y"] - y) for c in curves]))
            flats = 2 * size * math.cos(math.pi / len(curves))  # of a regular polygon
            curves[0] |= {"whole_x": x, "whole_y": y, "whole": size, "flats": flats}
        out.append(curves)
    return out


def _numbers_of(curve: Curve | Ellipse) -> dict[str, float]:
    if isinstance(curve, Ellipse):
        return {"x": curve.x, "y": curve.y, "rx": curve.rx, "ry": curve.ry}
    out = {"x": curve[0], "y": curve[1]}
    if curve[4]:
        out["center_x"], out["center_y"] = arc_center(curve)
        out["r"], out["bulge"] = arc_radius(curve), curve[4]
    return out
