"""The relations that fit clicked faces: a person chooses one in words, and needs to know no names of features."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from imdim.app.lab.edits import ConstrainedProgram
from imdim.app.lab.picks import Pick
from imdim.app.lab.solving import violations
from imdim.geometry.lowering import lower
from imdim.geometry.pose import Pose
from imdim.program.constraints import AXES, AXES_OF, LENGTHS_OF, WORLD, Constraint, ConstraintError, Ref, check
from imdim.program.tree import Primitive, leaves
from imdim.relations.residuals import HOLDS

DIGITS = 9  # of a distance
ROUND = ("cylinder", "sphere")  # whose walls may be tangent
ALONG = 1e-6  # a cosine: two directions are parallel, or at a right angle
_ROUND = ("r", "r_bottom")  # sizes by which round things are equal
_OF_FACE = {
    "box": {"x": "sx", "y": "sy", "z": "sz"},
    "cylinder": {"z": "h"},
    "cone": {"z": "h"},
    "extrude": {"z": "h"},
    "drafted": {"z": "h"},
}


@dataclass(frozen=True)
class FittingRelation:
    """A relation; whether the numbers `hold` it already, and as which number it `is_there`, if it is."""

    constraint: Constraint
    holds: bool
    is_there: int | None


def find_fitting(picks: Sequence[Pick], theory: ConstrainedProgram) -> list[FittingRelation]:
    """What can be asked of the faces, what is asked most first."""
    parts = list(leaves(theory.program))
    if not picks or any(pick.leaf >= len(parts) for pick in picks):
        return []
    known = {(c.kind, frozenset(c.of), c.about): i for i, c in enumerate(theory.constraints)}
    out: list[FittingRelation] = []
    for constraint in dict.fromkeys(_candidates(picks, parts, Pose.of(lower(theory.program)))):
        try:
            check(0, constraint, parts)
        except ConstraintError:
            continue
        off = violations(theory.program, [constraint])[0]
        there = known.get((constraint.kind, frozenset(constraint.of), constraint.about))
        out.append(FittingRelation(constraint, off <= 10 * HOLDS, there))
    return out


def _candidates(picks: Sequence[Pick], parts: Sequence[Primitive], pose: Pose) -> Iterator[Constraint]:
    if len(picks) == 1:
        yield from _of_one(picks[0], parts)
    elif len(picks) == 2:
        yield from _of_two(picks[0], picks[1], parts, pose)
    else:
        yield from _of_many(picks, parts)


def _of_one(pick: Pick, parts: Sequence[Primitive]) -> Iterator[Constraint]:
    ref = _size(pick, parts)
    if ref is not None:
        part = parts[ref.leaf]
        yield Constraint("value", (ref,), value=part.size[LENGTHS_OF[part.kind].index(ref.feature)])


def _of_two(one: Pick, two: Pick, parts: Sequence[Primitive], pose: Pose) -> Iterator[Constraint]:
    if one.leaf == two.leaf:
        if one.face is not None and two.face is not None and one.face.axis == two.face.axis:
            yield from _of_one(one, parts)
        return
    sizes = [ref for ref in (_size(one, parts), _size(two, parts)) if ref is not None]
    axes = [axis for axis in (_axis(one, parts), _axis(two, parts)) if axis is not None]
    if one.face is not None and two.face is not None:
        apart = one.face.side * float((pose.position(two.face) - pose.position(one.face)).value @ pose.axis(one.face).value)
        yield Constraint("coplanar", (one.face, two.face))
        yield Constraint("coplanar", (one.face, two.face), value=round(apart, DIGITS))
    if not one.is_flat and not two.is_flat and len(sizes) == 2:
        yield Constraint("equal", tuple(sizes))
    if not one.is_flat and not two.is_flat and _is_centred(one, parts) and _is_centred(two, parts):
        if len(axes) == 2:
            yield Constraint("coaxial", (axes[0], Ref(two.leaf)))
        elif not axes:
            yield Constraint("concentric", (Ref(one.leaf), Ref(two.leaf)))
        yield from _tangent(one, Ref(two.leaf, "r"), parts, pose)
        yield from _centers(one, two, pose)
    if one.is_flat != two.is_flat:
        flat, other = (one, two) if one.is_flat else (two, one)
        if flat.face is not None and _is_centred(other, parts):
            yield from _tangent(other, flat.face, parts, pose)
            yield _apart((flat.face, Ref(other.leaf)), Ref(flat.leaf, AXES[flat.face.axis]), pose)
    if len(axes) == 2:
        yield Constraint("parallel", tuple(axes))
        yield Constraint("perpendicular", tuple(axes))
    if one.is_flat and two.is_flat and len(sizes) == 2:
        yield Constraint("equal", tuple(sizes))


def _tangent(pick: Pick, wall: Ref, parts: Sequence[Primitive], pose: Pose) -> Iterator[Constraint]:
    """A round wall and what runs along it: a face, or another wall about an axis that is parallel."""
    kinds = parts[pick.leaf].kind, parts[wall.leaf].kind
    if kinds[0] not in ROUND or not (wall.side or kinds[1] in ROUND):
        return
    turned = [Ref(leaf, "z") for leaf, kind in zip((pick.leaf, wall.leaf), kinds, strict=True) if kind == "cylinder"]
    if wall.side and kinds[0] == "cylinder":
        fits = abs(float(pose.axis(turned[0]).value @ pose.axis(wall).value)) < ALONG
    else:
        fits = wall.side != 0 or len(turned) < 2 or abs(float(pose.axis(turned[0]).value @ pose.axis(turned[1]).value)) > 1 - ALONG
    if fits:
        yield Constraint("tangent", (Ref(pick.leaf, "r"), wall))


def _centers(one: Pick, two: Pick, pose: Pose) -> Iterator[Constraint]:
    """Two centres level along an axis of the frame, or as far apart as they are."""
    for axis in AXES:
        of, about = (Ref(one.leaf), Ref(two.leaf)), Ref(WORLD, axis)
        now = _apart(of, about, pose)
        yield Constraint("aligned", of, about)
        if now.value:
            yield now


def _of_many(picks: Sequence[Pick], parts: Sequence[Primitive]) -> Iterator[Constraint]:
    """Of three or more: all equal, in a row, on a circle; of three the last midway between the others."""
    own = [pick.leaf for pick in picks]
    if len(set(own)) < len(own) or not all(pick.is_flat or _is_centred(pick, parts) for pick in picks):
        return
    sizes = [_size(pick, parts) for pick in picks]
    axes = [_axis(pick, parts) for pick in picks]
    centers = tuple(map(Ref, own))
    *sides, middle = picks
    if len(picks) == 3 and (sides[0].is_flat == sides[1].is_flat):
        ends = tuple(pick.face or Ref(pick.leaf) for pick in sides)
        flat = next((pick.face for pick in sides if pick.face is not None), None)
        for about in [Ref(flat.leaf, AXES[flat.axis])] if flat is not None else [Ref(WORLD, axis) for axis in AXES]:
            yield Constraint("symmetric", (*ends, Ref(middle.leaf)), about)
    if not any(pick.is_flat for pick in picks):
        known = [ref for ref in sizes if ref is not None]
        if len(known) == len(picks):
            yield Constraint("equal", tuple(known))
        yield Constraint("linear", centers)
        if axes[0] is not None:
            yield Constraint("circular", centers, axes[0])
            yield Constraint("coaxial", (axes[0], *centers[1:]))
    known = [axis for axis in axes if axis is not None]
    if len(known) == len(picks):
        yield Constraint("parallel", tuple(known))


def _apart(of: tuple[Ref, Ref], about: Ref, pose: Pose) -> Constraint:
    first, second = (pose.position(ref) for ref in of)
    return Constraint("aligned", of, about, round(float((second - first).value @ pose.axis(about).value), DIGITS) + 0.0)


def _size(pick: Pick, parts: Sequence[Primitive]) -> Ref | None:
    """The size that a face shows: the diameter of a round one, the extent across a plane one."""
    part = parts[pick.leaf]
    if pick.face is not None:
        name = _OF_FACE[part.kind].get(pick.face.feature[-1])
        return None if name is None else Ref(pick.leaf, name)
    name = next((name for name in _ROUND if name in LENGTHS_OF[part.kind]), None)
    return None if name is None or pick.is_flat else Ref(pick.leaf, name)


def _is_centred(pick: Pick, parts: Sequence[Primitive]) -> bool:
    """Whether a round face has the centre of its primitive, as an arc of an outline seldom has."""
    return pick.center is not None and np.allclose(pick.center, parts[pick.leaf].center)


def _axis(pick: Pick, parts: Sequence[Primitive]) -> Ref | None:
    """The axis by which relations speak of a face: that of a round one, or the one across a plane face."""
    if pick.face is not None:
        return Ref(pick.leaf, AXES[pick.face.axis])
    return Ref(pick.leaf, AXES_OF[parts[pick.leaf].kind][0]) if pick.axis is not None else None
