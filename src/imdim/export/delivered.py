"""A delivered program together with the texts that name its numbers, and what these names are: which sizes and places follow them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from imdim.deadline import NEVER, Deadline
from imdim.export.cadquery import to_cadquery
from imdim.export.edge_text import draw_edges
from imdim.export.feature_names import say_features
from imdim.export.freecad import to_freecad
from imdim.export.numbers import plain
from imdim.export.openscad import to_openscad, to_openscad_loops
from imdim.export.openscad_reader import read_openscad
from imdim.export.parameters import Parameters, is_count
from imdim.export.script import to_script
from imdim.export.ucad import to_ucad
from imdim.program.codec import Meta
from imdim.program.constraints import Constraint
from imdim.program.edges import EdgeFeature, describe_edges
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Loop
from imdim.program.repeats import Folded
from imdim.program.tree import SIZE_NAMES, Program, leaves, longest

LOOPS = ("program.loops.scad", "program.py", "program.cq.py", "program.ucad")  # which have counts among their names
TEXTS = ("program.scad", *LOOPS, "program.FCMacro")
AGREE = 1e-6  # of the largest size: the nine digits of each number of a text, summed up along its expressions

DRAWING_S = 6.0  # for the names that blends follow
PROBE = 1e-3  # share of a value by which it is moved to see what follows

_MEANING: Mapping[str, str] = {
    "sx": "length along x",
    "sy": "length along y",
    "sz": "length along z",
    "r": "radius",
    "h": "height",
    "angle": "degrees of the turn",
    "draft": "degrees that the walls lean inward",
    "r_bottom": "radius at the bottom",
    "r_top": "radius at the top",
    "r_major": "radius of the ring",
    "r_minor": "radius of the tube",
    "rx": "radius along x",
    "ry": "radius along y",
    "rz": "radius along z",
    "x": "centre along x",
    "y": "centre along y",
    "z": "centre along z",
    "outline": "drawing",
}
_ACROSS = ("r", "r_bottom", "r_top")  # radii that are measured as diameters
_DIMENSIONS = frozenset(("circle", "radius", "diameter", "length", "width", "chamfer", "depth", "height", "distance", "second"))
NAMED = re.compile(r"^([A-Za-z_]\w*) = (-?[\d.]+(?:e[+-]?\d+)?)(mm)?(;?)( // \[[^\]\n]*\])?$", re.MULTILINE)
SEGMENTS_LINE = re.compile(r"^\$fn = (\d{1,18});$", re.MULTILINE)
SIZES = frozenset(name for names in SIZE_NAMES.values() for name in names)

Feature = tuple[int, str]  # the primitive's number, and the name of a size or of a coordinate; those of an outline are counted


class Followers(NamedTuple):
    """What follows a name: radii that are half its value, numbers that are it, others that move with it."""

    across: list[Feature]
    equal: list[Feature]
    moved: list[Feature]

    def meant(self) -> dict[str, list[int]]:
        """What its value is, in words, and the primitives that it is that of."""
        across = [(leaf, _MEANING[f].replace("radius", "diameter")) for leaf, f in self.across]
        found = across + [(leaf, _MEANING[f]) for leaf, f in self.equal]
        return {word: [leaf for leaf, its in found if its == word] for word in dict.fromkeys(word for _, word in found)}


class EditError(ValueError):
    """A name or a value that cannot be used; the message is one line."""


@dataclass(frozen=True)
class Delivered:
    """A program with its named `values` and the `texts` that begin with them; `segments` are those of the OpenSCAD text.

    `folded` has its repeats, None if there are none, and `counts` the names of how often these repeat. `labels` are what its leaves are
    called, which an edit keeps.
    """

    program: Program
    meta: Meta
    constraints: tuple[Constraint, ...]
    texts: Mapping[str, str]
    values: Mapping[str, float]
    segments: int
    folded: Folded | None = None
    counts: Mapping[str, int] = field(default_factory=dict)
    edges: tuple[EdgeFeature, ...] = ()
    labels: tuple[str, ...] = ()


def texts_of(
    program: Program,
    named: Parameters,
    folded: Folded | None,
    segments: int,
    edges: Sequence[EdgeFeature] = (),
    matter: bool = True,
    deadline: Deadline = NEVER,
) -> dict[str, str]:
    """The texts by their names in TEXTS; with loops where `folded`, which `program` is the expansion of, has repeats.

    Those that `unwritten` names are left out. program.scad draws `edges` unless told otherwise if they `matter`, or take few
    statements; past the `deadline` (by default never), or after DRAWING_S, their numbers follow no more names. Past it, holes of program.py
    are calls only where all may be.
    """
    sharp = to_openscad(program, segments, named)

    def read(values: Mapping[str, float]) -> Program:
        return read_openscad(sharp, values)

    drawn = draw_edges(edges, named.values, read, matter, deadline.earlier(deadline.ahead(DRAWING_S))) if edges else None
    texts = {
        "program.scad": sharp if drawn is None else to_openscad(program, segments, named, drawn),
        "program.py": to_script(program, named, folded, edges, deadline),
        "program.cq.py": to_cadquery(program, named, folded, edges),
        "program.FCMacro": to_freecad(program, named, edges),
    }
    if "program.ucad" not in unwritten(program):
        texts["program.ucad"] = to_ucad(program, named, folded)
    return texts if folded is None else {**texts, "program.loops.scad": to_openscad_loops(folded, segments, named)}


def unwritten(program: Program) -> dict[str, str]:
    """The texts that cannot say `program`, with the reason."""
    return {"program.ucad": "skipped: µcad has no polygons"} if any(leaf.outline for leaf in leaves(program)) else {}


def with_segments(texts: Mapping[str, str], segments: int) -> dict[str, str]:
    """The texts with so many facets per circle, where they say how many."""
    return {file: SEGMENTS_LINE.sub(f"$fn = {segments};", text) for file, text in texts.items()}


def read(delivered: Delivered, values: Mapping[str, float]) -> Program:
    """What program.scad describes with some names at other values; a one-line ValueError where that is nothing."""
    try:
        return read_openscad(delivered.texts["program.scad"], values)
    except ValueError as error:
        raise ValueError(f"program.scad: {error}") from None


def meanings(delivered: Delivered) -> dict[str, str]:
    """For each name the sizes and places that are its value, and those that move with it, of features by label and number."""
    out: dict[str, str] = {}
    for name, found in find_followers(delivered).items():
        blended = [describe_edges(f) for f in delivered.edges if name in f.size_names]
        if blended:
            out[name] = f"size of {blended[0]}"
            continue
        is_what = [f"{word} of {say_features(of, delivered.labels)}" for word, of in found.meant().items()]
        follow = [f"moves {_say_moved(found.moved, delivered.labels)}"] if found.moved else []
        out[name] = "; ".join(is_what + follow) or f"nothing follows {plain(delivered.values[name])}"
    return out | dict.fromkeys(delivered.counts, "how many copies there are")


def _say_moved(moved: Sequence[Feature], label: Sequence[str]) -> str:
    """As "z of plate #0, boss #1 and height of hole #2 to #5"."""
    of: dict[str, list[int]] = {}
    for leaf, feature in moved:
        of.setdefault(feature if feature in "xyz" else _MEANING[feature], []).append(leaf)
    return " and ".join(f"{word} of {say_features(numbers, label)}" for word, numbers in of.items())


def list_tied_sizes(delivered: Delivered) -> dict[str, list[Feature]]:
    """For each name the sizes of primitives that are its value, or half of it; more than one where they are tied."""
    found = find_followers(delivered)
    return {name: [feature for feature in (*f.across, *f.equal) if feature[1] in SIZES] for name, f in found.items()}


def find_followers(delivered: Delivered) -> dict[str, Followers]:
    """What follows each name but those of counts; sizes of edge features have no followers among primitives."""
    before = dict(_numbers(read(delivered, {})))
    blended = {name for feature in delivered.edges for name in feature.size_names}
    return {name: Followers([], [], []) if name in blended else _followers(delivered, name, before) for name in delivered.values}


def is_size(delivered: Delivered, name: str) -> bool:
    """Whether some size is the named value, or the name is that of a diameter or of a size of an outline."""
    what = [word for word in name.split("_") if not word.isdigit()][-1]  # words before it are what the feature is called
    return what in _DIMENSIONS or any(
        feature in SIZES for _, feature in _followers(delivered, name, dict(_numbers(read(delivered, {})))).equal
    )


def read_values(text: str) -> dict[str, float]:
    """The names at the head of a text, with their values."""
    return {found[1]: float(found[2]) for found in NAMED.finditer(text)}


def _followers(delivered: Delivered, name: str, before: Mapping[Feature, float]) -> Followers:
    """What follows a name; `before` has all numbers as they are."""
    value = delivered.values[name]
    step = 1.0 if is_count(name) else PROBE * (abs(value) or longest(leaves(delivered.program)))
    after, step = _probe(delivered, name, step)
    slack = AGREE * abs(step)
    moved = {feature: after[feature] - before[feature] for feature in before if abs(after[feature] - before[feature]) > slack}
    drawn = {f for f in moved if f[1].isdigit()}
    equal = [f for f, way in moved.items() if f not in drawn and max(abs(way - step), abs(before[f] - value)) <= slack]
    moved = {f: way for f, way in moved.items() if f not in drawn} | dict.fromkeys([(leaf, "outline") for leaf, _ in drawn], step)
    across = [f for f, way in moved.items() if f[1] in _ACROSS and max(abs(2 * way - step), abs(2 * before[f] - value)) <= slack]
    return Followers(across, equal, [f for f in moved if f not in equal and f not in across])


def _probe(delivered: Delivered, name: str, step: float) -> tuple[dict[Feature, float], float]:
    """The numbers with one name moved by `step`, or the other way where there is no room: a full turn has none. Which way it was."""
    value = delivered.values[name]
    try:
        return dict(_numbers(read(delivered, {name: value + step}))), step
    except ValueError:
        return dict(_numbers(read(delivered, {name: value - step}))), -step


def _numbers(program: Program) -> Iterator[tuple[Feature, float]]:
    for i, p in enumerate(leaves(program)):
        for feature, number in zip((*SIZE_NAMES[p.kind], "x", "y", "z"), (*p.size, *p.center), strict=True):
            yield (i, feature), number
        if p.outline is not None:
            yield from (((i, str(k)), v) for k, v in enumerate(v for loop in p.outline.loops for v in _loop_numbers(loop)))


def _loop_numbers(loop: Loop) -> Iterator[float]:
    """The numbers of a loop's vertices, or of an ellipse."""
    if isinstance(loop, Ellipse):
        yield from (loop.rx, loop.ry, loop.x, loop.y, loop.angle)
    else:
        yield from (v for vertex in loop for v in vertex)
