"""Which curves of an outline's loops meet where, and how: the ground that `outline_dimensions` puts variables on."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from imdim.program.ellipse import Ellipse
from imdim.program.outline import Curve, Loop, Outline, Point, arc_center, arc_radius, circle_of, nesting, ring_curves
from imdim.program.regular_polygon import regular_of

HALF = 1e-6  # of a bulge, by which a half turn may differ from 1
QUARTER = math.tan(math.pi / 8)  # the bulge of a quarter turn
STEEP = 0.05  # of the radius: what an arc must reach along a line that it crosses
TENTH = 0.1  # of a radius, or of a place
HALF_TURN = 180.0  # degrees
NEARLY = 0.01  # of an arc's radius, by which its centre, as fitted, may miss the axis that it runs about
WIDEST = 120.0  # degrees by which an arc turns that is told by its radius: the ends of a wider one soon lie too far apart for that
X, Y = 0, 1

Row = dict[int, float]  # a sum of variables: their factors


def sum_rows(*parts: tuple[Row, float]) -> Row:
    """Sums of variables times factors, added up."""
    out: Row = {}
    for row, factor in parts:
        for v, c in row.items():
            out[v] = out.get(v, 0.0) + factor * c
    return {v: c for v, c in out.items() if c}


@dataclass
class DrawnLine:
    """A line along axis 1 - `across` whose place is that along `across`; the other ones have no axis."""

    across: int | None
    place: float
    inner: bool


@dataclass
class DrawnArc:
    """An arc with the variables of its centre and radius, once it has them. One that is `half` turns by 180 degrees, a `wide` one by more
    than 90. `inner` ones bound a hole, those that are `crossed` have no angles of their own, and `loose` ones are told by their ends and
    have no centre, but for an `end`, whose ends are where the lines beside it touch it. A `rim` turns far, and its ends lie where they do
    about its centre."""

    center: tuple[float, float]
    radius: float
    half: bool
    wide: bool
    inner: bool
    loose: bool = False
    end: bool = False
    crossed: bool = False
    rim: bool = False
    at: list[Row | None] = field(default_factory=lambda: [None, None])
    size: Row = field(default_factory=dict)


DrawnCurve = DrawnLine | DrawnArc


@dataclass
class Joint:
    """Where two curves of a loop meet. `along` is the axis along which an arc's centre lies from here, None for a corner of lines, and
    `fits` whether the vertex is a sum of variables; or an arc `crosses` a line along an axis.

    The curve after it turns by `turn` degrees. If it is a loose arc, it `rounds` the corner of two lines, which is `at` then, here and at
    its other end; or it goes on as the curve before it ends, or ends as the one after it begins (`touches` -1 or 1), or comes back along
    either in a cusp (`is_cusp`). Of an end `about` is the arc, at both its joints. Where an arc fills a corner (`_is_filled`), `fills` is
    the joint at that, at both its ends.
    """

    before: DrawnCurve
    after: DrawnCurve
    at: tuple[float, float]
    along: int | None
    fits: bool
    crosses: bool = False
    turn: float = 0.0
    rounds: bool = False
    touches: int = 0
    is_cusp: bool = False
    about: DrawnArc | None = None
    fills: Joint | None = None

    @property
    def is_placed(self) -> bool:
        """Whether something else than its own coordinates says where it is."""
        return self.carried or self.about is not None or self.fills is not None

    @property
    def carried(self) -> bool:
        """Whether an arc with a centre says where it is."""
        return any(isinstance(c, DrawnArc) and not c.loose for c in (self.before, self.after))


class OutlineJoints:
    """The joints of each loop, None for a circle, an ellipse or a regular polygon.

    `holes` says which loops bound holes, `slack` within what numbers are one, and `centers` are those of circles and ellipses; `axes` are
    the places of round walls of other leaves. Where it `has_webs` a triangle may fill a corner.
    """

    def __init__(self, outline: Outline, slack: float, has_webs: bool = True, axes: Sequence[Point] = ()) -> None:
        self.outline, self.slack, self.has_webs, self.axes = outline, slack, has_webs, axes
        self.holes = [sign < 0 for sign in nesting(outline.loops)]
        self.centers = [center for center in map(_center, outline.loops) if center]
        self.regular = [regular_of(loop, slack) for loop in outline.loops]
        self.loops: list[list[Joint] | None] = []
        for loop, hole, regular in zip(outline.loops, self.holes, self.regular, strict=True):
            self.loops.append(None if regular or isinstance(loop, Ellipse) or circle_of(loop) else self._joints(ring_curves(loop), hole))

    def all(self) -> Iterator[Joint]:
        """The joints of all loops."""
        return (joint for loop in self.loops if loop for joint in loop)

    def lines(self) -> Iterator[DrawnLine]:
        """All lines."""
        return (j.after for j in self.all() if isinstance(j.after, DrawnLine))

    def arcs(self) -> Iterator[DrawnArc]:
        """All arcs; one that is written as two comes twice."""
        return (j.after for j in self.all() if isinstance(j.after, DrawnArc))

    def apexes(self) -> Iterator[tuple[DrawnArc, int, int]]:
        """Arcs of less than a quarter turn that cross lines, with the axis and the side to which they reach furthest between their ends, or
        would not far beyond them: the way from their centre to either end is mostly along that axis."""
        for loop in filter(None, self.loops):
            for joint, following in zip(loop, [*loop[1:], loop[0]], strict=True):
                arc = joint.after
                if isinstance(arc, DrawnArc) and arc.crossed and not (arc.wide or arc.loose):
                    away = [[at[axis] - arc.center[axis] for at in (joint.at, following.at)] for axis in (X, Y)]
                    for across, along in ((X, Y), (Y, X)):
                        is_between = away[across][0] * away[across][1] < 0
                        is_near = all(abs(u) < abs(v) for u, v in zip(away[across], away[along], strict=True))
                        if is_between or (is_near and away[along][0] * away[along][1] > 0):
                            yield arc, along, 1 if sum(away[along]) > 0 else -1

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
        joints = [self._joint(a, b, curve) for a, b, curve in zip(before, carriers, curves, strict=True)]
        for joint in joints:
            for c in (joint.before, joint.after):
                if isinstance(c, DrawnArc):
                    c.loose |= not joint.fits and not joint.crosses
        self._join_smoothly(joints, curves)
        if self.has_webs:
            self._fill_corner(joints, curves)
        return joints

    def _carrier(self, curve: Curve, inner: bool) -> DrawnCurve:
        x, y, u, v, bulge = curve
        if bulge:
            # the digits of three vertices say no more of a circle
            radius = round(arc_radius(curve), self._digits)
            return DrawnArc(self._round(arc_center(curve)), radius, abs(abs(bulge) - 1) < HALF, abs(bulge) > QUARTER + HALF, inner)
        if abs(u - x) <= self.slack:
            return DrawnLine(X, x, inner)
        return DrawnLine(Y, y, inner) if abs(v - y) <= self.slack else DrawnLine(None, 0.0, inner)

    @property
    def _digits(self) -> int:
        return -math.floor(math.log10(self.slack))

    def _round(self, point: Point) -> Point:
        x, y = point
        return round(x, self._digits) + 0.0, round(y, self._digits) + 0.0

    def _is_one(self, a: DrawnCurve, b: DrawnCurve) -> bool:
        """Whether two arcs are of one circle."""
        if isinstance(a, DrawnLine) or isinstance(b, DrawnLine):
            return False
        if math.dist(a.center, b.center) <= self.slack and abs(a.radius - b.radius) <= self.slack:
            return True
        about = self._find_axis(a)
        return about is not None and about == self._find_axis(b) and abs(a.radius - b.radius) <= NEARLY * a.radius

    def _find_axis(self, arc: DrawnArc) -> Point | None:
        """The place of the hole, or of a round wall of another leaf, that an arc of more than a quarter turn runs about."""
        if not arc.wide:
            return None
        return next((at for at in (*self.centers, *self.axes) if math.dist(at, arc.center) <= NEARLY * arc.radius), None)

    def _joint(self, a: DrawnCurve, b: DrawnCurve, curve: Curve) -> Joint:
        at, turn = curve[:2], math.degrees(4 * math.atan(curve[4]))
        if isinstance(a, DrawnLine) and isinstance(b, DrawnLine):
            return Joint(a, b, at, None, True)
        along = {self._axis_from(arc, at) for arc in (a, b) if isinstance(arc, DrawnArc)}
        axis = along.pop() if len(along) == 1 else None
        level = all(isinstance(c, DrawnArc) or c.across is not None for c in (a, b))
        # a line may touch an arc or be square to it: either way it lies along an axis
        joint = Joint(a, b, at, axis, level and axis is not None, axis is None and self._crosses(a, b, at), turn)
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

    def _join_smoothly(self, joints: Sequence[Joint], curves: Sequence[Curve]) -> None:
        """Say of loose arcs which corner they round, whether they are ends, or along which neighbour they begin or end."""
        n = len(joints)
        smooth = [self._goes_on(curves[k - 1], curves[k]) for k in range(n)]
        cusps = [self._comes_back(curves[k - 1], curves[k]) for k in range(n)]
        loose = {k: j.after for k, j in enumerate(joints) if isinstance(j.after, DrawnArc) and j.after.loose}
        between = [k for k in loose if smooth[k] and smooth[(k + 1) % n] and self._is_between_lines(joints, k)]
        corners = {k: self._rounded_corner(curves[k - 1], curves[k]) for k in between}
        ends = {k for k in between if self._is_end(loose[k], corners[k], curves[k - 1], curves[(k + 1) % n])}
        while grown := {k for k in corners if {(k - 2) % n, (k + 2) % n} & ends} - ends:
            ends |= grown  # the line between two arcs touches both alike
        tight = {k for k in ends if (k + 2) % n in ends and not _can_part(joints[k], joints[(k + 2) % n])}
        while grown := {k for k in ends if {(k - 2) % n, k, (k + 2) % n} & tight} - tight:
            tight |= grown
        for k in loose:
            joint, following, corner = joints[k], joints[(k + 1) % n], corners.get(k)
            is_rim = abs(joint.turn) > WIDEST and self._is_rim(loose[k]) and self._is_between_movable(joints, k)
            if k in tight:
                loose[k].loose, loose[k].rim = False, True
            elif k in ends:
                loose[k].end, joint.about, following.about = True, loose[k], loose[k]
            elif corner is not None:
                joint.rounds, joint.at, following.at = True, corner, corner
            elif self._is_eye(loose[k], joint.turn) and self._is_between_movable(joints, k):
                loose[k].loose, loose[k].rim = False, True  # what touches it gives way
            elif not is_rim and (cusps[k] or (cusps[(k + 1) % n] and (k + 1) % n not in loose)):
                # a kink where it should be smooth is a kink, but curves that leave a cusp on the wrong sides cross
                joint.touches, joint.is_cusp = -1 if cusps[k] else 1, True
            elif smooth[k]:
                joint.touches = -1
            elif smooth[(k + 1) % n] and (k + 1) % n not in loose:
                joint.touches = 1
            elif is_rim:
                loose[k].loose, loose[k].rim = False, True
        if all(j.touches == -1 for j in joints):
            joints[0].touches = 0  # one of a ring of arcs is not told by the others

    def _fill_corner(self, joints: Sequence[Joint], curves: Sequence[Curve]) -> None:
        """Say of a triangle of two lines and an arc that this fills the corner between them."""
        if len(curves) != 3 or sum(1 for curve in curves if curve[4]) != 1:
            return
        k = next(i for i in range(3) if curves[i][4])
        arc, following, corner = joints[k], joints[(k + 1) % 3], joints[k - 1]
        if isinstance(arc.after, DrawnArc) and arc.after.loose and _is_filled(curves[k - 1], curves[k], curves[(k + 1) % 3]):
            arc.fills = following.fills = corner

    def _is_between_lines(self, joints: Sequence[Joint], k: int) -> bool:
        return isinstance(joints[k].before, DrawnLine) and isinstance(joints[(k + 1) % len(joints)].after, DrawnLine)

    def _is_rim(self, arc: DrawnArc) -> bool:
        """Whether an arc runs about the middle of its drawing: elsewhere a tenth more of where it is would take it out of its loop."""
        (left, low), (right, high) = self.outline.bounds
        return not arc.half and math.dist(arc.center, ((left + right) / 2, (low + high) / 2)) < arc.radius

    def _is_eye(self, arc: DrawnArc, turn: float) -> bool:
        """Whether an arc lies about a hole or a round wall, or turns by more than half, and a tenth more of where it is leaves it almost
        there."""
        is_near = abs(turn) > HALF_TURN and TENTH * max(map(abs, arc.center)) <= arc.radius / 4
        return not arc.half and (is_near or self._find_axis(arc) is not None)

    def _is_between_movable(self, joints: Sequence[Joint], k: int) -> bool:
        """Whether an arc, which may be written as two, crosses the lines beside it, or these curves go wherever its ends are."""
        arc, n = joints[k].after, len(joints)
        first = next((joints[k - i] for i in range(n) if joints[k - i].before is not arc), joints[k])
        last = next((joints[(k + i) % n] for i in range(1, n) if joints[(k + i) % n].after is not arc), joints[k])
        return all(_is_movable(c) or (joint.crosses and _cross_well(c, arc)) for joint, c in ((first, first.before), (last, last.after)))

    def _is_end(self, arc: DrawnArc, corner: Point | None, before: Curve, after: Curve) -> bool:
        """Whether an arc between two lines that touch it rounds no corner, or lies about a hole."""
        if corner is not None and not any(math.dist(center, arc.center) <= self.slack for center in self.centers):
            return False
        return all(abs(_distance(line, arc.center) - arc.radius) <= self.slack for line in (before, after))

    def _goes_on(self, a: Curve, b: Curve) -> bool:
        """Whether the second curve begins in the direction in which the first one ends, to the digits of its own ends."""
        bend = _difference(_direction(b, -1), _direction(a, 1))
        return abs(bend) * min(math.dist(c[:2], c[2:4]) for c in (a, b)) <= self.slack

    def _comes_back(self, a: Curve, b: Curve) -> bool:
        """Whether the second curve begins in the direction from which the first one came, as `_goes_on`."""
        bend = _difference(_direction(b, -1), _direction(a, 1) + math.pi)
        return abs(bend) * min(math.dist(c[:2], c[2:4]) for c in (a, b)) <= self.slack

    def _rounded_corner(self, before: Curve, arc: Curve) -> Point | None:
        """Where two lines meet beyond the arc between them; None where they do not."""
        half = 2 * math.atan(arc[4])
        if abs(math.cos(half)) < STEEP:
            return None
        chord, way = math.dist(arc[:2], arc[2:4]), _direction(before, 1)
        length = chord / 2 / math.cos(half)
        corner = arc[0] + length * math.cos(way), arc[1] + length * math.sin(way)
        far = math.dist(corner, arc[2:4]) - length
        return self._round(corner) if length > 0 and abs(far) <= self.slack else None


def _can_part(before: Joint, after: Joint) -> bool:
    """Whether a line still touches the arcs after both joints once a radius, or the place of one, is a tenth more or less: of circles that
    are run the same way none does where one lies in the other, of others where they cross."""
    one, two = before.after, after.after
    assert isinstance(one, DrawnArc)
    assert isinstance(two, DrawnArc)
    reach = one.radius + two.radius if before.turn * after.turn < 0 else abs(one.radius - two.radius)
    return (1 - TENTH) * math.dist(one.center, two.center) > reach + TENTH * max(one.radius, two.radius)


def _is_movable(curve: DrawnCurve) -> bool:
    """Whether a curve goes wherever its ends are."""
    return curve.across is None if isinstance(curve, DrawnLine) else curve.loose and not curve.end


def _cross_well(line: DrawnCurve, arc: DrawnCurve) -> bool:
    """Whether a line along an axis meets an arc even if it lies a tenth further from the centre."""
    if not isinstance(line, DrawnLine) or not isinstance(arc, DrawnArc) or line.across is None:
        return False
    return (1 + TENTH) * abs(line.place - arc.center[line.across]) < arc.radius


def _is_filled(before: Curve, arc: Curve, after: Curve) -> bool:
    """Whether an arc between two lines from one corner bends towards that and all but touches a line, as the web of a fillet does: from the
    same ends, with a radius that is a tenth smaller, it would cross the line."""
    half = 2 * math.atan(arc[4])
    tighter = math.asin(min(abs(math.sin(half)) / (1 - TENTH), 1.0)) - abs(half)
    first = _difference(_direction(before, 1) + math.pi, _direction(arc, -1))
    last = _difference(_direction(arc, 1) + math.pi, _direction(after, -1))
    room = [math.copysign(1.0, -half) * angle for angle in (first, last)]
    return abs(half) < math.pi / 2 and -HALF <= min(room) <= tighter


def _center(loop: Loop) -> Point | None:
    """The centre of a circle or an ellipse."""
    if isinstance(loop, Ellipse):
        return loop.x, loop.y
    found = circle_of(loop)
    return found and found[:2]


def _distance(line: Curve, point: Point) -> float:
    """How far a point is from a line that goes on both ways."""
    x, y, u, v, _ = line
    return abs((u - x) * (point[1] - y) - (v - y) * (point[0] - x)) / math.dist((x, y), (u, v))


def _direction(curve: Curve, end: int) -> float:
    """The direction of a curve at its start (-1) or at its end (1), in radians."""
    x, y, u, v, bulge = curve
    return math.atan2(v - y, u - x) + 2 * end * math.atan(bulge)


def _difference(a: float, b: float) -> float:
    """The angle from b to a, between half a turn back and half a turn on."""
    return math.remainder(a - b, 2 * math.pi)
