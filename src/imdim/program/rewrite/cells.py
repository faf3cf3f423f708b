"""Walls between pockets, and bars of a lattice, as the pockets and windows that they leave.

A search that counts features fills two long pockets with a dividing wall across both, and builds a grille of crossing bars. To whom it is a
part, it is a tray with a grid of pockets, or a plate with a grid of windows: one feature and its repeats. Both are areas of a plane: what
is swept straight between the same two levels is united, or cut from each other, as its outlines are.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, groupby, product

from imdim.program.motions import euler
from imdim.program.outline import Loop, Outline, circle, circle_of, regions
from imdim.program.plain_outlines import to_simple
from imdim.program.rewrite.containment import axes, disjoint, reach
from imdim.program.rewrite.containment_rules import parts
from imdim.program.rewrite.separation import separate_loops
from imdim.program.sequence import SignedSequence, Step, to_program
from imdim.program.tree import FLAT_ENDS, PRISMS, Combine, Op, Primitive, Program, Vec3, leaves, longest
from imdim.program.vectors import along, dot, plus, times

Frame = tuple[Vec3, Vec3, Vec3]
Steps = SignedSequence[Program]
DrawArea = Callable[[Sequence[Outline], Sequence[Outline]], Outline | None]

PARALLEL = 1e-9  # of a cosine
SAME_LEVEL = 1e-5  # of the longest length, within which two levels are one
FEWEST_BARS = 4
MOST_CURVES = 12  # of an outline that is parted, or parts one: what is drawn of more is no cell
MOST_LEAVES = 100  # of a program; pairs are looked at, and what is longer is read by nobody


@dataclass(frozen=True)
class Prism:
    """A leaf as its outline in the plane of a frame's first two axes, from `low` to `high` along the third."""

    outline: Outline
    low: float
    high: float


def propose_cells(program: Program, draw: DrawArea) -> Iterator[Program]:
    """Programs that are meant as the same solid, with cavities in place of the walls between them, and with plates that have windows in
    place of bars.

    `draw` gives the area that some outlines cover and others don't, None where there is none. Whoever takes a proposal has to compare the
    solids.
    """
    terms = _terms(program)
    if len(terms) == 1 or sum(1 for _ in leaves(program)) > MOST_LEAVES:
        return
    slack = SAME_LEVEL * longest(leaves(program))
    for op in ("difference", "union"):
        yield from map(to_program, _crossings(terms, op, slack, draw))
    yield from map(to_program, _plates(terms, slack, draw))
    yield from map(to_program, _drawn_cells(terms, slack))
    for i, (op, part) in enumerate(terms):
        for proposal in propose_cells(part, draw) if isinstance(part, Combine) else ():
            yield to_program((*terms[:i], Step(op, proposal), *terms[i + 1 :]))


def end_cuts_with_the_solid(program: Program) -> Program:
    """The same solid, whose cutters end where the solid does, for how far they stand out says nothing: else equal ones may look unequal."""
    terms = _terms(program)
    solid = [step.term for step in terms if step.positive]
    ended = (_end(part, solid) if op == "difference" and isinstance(part, Primitive) else part for op, part in terms)
    return to_program(tuple(Step(op, part) for (op, _), part in zip(terms, ended, strict=True)))


def count_runs(program: Program) -> int:
    """How often what is united with a program's first part turns to what is cut from it, or back, and the same of its parts: the order of
    runs has to be read."""
    todo, count = [program], 0
    while todo:
        first, *others = _terms(todo.pop())
        count += sum(1 for _ in groupby(op for op, _ in others))
        todo += [part for _, part in (first, *others) if isinstance(part, Combine) and part.op != "intersection"]
    return count


def _end(leaf: Primitive, solid: Sequence[Program]) -> Primitive:
    """A box or prism no longer than some programs reach."""
    size, center, frame = list(leaf.size), leaf.center, axes(leaf)
    for k, at in FLAT_ENDS[leaf.kind].items() if leaf.kind in PRISMS else ():
        middle, (low, high) = dot(center, frame[k]), _span(solid, frame[k])
        start, end = max(middle - size[at] / 2, low), min(middle + size[at] / 2, high)
        if start < end and end - start < size[at]:
            size[at], center = end - start, along(center, frame[k], (start + end) / 2 - middle)
    return replace(leaf, size=tuple(size), center=center)


def prism_along(leaf: Primitive, frame: Frame) -> Prism | None:
    """The leaf as a prism along the third axis of a frame; None where it is none, or has an ellipse."""
    own = axes(leaf)
    way = next((k for k in (FLAT_ENDS[leaf.kind] if leaf.kind in PRISMS else ()) if abs(dot(own[k], frame[2])) > 1 - PARALLEL), None)
    if way is None:
        return None
    at, half = dot(leaf.center, frame[2]), leaf.size[way if leaf.kind == "box" else -1] / 2
    loops = _project(leaf, own, way, frame)
    return None if loops is None else Prism(Outline(loops), at - half, at + half)


def _project(leaf: Primitive, own: Frame, way: int, frame: Frame) -> tuple[Loop, ...] | None:
    """The loops of a leaf's section across its axis `way` in a frame's plane."""
    x, y = dot(leaf.center, frame[0]), dot(leaf.center, frame[1])
    if leaf.kind == "cylinder":
        return (circle(leaf.size[0], x, y),)
    first, second = own[(way + 1) % 3], own[(way + 2) % 3]
    (ax, ay), (bx, by) = ((dot(axis, frame[0]), dot(axis, frame[1])) for axis in (first, second))
    if leaf.kind == "box":
        s, t = leaf.size[(way + 1) % 3] / 2, leaf.size[(way + 2) % 3] / 2
        corners = ((-s, -t), (s, -t), (s, t), (-s, t))
        return (tuple((x + u * ax + v * bx, y + u * ay + v * by, 0.0) for u, v in corners),)
    assert leaf.outline is not None
    sense = 1.0 if dot(own[2], frame[2]) > 0 else -1.0  # seen from behind, arcs turn the other way
    rings = leaf.outline.rings
    if len(rings) < len(leaf.outline.loops):
        return None
    return tuple(tuple((x + u * ax + v * bx, y + u * ay + v * by, sense * b) for u, v, b in ring) for ring in rings)


# --- walls that cross pockets ------------------------------------------------------------------------------------------


def _crossings(terms: Steps, op: Op, slack: float, draw: DrawArea) -> Iterator[Steps]:
    """The terms with cavities in place of each group of cutters and the walls that cross them later; of what is united blocks in place of
    bars and the slots between them."""
    crossed = dict(_crossed(terms, op, slack))
    whole = {j for _, walls in crossed.values() for j in walls}
    for i, (side, part) in enumerate(terms):  # a wall that something else needs stays
        if side == op and i not in crossed:
            whole -= {j for j in whole if j > i and _meet(part, terms[j].term)}
    pieces: dict[int, tuple[list[Program], list[int]]] = {}
    solid = [step.term for step in terms if step.positive]
    for i, (frame, found) in crossed.items():
        walls = [j for j in found if j in whole]
        cells = _part(_leaf(terms[i]), frame, [_leaf(terms[j]) for j in walls], solid, slack, draw) if walls else None
        if cells:
            pieces[i] = (cells, walls)
    for targets in _joined({i: walls for i, (_, walls) in pieces.items()}):
        gone = {j for i in targets for j in pieces[i][1]}
        if any(len(pieces[i][0]) > 1 for i in targets):
            yield tuple(
                Step(side, piece)
                for i, (side, part) in enumerate(terms)
                if i not in gone
                for piece in (pieces[i][0] if i in targets else [part])
            )


def _crossed(terms: Steps, op: Op, slack: float) -> Iterator[tuple[int, tuple[Frame, list[int]]]]:
    """Leaves of one kind of term, with the frame along whose third axis most of the later ones of the other kind that meet them go through
    them, and these."""
    solid = [step.term for step in terms if step.positive]
    later = [j for j, (side, part) in enumerate(terms) if side != op and isinstance(part, Primitive)]
    for i, (side, part) in enumerate(terms):
        if side != op or not isinstance(part, Primitive):
            continue
        met = {j: _leaf(terms[j]) for j in later if j > i and _meet(part, terms[j].term)}
        if met:
            frame, walls = max(((f, _through(part, f, met, solid, slack)) for f in _frames(part)), key=lambda found: len(found[1]))
            if _may_part(part, frame, [met[j] for j in walls], solid, slack):
                yield i, (frame, walls)


def _through(part: Primitive, frame: Frame, met: dict[int, Primitive], solid: list[Program], slack: float) -> list[int]:
    """The numbers of those leaves `met` that are prisms as high as the part, as far as that is within the solid."""
    prism = prism_along(part, frame)
    if prism is None:
        return []
    low, high = _within(prism, solid, frame[2])
    others = [(j, prism_along(leaf, frame)) for j, leaf in met.items()]
    return [j for j, other in others if other is not None and other.low <= low + slack and other.high >= high - slack]


def _within(prism: Prism, solid: list[Program], axis: Vec3) -> tuple[float, float]:
    """The levels of a prism, no farther than anything solid reaches."""
    low, high = _span(solid, axis)
    return max(prism.low, low), min(prism.high, high)


def _part(
    leaf: Primitive, frame: Frame, walls: list[Primitive], solid: list[Program], slack: float, draw: DrawArea
) -> list[Program] | None:
    """What `walls` leave of a leaf, area by area."""
    prism = prism_along(leaf, frame)
    if prism is None:
        return None
    low, high = _within(prism, solid, frame[2])
    outline = _clip(prism.outline, frame, solid)
    if high - low <= slack or outline is None:
        return None
    area = draw([outline], _outlines(walls, frame))
    return None if area is None else [_aligned(piece, leaf) for piece in _sweep(area, frame, low, high)]


def _may_part(leaf: Primitive, frame: Frame, walls: list[Primitive], solid: list[Program], slack: float) -> bool:
    """Whether walls may leave a leaf in several pieces: they reach two sides of a rectangle, or the edge of what is no rectangle."""
    prism, others = prism_along(leaf, frame), _outlines(walls, frame)
    outline = None if prism is None else _clip(prism.outline, frame, solid)
    if outline is None or not others or max(o.curve_count for o in (outline, *others)) > MOST_CURVES:
        return False
    if (ring := circle_of(outline.loops[0])) is not None and len(outline.loops) == 1:
        return any(_reach_from(ring[0], ring[1], other) >= ring[2] - slack for other in others)
    if not _is_rectangle(outline):
        return True
    (left, low), (right, high) = outline.bounds
    bounds = [other.bounds for other in others]
    return sum((x <= left + slack) + (y <= low + slack) + (u >= right - slack) + (v >= high - slack) for (x, y), (u, v) in bounds) > 1


def _reach_from(x: float, y: float, outline: Outline) -> float:
    """How far an outline, or its bounding box, reaches from a point."""
    if (ring := circle_of(outline.loops[0])) is not None and len(outline.loops) == 1:
        return math.dist((x, y), ring[:2]) + ring[2]
    return max(math.dist((x, y), corner) for corner in product(*zip(*outline.bounds, strict=True)))


def _outlines(leaves: list[Primitive], frame: Frame) -> list[Outline]:
    return [prism.outline for leaf in leaves if (prism := prism_along(leaf, frame)) is not None]


def _is_rectangle(outline: Outline) -> bool:
    """Whether an outline fills its bounding box."""
    (left, low), (right, high) = outline.bounds
    return abs((right - left) * (high - low) - outline.area) <= PARALLEL * outline.area


def _clip(outline: Outline, frame: Frame, solid: list[Program]) -> Outline | None:
    """A rectangle along the axes no farther than anything solid reaches, for where it ends in the air no wall parts it; another outline as
    it is, None where nothing is left."""
    if not _is_rectangle(outline):
        return outline
    spans = [_span(solid, axis) for axis in frame[:2]]
    (left, low), (right, high) = outline.bounds
    left, right = max(left, spans[0][0]), min(right, spans[0][1])
    low, high = max(low, spans[1][0]), min(high, spans[1][1])
    if left >= right or low >= high:
        return None
    return Outline((((left, low, 0.0), (right, low, 0.0), (right, high, 0.0), (left, high, 0.0)),))


def _joined(walls: dict[int, list[int]]) -> list[list[int]]:
    """Groups of keys that share a wall, one over the other."""
    groups: list[tuple[list[int], set[int]]] = []
    for i, own in walls.items():
        touched = [group for group in groups if group[1] & set(own)]
        groups = [group for group in groups if group not in touched]
        groups.append(([i, *(k for keys, _ in touched for k in keys)], set(own).union(*(w for _, w in touched))))
    return [keys for keys, _ in groups]


# --- bars that leave windows -------------------------------------------------------------------------------------------


def _plates(terms: Steps, slack: float, draw: DrawArea) -> Iterator[Steps]:
    """For each run of what is united, and each pair of levels that four bars or more of it have, the terms with a plate and its windows in
    place of these."""
    for positive, run in groupby(range(len(terms)), key=lambda i: terms[i].positive):
        bars = [i for i in run if isinstance(terms[i].term, Primitive)]
        if not positive or len(bars) < FEWEST_BARS:
            continue
        for frame, members in _layers({i: _leaf(terms[i]) for i in bars}, slack):
            prism = next(iter(members.values()))
            area = draw([bar.outline for bar in members.values()], [])
            if area is None or all(len(region) == 1 for region in regions(area)):
                continue
            plates = [Step("union", plate) for plate in _sweep(area, frame, prism.low, prism.high)]
            at = min(members)
            yield (*terms[:at], *plates, *(step for i, step in enumerate(terms) if i > at and i not in members))


def _layers(bars: dict[int, Primitive], slack: float) -> Iterator[tuple[Frame, dict[int, Prism]]]:
    """Bars that lie between one pair of levels, where there are enough of them and they may leave a window."""
    frames: list[Frame] = []
    for frame in (frame for leaf in bars.values() for frame in _frames(leaf)):
        if all(abs(dot(frame[2], known[2])) < 1 - PARALLEL for known in frames):
            frames.append(frame)
    for frame in frames:
        found: defaultdict[tuple[int, int], dict[int, Prism]] = defaultdict(dict)
        for i, leaf in bars.items():
            if (prism := prism_along(leaf, frame)) is not None:
                found[round(prism.low / slack), round(prism.high / slack)][i] = prism
        for members in found.values():
            if len(members) >= FEWEST_BARS and _close_a_ring([prism.outline for prism in members.values()], slack):
                yield frame, members


def _close_a_ring(outlines: list[Outline], slack: float) -> bool:
    """Whether outlines may leave a window between them: one has a hole, or there are as many touches as there are outlines that they
    connect, or more."""
    if any(len(outline.loops) > 1 for outline in outlines):
        return True
    bounds = [outline.bounds for outline in outlines]
    group, links = list(range(len(outlines))), 0
    for i, j in combinations(range(len(outlines)), 2):
        if all(bounds[i][0][k] <= bounds[j][1][k] + slack and bounds[j][0][k] <= bounds[i][1][k] + slack for k in (0, 1)):
            links += 1
            group = [group[i] if g == group[j] else g for g in group]
    return links > len(outlines) - len(set(group))


# --- cells in one drawing ----------------------------------------------------------------------------------------------


def _drawn_cells(terms: Steps, slack: float) -> Iterator[Steps]:
    """The terms with each of the equal areas of an outline, four or more, as a leaf of its own."""
    for i, (op, part) in enumerate(terms):
        if not isinstance(part, Primitive) or part.outline is None or part.kind == "drafted" or len(part.outline.loops) < FEWEST_BARS:
            continue
        cells = [to_simple(replace(part, outline=Outline(region))) for region in regions(part.outline)]
        if len(cells) == len(part.outline.loops) and all(cell is not None and _are_alike(cell, cells[0], slack) for cell in cells):
            yield (*terms[:i], *(Step(op, cell) for cell in cells if cell is not None), *terms[i + 1 :])


def _are_alike(a: Primitive, b: Primitive | None, slack: float) -> bool:
    """Whether two leaves are equal but for where they are."""
    return b is not None and a.kind == b.kind and all(abs(s - t) <= slack for s, t in zip(a.size, b.size, strict=True))


# --- programs as terms, areas as leaves --------------------------------------------------------------------------------


def _terms(program: Program) -> Steps:
    """What the program begins with, and what is united with that and cut from it, in order: as `to_sequence`, but of what is united the
    longest term comes first."""
    steps: list[Step[Program]] = []
    while isinstance(program, Combine) and program.op != "intersection":
        if program.op == "difference":
            steps[:0] = [Step(program.op, part) for part in parts(program.right, "union")]
            program = program.left
        else:
            terms = parts(program, "union")
            main = max(range(len(terms)), key=lambda i: (sum(1 for _ in leaves(terms[i])), -i))
            steps[:0] = [Step(program.op, term) for i, term in enumerate(terms) if i != main]
            program = terms[main]
    return (Step("union", program), *steps)


def _leaf(step: Step[Program]) -> Primitive:
    assert isinstance(step.term, Primitive)
    return step.term


def _sweep(area: Outline, frame: Frame, low: float, high: float) -> list[Program]:
    """Each region of an area as a solid between two levels, its holes cut from it where one of the six kinds does."""
    out: list[Program] = []
    for outline in sorted(map(Outline, regions(area)), key=lambda outline: outline.bounds):
        (left, bottom), (right, top) = outline.bounds
        x, y, z = (left + right) / 2, (bottom + top) / 2, (low + high) / 2
        center = plus(plus(times(frame[0], x), times(frame[1], y)), times(frame[2], z))
        out.append(separate_loops(Primitive("extrude", (high - low,), center, euler(*frame), outline.shift(-x, -y))))
    return out


def _aligned(program: Program, like: Primitive) -> Program:
    """A box with the angles of another whose edges it shares the directions of; anything else as it is."""
    if not isinstance(program, Primitive) or program.kind != "box" or like.kind != "box":
        return program
    own, target = axes(program), axes(like)
    order = [next((k for k in range(3) if abs(dot(own[k], axis)) > 1 - PARALLEL), None) for axis in target]
    if None in order:
        return program
    return replace(program, size=tuple(program.size[k] for k in order if k is not None), rotation=like.rotation)


def _frames(leaf: Primitive) -> list[Frame]:
    """The frames along whose third axes a leaf may be a prism."""
    x, y, z = axes(leaf)
    return [(x, y, z), (y, z, x), (z, x, y)] if leaf.kind == "box" else [(x, y, z)]


def _meet(a: Program, b: Program) -> bool:
    return any(not disjoint(p, q) for p in leaves(a) for q in leaves(b))


def _span(programs: Sequence[Program], axis: Vec3) -> tuple[float, float]:
    """How far the leaves of programs reach along an axis."""
    back = times(axis, -1.0)
    found = [(dot(p.center, axis) - reach(p, back), dot(p.center, axis) + reach(p, axis)) for program in programs for p in leaves(program)]
    return min(low for low, _ in found), max(high for _, high in found)
