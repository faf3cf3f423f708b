"""Edit a delivered program by the names at the head of its texts: the same texts with other values, and the program they then describe.

What follows a name is what follows it in ``program.scad``, so that an edit here is OpenSCAD's ``-D name=value``.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from manifold3d import Manifold

from imdim.export.folder import FILES, replacing
from imdim.export.meshes import write_meshes
from imdim.export.numbers import fixed, plain, rounded
from imdim.export.openscad import to_openscad
from imdim.export.openscad_reader import read_openscad
from imdim.export.parameters import parametrise
from imdim.export.script import to_script
from imdim.export.step import StepError
from imdim.export.step_worker import finish_step, start_step, stop_step
from imdim.export.ucad import to_ucad
from imdim.geometry.constraints import verify
from imdim.geometry.solid import SEGMENTS, to_manifold
from imdim.program.codec import Meta, constraints_of, dumps, from_json, meta_of
from imdim.program.constraints import Constraint
from imdim.program.tree import SIZE_NAMES, Program, leaves

TEXTS = ("program.scad", "program.py", "program.ucad")
AGREE = 1e-6  # of the largest size: the nine digits of each number of a text, summed up along its expressions
PROBE = 1e-3  # share of a value by which it is moved to see what follows
LARGEST_VOLUME = 1e30  # mesh files hold single precision

_NAMED = re.compile(r"^([A-Za-z_]\w*) = (-?[\d.]+(?:e[+-]?\d+)?)(mm)?(;?)$", re.MULTILINE)
_SEGMENTS = re.compile(r"^\$fn = (\d+);$", re.MULTILINE)

_MEANING: Mapping[str, str] = {
    "sx": "length along x",
    "sy": "length along y",
    "sz": "length along z",
    "r": "radius",
    "h": "height",
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
}


class EditError(ValueError):
    """A name or a value that cannot be used; the message is one line."""


@dataclass(frozen=True)
class Delivered:
    """A program with its named `values` and the `texts` that begin with them; `segments` are those of the OpenSCAD text."""

    program: Program
    meta: Meta
    constraints: tuple[Constraint, ...]
    texts: Mapping[str, str]
    values: Mapping[str, float]
    segments: int


def opened(document: object, texts: Mapping[str, str]) -> Delivered:
    """A program.json with the texts that lie beside it, by their names in TEXTS; without program.scad names come from the constraints.

    Raises a one-line ValueError for a document or a text at fault, and where they do not describe one program.
    """
    program, constraints = from_json(document), constraints_of(document)
    if "program.scad" not in texts:
        named = parametrise(program, constraints, program)
        written = to_openscad(program, parameters=named), to_script(program, named), to_ucad(program, named)
        texts = dict(zip(TEXTS, written, strict=True))
    values = _values(texts["program.scad"])
    found = _SEGMENTS.search(texts["program.scad"])
    segments = int(found[1]) if found else SEGMENTS
    delivered = Delivered(program, meta_of(document), constraints, texts, values, segments)
    _check_same(delivered)
    return delivered


def changed(delivered: Delivered, values: Mapping[str, float]) -> Delivered:
    """The program with some names at other values. Raises EditError for a name or value that cannot be."""
    values = {name: float(value) for name, value in values.items()}
    _check_values(delivered, values)
    texts = {file: _rewritten(text, values) for file, text in delivered.texts.items()}
    said = ", ".join(f"{name} = {plain(value)}" for name, value in values.items())
    try:
        program = rounded(read_openscad(texts["program.scad"]))
        verify(program, delivered.constraints, AGREE)
    except ValueError as error:
        raise EditError(f"{said}: {error}") from None
    return replace(delivered, program=program, texts=texts, values={**delivered.values, **values})


def solid_of(delivered: Delivered) -> Manifold:
    """The exact solid; raises EditError where nothing is left of it."""
    solid = to_manifold(delivered.program, delivered.segments)
    if not 0 < solid.volume() < LARGEST_VOLUME:
        raise EditError(f"no solid is left, its volume is {solid.volume():g}")
    return solid


def write(delivered: Delivered, folder: Path, step_limit_s: float = 0.0) -> dict[str, str]:
    """Write program.json, the texts and the meshes into `folder`, whole or not at all; what became of each file.

    With `step_limit_s` also program.step, which is skipped, with the reason, where OpenCASCADE is missing, fails or takes longer.
    Raises OutputError when the folder cannot be written or holds foreign files, EditError where the solid is empty.
    """
    solid = solid_of(delivered)
    with replacing(folder) as partial:
        texts = {"program.json": dumps(delivered.program, delivered.meta, delivered.constraints), **delivered.texts}
        for file, text in texts.items():
            (partial / file).write_text(text, encoding="utf-8")
        write_meshes(solid, partial)
        skipped = _write_step(partial, step_limit_s) if step_limit_s else {}
        files = {file: "written" for file in FILES if (partial / file).exists()}
    return {**files, **skipped}


def _write_step(folder: Path, limit_s: float) -> dict[str, str]:
    try:
        job = start_step(folder / "program.json", folder / "program.step")
        try:
            finish_step(job, limit_s)
        finally:
            stop_step(job)
    except StepError as error:
        return {"program.step": f"skipped: {error}"}
    return {}


def meanings(delivered: Delivered) -> dict[str, str]:
    """For each name the sizes and places that are its value, and those that move with it, as ``primitive.feature``.

    Primitives are counted from 0 in the order of program.json, as constraints count them.
    """
    out: dict[str, str] = {}
    for name, value in delivered.values.items():
        equal, moved = _followers(delivered, name)
        words = [_MEANING[feature] for _, feature in equal]
        is_what = [f"{word} of primitive {_some([str(leaf) for leaf, f in equal if _MEANING[f] == word])}" for word in dict.fromkeys(words)]
        follow = [f"moves {_some([f'{leaf}.{feature}' for leaf, feature in moved])}"] if moved else []
        out[name] = "; ".join(is_what + follow) or f"nothing follows {plain(value)}"
    return out


def _values(text: str) -> dict[str, float]:
    return {found[1]: float(found[2]) for found in _NAMED.finditer(text)}


def _check_same(delivered: Delivered) -> None:
    """Refuse texts that say something else than the document: an edit would undo what was changed in one of them."""
    ours, theirs = list(leaves(delivered.program)), list(leaves(_read(delivered, {})))
    slack = AGREE * max(max(p.size) for p in ours)
    differ = len(ours) != len(theirs) or any(
        a.kind != b.kind or max(abs(u - v) for u, v in zip((*a.size, *a.center), (*b.size, *b.center), strict=True)) > slack
        for a, b in zip(ours, theirs, strict=False)
    )
    if differ:
        raise ValueError("program.scad beside it describes another program: one of them was changed by hand")
    other = next((file for file, text in delivered.texts.items() if _values(text) != delivered.values), None)
    if other is not None:
        raise ValueError(f"{other} beside it begins with other names or values than program.scad: one of them was changed by hand")


def _read(delivered: Delivered, values: Mapping[str, float]) -> Program:
    try:
        return read_openscad(delivered.texts["program.scad"], **values)
    except ValueError as error:
        raise ValueError(f"program.scad: {error}") from None


def _check_values(delivered: Delivered, values: Mapping[str, float]) -> None:
    for name, value in values.items():
        if name not in delivered.values:
            near = difflib.get_close_matches(name, delivered.values, 3, 0.4)
            known = f"nearest are {', '.join(near)}" if near else f"it has {', '.join(delivered.values) or 'none'}"
            raise EditError(f"no parameter {name!r}; {known}")
        if not math.isfinite(value):
            raise EditError(f"{name} needs a finite number, got {value}")
        if value <= 0 and _is_size(delivered, name):
            raise EditError(f"{name} needs a positive number, got {plain(value)}")


def _is_size(delivered: Delivered, name: str) -> bool:
    """Whether some size is the named value, or the name is that of a diameter."""
    return "circle" in name.split("_") or any(feature in SIZES for _, feature in _followers(delivered, name)[0])


SIZES = frozenset(name for names in SIZE_NAMES.values() for name in names)

Feature = tuple[int, str]  # the primitive's number, and the name of a size or of a coordinate


def _followers(delivered: Delivered, name: str) -> tuple[list[Feature], list[Feature]]:
    """The numbers that are the named value, and the others that move with it."""
    value = delivered.values[name]
    step = PROBE * (abs(value) or max(max(p.size) for p in leaves(delivered.program)))
    before, after = (dict(_numbers(_read(delivered, {name: v}))) for v in (value, value + step))
    moved = {feature: after[feature] - before[feature] for feature in before if abs(after[feature] - before[feature]) > AGREE * step}
    equal = [f for f, way in moved.items() if max(abs(way - step), abs(before[f] - value)) <= AGREE * step]
    return equal, [f for f in moved if f not in equal]


def _numbers(program: Program) -> Iterator[tuple[Feature, float]]:
    for i, p in enumerate(leaves(program)):
        for feature, number in zip((*SIZE_NAMES[p.kind], "x", "y", "z"), (*p.size, *p.center), strict=True):
            yield (i, feature), number


def _rewritten(text: str, values: Mapping[str, float]) -> str:
    def line(found: re.Match[str]) -> str:
        name, _, unit, end = found.groups(default="")
        return f"{name} = {fixed(plain(values[name]))}{unit}{end}" if name in values else found[0]

    return _NAMED.sub(line, text)


def _some(words: Sequence[str], most: int = 8) -> str:
    return ", ".join(words[:most]) + (f" and {len(words) - most} more" if len(words) > most else "")
