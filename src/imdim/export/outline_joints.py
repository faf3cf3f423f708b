"""Which curves of an outline's loops meet where, and which of them may move: the ground that `outline_rows` puts variables on."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from imdim.program.outline import Curve, Outline, arc_center, arc_radius, circle_of, loop_curves, nesting

HALF = 1e-6  # of a bulge, by which a half turn may differ from 1
QUARTER = math.tan(math.pi / 8)  # the bulge of a quarter turn
STEEP = 0.05  # of the radius: what an arc must reach along a line that it crosses
X, Y = 0, 1

Row = dict[int, float]


@dataclass
class DrawnLine:
    """A line along axis 1 - `across` whose place is that along `across`; the other ones have no axis."""

    across: int | None
    place: float
    inner: bool


@dataclass
class DrawnArc:
    """An arc with the variables of its centre and radius, once it has them; one that is `fixed` has none. One that is `half` turns by
    180 degrees, a `wide` one by more than 90. `inner` ones bound a hole, and those that are `crossed` have no angles of their own."""

    center: tuple[float, float]
    radius: float
    half: bool
    wide: bool
    inner: bool
    fixed: bool = False
    crossed: bool = False
    at: list[Row | None] = field(default_factory=lambda: [None, None])
    size: Row = field(default_factory=dict)


DrawnCurve = DrawnLine | DrawnArc


@dataclass
class Joint:
    """Where two curves of a loop meet. `along` is the axis along which an arc's centre lies from here, None for a corner of lines, and
    `fits` whether the vertex is a sum of variables; or an arc `crosses` a line along an axis."""

    before: DrawnCurve
    after: DrawnCurve
    at: tuple[float, float]
    along: int | None
    fits: bool
    crosses: bool = False


class OutlineJoints:
    """The joints of each loop, None for a circle.

    `holes` says which loops bound holes, `slack` within what numbers are one, and `fixed` which lines along an axis stay, by axis and the
    cell of their place.
    """

    def __init__(self, outline: Outline, slack: float) -> None:
        self.outline, self.slack = outline, slack
        self.holes = [sign < 0 for sign in nesting(outline.loops)]
        loops = zip(outline.loops, self.holes, strict=True)
        self.loops = [None if circle_of(loop) else self._joints(loop_curves(loop), hole) for loop, hole in loops]
        self.fixed = set[tuple[int, int]]()
        self._fix()

    def all(self) -> Iterator[Joint]:
        """The joints of all loops."""
        return (joint for loop in self.loops if loop for joint in loop)

    def lines(self) -> Iterator[DrawnLine]:
        """All lines."""
        return (j.after for j in self.all() if isinstance(j.after, DrawnLine))

    def arcs(self) -> Iterator[DrawnArc]:
        """All arcs; one that is written as two comes twice."""
        return (j.after for j in self.all() if isinstance(j.after, DrawnArc))

    def cell(self, number: float) -> int:
        """The same for numbers that are one."""
        return round(number / (4 * self.slack))

    def _joints(self, curves: Sequence[Curve], inner: bool) -> list[Joint]:
        carriers: list[DrawnCurve] = []
        for curve in curves:
            found = self._carrier(curve, inner)
            # a wide arc is written as two
            one = next((c for c in (*carriers[-1:], *carriers[:1]) if self._is_one(c, found)), found)
            carriers.append(one)
        before = [carriers[-1], *carriers[:-1]]
        return [self._joint(a, b, curve[:2]) for a, b, curve in zip(before, carriers, curves, strict=True)]

    def _carrier(self, curve: Curve, inner: bool) -> DrawnCurve:
        x, y, u, v, bulge = curve
        if bulge:
            # the digits of three vertices say no more of a circle
            digits = -math.floor(math.log10(self.slack))
            (a, b), radius = arc_center(curve), arc_radius(curve)
            center = round(a, digits) + 0.0, round(b, digits) + 0.0
            return DrawnArc(center, round(radius, digits), abs(abs(bulge) - 1) < HALF, abs(bulge) > QUARTER + HALF, inner)
        if abs(u - x) <= self.slack:
            return DrawnLine(X, x, inner)
        return DrawnLine(Y, y, inner) if abs(v - y) <= self.slack else DrawnLine(None, 0.0, inner)

    def _is_one(self, a: DrawnCurve, b: DrawnCurve) -> bool:
        """Whether two arcs are of one circle."""
        if isinstance(a, DrawnLine) or isinstance(b, DrawnLine):
            return False
        return math.dist(a.center, b.center) <= self.slack and abs(a.radius - b.radius) <= self.slack

    def _joint(self, a: DrawnCurve, b: DrawnCurve, at: tuple[float, float]) -> Joint:
        if isinstance(a, DrawnLine) and isinstance(b, DrawnLine):
            return Joint(a, b, at, None, a.across is not None or b.across is not None)
        along = {self._axis_from(arc, at) for arc in (a, b) if isinstance(arc, DrawnArc)}
        axis = along.pop() if len(along) == 1 else None
        level = all(isinstance(c, DrawnArc) or c.across is not None for c in (a, b))
        # a line may touch an arc or be square to it: either way it lies along an axis
        joint = Joint(a, b, at, axis, level and axis is not None, axis is None and self._crosses(a, b, at))
        for c in (a, b):
            if isinstance(c, DrawnArc):
                c.crossed |= joint.crosses
        return joint

    def _crosses(self, a: DrawnCurve, b: DrawnCurve, at: tuple[float, float]) -> bool:
        """Whether a line along an axis and an arc meet there, and not so nearly along each other that digits decide where."""
        line, arc = (a, b) if isinstance(a, DrawnLine) else (b, a)
        if not isinstance(line, DrawnLine) or not isinstance(arc, DrawnArc) or line.across is None:
            return False
        off, reach = line.place - arc.center[line.across], abs(at[1 - line.across] - arc.center[1 - line.across])
        return reach > STEEP * arc.radius and abs(math.hypot(off, reach) - arc.radius) <= self.slack

    def _axis_from(self, arc: DrawnArc, at: tuple[float, float]) -> int | None:
        away = [abs(at[i] - arc.center[i]) for i in (X, Y)]
        return X if away[Y] <= self.slack else Y if away[X] <= self.slack else None

    def _fix(self) -> None:
        """Arcs that end otherwise stay, and so do the lines that meet them there, and what touches those that lean."""
        changed = True
        while changed:
            changed = False
            for joint in self.all():
                arcs = [c for c in (joint.before, joint.after) if isinstance(c, DrawnArc)]
                if (arcs and not joint.fits and not joint.crosses) or any(arc.fixed for arc in arcs):
                    for c in (joint.before, joint.after):
                        changed |= self._fix_one(c)
            for loop in filter(None, self.loops):
                for a, b in zip(loop, [*loop[1:], loop[0]], strict=True):
                    leaning = isinstance(a.after, DrawnLine) and a.after.across is None
                    ends = [(a, a.before), (b, b.after)]
                    if leaning and any(isinstance(c, DrawnArc) for _, c in ends):
                        for c in (c for _, c in ends):
                            changed |= self._fix_one(c)

    def _fix_one(self, c: DrawnCurve) -> bool:
        if isinstance(c, DrawnArc):
            before, c.fixed = c.fixed, True
            return not before
        key = None if c.across is None else (c.across, self.cell(c.place))
        if key is None or key in self.fixed:
            return False
        self.fixed.add(key)
        return True
