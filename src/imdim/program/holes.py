"""Holes as a value: what stands around an axis in the air, from the face where a screw would enter to the bottom or the other side.

A hole is a sequence of sections, each a piece of a cylinder, of a cone, or of a hexagonal prism about the axis. What kind of hole it is
follows from these and from whether it goes through. `geometry.holes` finds them in programs, `metric` names their sizes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from imdim.program.tree import Vec3

HoleKind = Literal[
    "through",  # one diameter, open at both ends; the edges may be chamfered
    "blind",  # one diameter, with a flat bottom
    "drilled",  # one diameter, with the conical bottom that a drill leaves
    "counterbore",  # a wider cylinder at the opening, for a screw's head
    "countersink",  # a cone at the opening, for a countersunk head
    "hex pocket",  # a hexagon at the opening, for a nut or a screw's head
    "stepped",  # several diameters otherwise
    "tapered",  # a cone alone
]

SUNK = 1.5  # of the hole's diameter, from which a cone at its edge is for a head (ISO 10642: 1.9 and more) and not a chamfer
POINTED = 0.2  # of the diameter, up to which a cone at the bottom is a drill's point
EVEN = 1e-6  # of a diameter
ALIKE = 0.02  # of the diameter, by which the parts of one bore may differ


@dataclass(frozen=True, slots=True)
class HoleSection:
    """From `start` to `end` below the opening; `diameter` at the start and `narrow` at the end, across flats where there are `corners`.

    `leaves` are the numbers of the primitives that make this piece of the wall.
    """

    start: float
    end: float
    diameter: float
    narrow: float
    corners: int
    leaves: tuple[int, ...]

    @property
    def is_cone(self) -> bool:
        """Whether the diameter changes along it."""
        return abs(self.diameter - self.narrow) > EVEN * max(self.diameter, self.narrow)

    @property
    def angle_deg(self) -> float:
        """Of a cone the whole angle, else 0."""
        return 2 * math.degrees(math.atan2(abs(self.diameter - self.narrow) / 2, self.end - self.start)) if self.is_cone else 0.0


@dataclass(frozen=True, slots=True)
class Hole:
    """Entered at `point` along the unit `direction`; `sections` in that order. `through` says whether it is open at the other end."""

    point: Vec3
    direction: Vec3
    sections: tuple[HoleSection, ...]
    through: bool

    @property
    def leaves(self) -> tuple[int, ...]:
        """The primitives that make it, in order."""
        return tuple(sorted({leaf for s in self.sections for leaf in s.leaves}))

    @property
    def bore(self) -> HoleSection:
        """The narrowest section of one diameter, the deepest of several; of a taper its only one."""
        straight = [s for s in self.sections if not s.is_cone] or list(self.sections)
        return min(reversed(straight), key=lambda s: (s.corners, s.diameter))

    @property
    def head(self) -> HoleSection | None:
        """What is at the opening for a head or a nut: a wider cylinder, a cone, a hexagon, which may be all there is."""
        if self.kind not in ("counterbore", "countersink", "hex pocket"):
            return None
        return self.bore if self.bore.corners else _head(self._before())

    @property
    def point_section(self) -> HoleSection | None:
        """The cone at the bottom that a drill leaves."""
        return self.sections[-1] if self.kind == "drilled" or self._is_pointed() else None

    @property
    def diameters(self) -> tuple[float, ...]:
        """That of the bore, and that of the head (across flats where it is a hexagon)."""
        head = self.head
        return (self.bore.diameter,) if head is None or head is self.bore else (self.bore.diameter, head.diameter)

    @property
    def depth(self) -> float:
        """From the opening to the bottom, without a drill's point, or to the other side."""
        last = self.sections[-2] if self._is_pointed() else self.sections[-1]
        return last.end

    @property
    def kind(self) -> HoleKind:
        """What a drawing calls it."""
        bore = self.bore
        if bore.is_cone:
            return "tapered"
        first = len(self._before())
        before, after = self.sections[:first], self.sections[first:-1] if self._is_pointed() else self.sections[first:]
        if not all(_is_alike(s, bore) or _is_chamfer(s, bore) for s in after):
            return "stepped"
        if bore.corners:
            return "hex pocket" if len(self.sections) == 1 else "stepped"
        return _kind_by_head(before, bore) or ("through" if self.through else "drilled" if self._is_pointed() else "blind")

    def is_chamfer(self, section: HoleSection) -> bool:
        """Whether a section is a cone that widens an edge of the bore a little."""
        return section is not self.bore and _is_chamfer(section, self.bore)

    def _before(self) -> tuple[HoleSection, ...]:
        first = next(i for i, s in enumerate(self.sections) if _is_alike(s, self.bore))
        return self.sections[:first]

    def _is_pointed(self) -> bool:
        last = self.sections[-1]
        return not self.through and len(self.sections) > 1 and last.is_cone and last.narrow <= POINTED * last.diameter


def _head(before: tuple[HoleSection, ...]) -> HoleSection:
    """The section that says what the head is: of a cone below a cylinder, and of a chamfered cylinder, the one that bears the head."""
    return max(before, key=lambda s: (s.corners, s.is_cone and s.diameter >= SUNK * s.narrow, not s.is_cone))


def _kind_by_head(before: tuple[HoleSection, ...], bore: HoleSection) -> HoleKind | None:
    """What the sections above the bore make of it; None where they are its chamfer."""
    if all(_is_chamfer(s, bore) for s in before):
        return None
    if any(s.corners for s in before):
        return "hex pocket" if len(before) == 1 else "stepped"
    cones, straight = [s for s in before if s.is_cone], [s for s in before if not s.is_cone]
    if len(straight) > 1 or any(a.narrow < b.diameter * (1 - EVEN) for a, b in pairwise(before)):
        return "stepped"
    if before[-1].is_cone and before[-1].diameter >= SUNK * bore.diameter and len(cones) == 1:
        return "countersink"
    if straight and all(_is_chamfer(s, straight[0]) or _is_chamfer(s, bore) for s in cones):
        return "counterbore"
    return "stepped"


def _is_alike(s: HoleSection, bore: HoleSection) -> bool:
    """Whether a section has the bore's diameter, as beyond a gap."""
    return s is bore or (not s.is_cone and s.corners == bore.corners and abs(s.diameter - bore.diameter) <= ALIKE * bore.diameter)


def _is_chamfer(s: HoleSection, beside: HoleSection) -> bool:
    """Whether a section is a cone that widens the edge a little."""
    return s.is_cone and max(s.diameter, s.narrow) < SUNK * beside.diameter
