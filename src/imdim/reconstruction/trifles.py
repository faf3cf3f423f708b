"""Parts of a scanned thing's program that move its surface by no more than real things deviate."""

from __future__ import annotations

import math

import numpy as np

from imdim.deadline import NEVER, Deadline
from imdim.geometry import kernels
from imdim.geometry.shadows import Shadows
from imdim.numbers.likelihood import SurfaceSamples
from imdim.program.paths import Path, leaf_paths, without
from imdim.program.tree import Program

TENTH = 0.1  # of what a leaf changes may lie farther off than its depth: a shallow dish that runs across a lip


def without_trifles(program: Program, reach: float, deadline: Deadline = NEVER, shadows: Shadows | None = None) -> Program:
    """The program without the leaves that, all together, move hardly any of its surface by more than `reach`; those that move it least go
    first, as far as time allows. What only fills such a leaf's cut is looked at again once that is gone: alone it moves much. What lies in
    the `shadows` of known scanners is of no account."""
    stay = [path for path, _ in leaf_paths(program)] if reach else []
    gone: list[Path] = []
    stay.sort(key=lambda path: _move(program, [path], reach, deadline, shadows))
    while (light := next((path for path in stay if _move(program, [*gone, path], reach, deadline, shadows) <= reach), None)) is not None:
        gone.append(light)
        stay.remove(light)
    return without(program, gone) or program


def _move(program: Program, gone: list[Path], reach: float, deadline: Deadline, shadows: Shadows | None) -> float:
    """How far what a program has of its own, and what it has without the leaves that are `gone`, lies from the other's surface, but for a
    TENTH of it; by even samples so dense that what reaches so far has some. Infinite where nothing is left, or no time."""
    less = without(program, gone)
    if less is None or deadline.has_passed():
        return math.inf
    farthest = 0.0
    for one, other in ((program, less), (less, program)):
        places = SurfaceSamples.of(one, reach / 4, shadows=shadows).points
        far = np.abs(kernels.program_sdf(other, places)) if len(places) else np.array([math.inf])
        own = far[far > reach / 20]
        farthest = max(farthest, float(np.quantile(own, 1 - TENTH)) if len(own) else 0.0)
    return farthest
