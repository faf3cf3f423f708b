"""Fewer changes between adding and cutting: the steps of a program in an order that gathers what adds and what cuts, the solid the same.

The last step that covers a point decides whether it is inside. So two steps of different kinds may change places where they do not
overlap, and a step may come later than all that follow it where the finished solid is as it leaves it: a cut of which the solid holds
nothing, an added part of which it holds all.
"""

from __future__ import annotations

from itertools import dropwhile, groupby, takewhile

import numpy as np
from manifold3d import Manifold

from imdim.deadline import NEVER, Deadline
from imdim.geometry.finish.overlap import surely_overlap
from imdim.geometry.finish.section import CHECK_SEGMENTS
from imdim.geometry.finish.tolerances import NOTHING
from imdim.geometry.solid import bounds_of, to_manifold
from imdim.program.rewrite.containment_rules import parts
from imdim.program.sequence import SignedSequence, Step, to_program
from imdim.program.tree import Combine, Program


def gather_steps(program: Program, deadline: Deadline = NEVER) -> Program:
    """The same solid with as few groups of added parts and of cuts as an order of its steps gives, cuts as late as can be; the program
    itself where no order is better, and past the `deadline` (by default never). What stands on the right of an operation, and is not of
    the operation's own kind, stays whole."""
    steps = _steps(program)
    if _unrest(steps) == (1, 0):
        return program
    before = _constraints(steps, program, deadline)
    if before is None:
        return program
    gathered = _gather(steps, before)
    return to_program(gathered) if _unrest(gathered) < _unrest(steps) else program


def _steps(program: Program) -> SignedSequence[Program]:
    """The steps of which a program is the left fold, intersections too."""
    steps: list[Step[Program]] = []
    while isinstance(program, Combine):
        terms = parts(program.right, "intersection" if program.op == "intersection" else "union")
        steps += [Step(program.op, term) for term in reversed(terms)]
        program = program.left
    return (Step("union", program), *reversed(steps))


def _unrest(steps: SignedSequence[Program]) -> tuple[int, int]:
    """How many groups of added parts an order has, and how many steps that cut stand before the last of them."""
    last = sum(1 for _ in takewhile(lambda step: not step.positive, reversed(steps)))
    adding = sum(positive for positive, _ in groupby(steps, key=lambda step: step.positive))
    return adding, sum(not step.positive for step in steps) - last


def _constraints(steps: SignedSequence[Program], program: Program, deadline: Deadline) -> np.ndarray | None:
    """[n, n] of bool, true where step i has to stay before step j of those of a `program`; None where time does not allow to find out."""
    solid, covered = to_manifold(program, CHECK_SEGMENTS), _covered(steps)
    boxes, volumes = np.array([bounds_of(each) for each in covered]), [each.volume() for each in covered]
    before = np.triu(_meet(boxes), 1)
    positive = np.array([step.positive for step in steps])
    before &= positive[:, None] != positive
    for i, j in np.argwhere(before):
        if deadline.has_passed():
            return None
        shared = np.array([np.maximum(boxes[i, 0], boxes[j, 0]), np.minimum(boxes[i, 1], boxes[j, 1])])
        least = NOTHING * min(volumes[i], volumes[j])
        # most do overlap, and far: then points tell
        terms = [steps[k].term for k in (i, j) if steps[k].op != "intersection"]
        if len(terms) < 2 or not surely_overlap(terms, shared, least):
            before[i, j] = (covered[i] ^ covered[j]).volume() > least
    # what the solid is as a step leaves it is asked last: it has the most faces
    for i in np.flatnonzero(before.any(axis=1)):
        if deadline.has_passed():
            return None
        least, term = NOTHING * solid.volume(), steps[i].term
        within, outside = ([term], [program]) if positive[i] else ([term, program], [])
        if steps[i].op == "intersection" or not surely_overlap(within, boxes[i], least, outside):
            before[i] &= (covered[i] - solid if positive[i] else covered[i] ^ solid).volume() > least
    return before


def _meet(boxes: np.ndarray) -> np.ndarray:
    """[n, n] of bool: whether two boxes [n, 2, 3] have anything in common, without which solids do not overlap."""
    return np.all((boxes[:, None, 0] <= boxes[:, 1]) & (boxes[:, 0] <= boxes[:, None, 1]), axis=2)


def _covered(steps: SignedSequence[Program]) -> list[Manifold]:
    """What each step decides: an intersection cuts what lies outside its term."""
    made = [to_manifold(step.term, CHECK_SEGMENTS) for step in steps]
    corners = np.reshape([solid.bounding_box() for solid in made], (-1, 3))
    size = np.ptp(corners, axis=0)
    whole = Manifold.cube(tuple(2 * size)).translate(tuple(corners.min(axis=0) - size / 2))
    return [whole - solid if step.op == "intersection" else solid for step, solid in zip(steps, made, strict=True)]


def _gather(steps: SignedSequence[Program], before: np.ndarray) -> SignedSequence[Program]:
    """The steps from the last to the first: cuts as long as one may come last, then added parts, and so on; in each group as they stood,
    intersections before differences."""
    left, groups, positive = list(range(len(steps))), [], False
    while left:
        group: list[int] = []
        while free := [i for i in left if steps[i].positive == positive and not before[i, left].any()]:
            group += free
            left = [i for i in left if i not in free]
        groups.append(sorted(group, key=lambda i: (steps[i].op == "difference", i)))
        positive = not positive
    ordered = [steps[i] for group in reversed(groups) for i in group]
    # what is cut before anything is there
    return tuple(dropwhile(lambda step: not step.positive, ordered))
