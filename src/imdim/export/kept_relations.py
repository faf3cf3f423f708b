"""Relations that stay true whatever value a name gets: those that the names of a program keep."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from imdim.export.elimination import SLOPE, world_rows
from imdim.export.parameters import Parameters
from imdim.geometry.lowering import lower
from imdim.program.constraints import Constraint
from imdim.program.tree import Program

VARIABLES = 6  # of a leaf: three sizes and the coordinates of its centre


def keep_by_names(program: Program, constraints: Sequence[Constraint], named: Parameters) -> tuple[Constraint, ...]:
    """The constraints of a program that no change of one of its names breaks, as far as these say where its leaves are.

    An edit that breaks one is refused. Equations may give way where a name would have no other value left, and what said the same as one of
    them is then no more true. Directions stay, and so do the relations that bind these alone.
    """
    numbers = lower(program)
    if not constraints or len(named.sizes) != len(numbers.kinds):
        return tuple(constraints)
    column = {name: k for k, name in enumerate(named.values)}
    slopes = np.zeros((VARIABLES * len(named.sizes), len(column)))
    for leaf, (sizes, center) in enumerate(zip(named.sizes, named.centers, strict=True)):
        for first, expressions in ((0, sizes), (3, center)):
            for k, expression in enumerate(expressions):
                for term in expression.terms:
                    slopes[VARIABLES * leaf + first + k, column[term.name]] += float(term.coefficient)
    unsaid = np.repeat([not center for center in named.centers], VARIABLES)
    matrix, owner = world_rows(constraints, numbers)
    largest = np.abs(matrix).max(1, initial=0.0)
    broken = (np.abs(matrix @ slopes).max(1, initial=0.0) > SLOPE * largest) & ~(np.abs(matrix[:, unsaid]).max(1, initial=0.0) > 0)
    lost = set(owner[broken].tolist())
    return tuple(c for k, c in enumerate(constraints) if k not in lost)
