"""Turned parts of which a box keeps or takes a half or a quarter, as parts of a turn: an elbow is turned by 90 degrees.

A search for the fewest primitives says an elbow by what a whole ring and a box have in common; the box, whose other faces lie anywhere
beyond, is no thing that a person would draw.
"""

from __future__ import annotations

from imdim.program.motions import euler
from imdim.program.outline import Outline, circle
from imdim.program.rewrite.containment import axes
from imdim.program.tree import FULL_TURN, OPS, Combine, Op, Primitive, Program, Vec3, fold, longest
from imdim.program.vectors import cross, dot, minus, times

ALIGNED = 1e-9  # by which the cosine between two axes may lack of 1
TOUCH = 1e-6  # of the largest size, by which a face may miss the axis
QUARTER = 90.0


def turn_part_way(program: Program) -> Program:
    """The same solid, in which turned parts that a box cuts off along planes through their axis are turned by less."""

    def join(op: Op, a: Program, b: Program) -> Program:
        if op != "union" and isinstance(a, Primitive) and isinstance(b, Primitive):
            pair = (b, a) if op == "intersection" and a.kind == "box" else (a, b)
            return _turn_by_less(*pair, keeps=op == "intersection") or Combine(op, a, b)
        return Combine(op, a, b)

    return fold(program, lambda _, p: p, {op: (lambda a, b, op=op: join(op, a, b)) for op in OPS})  # type: ignore[arg-type, return-value]


def _turn_by_less(turned: Primitive, box: Primitive, keeps: bool) -> Primitive | None:
    """What a box `keeps` of a turned part, or else leaves of it; None where that is no half, quarter or rest of one."""
    profile = _profile_of(turned)
    if profile is None or box.kind != "box":
        return None
    (_, _, z), own = axes(turned), axes(box)
    along = next((k for k in range(3) if abs(dot(own[k], z)) > 1 - ALIGNED), None)
    if along is None:
        return None
    (_, low), (radius, high) = profile.bounds
    slack, offset = TOUCH * longest((turned, box)), minus(turned.center, box.center)
    half, middle = box.size[along] / 2, dot(offset, z)
    if middle + high > half + slack or middle + low < -half - slack:
        return None
    inwards: list[Vec3] = []  # square to the faces that go through the axis
    for k in (k for k in range(3) if k != along):
        place = dot(offset, own[k])
        beyond = [box.size[k] / 2 - way * place for way in (1, -1)]  # from the axis to the face on either side
        through = [abs(far) <= slack for far in beyond]
        if any(far < radius - slack and not at for far, at in zip(beyond, through, strict=True)) or all(through):
            return None
        inwards += [times(own[k], -1.0 if through[0] else 1.0)] if any(through) else []
    if not inwards:
        return None
    angle = 2 * QUARTER if len(inwards) == 1 else QUARTER
    first = cross(inwards[0], z) if len(inwards) == 1 else inwards[0]
    start = first if dot(cross(first, inwards[-1]), z) > 0 else inwards[1]
    if not keeps:
        ahead = cross(z, start)
        start, angle = (times(start, -1.0) if angle > QUARTER else ahead), FULL_TURN - angle
    return Primitive("revolve", (angle,), turned.center, euler(start, cross(z, start), z), profile)


def _profile_of(turned: Primitive) -> Outline | None:
    """What a ring, or a whole turn of a drawing, is turned from."""
    if turned.kind == "torus" and turned.size[1] < turned.size[0]:
        return Outline((circle(turned.size[1], turned.size[0]),))
    return turned.outline if turned.kind == "revolve" and turned.size[0] == FULL_TURN else None
