"""Which metric screw a hole is for, where its numbers bear that out; lengths in mm.

A diameter alone says something where a standard has it and nobody would choose it for another reason: 3.4 is the clearance hole of M3, 10
is a round number. A round one is believed where the counterbore, the countersink or the pocket beside it fits the same screw. Blind holes
are for threads, and are compared with tap drills alone.

The tables are those of ISO 273 (clearance holes), ISO 4762 (socket head cap screws), ISO 10642 (countersunk ones), ISO 4032 (nuts),
ISO 2306 (tap drills, coarse threads) and ISO 261 (pitches of threads), as makers of fasteners print them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from imdim.program.holes import Hole

CLEARANCE: Mapping[str, tuple[float, float, float]] = {  # ISO 273: fine, medium and coarse series
    "M1.6": (1.7, 1.8, 2.0),
    "M2": (2.2, 2.4, 2.6),
    "M2.5": (2.7, 2.9, 3.1),
    "M3": (3.2, 3.4, 3.6),
    "M4": (4.3, 4.5, 4.8),
    "M5": (5.3, 5.5, 5.8),
    "M6": (6.4, 6.6, 7.0),
    "M8": (8.4, 9.0, 10.0),
    "M10": (10.5, 11.0, 12.0),
    "M12": (13.0, 13.5, 14.5),
    "M16": (17.0, 17.5, 18.5),
    "M20": (21.0, 22.0, 24.0),
}
CAP_HEAD: Mapping[str, float] = dict(  # ISO 4762: diameter of the head
    zip(CLEARANCE, (3.0, 3.8, 4.5, 5.5, 7.0, 8.5, 10.0, 13.0, 16.0, 18.0, 24.0, 30.0), strict=True)
)
SUNK_HEAD: Mapping[str, float] = {  # ISO 10642: theoretical diameter of the head, 90 degrees
    "M3": 6.72,
    "M4": 8.96,
    "M5": 11.2,
    "M6": 13.44,
    "M8": 17.92,
    "M10": 22.4,
    "M12": 26.88,
    "M16": 33.6,
    "M20": 40.32,
}
NUT: Mapping[str, float] = dict(  # ISO 4032: width across flats
    zip(CLEARANCE, (3.2, 4.0, 5.0, 5.5, 7.0, 8.0, 10.0, 13.0, 16.0, 18.0, 24.0, 30.0), strict=True)
)
TAP_DRILL: Mapping[str, float] = dict(  # ISO 2306
    zip(CLEARANCE, (1.25, 1.6, 2.05, 2.5, 3.3, 4.2, 5.0, 6.8, 8.5, 10.2, 14.0, 17.5), strict=True)
)
PITCHES: Mapping[str, tuple[float, ...]] = {  # ISO 261: coarse, and fine ones in use
    "M1.6": (0.35, 0.2),
    "M2": (0.4, 0.25),
    "M2.5": (0.45, 0.35),
    "M3": (0.5, 0.35),
    "M4": (0.7, 0.5),
    "M5": (0.8, 0.5),
    "M6": (1.0, 0.75),
    "M8": (1.25, 1.0, 0.75),
    "M10": (1.5, 1.25, 1.0, 0.75),
    "M12": (1.75, 1.5, 1.25, 1.0),
    "M14": (2.0, 1.5),
    "M16": (2.0, 1.5, 1.0),
    "M18": (2.5, 2.0, 1.5),
    "M20": (2.5, 2.0, 1.5, 1.0),
    "M22": (2.5, 2.0, 1.5),
    "M24": (3.0, 2.0, 1.5),
    "M27": (3.0, 2.0),
    "M30": (3.5, 2.0, 1.5),
    "M36": (4.0, 3.0, 2.0),
    "M42": (4.5, 3.0),
    "M48": (5.0, 3.0),
    "M56": (5.5, 4.0),
    "M64": (6.0, 4.0),
}

SAME = 0.02  # mm, within which a diameter is that of a table
ROUND = 1.0  # mm, whose multiples are chosen for no screw
HEAD_ROOM = (1.0, 1.35)  # times a head's diameter, between which a counterbore takes it (DIN 974: up to 1.17)
SUNK_ROOM = (0.8, 1.15)
NUT_ROOM = (0.995, 1.06)
SUNK_DEG = (87.0, 93.0)
SAME_PITCH = 0.01  # relative
BOLT_ALLOWANCE, NUT_ALLOWANCE = (0.965, 1.005), (0.995, 1.04)  # of the major diameter: bolts are drawn thinner, nuts wider (ISO 965-1)


class Screw(NamedTuple):
    """`size` as "M3"; `use` is "clearance" or "tap drill"."""

    size: str
    use: str


def metric_thread(major: float, pitch: float, internal: bool) -> str | None:
    """The size of a thread of this major diameter, as "M8 x 1.25"; None where it is no metric one."""
    allowance = NUT_ALLOWANCE if internal else BOLT_ALLOWANCE
    for size, pitches in PITCHES.items():
        found = next((p for p in pitches if abs(p - pitch) <= SAME_PITCH * p), None)
        if found and _is_within(major / float(size[1:]), allowance):
            return f"{size} x {found:g}"
    return None


def screw_of(hole: Hole) -> Screw | None:
    """The screw that a hole is for; None where its numbers do not say."""
    bore = hole.bore
    if bore.corners or bore.is_cone or hole.kind == "stepped":
        return None
    is_round = abs(bore.diameter / ROUND - round(bore.diameter / ROUND)) * ROUND <= SAME
    passing = [size for size, series in CLEARANCE.items() if any(_same(bore.diameter, d) for d in series)]
    seated = next((size for size in passing if _fits_head(hole, size)), None)
    if seated:
        return Screw(seated, "clearance")
    usual = next((size for size in passing if any(_same(bore.diameter, d) for d in CLEARANCE[size][:2])), None)
    if hole.through and usual and not is_round:
        return Screw(usual, "clearance")
    drilled = next((size for size, d in TAP_DRILL.items() if _same(bore.diameter, d)), None)
    is_plain = hole.kind == "drilled" or (hole.head is None and not is_round)
    return Screw(drilled, "tap drill") if drilled and is_plain else None


def _fits_head(hole: Hole, size: str) -> bool:
    """Whether the opening takes the head of a screw, or its nut."""
    head = hole.head
    if head is None:
        return False
    if head.corners:
        return _is_within(head.diameter / NUT[size], NUT_ROOM)
    if head.is_cone:
        return size in SUNK_HEAD and _is_within(head.diameter / SUNK_HEAD[size], SUNK_ROOM) and _is_within(head.angle_deg, SUNK_DEG)
    return _is_within(head.diameter / CAP_HEAD[size], HEAD_ROOM)


def _same(a: float, b: float) -> bool:
    return abs(a - b) <= SAME


def _is_within(value: float, limits: tuple[float, float]) -> bool:
    return limits[0] <= value <= limits[1]
