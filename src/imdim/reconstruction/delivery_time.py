"""How long a program takes to be delivered, which its search and its numbers must leave.

Delivery makes its solid again and again, and writes its leaves and curves in every language: the seconds of a long program, or of one whose
solid is slow to make, are not in the shares of a budget, which fit short ones.
"""

from __future__ import annotations

import math
from dataclasses import replace

from imdim.deadline import Deadline
from imdim.geometry.solid import time_solid
from imdim.program.cost import count
from imdim.program.tree import Program

SOLIDS, LEAF_S, CURVE_S = 30.0, 0.15, 0.03  # solids that are made, and seconds for each leaf and curve
FITTED = 20.0  # solids that are made while numbers are fitted
OWN = 0.5  # of the time that a search has left, which it keeps
# seconds that the shares leave of a noisy cloud in any case before numbers are fitted, and from then on
ALLOWED_S, ALLOWED_AFTER_S = 1.5, 5.0
FILES_S = 7.0  # for the files of a finished program, STEP among them
# more for those of a long program, and for each of its primitives beyond a few: OpenCASCADE's booleans of two in four went wrong at once,
# and were done again one by one
AGAIN_S, EACH_S, FEW = 6.0, 0.75, 20
MOST_S = 30.0  # that search and numbers leave for files: a hundred copies of one hole are no hundred primitives to OpenCASCADE


def time_to_write(program: Program) -> float:
    """How many seconds the files of a finished program take: OpenCASCADE needs 10 to 20 for the solid of a long one."""
    more = count(program).primitives - FEW
    return FILES_S + (AGAIN_S + EACH_S * more if more > 0 else 0.0)


def leave_time_for_files(program: Program, deadline: Deadline, end: Deadline) -> Deadline:
    """The deadline of work on a mesh's program, earlier where the time from then to the `end` is too short to deliver it, with its STEP."""
    if deadline.at == math.inf:
        return deadline
    return leave_time_to_deliver(program, deadline, max(end.at - deadline.at - min(time_to_write(program), MOST_S), 0.0))


def leave_time_to_fit(program: Program, search_by: Deadline, fit_by: Deadline, end: Deadline) -> Deadline:
    """The deadline of the search for a mesh's program, earlier where fitting it until `fit_by`, or what comes before the `end`, would have
    too little time left: rounding and joining make its solid again and again too. A part of the search's own time stays in any case:
    what is long at first may become shorter."""
    fit_by = leave_time_for_files(program, fit_by, end)
    leave = replace(fit_by, at=fit_by.at - FITTED * time_solid(program, fit_by.now))
    return search_by.earlier(leave.later(search_by.ahead(OWN * search_by.left())))


def leave_time_to_deliver(program: Program, deadline: Deadline, allowed_s: float = ALLOWED_S) -> Deadline:
    """The deadline, earlier by what delivering the program takes beyond what is allowed for."""
    has = count(program)
    takes_s = SOLIDS * time_solid(program, deadline.now) + LEAF_S * has.primitives + CURVE_S * has.curves
    return replace(deadline, at=deadline.at - max(takes_s - allowed_s, 0.0))
