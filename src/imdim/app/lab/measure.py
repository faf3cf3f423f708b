"""What lies between clicked faces: distances, angles, diameters, as words, and as a line in the view."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from imdim.app.lab.edits import ConstrainedProgram
from imdim.app.lab.picks import Pick
from imdim.app.lab.relation_words import name_side
from imdim.export.feature_names import name_leaves
from imdim.geometry.pose import Pose
from imdim.program.edges import describe_edges
from imdim.program.tree import leaves

ALONG = 1e-6  # sine, below which two directions are one
NOTHING = 1e-9  # of a coordinate, that is rounding
DIGITS = 5


@dataclass(frozen=True, eq=False)
class Measurement:
    """Lines of text; the ends [2, 3] of what was measured in the target's units, None where it is no length; and what is written there."""

    lines: tuple[str, ...]
    ends: np.ndarray | None = None
    label: str = ""


def name_pick(pick: Pick, theory: ConstrainedProgram) -> str:
    """A face as a person would call it: "the top face of plate", "the round face of hole (3)"."""
    feature = theory.edge_feature(pick.leaf)
    if feature is not None:
        return f"the {describe_edges(theory.edges[feature])}"
    whole = name_leaves([pick.leaf], theory.labels)[0]
    part = list(leaves(theory.program))[pick.leaf]
    which = name_side(part, pick.face) if pick.face is not None else "flat" if pick.is_flat else "round"
    return f"the {which} face of {whole}"


def measure(picks: Sequence[Pick], pose: Pose, unit: str) -> Measurement:
    """What can be said of one face, or lies between the last two."""
    if not picks:
        return Measurement(())
    if len(picks) == 1:
        return Measurement(_of_one(picks[0], unit))
    found = _between(picks[-2], picks[-1], pose, unit)
    is_apart = found.ends is not None and float(np.linalg.norm(found.ends[1] - found.ends[0])) > NOTHING
    return found if is_apart else Measurement(found.lines)


def _between(one: Pick, two: Pick, pose: Pose, unit: str) -> Measurement:
    if one.is_flat and two.is_flat:
        return _between_planes(one, two, pose, unit)
    if one.is_flat or two.is_flat:
        return _to_plane(*((one, two) if one.is_flat else (two, one)), pose, unit)
    return _between_centers(one, two, unit)


def _of_one(pick: Pick, unit: str) -> tuple[str, ...]:
    if pick.radius is not None:
        return (f"diameter {_length(2 * pick.radius, unit)}", f"axis through {_place(pick.center, unit)}")
    where = f"clicked at {_place(pick.point, unit)}"
    axis = int(np.argmax(np.abs(pick.normal)))
    if pick.is_flat and abs(pick.normal[axis]) > 1 - ALONG:
        return (f"flat, at {'xyz'[axis]} = {_length(float(pick.point[axis]), unit)}", where)
    return (where,)


def _between_planes(one: Pick, two: Pick, pose: Pose, unit: str) -> Measurement:
    cosine = abs(float(one.normal @ two.normal))
    if math.sqrt(max(0.0, 1 - cosine**2)) > 1e-3:
        angle = math.degrees(math.acos(min(1.0, cosine)))
        return Measurement((f"angle {angle:.4g}°", *_apart(one.point, two.point, unit)))
    start, end = _on_plane(one, pose), _on_plane(two, pose)
    across = float((end - start) @ one.normal)
    ends = np.array([two.point - across * one.normal, two.point])
    return Measurement((f"distance {_length(abs(across), unit)}, parallel",), ends, _length(abs(across), unit))


def _to_plane(flat: Pick, other: Pick, pose: Pose, unit: str) -> Measurement:
    assert other.center is not None
    if other.axis is not None and abs(float(other.axis @ flat.normal)) > 1e-3:
        angle = math.degrees(math.asin(min(1.0, abs(float(other.axis @ flat.normal)))))
        return Measurement((f"angle between axis and face {angle:.4g}°",))
    across = float((other.center - _on_plane(flat, pose)) @ flat.normal)
    ends = np.array([other.center - across * flat.normal, other.center])
    what = "centre" if other.axis is None else "axis"
    return Measurement((f"{what} {_length(abs(across), unit)} from the face",), ends, _length(abs(across), unit))


def _between_centers(one: Pick, two: Pick, unit: str) -> Measurement:
    assert one.center is not None
    assert two.center is not None
    sizes = [f"diameters {_length(2 * one.radius, unit)} and {_length(2 * two.radius, unit)}"] if one.radius and two.radius else []
    off = two.center - one.center
    if one.axis is None or two.axis is None:
        far = float(np.linalg.norm(off))
        ends = np.array([one.center, two.center])
        return Measurement((f"centres {_length(far, unit)} apart", *_apart(ends[0], ends[1], unit), *sizes), ends, _length(far, unit))
    cosine = abs(float(one.axis @ two.axis))
    if cosine < 1 - ALONG:
        return Measurement((f"angle between the axes {math.degrees(math.acos(cosine)):.4g}°", *sizes))
    across = off - float(off @ one.axis) * one.axis
    far = float(np.linalg.norm(across))
    # drawn at the height of the first click
    start = one.center + float((one.point - one.center) @ one.axis) * one.axis
    ends = np.array([start, start + across])
    return Measurement((f"axes {_length(far, unit)} apart", *_apart(ends[0], ends[1], unit), *sizes), ends, _length(far, unit))


def _on_plane(pick: Pick, pose: Pose) -> np.ndarray:
    """A point of a plane face: by the numbers of its primitive where it is one of its ends, which the view rounds."""
    return pick.point if pick.face is None else pose.position(pick.face).value


def _apart(a: np.ndarray, b: np.ndarray, unit: str) -> tuple[str, ...]:
    off = np.where(np.abs(b - a) < NOTHING + 1e-7 * np.abs(b), 0.0, b - a)
    if (np.abs(off) > 0).sum() < 2:
        return ()
    return (", ".join(f"{axis} {_length(abs(float(d)), unit)}" for axis, d in zip("xyz", off, strict=True) if d),)


def _place(point: np.ndarray | None, unit: str) -> str:
    assert point is not None
    return f"{', '.join(_text(float(v)) for v in point)} {unit}".strip()


def _length(value: float, unit: str) -> str:
    return f"{_text(value)} {unit}".strip()


def _text(value: float) -> str:
    """As a caliper shows it: the view's vertices are single floats."""
    return f"{round(value, 3) + 0.0:.{DIGITS + 2}g}"
