"""Which numbers of a program follow from which others, by Gaussian elimination over its constraints, linear while directions stay.

Variables are, per leaf, three sizes (that of a turned outline is in degrees) and the three coordinates of its centre; rows and circles of
equal steps add spacings, diameters and middles. Centres are eliminated before sizes and later leaves before earlier ones, so that what
stays free are the sizes that a person would name. Equations along directions that are none of the world's axes come after the others, so
that expressions stay as simple as they can. Cuts keep sticking out of what they cut
by as much as they do, and what stands on something stays on it (`seats`).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from imdim.export.chance import rest_on_faces
from imdim.export.clip_seats import seats_at_clips
from imdim.export.contacts import find_contacts, find_own_numbers
from imdim.export.corner_contacts import find_corner_contacts
from imdim.export.datums import UP, Datum, Tie, ties
from imdim.export.diameters import add_diameters
from imdim.export.feature_roles import MOST_NAMED
from imdim.export.outline_joints import sum_rows
from imdim.export.outline_rows import Drawn, add_outlines
from imdim.export.outline_walls import EXACT, RoundWall
from imdim.export.own_directions import find_own_directions
from imdim.export.reduction import ZERO, Reduced
from imdim.export.repeat_rows import add_repeats
from imdim.export.rim_seats import end_in_walls, stand_on_rims
from imdim.export.round_contacts import bind_plugs, bind_tangents, bind_tubes, find_following_rims, find_stacked
from imdim.export.round_seats import seats_at_rounds
from imdim.export.seats import End, Seat, ends_of, place_of, reach_of, seats, world_axis
from imdim.export.seen import HAIR, SeenPlanes, find_hidden_ends
from imdim.export.spoke_seats import bind_bores
from imdim.export.tilted_cuts import pass_aslant
from imdim.export.twins import find_twins
from imdim.export.wall_seats import FlatWall, seats_at_walls
from imdim.geometry.lowering import Lowered, lower
from imdim.program.constraints import AXES_OF, Constraint, Ref
from imdim.program.repeats import Folded
from imdim.program.roles import signs
from imdim.program.tree import KINDS, Primitive, Program, leaves, longest
from imdim.relations.residuals import rows_of

HALVES = 1e-6  # by which a coefficient may miss a half that it stands for: the digits of files
MOST_PLACED = 300  # primitives of a program whose places have names too; nobody reads a thousand of them
SLOPE = 1e-6  # of a constraint's own slopes, that it may have with respect to a name
PATTERNS = ("linear", "circular")
_RANKS = {"center": 0, "radius": 2, "circle": 2, "diameter": 3}  # by the last part of a word, the last are eliminated last


@dataclass
class LinearSystem:
    """Equations [m, n] that hold at `start` [n]; variables from `extra` on are those of patterns, each with its first leaf and a word.

    `ties` are such for the numbers of one leaf, that are to bind no others, `contacts` such that may settle a line of its drawing,
    `places` such for the coordinates of its centre alone, or, if they say so, for the spacing of the row or grid that begins with it, and
    `reaches` such for its sizes, once its place is known.
    `length` is the largest size. `drawn` says of leaves with outlines what the vertices are, `heights` which variable is the height of
    turned ones whose centre is at half of it. `angles` are variables in degrees, `on_circles` the places of what stands on a circle,
    `on_rims` those of them whose circle follows a round wall, and that circle, `followers` what follows before anything else does: circles
    and heights of cuts that go through others, and of what ends in round walls. Leaves that `twins` gives one number are as deep or as
    high as each other by one name, where they are so now; `gaps` has for each variable of one the other leaf.
    """

    start: list[float]
    extra: int
    length: float
    rows: list[dict[int, float]] = field(default_factory=list)
    ties: list[tuple[int, dict[int, float]]] = field(default_factory=list)
    contacts: list[tuple[int, dict[int, float]]] = field(default_factory=list)
    places: list[tuple[int, dict[int, float], bool]] = field(default_factory=list)
    reaches: list[tuple[int, dict[int, float]]] = field(default_factory=list)
    extras: list[tuple[int, str]] = field(default_factory=list)
    drawn: dict[int, Drawn] = field(default_factory=dict)
    walls: list[FlatWall] = field(default_factory=list)
    round_walls: list[RoundWall] = field(default_factory=list)
    heights: dict[int, int] = field(default_factory=dict)
    angles: set[int] = field(default_factory=set)
    on_circles: set[int] = field(default_factory=set)
    on_rims: set[int] = field(default_factory=set)
    followers: set[int] = field(default_factory=set)
    twins: Mapping[int, int] = field(default_factory=dict)
    gaps: dict[int, int] = field(default_factory=dict)

    @staticmethod
    def of(
        program: Program,
        constraints: Sequence[Constraint],
        delivered: Program | None = None,
        folded: Folded | None = None,
        fixed: Collection[int] = (),
    ) -> LinearSystem:
        """The equations of those constraints that are linear while all directions stay, of the repeats in `folded`, and of the outlines of
        `delivered` (by default those of `program`).

        Places in repeats whose numbers (in the order of `repeats`) are in `fixed` follow nothing.
        """
        parts, numbers = list(leaves(program)), lower(program)
        start = vector(parts).tolist()
        system = LinearSystem(start, len(start), longest(parts))
        sign = signs(program)
        if folded is not None:
            add_repeats(system, folded, parts, sign, fixed)
        system.drawn = add_outlines(system, parts if delivered is None else list(leaves(delivered)), folded, sign)
        sources = add_diameters(system, parts, folded)
        system.twins = find_twins(constraints, parts, EXACT * system.length)
        plugs = list(bind_plugs(parts, sources, system.drawn))
        system.rows += plugs
        system.followers |= find_following_rims(system, plugs, parts)
        system.rows += bind_tubes(parts, sources, system.drawn)
        system.rows += bind_tangents(parts, sources, system.drawn)
        whole = program if delivered is None else delivered
        if folded is not None:
            system.rows += stand_on_rims(system, whole, folded)
            system.rows += end_in_walls(system, program, folded)
            system.rows += bind_bores(system, program, folded)
        hidden = find_hidden_ends(whole)
        at_walls = list(seats_at_walls(program, system.walls, hidden))
        stacked = list(find_stacked(program, sources))
        going_on = {(own.leaf, own.axis, own.side) for own, _ in stacked} & hidden
        # a bore that goes on in another one has no floor there, and no depth
        ends = _without_farther(seats(program, hidden), at_walls, parts)
        found = [seat for seat in ends if not (seat.word and (seat.own.leaf, seat.own.axis, seat.own.side) in going_on)]
        constraints = rest_on_faces(constraints, found, parts)
        others = [c for c in constraints if c.kind not in PATTERNS or _is_slanted(c, numbers)]
        for constraint in (c for c in constraints if c not in others):
            if constraint.kind == "linear":
                system._add_row(constraint, numbers)
            elif len(constraint.of) > 2:
                system._add_circle(constraint, numbers)
            else:
                system._add_opposite(constraint, numbers)
        system.rows += filter(None, map(_simple, _linear(others, numbers)))
        system.rows += list(system._ground_leaf(parts[0], numbers))
        flush = {ref for c in constraints if c.kind in ("coplanar", "aligned") for ref in c.of}
        for own, face, word in found:
            # what equal bosses have in common is how far they stand out
            if word or Ref(own.leaf, own.local) not in flush:
                system._add_seat(own.leaf, system.place_of_end(own, 1.0) | system.place_of_end(face, -1.0), word)
        system._measure_turned_cuts(found, parts, sign)
        seated = {(seat.own.leaf, seat.own.axis, seat.own.side) for seat in found}
        for own, wall, word in at_walls:
            if (own.leaf, own.axis, own.side) not in seated and Ref(own.leaf, own.local) not in flush:
                row = system.place_of_end(own, 1.0)
                for v, factor in wall.row.items():
                    row[v] = row.get(v, 0.0) - factor
                system._add_seat(own.leaf, row, word)
                seated.add((own.leaf, own.axis, own.side))
        cut_off = find_hidden_ends(whole, turned=True)
        clipped = ((own, row, False) for own, row in seats_at_clips(system, program, cut_off))
        for own, row, moves in (*clipped, *seats_at_rounds(system, program, cut_off)):
            if (own.leaf, own.axis, own.side) in seated or Ref(own.leaf, own.local) in flush:
                continue
            # where the other end is seen that says where the leaf is, and this one how large
            moves = moves or (own.leaf, own.axis, -own.side) in cut_off or parts[own.leaf].kind == "cone"
            (system.ties if moves else system.reaches).append((sources[own.leaf], row))
            seated.add((own.leaf, own.axis, own.side))
        for own, other in stacked:
            if (own.leaf, own.axis, own.side) not in seated:
                system.ties.append((own.leaf, sum_rows((system.place_of_end(own), 1.0), (system.place_of_end(other), -1.0))))
        # both about their middles, so that neither end of the cut falls behind
        system.ties += [(cut, {6 * cut + c: 1.0, 6 * leaf + d: -1.0}) for (cut, c), (leaf, d) in pass_aslant(program)]
        if system.walls:
            at_corners, as_round = find_corner_contacts(system, program)
            system.contacts = [*find_contacts(system, program, SeenPlanes(whole, HAIR)), *at_corners]
            system.rows += as_round
        if len(parts) <= MOST_PLACED:
            system._add_places(ties(program, constraints, hidden))
            system._hold_places(parts, numbers)
        for leaf in system.heights:
            # otherwise what is turned grows upwards, as seen along its own axis, or from the end that is seen
            ends = sorted(ends_of(leaf, parts[leaf], numbers), key=lambda e: ((e.leaf, e.axis, e.side) in cut_off, e.local == "+z"))
            system.ties += [(leaf, system.place_of_end(end, 1.0)) for end in ends[:1]]
        return system

    def reduce(self) -> Reduced:
        """The equations but for those of places, each solved for the number that follows from it."""
        soft = (*self.ties, *self.contacts)
        reduced = Reduced.of([*self.rows, *(row for _, row in soft)], len(self.start))
        for v, i in self._plain_pivots(reduced.matrix, self._order()):
            reduced.solve_for(v, i)
        own = [sorted(range(6 * leaf, 6 * leaf + 6), key=lambda v: (v % 6 < 3, -v)) for leaf, _ in self.ties]
        own += [find_own_numbers(self, leaf) for leaf, _ in self.contacts]
        for i, among in enumerate(own, start=len(self.rows)):
            self._solve_for_first(reduced, i, among)
        return reduced

    def solve(self, reduced: Reduced | None = None) -> dict[int, dict[int, float]]:
        """Each number that follows from others, with their coefficients; a constant makes up the rest. Those are wholes, halves and
        quarters, but for places on a circle; what would follow by others stays a number. The equations are by default those of
        `reduce`."""
        late = [*(row for _, row, _ in self.places), *(row for _, row in self.reaches)]
        whole = (self.reduce() if reduced is None else reduced).add(late, len(self.start))
        spacings = [v for v in self._order() if self._is_spacing(v)]
        firsts = {self.leaf_of(v) for v in spacings}
        for i, (leaf, _, with_spacing) in enumerate(self.places, start=len(whole.matrix) - len(late)):
            among = [*(6 * leaf + 5 - k for k in range(3)), *(spacings if with_spacing and leaf in firsts else [])]
            self._solve_for_first(whole, i, among)
        for i, (leaf, _) in enumerate(self.reaches, start=len(whole.matrix) - len(self.reaches)):
            self._solve_for_first(whole, i, [*range(6 * leaf, 6 * leaf + 3), *filter(None, [self.heights.get(leaf)])])
        rows = whole.read()
        return {
            v: row for v, row in rows.items() if v in self.on_rims or all(_is_plain(2 * c) or self._is_circle(w) for w, c in row.items())
        }

    def is_plain(self, row: np.ndarray) -> bool:
        """Whether the coefficients [n] of an equation are wholes and halves, but for places on a circle."""
        return all(_is_plain(float(row[v])) or self._is_circle(v) for v in np.flatnonzero(row).tolist())

    def _is_circle(self, v: int) -> bool:
        return v >= self.extra and self.extras[v - self.extra][1] == "circle"

    def _solve_for_first(self, reduced: Reduced, i: int, among: Iterable[int]) -> None:
        """Solve equation `i` for the first of some variables that it holds; for a spacing only by halves."""
        row = reduced.matrix[i]
        held = (v for v in among if abs(row[v]) > ZERO)
        v = next((v for v in held if not self._is_spacing(v) or all(map(_is_plain, row / row[v]))), None)
        if v is not None:
            reduced.solve_for(v, i)

    def _plain_pivots(self, matrix: np.ndarray, order: list[int]) -> Iterator[tuple[int, int]]:
        free = np.arange(len(matrix)) < len(self.rows)
        # what stands on a circle follows its centre, even where that is the place of a later leaf
        centres = [(v, False) for v in sorted(order, key=lambda v: v not in self.on_circles) if v < self.extra and v % 6 > 2]
        # how far apart flush parts are follows from their sizes, if it does so by halves
        spacings = [(v, True) for v in order if self._is_spacing(v)]
        rest = [(v, False) for v in order if v >= self.extra or v % 6 < 3]
        for v, by_halves in [*centres, *spacings, *rest] if self.rows else []:
            column = np.where(free, np.abs(matrix[:, v]), 0.0)
            pivot = int(column.argmax())
            if column[pivot] > ZERO and not (by_halves and not all(map(_is_plain, matrix[pivot] / matrix[pivot, v]))):
                yield v, pivot
                free[pivot] = False

    def _is_spacing(self, v: int) -> bool:
        return v >= self.extra and self.extras[v - self.extra][1].startswith("spacing")

    def is_step(self, v: int) -> bool:
        """Whether a further variable is by how much one corner or level of a drawing is off another."""
        return "step" in self.extras[v - self.extra][1].split("_")

    def is_origin(self, v: int) -> bool:
        """Whether the variable is 0, and a coordinate or the radius of a cone's point: no name is needed for that."""
        is_place = v < self.extra or self.extras[v - self.extra][1] in ("center_x", "center_y", "center_z")
        return is_place and abs(self.start[v]) <= ZERO * self.length

    def _order(self) -> list[int]:
        """Variables in the order in which they are eliminated: what a person would measure last."""
        # of diameters that are equal the first stays, and of spacings of holes
        extra = sorted(range(self.extra, len(self.start)), key=lambda v: (self.rank(v), -v if self._is_shared(v) else v))
        return sorted([*sorted(range(self.extra), key=lambda v: (v % 6 < 3, -v)), *extra], key=lambda v: v not in self.followers)

    def _is_shared(self, v: int) -> bool:
        """Whether a further variable is one that later leaves are equal to."""
        return self.rank(v) == _RANKS["diameter"] or self.extras[v - self.extra][1].startswith("hole_spacing")

    def leaf_of(self, v: int) -> int:
        """The leaf that a variable belongs to."""
        return v // 6 if v < self.extra else self.extras[v - self.extra][0]

    def rank(self, v: int) -> int:
        """How late a variable is eliminated."""
        at_once = v < self.extra or v in self.on_rims
        return 0 if at_once else _RANKS.get(self.extras[v - self.extra][1].split("_")[-1], 1)

    def new(self, leaf: int, word: str, value: float) -> int:
        """A further variable, named after a leaf and a word."""
        self.start.append(value)
        self.extras.append((leaf, word))
        return len(self.start) - 1

    def new_angle(self, leaf: int, word: str, value: float) -> int:
        """A further variable in degrees."""
        self.angles.add(v := self.new(leaf, word, value))
        return v

    def _add_seat(self, leaf: int, row: dict[int, float], word: str) -> None:
        """An end of a leaf stays as far from a face as it is: `row` is how far."""
        if word:
            away = sum(factor * self.start[v] for v, factor in row.items())
            row[self._share_end(leaf, word, abs(away))] = -math.copysign(1.0, away)
        self.ties.append((leaf, row))

    def _measure_turned_cuts(self, found: Sequence[Seat], parts: Sequence[Primitive], sign: Sequence[int]) -> None:
        """Turned cuts that begin in the air are as deep as they go from where that ends."""
        ends = Counter(seat.own.leaf for seat in found)
        for own, face, word in found:
            height = self.heights.get(own.leaf)
            beyond = own.side * (place_of(own, parts) - place_of(face, parts))
            if height is not None and sign[own.leaf] < 0 and not word and ends[own.leaf] == 1 and beyond > ZERO * self.length:
                self.rows.append({height: 1.0, self.new(own.leaf, "depth", self.start[height] - beyond): -1.0})

    def _share_end(self, leaf: int, word: str, value: float) -> int:
        """The variable that says how deep or how high a leaf is, that of a twin that is so, too."""
        named = ((v, other) for v, (other, its) in enumerate(self.extras, self.extra) if its == word)
        twin = self.twins.get(leaf)
        alike = (v for v, other in named if twin is not None and self.twins.get(other) == twin)
        same = next((v for v in alike if abs(self.start[v] - value) <= EXACT * self.length), None)
        return self.new(leaf, word, value) if same is None else same

    def _add_places(self, found: Iterable[Tie]) -> None:
        """Where features lie from their datums; ties of one key share a name."""
        shared: dict[tuple[str, tuple[int, float]], int] = {}
        sizing: list[tuple[int, dict[int, float]]] = []
        for tie in found:
            row = self._datum(tie.own, 1.0)
            for v, factor in ({} if tie.datum is None else self._datum(tie.datum, -1.0)).items():
                row[v] = row.get(v, 0.0) + factor
            if tie.word:
                key = (tie.word, tie.key) if tie.key is not None else None
                v = shared.get(key) if key is not None else None
                v = self.new(tie.named, tie.word, abs(tie.value)) if v is None else v
                if key is not None:
                    shared[key] = v
                row[v] = -math.copysign(1.0, tie.value)
            if tie.sizes:
                sizing.append((tie.own.leaf, row))
            else:
                self.places.append((tie.own.leaf, row, tie.at_corner))
        self.ties = sizing + self.ties  # a shell's floor before the depth of its pocket

    def _datum(self, datum: Datum, sign: float) -> dict[int, float]:
        """The position of what a distance is measured from, times `sign`."""
        return {6 * datum.leaf + 3 + datum.axis: sign} if datum.end is None else self.place_of_end(datum.end, sign)

    def _ground_leaf(self, first: Primitive, numbers: Lowered) -> Iterator[dict[int, float]]:
        """Where the first leaf stands on a plane through the origin: it keeps standing there."""
        for end in (e for e in ends_of(0, first, numbers) if e.column >= 0):
            half = first.size[end.column] / 2
            if abs(first.center[end.axis] + end.side * half) <= ZERO * half:
                yield self.place_of_end(end, 1.0)
        yield from (dict(w.row) for w in self.walls if w.leaf == 0 and w.span is None and abs(w.place) <= ZERO * self.length)

    def _hold_places(self, parts: Sequence[Primitive], numbers: Lowered) -> None:
        """The first leaf stays where it is, as far as nothing says where that is: the others are placed from it. What it stands on stays,
        and across that its middle. Where the world's origin lies beside the part nothing is measured from it, and all others stay."""
        boxes = np.array([reach_of(p, numbers.rotations[i]) for i, p in enumerate(parts)])
        low, high = boxes[:, 0].min(0), boxes[:, 1].max(0)
        beside = [a for a in range(3) if low[a] > ZERO * self.length or high[a] < -ZERO * self.length]
        bottoms = [e for e in ends_of(0, parts[0], numbers) if (e.axis, e.side) == (UP, -1)]
        held = [self.place_of_end(e) for e in bottoms] or [{3 + UP: 1.0}]
        rows = [*held, *({3 + a: 1.0} for a in range(3) if a != UP)]
        self.places += [(0, row, False) for row in rows if not all(self.is_origin(v) for v in row if v in (3, 4, 5))]
        held = (6 * leaf + 3 + a for leaf in range(1, len(parts)) for a in beside)
        self.places += [(v // 6, {v: 1.0}, False) for v in held if v not in self.on_circles]

    def place_of_end(self, end: End, sign: float = 1.0) -> dict[int, float]:
        """The position of a face, times `sign`."""
        across = 6 * end.leaf + end.column if end.column >= 0 else self.heights.get(end.leaf)
        return {6 * end.leaf + 3 + end.axis: sign} | ({} if across is None else {across: sign * end.side / 2})

    def _add_row(self, c: Constraint, numbers: Lowered) -> None:
        """Equal steps along each coordinate in which they step."""
        members = [ref.leaf for ref in c.of]
        for axis in _step_axes(members[0], numbers):
            at = [6 * leaf + 3 + axis for leaf in members]
            step = (self.start[at[-1]] - self.start[at[0]]) / (len(at) - 1)
            moves = abs(step) > ZERO * self.length
            spacing = {self.new(members[0], "spacing", step): 1.0} if moves else {}
            for number, v in enumerate(at[1:], start=1):
                self.rows.append({v: 1.0, at[0]: -1.0} | {s: -float(number) for s in spacing})

    def _add_opposite(self, c: Constraint, numbers: Lowered) -> None:
        """Two members on a circle have its centre midway."""
        assert c.about is not None
        axis = world_axis(numbers.rotations[c.about.leaf][:, c.about.axis])
        (a, b), hub = (ref.leaf for ref in c.of), c.about.leaf
        self.rows += [{6 * a + 3 + i: 0.5, 6 * b + 3 + i: 0.5, 6 * hub + 3 + i: -1.0} for i in range(3) if i != axis]

    def _add_circle(self, c: Constraint, numbers: Lowered) -> None:
        """Members at half a diameter from the middle, at angles that are numbers."""
        assert c.about is not None
        members = [ref.leaf for ref in c.of]
        axis = world_axis(numbers.rotations[c.about.leaf][:, c.about.axis])
        assert axis is not None
        plane = [(axis + 1) % 3, (axis + 2) % 3]
        points = numbers.centers[members][:, plane]
        hub = c.about.leaf if c.about.leaf not in members else None
        middle = points.mean(0) if hub is None else numbers.centers[hub][plane]
        offsets = points - middle
        diameter = self.new(members[0], "circle", 2 * float(np.linalg.norm(offsets, axis=1).mean()))
        if hub is None:
            centers = [self.new(members[0], f"center_{'xyz'[a]}", float(m)) for a, m in zip(plane, middle, strict=True)]
        else:
            centers = [6 * hub + 3 + a for a in plane]
        for leaf, offset in zip(members, offsets / self.start[diameter], strict=True):
            for a, center, share in zip(plane, centers, offset, strict=True):
                part = {diameter: -float(share)} if abs(share) > ZERO else {}
                self.on_circles.add(6 * leaf + 3 + a)
                self.rows.append({6 * leaf + 3 + a: 1.0, center: -1.0} | part)


def _without_farther(found: Iterable[Seat], at_walls: Iterable[tuple[End, FlatWall, str]], parts: Sequence[Primitive]) -> Iterator[Seat]:
    """The seats but for those of ends that leave by a wall further on: a cut through a part and a higher one goes through both."""
    last = {(own.leaf, own.axis, own.side): wall for own, wall, word in at_walls if not word}
    for seat in found:
        wall = None if seat.word else last.get((seat.own.leaf, seat.own.axis, seat.own.side))
        if wall is None or wall.side * wall.place <= seat.own.side * place_of(seat.face, parts):
            yield seat


def _simple(row: dict[int, float]) -> dict[int, float] | None:
    """The equation in wholes and halves, or None where it has none."""
    largest = max(map(abs, row.values()))
    halves = {v: round(2 * c / largest) / 2 for v, c in row.items()}
    return {v: c for v, c in halves.items() if c} if all(abs(c - row[v] / largest) <= HALVES for v, c in halves.items()) else None


def _is_plain(coefficient: float) -> bool:
    """Whether it is a whole number of halves."""
    return abs(2 * coefficient - round(2 * coefficient)) <= ZERO


def vector(parts: Sequence[Primitive]) -> np.ndarray:
    """The variables [6 k] of leaves: sizes padded with zeros, then the centre."""
    return np.array([v for p in parts for v in (*p.size, *(0.0,) * (3 - len(p.size)), *p.center)])


def without_loose(
    program: Program, constraints: Sequence[Constraint], delivered: Program, folded: Folded | None = None
) -> tuple[Constraint, ...]:
    """The constraints that hold whatever value a name gets. The others say of numbers as they are what the next edit makes untrue; one
    that binds directions alone stays, since edits turn nothing."""
    numbers = lower(program)
    if not constraints or len(numbers.kinds) > MOST_NAMED:
        return ()
    if own := find_own_directions(delivered):
        turned = own.turn_program(delivered)
        held = own.keep_constraints(constraints, turned)
        kept = {id(c) for c in without_loose(own.turn_program(program), held, turned, folded and own.turn_folded(folded))}
        return tuple(c for c in constraints if id(c) in kept or c.kind in ("parallel", "perpendicular"))
    system = LinearSystem.of(program, constraints, delivered, folded)
    matrix, owner = world_rows(constraints, numbers)
    follows = np.zeros((6 * len(numbers.kinds), len(system.start)))
    follows[np.arange(len(follows)), np.arange(len(follows))] = 1.0
    for v, row in system.solve().items():
        if v < len(follows):
            follows[v] = 0.0
            follows[v, list(row)] = list(row.values())
    slope = np.abs(matrix @ follows).max(1, initial=0.0)
    loose = set(owner[slope > SLOPE * np.abs(matrix).max(1, initial=0.0)].tolist())
    return tuple(c for number, c in enumerate(constraints) if number not in loose)


def _linear(constraints: Sequence[Constraint], numbers: Lowered) -> Iterator[dict[int, float]]:
    """The rows of constraints with respect to sizes and centres; those of directions alone are empty and left out."""
    for row in world_rows([c for c in constraints if c.kind not in ("parallel", "perpendicular")], numbers)[0]:
        found = {int(v): float(row[v]) for v in np.flatnonzero(np.abs(row) > ZERO)}
        if found:
            yield found


def world_rows(constraints: Sequence[Constraint], numbers: Lowered) -> tuple[np.ndarray, np.ndarray]:
    """The rows [m, 6 k] of constraints with respect to sizes and centres in the world, and the constraint [m] that each is of."""
    k = len(numbers.kinds)
    rows = rows_of(constraints, numbers)
    local = rows.jacobian.reshape(-1, k, 9)
    world = np.concatenate([local[:, :, :3], np.einsum("mki,kji->mkj", local[:, :, 3:6], numbers.rotations)], axis=2)
    return world.reshape(-1, 6 * k), rows.owner


def _step_axes(leaf: int, numbers: Lowered) -> list[int]:
    """The world's axes along which the steps of a row are equal: not along the axis of a hole or shaft."""
    own = world_axis(numbers.rotations[leaf][:, 2]) if _is_round(leaf, numbers) else None
    return [a for a in range(3) if a != own]


def _is_slanted(c: Constraint, numbers: Lowered) -> bool:
    """Whether a pattern lies across a direction that is none of the world's axes."""
    if c.about is not None:
        return world_axis(numbers.rotations[c.about.leaf][:, c.about.axis]) is None
    first = c.of[0].leaf
    return _is_round(first, numbers) and world_axis(numbers.rotations[first][:, 2]) is None


def _is_round(leaf: int, numbers: Lowered) -> bool:
    return AXES_OF[KINDS[numbers.kinds[leaf]]] == ("z",)
