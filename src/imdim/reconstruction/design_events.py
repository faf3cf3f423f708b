"""What occurs in a program as a designer would count it: kinds of features, what is seen of their faces, and the numbers that say where.

The same events are counted in a corpus of designs (`scripts/corpus/count_prices.py`) and in the program whose description length is asked
for (`description`), so that what is rare in the one is dear in the other. Copies of a row, grid, circle or mirror image are read once.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from imdim.geometry import kernels
from imdim.geometry.lowering import lower
from imdim.geometry.sampling import even_surface
from imdim.program.ellipse import Ellipse
from imdim.program.patterns.weigh import take_first_copies
from imdim.program.regular_polygon import regular_of
from imdim.program.roles import signs
from imdim.program.tree import KINDS, Primitive, Program, leaves
from imdim.reconstruction.plain_program import AXES_OF, ONE_NUMBER, ONE_WAY, OUTSIDE, face_levels, place_numbers

Event = tuple[str, str]  # a group, of whose events one occurs at each place, and which

SIGN = {1: "add", -1: "cut"}
ON_A_LEAF = 240  # points
SKIN = 2e-4  # of the part's size, on either side of a face
SEEN = {"seen": 0.75, "partly": 0.25, "little": 0.02}  # the share of a face that is seen at least
UPRIGHT = 0.9999  # cosine, from which a face of a round or drawn feature is one of its flat ends
GRIDS = {"whole": 1.0, "half": 0.5, "tenth": 0.1, "fine": 0.05}  # millimetres of which numbers are multiples
ON_GRID = 2e-3  # millimetres
DIGITS = 1e4  # numbers that a part's size is told apart in by what is on no grid
ANGLE = 8.0  # bits of an angle in whole degrees, of either sense
COPIES = 8.0  # bits of a count to eight and of a step in thirty-two

NUMBERS = ("outside", "zero", "again", *GRIDS, "odd")
FACES = (*SEEN, "inside", "air")
GROUPS: Mapping[str, tuple[str, ...]] = {
    "feature": tuple(f"{sign} {kind}" for sign in SIGN.values() for kind in KINDS),
    "copies": ("once", "more"),
    "direction": ("known", "turned"),
    "curve": ("line", "arc", "ellipse", "polygon", "end"),
    "loops": ("more", "end"),
    **dict.fromkeys(("level add", "level cut", "place", "radius", "vertex"), NUMBERS),
    **dict.fromkeys((f"{sign} {face}" for sign in SIGN.values() for face in ("flat", "side")), FACES),
}


@dataclass(frozen=True)
class PartBox:
    """The box from `low` [3] to `high` [3] that a part fills, in units of so many millimetres."""

    low: np.ndarray
    high: np.ndarray
    unit: float = 1.0

    @property
    def size(self) -> float:
        return float(np.linalg.norm(self.high - self.low))


@dataclass
class Reading:
    """What was read so far: how often each event occurred, and the bits that say which of several numbers each is."""

    events: Counter[Event] = field(default_factory=Counter)
    bits: float = 0.0

    def add(self, group: str, event: str, count: int = 1) -> None:
        self.events[group, event] += count


@dataclass(frozen=True)
class ReadFeature:
    """A leaf of those that are written, what occurs in it, and what of its outline: curves and vertices."""

    leaf: Primitive
    own: Reading
    drawn: Reading


def read_events(program: Program, part: PartBox) -> Reading:
    """What occurs in the program of a part."""
    features, ways = read_features(program, part)
    total = Reading(bits=COPIES * ways)
    total.add("copies", "more", ways)
    for reading in (reading for feature in features for reading in (feature.own, feature.drawn)):
        total.events.update(reading.events)
        total.bits += reading.bits
    return total


def read_features(program: Program, part: PartBox) -> tuple[list[ReadFeature], int]:
    """What occurs in each leaf of the program of a part, the first of all copies alone, and in how many ways copies go on."""
    first, ways = take_first_copies(program)
    placed, known, numbers, features = lower(first), list(np.eye(3)), _NumberReader(part), list[ReadFeature]()
    for i, (leaf, sign) in enumerate(zip(leaves(first), signs(first), strict=True)):
        feature, does = ReadFeature(leaf, Reading(), Reading()), SIGN[sign]
        feature.own.add("feature", f"{does} {leaf.kind}")
        feature.own.add("copies", "once")
        _read_faces(leaf, does, program, part, feature.own)
        _read_directions(leaf, placed.rotations[i], known, feature.own)
        _read_curves(leaf, feature.drawn)
        numbers.read(feature, does, placed.rotations[i], placed.centers[i])
        features.append(feature)
    return features, ways


def _read_faces(leaf: Primitive, does: str, program: Program, part: PartBox, reading: Reading) -> None:
    """How much of each face of a leaf is seen, and where the rest is: in material, or in the air. By how much a cutter sticks out of the
    part is how it is built, and does not count."""
    skin = SKIN * part.size
    points, normals = even_surface(leaf, ON_A_LEAF)
    outer, inner = (kernels.inside(program, points + side * skin * normals) for side in (1, -1))
    within = ((points > part.low - skin) & (points < part.high + skin)).all(axis=1)
    faces = _face_numbers(leaf, normals @ lower(leaf).rotations[0])
    for face in np.unique(faces):
        on = faces == face
        on = on & within if (on & within).any() else on
        share = float((outer != inner)[on].mean())
        hidden = "inside" if (outer & inner)[on].mean() > 0.5 else "air"
        flat = "flat" if leaf.kind == "box" or face < 2 else "side"
        reading.add(f"{does} {flat}", next((name for name, least in SEEN.items() if share >= least), hidden))


def _face_numbers(leaf: Primitive, normals: np.ndarray) -> np.ndarray:
    """For each normal [n, 3] in a leaf's frame the number of the face: six of a box, else two flat ends and 2 for all that is round or
    drawn."""
    if leaf.kind == "box":
        axis = np.abs(normals).argmax(axis=1)
        return 2 * axis + (normals[np.arange(len(normals)), axis] > 0)
    if leaf.kind not in ("cylinder", "cone", "extrude"):
        return np.full(len(normals), 2)
    return np.where(normals[:, 2] > UPRIGHT, 1, np.where(normals[:, 2] < -UPRIGHT, 0, 2))


def _read_curves(leaf: Primitive, reading: Reading) -> None:
    if leaf.outline is None:
        return
    for loop in leaf.outline.loops:
        if isinstance(loop, Ellipse):
            reading.add("curve", "ellipse")
        elif regular_of(loop, ONE_NUMBER * max(abs(v) for vertex in loop for v in vertex[:2])):
            reading.add("curve", "polygon")
        else:
            for vertex in loop:
                reading.add("curve", "arc" if vertex[2] else "line")
            reading.add("curve", "end")
    reading.add("loops", "more", len(leaf.outline.loops) - 1)
    reading.add("loops", "end")


def _read_directions(leaf: Primitive, turn: np.ndarray, known: list[np.ndarray], reading: Reading) -> None:
    """Whether the axes of a leaf run along those of the part or of leaves before it, which are `known`, as they are from then on."""
    for axis in (turn[:, k] for k in AXES_OF.get(leaf.kind, (2,))):
        if any(abs(float(axis @ other)) >= 1 - ONE_WAY for other in known):
            reading.add("direction", "known")
        else:
            known.append(axis)
            reading.add("direction", "turned")
            reading.bits += ANGLE


class _NumberReader:
    """Reads numbers leaf by leaf, from the middle of the part and whatever their sign, and knows those that came before."""

    def __init__(self, part: PartBox) -> None:
        self.part = part
        self.middle, self.half = (part.low + part.high) / 2, (part.high - part.low) / 2
        self.known: dict[object, list[float]] = {}

    def read(self, feature: ReadFeature, does: str, turn: np.ndarray, center: np.ndarray) -> None:
        """All numbers of a leaf that adds or cuts, as it is placed."""
        # a cutter that ends level with the part is made longer when it is delivered
        beyond = -ONE_NUMBER if does == "cut" else OUTSIDE
        at, reach = turn.T @ (center - self.middle), np.abs(turn.T) @ self.half + beyond * self.part.size
        own: list[float] = []
        for slot, axis, value in _slots(feature.leaf, at):
            # levels and places along one direction are told by each other, and so are all radii; an outline's by its own
            line = slot if axis is None else tuple(np.round(np.abs(turn[:, axis]), 3))
            known = own if slot == "vertex" else self.known.setdefault(line, [])
            limit = reach[axis] if slot == "level" and axis is not None else self.part.size / 2 if slot == "radius" else math.inf
            reading = feature.drawn if slot == "vertex" else feature.own
            self._read_number(reading, f"level {does}" if slot == "level" else slot, known, (abs(value), limit))

    def _read_number(self, reading: Reading, group: str, known: list[float], limited: tuple[float, float]) -> None:
        (value, limit), near = limited, ONE_NUMBER * self.part.size
        if value >= limit:
            reading.add(group, "outside")
        elif value < near:
            reading.add(group, "zero")
        elif any(abs(value - other) < near for other in known):
            reading.add(group, "again")
            reading.bits += math.log2(len(known))
        else:
            known.append(value)
            name, count = _grid_of(value * self.part.unit, self.part.size * self.part.unit)
            reading.add(group, name)
            reading.bits += math.log2(max(count, 2.0))


def _grid_of(value: float, size: float) -> tuple[str, float]:
    """The coarsest grid that twice a number is on, as sizes and places from an end are, and how many numbers of it a part's size holds; all
    in millimetres."""
    for name, step in GRIDS.items():
        if abs(math.remainder(2 * value, step)) < ON_GRID:
            return name, size / step
    return "odd", DIGITS


def _slots(leaf: Primitive, at: np.ndarray) -> Iterator[tuple[str, int | None, float]]:
    """The numbers of a leaf at `at` [3] in its own frame: what each is, along which of its axes if along one, and its value."""
    yield from (("level", axis, value) for axis, value in face_levels(leaf, at))
    if leaf.outline is not None:
        yield from (("vertex", None, value) for value in place_numbers(leaf, at))
    elif leaf.kind != "box":
        round_about_z = leaf.kind in ("cylinder", "cone")
        yield from (("place", axis, float(at[axis])) for axis in range(2 if round_about_z else 3))
        yield from (("radius", None, value) for value in (leaf.size[:-1] if round_about_z else leaf.size))
