"""Numbers of a program as named parameters and expressions of them, so that editing one name moves all that follows.

While directions stay, constraints are linear in sizes and centres. `elimination` writes as many of these as it can in terms of the others;
those that others need get names. What no constraint ties stays a number.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

from imdim.deadline import NEVER, Deadline
from imdim.export.collisions import solve_apart
from imdim.export.drawn_vertex import BendRadius, DrawnEllipse, DrawnRing, DrawnVertex, map_ring, numbers_of
from imdim.export.elimination import LinearSystem, vector
from imdim.export.feature_names import label_features
from imdim.export.feature_notes import Notes, feature_notes
from imdim.export.feature_roles import MOST_NAMED, size_words
from imdim.export.hole_names import BoreWords
from imdim.export.loops import Loop, loop_of
from imdim.export.numbers import Expression, Rounding, Term, constants, simple_fraction
from imdim.export.outline_rows import Sum
from imdim.export.outline_walls import EXACT
from imdim.export.own_directions import OwnPlaces, find_own_directions
from imdim.program.constraints import Constraint
from imdim.program.cost import count
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Loop as OutlineLoop
from imdim.program.repeats import Folded, Repeat, repeats
from imdim.program.roles import join_words, labels, signs, size_word, unique
from imdim.program.tree import ANGLES, FULL_TURN, SIZE_NAMES, Primitive, Program, leaves, longest

ZERO = 1e-9
ROUND = 1e-4  # degrees, by which a turn may miss a quarter
COUNTED = "sides"  # the word in the names of counts that are among the lengths
FAINT = 1e-7  # a coefficient whose term files do not keep


DrawnLoop = DrawnRing[Expression]


@dataclass(frozen=True)
class Parameters:
    """`values` of the names in the order of the text; for each leaf the expressions of its sizes, of its centre, and of its loops.

    `counts` are the names that say how often parts repeat, `loops` the repeats in the order of `repeats`. The names in `angles` are
    degrees, all others lengths. `notes` are comments above leaves; `labels` what the leaves are called, if
    that is known. `own` has the places along the program's own directions, None where these are the world's.
    """

    values: dict[str, float] = field(default_factory=dict)
    sizes: tuple[tuple[Expression, ...], ...] = ()
    centers: tuple[tuple[Expression, ...], ...] = ()
    counts: dict[str, int] = field(default_factory=dict)
    loops: tuple[Loop, ...] = ()
    angles: frozenset[str] = frozenset()
    outlines: tuple[tuple[DrawnLoop, ...], ...] = ()
    notes: Notes = field(default_factory=dict)
    labels: tuple[str, ...] = ()
    own: OwnPlaces | None = None

    @staticmethod
    def none(program: Program, folded: Folded | None = None) -> Parameters:
        """No names but those of counts: each number stands for itself."""
        parts = list(leaves(program))
        sizes, centers = tuple(constants(p.size) for p in parts), tuple(constants(p.center) for p in parts)
        bare = Parameters({}, sizes, centers, outlines=tuple(map(_constant_loops, parts)))
        if folded is None:
            return bare
        label = labels(program, (), folded)
        return add_loops(replace(bare, labels=tuple(label)), folded, label, longest(parts))[0]

    def free_numbers(self, length: float) -> list[int]:
        """For each leaf with an outline, how many numbers follow no name, of its vertices and centres, radii, and angles of arcs but for
        quarters of a turn. What is 0 to the slack of outlines in a part of that `length` needs none."""
        return [sum(_count_free(loop, EXACT * length) for loop in loops) for loops in self.outlines if loops]

    def head(self, number: Callable[[float], str], unit: str = "", end: str = "", counted: bool = True) -> list[str]:
        """``name = value`` for each name, `number` writing lengths, those of counts only where these are `counted`; an empty line below."""
        texts = {name: Rounding.angle(value) if name in self.angles else number(value) + unit for name, value in self.values.items()}
        lines = [f"{name} = {text}{end}" for name, text in texts.items()]
        lines += [f"{name} = {count}{end}" for name, count in self.counts.items()] if counted else []
        return [*lines, ""] if lines else []


def _count_free(loop: DrawnLoop, zero: float) -> int:
    numbers, turns = list(numbers_of(loop)), list[float]()
    if not isinstance(loop, tuple):
        numbers.pop()  # its angle is a name, or one that everyone draws
    else:
        turns = [math.degrees(4 * math.atan(v.bulge)) for v in loop if isinstance(v.bulge, int | float)]
    return sum(not e.terms and abs(e.constant) > zero for e in numbers) + sum(abs(math.remainder(t, 90)) > ROUND for t in turns)


def parametrise(
    program: Program,
    constraints: Sequence[Constraint],
    delivered: Program,
    folded: Folded | None = None,
    values: Mapping[str, float] | None = None,
    deadline: Deadline = NEVER,
) -> Parameters:
    """Names and expressions for the numbers of `delivered`, from constraints that hold for `program`; places are named along the part's own
    directions.

    Both have the same leaves but for what `overshoot` and rounding changed, which becomes a constant of the expression. `folded`, which
    `delivered` is the expansion of, adds what its repeats say, and their counts. Names in `values` get these instead of those of `program`.
    A program of more than MOST_NAMED primitives, copies counted, has names for its counts alone. Past the `deadline` no more faces are kept
    apart that a change of a name would move past each other.
    """
    if count(program).primitives > MOST_NAMED:
        return Parameters.none(delivered, folded)
    label = label_features(delivered, constraints, folded)
    named = _parametrise(program, constraints, delivered, folded, values or {}, label, deadline)
    return replace(named, notes=feature_notes(delivered, label, folded), labels=label)


def _parametrise(
    program: Program,
    constraints: Sequence[Constraint],
    delivered: Program,
    folded: Folded | None,
    values: Mapping[str, float],
    label: Sequence[str],
    deadline: Deadline,
) -> Parameters:
    if own := find_own_directions(delivered):
        turned = own.turn_program(delivered)
        held = own.keep_constraints(constraints, turned)
        named = _parametrise(own.turn_program(program), held, turned, folded and own.turn_folded(folded), values, label, deadline)
        centers, loops = tuple(map(own.in_world, named.centers)), tuple(map(own.turn_loop, named.loops))
        return replace(named, centers=centers, loops=loops, own=OwnPlaces(own, named.centers, named.loops))
    fixed: set[int] = set()
    while True:
        system = LinearSystem.of(program, constraints, delivered, folded, fixed)
        named = _shift_constants(_share_corners(_express_numbers(system, program, label, delivered, deadline)), values)
        if folded is None:
            return named
        looped, broken = add_loops(named, folded, label, longest(leaves(delivered)))
        if not broken:
            return looped
        if broken <= fixed:
            return Parameters.none(delivered, folded)
        fixed |= broken


def _share_corners(named: Parameters) -> Parameters:
    """The same numbers; where both ends of an arc are written at one place, that its corner or its centre is, by the same expressions."""

    def value(e: Expression) -> float:
        return e.constant + sum(float(t.coefficient) * named.values[t.name] for t in e.terms)

    def shared(one: Expression, two: Expression) -> Expression:
        # a name of this place alone says less than a sum of others
        return two if len(one.terms) == 1 and not one.constant else one

    def corners(loop: DrawnLoop) -> DrawnLoop:
        if not isinstance(loop, tuple):
            return loop
        out = list(loop)
        for i, v in enumerate(loop):
            j = (i + 1) % len(loop)
            near = ZERO * max(map(abs, named.values.values()), default=1.0)
            apart = max(abs(value(v.x) - value(out[j].x)), abs(value(v.y) - value(out[j].y)))
            if isinstance(v.bulge, BendRadius) and apart < near and (v.x, v.y) != (out[j].x, out[j].y):
                x, y = shared(out[i].x, out[j].x), shared(out[i].y, out[j].y)
                out[i], out[j] = replace(out[i], x=x, y=y), replace(out[j], x=x, y=y)
        return tuple(out)

    outlines = tuple(tuple(corners(loop) for loop in loops) for loops in named.outlines)
    used = {t.name for rows in (named.sizes, named.centers) for row in rows for e in row for t in e.terms}
    used |= {t.name for loops in outlines for loop in loops for e in numbers_of(loop) for t in e.terms}
    return replace(named, outlines=outlines, values={name: v for name, v in named.values.items() if name in used})


def _shift_constants(named: Parameters, values: Mapping[str, float]) -> Parameters:
    """The same numbers with names at other values: constants make up for it."""
    gone = {name: value - values[name] for name, value in named.values.items() if name in values}

    def shifted(e: Expression) -> Expression:
        constant = e.constant + sum(float(t.coefficient) * gone.get(t.name, 0.0) for t in e.terms)
        scale = max(map(abs, named.values.values()), default=1.0)
        return Expression(e.terms, 0.0 if e.terms and abs(constant) < ZERO * scale else constant)

    sizes, centers = (tuple(tuple(map(shifted, row)) for row in rows) for rows in (named.sizes, named.centers))
    outlines = tuple(tuple(map_ring(loop, shifted) for loop in loops) for loops in named.outlines)
    values = {**named.values, **{name: values[name] for name in gone}}
    return replace(named, values=values, sizes=sizes, centers=centers, outlines=outlines)


def add_loops(named: Parameters, folded: Folded, label: Sequence[str], length: float) -> tuple[Parameters, set[int]]:
    """With loops, and the numbers of the repeats that the expressions do not repeat in, which have none."""
    taken, broken = {*RESERVED, *named.values}, set[int]()
    counts: dict[str, int] = {}
    loops: list[Loop] = []
    for number, (first, repeat) in enumerate(repeats(folded)):
        loop = loop_of(repeat, first, named.sizes, named.centers, length)
        if loop is None:
            broken.add(number)
            continue
        known = (o for o in loops if replace(o, counts=(), part="") == loop and _counts(o, counts) == repeat.counts)
        same = next(known, None)
        names = same.counts if same else tuple(unique(f"{label[first]}_{word}", taken) for word in _count_words(repeat))
        counts |= dict(zip(names, repeat.counts, strict=False))
        loops.append(replace(loop, counts=names, part=unique(label[first], taken)))
    return replace(named, counts=counts, loops=tuple(loops)), broken


def _count_words(repeat: Repeat) -> tuple[str, ...]:
    if repeat.kind != "grid":
        return () if repeat.kind == "mirror" else ("count",)
    along = [[a for a in range(3) if step[a]] for step in repeat.steps]
    return tuple(f"count_{'xyz'[a[0]]}" for a in along) if all(len(a) == 1 for a in along) else ("rows", "columns")


def _counts(loop: Loop, counts: dict[str, int]) -> tuple[int, ...]:
    return tuple(counts[name] for name in loop.counts) or (2,)


def _express_numbers(system: LinearSystem, program: Program, label: Sequence[str], delivered: Program, deadline: Deadline) -> Parameters:
    found, unseen = solve_apart(system, delivered, deadline)
    solved = {v: _terms(row, system, unseen) for v, row in found.items()} | {v: [] for v in unseen}
    names = _names(program, label, system, solved, BoreWords.of(delivered), size_words(delivered))
    after = vector(list(leaves(delivered)))
    built = [_expression(v, float(value), system, solved, names) for v, value in enumerate(after)]
    parts = list(leaves(delivered))
    outlines = [_outline(i, p, system, solved, names) for i, p in enumerate(parts)]
    return Parameters(
        {name: float(system.start[v]) for v, name in names.items()},
        tuple(tuple(built[6 * i + c] for c in range(len(p.size))) for i, p in enumerate(parts)),
        tuple(tuple(built[6 * i + 3 + c] for c in range(3)) for i in range(len(parts))),
        angles=frozenset(name for v, name in names.items() if v in system.angles or _is_turn(v, system, parts)),
        outlines=tuple(outlines),
    )


def _is_turn(v: int, system: LinearSystem, parts: Sequence[Primitive]) -> bool:
    """Whether a variable is the angle by which an outline is turned, or its walls lean."""
    names = SIZE_NAMES[parts[v // 6].kind] if v < system.extra else ()
    return v % 6 < len(names) and names[v % 6] in ANGLES


_Solved = dict[int, list[tuple[int, Fraction | float]]]


def _terms(row: dict[int, float], system: LinearSystem, unseen: Collection[int]) -> list[tuple[int, Fraction | float]]:
    """The coefficients, as fractions where a person would write these; a place that is 0 is left out, and what is `unseen`."""
    # places first, sizes after them, spacings and diameters last
    seen = (v for v in row if v not in unseen and not system.is_origin(v) and abs(row[v]) >= FAINT)
    kept = sorted(seen, key=lambda v: (v >= system.extra, v % 6 < 3, v))
    return [(v, simple_fraction(row[v])) for v in kept]


def _expression(v: int, value: float, system: LinearSystem, solved: _Solved, names: dict[int, str]) -> Expression:
    return _as_expression(solved.get(v, [(v, Fraction(1))] if v in names else []), value, system, names)


def _as_expression(terms: Sequence[tuple[int, Fraction | float]], value: float, system: LinearSystem, names: dict[int, str]) -> Expression:
    """A sum of terms, with a constant that makes up what it lacks of the value."""
    known = sum(float(c) * float(system.start[w]) for w, c in terms)
    constant = value - known
    tiny = ZERO * max(abs(value), system.length)
    return Expression(tuple(Term(names[w], c) for w, c in terms), 0.0 if terms and abs(constant) < 10 * tiny else constant)


def _outline(leaf: int, p: Primitive, system: LinearSystem, solved: _Solved, names: dict[int, str]) -> tuple[DrawnLoop, ...]:
    """The loops of a leaf, each coordinate an expression."""
    if p.outline is None:
        return ()

    def expression(number: Sum) -> Expression:
        total: dict[int, Fraction | float] = {}
        for v, factor in number.row.items():
            for w, c in solved.get(v, [(v, Fraction(1))] if v in names else []):
                total[w] = total.get(w, Fraction(0)) + c * simple_fraction(factor)
        terms = sorted(((w, c) for w, c in total.items() if c), key=lambda t: (system.rank(t[0]), t[0]))
        return _as_expression(terms, number.value, system, names)

    return tuple(map_ring(loop, expression) for loop in system.drawn[leaf])


def _constant_loops(p: Primitive) -> tuple[DrawnLoop, ...]:
    loops = () if p.outline is None else p.outline.loops
    return tuple(map(constant_loop, loops))


def constant_loop(loop: OutlineLoop) -> DrawnLoop:
    """A loop whose numbers follow no name."""
    if isinstance(loop, Ellipse):
        rx, ry, x, y, angle = constants((loop.rx, loop.ry, loop.x, loop.y, loop.angle))
        return DrawnEllipse(rx, ry, x, y, angle)
    return tuple(DrawnVertex(Expression((), x), Expression((), y), b) for x, y, b in loop)


def _names(
    program: Program, label: Sequence[str], system: LinearSystem, solved: _Solved, bores: BoreWords, said: Mapping[tuple[int, int], str]
) -> dict[int, str]:
    """Names of all sizes that follow from nothing, and of the places that others need; in the order of the text, leaf by leaf. `said` has
    words for some sizes."""
    parts, sign = list(leaves(program)), signs(program)
    # a full turn and the point of a cone are no sizes that one would measure
    measured = [(6 * i + c, value, p.kind) for i, p in enumerate(parts) for c, value in enumerate(p.size)]
    sizes = [v for v, value, kind in measured if value and (kind != "revolve" or value < FULL_TURN)]
    needed = {w for row in solved.values() for w, _ in row} | {v for v in sizes if v not in solved}
    drawn = {v for loops in system.drawn.values() for loop in loops for number in numbers_of(loop) for v in number.row}
    needed |= drawn - solved.keys()
    taken: set[str] = set(RESERVED)
    ordered = sorted(needed, key=lambda v: (system.leaf_of(v), not _is_across(v, system, parts), v))
    return {v: unique(_name(v, system, parts, label, sign, bores, said), taken) for v in ordered}


def _is_across(v: int, system: LinearSystem, parts: Sequence[Primitive]) -> bool:
    """Whether a variable is a diameter of a cylinder or cone, which stands where the radius would."""
    return (
        v >= system.extra
        and parts[system.leaf_of(v)].kind in ("cylinder", "cone")
        and system.extras[v - system.extra][1].endswith("diameter")
    )


def is_count(name: str) -> bool:
    """Whether a named value is a whole number: the sides of a polygon."""
    return COUNTED in name.split("_")


# Words that mean something else in OpenSCAD or in the Python script.
RESERVED = (
    "part",
    "edges",
    "blended",
    "fillet",
    "chamfer",
    "scale",
    "export_step",
    "ring",
    "ngon",
    "across_flats",
    "ellipse",
    "reach",
    "bend",
    "outline",
    "curves",
    "face",
    "extruded",
    "drafted",
    "turned",
)


def _name(
    v: int,
    system: LinearSystem,
    parts: Sequence[Primitive],
    label: Sequence[str],
    sign: Sequence[int],
    bores: BoreWords,
    said: Mapping[tuple[int, int], str],
) -> str:
    if v >= system.extra:
        leaf, word = system.extras[v - system.extra]
        if word == "circle" and "hole" in label[leaf]:
            return "bolt_circle"
        return join_words(label[leaf], bores.word(leaf, word, float(system.start[v]), label[leaf]))
    leaf, column = divmod(v, 6)
    word = said.get((leaf, column)) or (size_word(parts[leaf], column, sign[leaf], label[leaf]) if column < 3 else "xyz"[column - 3])
    return join_words(label[leaf], word)
