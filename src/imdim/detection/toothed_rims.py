"""Rims of many equal teeth, as those of gears, pulleys, splines and knobs: found on a mesh, and taken off it.

A search that counts curves draws such a rim as it can: a hundred flanks are too many for it, and hide what else there is. Equal flanks on
a circle tell where a rim is, and a section has each of its teeth exactly. Teeth that something cuts are no copies of the others, and stay.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from manifold3d import CrossSection, Manifold, OpType

from imdim.detection.faceting import ON_SURFACE
from imdim.detection.facets import Facets
from imdim.detection.flank_rows import LEAST_TEETH, FlankRow, find_flank_rows

MOST_TEETH = 120  # each is a leaf of a program
LEVELS = (0.5, 0.15, 0.85)  # of the flanks' length, where a section may be free of other things
STRAIGHT = 2e-6  # of the diagonal, by which corners are off the line between their neighbours that triangles leave there
ROOTS = 1e-3  # of the diameter, by which roots may be off a circle: where flanks cut its facets they are on chords
BEYOND_FLANKS = 0.5  # of the height of flanks, that round roots and tips reach beyond them
ROOT_BAND = 1 / 3  # of the teeth's height, in which their roots are
WHOLE = 0.02  # pitches that fit on a circle, by which these are no whole number
IN_STEP = 0.02  # of the pitch, by which a tooth may be out of step
ALIKE = 0.02  # of a tooth's area, by which it may differ from the others
MODELS = 12  # teeth that are tried as the one that the others are copies of
BESIDE = 0.25  # of the pitch, by which what is taken off at the tip is wider than a tooth
ABOVE = 0.05  # of the teeth's height, by which it is higher
ARC_DEG = 1.0  # between corners of the root circle under a tooth
ROUND = 1e-3  # of the radius of a circle, by which corners of a round groove may be off it
ROUND_CORNERS = 6  # that a round groove has at least
FEW_ROUND = 30  # round grooves or lobes, that a search finds as such
ROUND_DEG, NEARLY_DEG = 0.5, 0.005  # degrees, to which the angle of the first tooth is rounded, and by how much at most
LOST = 0.05  # of the volume of the teeth, that taking them off and putting them on may change


class ToothedRim(NamedTuple):
    """Teeth on a circle of a `radius` about a `point` [3]; the columns of the `frame` [3, 3] are the directions of the first tooth, that
    across it, and the axis. They begin and end at the levels `low` and `high` along the axis from the point. A `tooth` [c, 2] is a loop
    about that point from one root to the other, with its middle on the first direction; of the `count` places of the circle those at the
    numbers `places` have one. `outward` is whether the teeth point away from the axis."""

    point: np.ndarray
    frame: np.ndarray
    radius: float
    low: float
    high: float
    tooth: np.ndarray
    count: int
    places: tuple[int, ...]
    outward: bool

    @property
    def tip(self) -> float:
        """How far teeth reach from the axis, or come near to it."""
        away = np.linalg.norm(self.tooth, axis=1)
        return float(away.max() if self.outward else away.min())


def find_toothed_rims(facets: Facets, solid: Manifold) -> list[ToothedRim]:
    """The toothed rims of a `solid` whose mesh has these facets. Few round grooves or lobes are left: a search finds them as what they
    are."""
    rows = [row for row in find_flank_rows(facets) if row.radius]
    return [rim for row in rows if (rim := _read_rim(row, facets, solid)) is not None]


def take_off_teeth(solid: Manifold, rim: ToothedRim) -> Manifold | None:
    """The solid without the teeth of a rim; None where these, put on again, would not make the same."""
    plain = solid - place_loop(rim, _draw_around(rim))
    again = plain + place_loop(rim, rim.tooth)
    teeth = (solid - plain).volume()
    changed = (again - solid).volume() + (solid - again).volume()
    return plain if teeth > 0 and changed <= LOST * teeth else None


def place_loop(rim: ToothedRim, loop: np.ndarray) -> Manifold:
    """What a loop [c, 2] about the axis is, extruded along the teeth, at the place of each."""
    section = CrossSection([loop])
    every = CrossSection.batch_boolean([section.rotate(360.0 * k / rim.count) for k in rim.places], OpType.Add)
    solid = every.extrude(rim.high - rim.low).translate((0.0, 0.0, rim.low))
    return solid.transform(np.column_stack([rim.frame, rim.point]))


def _draw_around(rim: ToothedRim) -> np.ndarray:
    """A loop [c, 2] that has all of a tooth and nothing but air beside it: on the root circle it is as wide as the tooth, and wider at the
    tip, so that no walls of both lie in one."""
    first, last = (math.atan2(*rim.tooth[end, ::-1]) for end in (0, -1))
    pitch, turn = 2 * math.pi / rim.count, last - first
    steps = max(2, math.ceil(math.degrees(abs(turn)) / ARC_DEG) + 1)
    side = math.copysign(min(BESIDE * pitch, (pitch - abs(turn)) / 2), turn)
    around = np.linspace(last, first, steps)
    root = rim.radius * np.column_stack([np.cos(around), np.sin(around)])
    root[[0, -1]] = rim.tooth[[-1, 0]]
    beyond = rim.tip + ABOVE * (rim.tip - rim.radius)
    top = np.linspace(first - side, last + side, steps)
    # corners of a polygon about a circle that its sides do not cut
    reach = beyond / (math.cos((top[1] - top[0]) / 2) if rim.outward else 1.0)
    return np.concatenate([root, reach * np.column_stack([np.cos(top), np.sin(top)])])


def _read_rim(row: FlankRow, facets: Facets, solid: Manifold) -> ToothedRim | None:
    """The rim whose flanks a row has; None where its teeth are not alike, or there are too many or too few."""
    count = round(2 * math.pi / row.pitch)
    if not LEAST_TEETH <= count <= MOST_TEETH or abs(2 * math.pi / row.pitch - count) > WHOLE:
        return None
    frame, flanks = _round_frame(row.frame), facets.corners[facets.triangles(row.facets)].reshape(-1, 3)
    along = (flanks - row.point) @ frame[:, 2]
    low, high = float(along.min()), float(along.max())
    near = ON_SURFACE * facets.diagonal
    if np.mean((along < low + near) | (along > high - near)) < 1 - ALIKE:
        return None  # two rims, or slanted ends
    away = np.linalg.norm((flanks - row.point) @ frame[:, :2], axis=1)
    nearest, farthest, beyond = float(away.min()), float(away.max()), BEYOND_FLANKS * float(np.ptp(away))
    local = solid.transform(np.column_stack([frame.T, -frame.T @ row.point]))
    for level in LEVELS:
        loops = local.slice(low + level * (high - low)).to_polygons()
        if loops and (found := _read_loops(loops, (nearest - beyond, farthest + beyond), count, facets.diagonal)) is not None:
            radius, tooth, angle, places, outward = found
            rounded = math.radians(round(math.degrees(angle) / ROUND_DEG) * ROUND_DEG)
            angle = rounded if abs(rounded - angle) < math.radians(NEARLY_DEG) else angle
            c, s = math.cos(angle), math.sin(angle)
            turned = frame @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            return ToothedRim(row.point, turned, radius, low, high, tooth, count, places, outward)
    return None


def _round_frame(frame: np.ndarray) -> np.ndarray:
    """A frame whose last column is an axis of the world where it all but is one."""
    axis = np.round(frame[:, 2])
    if np.abs(frame[:, 2] - axis).max() > ON_SURFACE:
        return frame
    first = np.eye(3)[(int(np.abs(axis).argmax()) + 1) % 3]
    return np.column_stack([first, np.cross(axis, first), axis])


class _Read(NamedTuple):
    radius: float
    tooth: np.ndarray
    angle: float
    places: tuple[int, ...]
    outward: bool


def _read_loops(loops: list[np.ndarray], between: tuple[float, float], count: int, diagonal: float) -> _Read | None:
    """What the loop tells that has the most corners whose distances from the axis are `between` those of teeth."""
    clean = [_without_straight(loop, STRAIGHT * diagonal) for loop in loops]
    near = [np.abs(np.linalg.norm(loop, axis=1) - sum(between) / 2) < (between[1] - between[0]) / 2 for loop in clean]
    most = max(range(len(clean)), key=lambda i: int(near[i].sum()))
    ring, close = clean[most], near[most]
    if close.sum() < 2 * LEAST_TEETH:
        return None
    outward = _area(ring) > 0
    low, high = _heights(ring[close], count)
    root = low if outward else high
    away = np.linalg.norm(ring, axis=1)
    band = close & (np.abs(away - root) < ROOT_BAND * (high - low))
    slack = ROOTS * 2 * high
    if not band.any():
        return None
    spread = float(np.ptp(away[band]))
    radius = float(away[band].max() if outward else away[band].min()) if spread <= slack else root
    is_root = close & (np.abs(away - radius) <= slack)
    return _gather(list(_split(ring, is_root)), radius, count, outward)


def _heights(corners: np.ndarray, count: int) -> tuple[float, float]:
    """The radii of roots and tips, the median of the least and largest in as many sectors as there are teeth: a notch has others."""
    away = np.linalg.norm(corners, axis=1)
    sector = np.floor((np.arctan2(corners[:, 1], corners[:, 0]) / (2 * math.pi) % 1.0) * count).astype(int)
    order = np.argsort(sector, kind="stable")
    firsts = np.flatnonzero(np.diff(sector[order], prepend=-1))
    return float(np.median(np.minimum.reduceat(away[order], firsts))), float(np.median(np.maximum.reduceat(away[order], firsts)))


def _split(ring: np.ndarray, is_root: np.ndarray) -> Iterator[np.ndarray]:
    """What lies between roots of a loop that follow each other, with these [c, 2]."""
    at = np.flatnonzero(is_root)
    for first, last in pairwise([*at, at[0] + len(ring)] if len(at) else []):
        if last > first + 1:
            yield ring[np.arange(first, last + 1) % len(ring)]


def _gather(runs: list[np.ndarray], radius: float, count: int, outward: bool) -> _Read | None:
    """The teeth among what lies between roots: the most that are copies of one, in step; None where they are few, or round and few."""
    pitch = 2 * math.pi / count
    ends = [np.arctan2(run[[0, -1], 1], run[[0, -1], 0]) for run in runs]
    turns = [math.remainder(b - a, 2 * math.pi) for a, b in ends]
    kept = [k for k, turn in enumerate(turns) if abs(turn) < pitch * (1 + IN_STEP)]
    angles = {k: float(ends[k][0] + turns[k] / 2) for k in kept}
    upright = {k: _turn(runs[k], -angles[k]) for k in kept}
    sections = {k: CrossSection([loop]) for k, loop in upright.items()}
    areas = {k: section.area() for k, section in sections.items()}

    def copies(i: int) -> list[int]:
        near = [
            k
            for k in kept
            if abs(math.remainder(angles[k] - angles[i], pitch)) < IN_STEP * pitch and abs(areas[k] - areas[i]) < ALIKE * areas[i]
        ]
        return [k for k in near if (sections[k] ^ sections[i]).area() > (1 - ALIKE) * areas[i]]

    model, same = max(((i, copies(i)) for i in kept[:: max(1, len(kept) // MODELS)]), key=lambda found: len(found[1]), default=(0, []))
    if len(same) < LEAST_TEETH:
        return None
    groove = np.concatenate([_beyond_tip(runs[model], outward), _beyond_tip(runs[(model + 1) % len(runs)][::-1], outward)[::-1]])
    if count <= FEW_ROUND and any(_is_round(corners, ROUND * radius) for corners in (upright[model][1:-1], groove)):
        return None
    first = min(same, key=lambda k: (round(abs(angles[k]), 6), angles[k]))
    places = sorted({round((angles[k] - angles[first]) / pitch) % count for k in same})
    return _Read(radius, upright[first], angles[first], tuple(places), outward)


def _turn(points: np.ndarray, angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    return points @ np.array([[c, s], [-s, c]])


def _beyond_tip(run: np.ndarray, outward: bool) -> np.ndarray:
    """The corners [k, 2] of a tooth from the last one at its tip."""
    away = np.linalg.norm(run, axis=1) * (1 if outward else -1)
    return run[np.flatnonzero(away >= away.max() - ROOTS * np.ptp(away))[-1] :]


def _is_round(corners: np.ndarray, slack: float) -> bool:
    """Whether corners [k, 2] are many and lie on one circle."""
    if len(corners) < ROUND_CORNERS:
        return False
    matrix = np.column_stack([2 * corners, np.ones(len(corners))])
    x, y, rest = np.linalg.lstsq(matrix, (corners**2).sum(1), rcond=None)[0]
    return bool(np.abs(np.linalg.norm(corners - [x, y], axis=1) - math.sqrt(max(rest + x * x + y * y, 0.0))).max() < slack)


def _area(ring: np.ndarray) -> float:
    x, y = ring.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def _without_straight(ring: np.ndarray, slack: float) -> np.ndarray:
    """The loop without the corners that are within `slack` of the line between those beside them."""
    before, after = np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0)
    along = after - before
    length = np.maximum(np.linalg.norm(along, axis=1), 1e-300)
    off = np.abs(along[:, 0] * (ring - before)[:, 1] - along[:, 1] * (ring - before)[:, 0]) / length
    straight = off <= slack
    return ring[~straight] if (~straight).sum() > 2 else ring
