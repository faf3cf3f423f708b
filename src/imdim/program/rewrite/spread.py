"""The same solid with each intersection done on the parts of what it cuts: (a + b - c) & d is (a & d) + (b & d) - c."""

from __future__ import annotations

from imdim.program.tree import Combine, Program


def spread_intersections(program: Program) -> Program:
    """The program with intersections of joined and cut parts done on these, each with a copy of what they are intersected with."""
    if not isinstance(program, Combine):
        return program
    left, right = spread_intersections(program.left), spread_intersections(program.right)
    return _intersect(left, right) if program.op == "intersection" else Combine(program.op, left, right)


def _intersect(program: Program, other: Program) -> Program:
    if not isinstance(program, Combine) or program.op == "intersection":
        return Combine("intersection", program, other)
    right = _intersect(program.right, other) if program.op == "union" else program.right
    return Combine(program.op, _intersect(program.left, other), right)
