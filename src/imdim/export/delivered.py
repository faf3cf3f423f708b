"""A delivered program together with the texts that name its numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from imdim.export.openscad_reader import read_openscad
from imdim.program.codec import Meta
from imdim.program.constraints import Constraint
from imdim.program.repeats import Folded
from imdim.program.tree import Program

TEXTS = ("program.scad", "program.loops.scad", "program.py", "program.ucad")
LOOPS = TEXTS[1:]
AGREE = 1e-6  # of the largest size: the nine digits of each number of a text, summed up along its expressions


class EditError(ValueError):
    """A name or a value that cannot be used; the message is one line."""


@dataclass(frozen=True)
class Delivered:
    """A program with its named `values` and the `texts` that begin with them; `segments` are those of the OpenSCAD text.

    `folded` has its repeats, None if there are none, and `counts` the names of how often these repeat.
    """

    program: Program
    meta: Meta
    constraints: tuple[Constraint, ...]
    texts: Mapping[str, str]
    values: Mapping[str, float]
    segments: int
    folded: Folded | None = None
    counts: Mapping[str, int] = field(default_factory=dict)


def read(delivered: Delivered, values: Mapping[str, float]) -> Program:
    """What program.scad describes with some names at other values; a one-line ValueError where that is nothing."""
    try:
        return read_openscad(delivered.texts["program.scad"], **values)
    except ValueError as error:
        raise ValueError(f"program.scad: {error}") from None
