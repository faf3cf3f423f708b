"""Numbers that a hair keeps from the round one that was meant: a spacing of 142.700016, a wall of 2.9999966, 4e-06 beside a name.

Numbers are rounded leaf by leaf, before relations are found. What then follows from several of them, or moved for a relation, may miss its
grid by the last bits of a mesh, and so may the constant beside it. Nobody would have typed these digits.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

from imdim.export.drawn_vertex import map_ring
from imdim.export.edit import refold
from imdim.export.numbers import Expression, round_program
from imdim.export.openscad import to_openscad
from imdim.export.openscad_reader import read_openscad
from imdim.export.parameters import Parameters, add_loops, is_count
from imdim.numbers.design_values import round_to_grid
from imdim.program.outline import check_crossings
from imdim.program.repeats import Folded, expand
from imdim.program.tree import Program, leaves, longest

RESIDUE = 3e-7  # of the largest size, by which a number may miss its grid,
WIDE = 20.0  # so many times which that is wide: a number is as near to it by chance one time in ten
DEGREES = 100.0  # as large as an angle is taken to be


def settle_residues(program: Program, named: Parameters, folded: Folded | None) -> tuple[Program, Parameters, Folded | None]:
    """A program and its names without residues; as they are where copies would not stay alike, or drawings cross themselves. `program` is
    the expansion of `folded`, where there are repeats."""
    length = longest(leaves(program))
    settled = _settle(named, length)
    if settled == named or (named.own is not None and folded is not None):
        return program, named, folded
    if folded is not None:
        settled, broken = add_loops(replace(settled, loops=(), counts={}), folded, settled.labels, length)
        if broken:
            return program, named, folded
    try:
        exact = read_openscad(to_openscad(program, parameters=settled))
        for leaf in leaves(exact):
            if leaf.outline is not None:
                check_crossings(leaf.outline)
        rounded = round_program(exact)
        if folded is None:
            return rounded, settled, None
        folded_anew = refold(folded, exact, rounded)
    except ValueError:
        return program, named, folded
    return expand(folded_anew), settled, folded_anew


def _settle(named: Parameters, length: float) -> Parameters:
    """The names and the constants of expressions, but for counts, on their grids."""

    def settle_name(name: str, value: float) -> float:
        return value if is_count(name) else (settle_number(value, DEGREES if name in named.angles else length) or value)

    def settle(expression: Expression, may_vanish: bool = True) -> Expression:
        constant = settle_number(expression.constant, length)
        return replace(expression, constant=constant) if constant or may_vanish or expression.terms else expression

    own = named.own and replace(named.own, centers=tuple(tuple(map(settle, row)) for row in named.own.centers))
    return replace(
        named,
        values={name: settle_name(name, value) for name, value in named.values.items()},
        sizes=tuple(tuple(map(partial(settle, may_vanish=False), row)) for row in named.sizes),
        centers=tuple(tuple(map(settle, row)) if own is None else own.directions.in_world(row) for row in (own or named).centers),
        outlines=tuple(tuple(map_ring(loop, settle) for loop in loops) for loops in named.outlines),
        own=own,
    )


def settle_number(value: float, length: float) -> float:
    """The multiple of the coarsest decimal grid that a number misses by no more than a residue of a part of that `length`; itself where
    there is none."""
    slack = RESIDUE * length
    if abs(value) <= slack:
        return 0.0
    top, finest = math.floor(math.log10(abs(value))), math.ceil(math.log10(WIDE * slack))
    found = (round_to_grid(value, 10.0**e) for e in range(top, finest - 1, -1))
    return next((number for number in found if abs(number - value) <= slack), value)
