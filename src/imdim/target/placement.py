"""What the numbers of a part mean and where it is put: lengths become millimetres, and its box may move to the origin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import trimesh

from imdim.program.units import MILLIMETRES, SPOKEN, UNSPECIFIED, WORDS
from imdim.target.readers import InputError
from imdim.target.target import LARGEST, Target

MILLIMETRE = "millimeter"
SMALL = 1.0  # a part whose longest side is shorter was hardly measured in millimetres
LARGE = 1e4  # and none is longer


def place(target: Target, units: str = "auto", origin: str = "keep") -> Target:
    """The target in millimetres, if `units` (READ_AS) say what its numbers are, and moved as `origin` (ORIGINS) wants: with the middle of
    its box, or of the lowest side of that, at 0, 0, 0.

    A file that says its unit is in millimetres already. What was changed, and that a size is odd, is a note. Raises InputError for
    coordinates that become too large.
    """
    notes = list(target.notes)
    factor = 1.0
    if units != "auto" and target.units != UNSPECIFIED:
        notes.append(f"The file says its unit itself: units={units} was not needed.")
    elif units != "auto":
        factor = MILLIMETRES[WORDS[units]]
        notes += [f"Lengths are read as {SPOKEN[units]}: each becomes {factor:g} millimetres."] if factor != 1 else []
        notes += _doubt_choice(target, units)
        target = replace(target, units=MILLIMETRE)
    elif target.units == UNSPECIFIED:
        notes += _doubt(target)
    low, high = (end * factor for end in _box(target))
    if max(np.abs(low).max(), np.abs(high).max()) > LARGEST:
        raise InputError(f"{target.name}: in millimetres a coordinate is beyond {LARGEST:g}")
    shift = {"keep": np.zeros(3), "center": 0.0 - (low + high) / 2, "base": 0.0 - np.array([*(low + high)[:2] / 2, low[2]])}[origin]
    if shift.any():
        x, y, z = shift.tolist()
        notes.append(f"Moved by {x:.9g}, {y:.9g}, {z:.9g}: origin={origin}.")
    return _moved(replace(target, notes=tuple(notes)), factor, shift)


def _doubt(target: Target) -> list[str]:
    """A hint where the part would be smaller or larger than parts are."""
    longest = _longest(target)
    would = {unit: longest * MILLIMETRES[word] for unit, word in WORDS.items() if word != MILLIMETRE}
    if longest > LARGE:
        return [f"{_much(longest)}: if it is in micrometres, it is {longest * MILLIMETRES['micron']:.4g} mm long and has to be scaled."]
    return _hint(f"The longest side measures {longest:.4g}, which is little for millimetres", would) if longest < SMALL else []


def _doubt_choice(target: Target, units: str) -> list[str]:
    """A hint where the units that were chosen make the part larger than parts are."""
    longest = _longest(target)
    would = {unit: longest * MILLIMETRES[word] for unit, word in WORDS.items() if unit != units}
    return _hint(_much(longest * MILLIMETRES[WORDS[units]]), would) if longest * MILLIMETRES[WORDS[units]] > LARGE else []


def _much(longest: float) -> str:
    return f"The longest side measures {longest:.6g} mm, which is much for a part"


def _hint(oddity: str, would: Mapping[str, float]) -> list[str]:
    """With the units that make the size a likely one, where there are such."""
    said = ", ".join(f"units={unit} makes it {size:.4g}" for unit, size in would.items() if SMALL <= size <= LARGE)
    return [f"{oddity}: {said} mm."] if said else []


def _longest(target: Target) -> float:
    return float(np.ptp(_box(target), axis=0).max())


def _box(target: Target) -> np.ndarray:
    """Low and high corner [2, 3]."""
    corners = target.points if target.mesh is None else np.asarray(target.mesh.vertices)
    return np.array([corners.min(axis=0), corners.max(axis=0)])


def _moved(target: Target, factor: float, shift: np.ndarray) -> Target:
    if factor == 1 and not shift.any():
        return target
    mesh = target.mesh
    if mesh is not None:
        mesh = trimesh.Trimesh(np.asarray(mesh.vertices) * factor + shift, mesh.faces, process=False)
    scanners = None if target.scanners is None else target.scanners * factor + shift
    return replace(target, points=target.points * factor + shift, mesh=mesh, scanners=scanners)
