"""What relations are called in program.json, the report and the lab: after the labels and the names of sizes that all files have."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction

from imdim.export.parameters import ZERO, Parameters
from imdim.program.constraints import Constraint, Ref
from imdim.program.roles import name_constraints
from imdim.program.tree import SIZE_NAMES, Program, leaves

WHOLE = (1, Fraction(1, 2))  # of a name: half of a diameter is a radius


def name_relations(constraints: Sequence[Constraint], program: Program, named: Parameters) -> tuple[Constraint, ...]:
    """The constraints of a program that is `named`; those that tie a size have its name."""
    return name_constraints(constraints, program, named.labels or None, dict(_names_of_sizes(program, named)))


def _names_of_sizes(program: Program, named: Parameters) -> Iterator[tuple[Ref, str]]:
    for leaf, (p, sizes) in enumerate(zip(leaves(program), named.sizes, strict=True)):
        for feature, e in zip(SIZE_NAMES[p.kind], sizes, strict=True):
            # a countersink that stands out of what it is in is wider there than its name says
            is_plain = abs(e.constant) <= ZERO or (p.kind == "cone" and feature.startswith("r"))
            if is_plain and len(e.terms) == 1 and e.terms[0].coefficient in WHOLE:
                yield Ref(leaf, feature), e.terms[0].name
