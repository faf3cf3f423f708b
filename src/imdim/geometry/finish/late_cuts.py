"""Body first, then what is cut into it: cuts of one part that another part fills again.

A cup with a tube in it may be found as (cup - hollow) | (tube - bore), where the bore ends anywhere in the cup's floor, which fills it. Who
edits it wants ((cup - hollow) | tube) - bore, with a bore that ends where one sees it end: on the floor. So cuts of joined parts are made
last where they can be, shortened to the air that they make.
"""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold, OpType

from imdim.deadline import NEVER, Deadline
from imdim.geometry.finish.cutter_extent import ends_of, stretch
from imdim.geometry.finish.section import CHECK_SEGMENTS
from imdim.geometry.solid import exact_rotation, primitive_to_manifold, to_manifold
from imdim.program.rewrite.containment_rules import parts, spine
from imdim.program.tree import Primitive, Program, combine_all

NOTHING = 1e-6  # of a volume
ROUNDS = 4  # of nested parts that are joined
DIGITS = 9  # decimals of the size of a cut, to which its new ends are rounded
AXES = {"box": (0, 1, 2), "cylinder": (2,), "cone": (2,), "extrude": (2,)}  # along which a cut may become shorter


def cut_last(program: Program, deadline: Deadline = NEVER) -> Program:
    """The same solid, with cuts of joined parts made after these are joined, as far as that is possible.

    A cut that another part fills again ends where that part begins, and what a cut leaves standing in the body is joined to it. Past the
    `deadline` (by default never) the other cuts stay.
    """
    if deadline.has_passed() or isinstance(program, Primitive):
        return program
    solid = to_manifold(program, CHECK_SEGMENTS)
    for _ in range(ROUNDS):
        flatter = program if deadline.has_passed() else _cut_late(_join_islands(program), deadline)
        made = to_manifold(flatter, CHECK_SEGMENTS)
        if flatter == program or (made - solid).volume() + (solid - made).volume() > NOTHING * solid.volume():
            break
        program = flatter
    return program


def _join_islands(program: Program) -> Program:
    """a - (b - c) as (a - b) | c, for what stands in the body that is cut."""
    base, cuts = spine(program)
    for i, node in enumerate(cuts):
        cutter, left = spine(node)
        if left and all(_stands_in(island, base) for island in left):
            first, later = combine_all("difference", [base, *cuts[:i], cutter]), cuts[i + 1 :]
            return combine_all("difference", [combine_all("union", [first, *left]), *later])
    return program


def _stands_in(island: Program, body: Program) -> bool:
    solid = to_manifold(island, CHECK_SEGMENTS)
    return (solid - to_manifold(body, CHECK_SEGMENTS)).volume() <= NOTHING * solid.volume()


def _cut_late(program: Program, deadline: Deadline) -> Program:
    base, cuts = spine(program)
    terms = parts(base, "union")
    if len(terms) < 2 or all(isinstance(term, Primitive) for term in terms):
        return program
    solids = [to_manifold(term, CHECK_SEGMENTS) for term in terms]
    joined = Manifold.batch_boolean(solids, OpType.Add)
    late: list[Program] = []
    for i, term in enumerate(terms):
        body, own = spine(term)
        beside = Manifold.batch_boolean([solid for k, solid in enumerate(solids) if k != i], OpType.Add)
        kept: list[Program] = []
        for cut in (part for node in own for part in parts(node, "union")):
            after = None if deadline.has_passed() else _cut_after(cut, to_manifold(body, CHECK_SEGMENTS), beside, joined)
            if after is None:
                kept.append(cut)
            else:
                late.append(after)
        terms[i] = combine_all("difference", [body, *kept])
    return combine_all("difference", [combine_all("union", terms), *late, *cuts]) if late else program


def _cut_after(cut: Program, body: Manifold, beside: Manifold, joined: Manifold) -> Program | None:
    """A cut that takes out of all that is `joined` what it takes out of one `body` and what is `beside` leaves empty."""
    solid = to_manifold(cut, CHECK_SEGMENTS)
    if (solid ^ joined).volume() <= NOTHING * solid.volume():
        return cut
    air = (solid ^ body) - beside
    if not isinstance(cut, Primitive) or cut.kind not in AXES or air.volume() <= NOTHING * solid.volume():
        return None
    for axis in AXES[cut.kind]:
        cut = _shorten(cut, axis, air, joined)
    shorter = primitive_to_manifold(cut, CHECK_SEGMENTS)
    left = air - shorter
    return cut if max((shorter ^ joined).volume(), left.volume()) <= NOTHING * solid.volume() else None


def _shorten(cut: Primitive, axis: int, air: Manifold, joined: Manifold) -> Primitive:
    """The cut with ends where the `air` ends that it makes, where it meets material beyond."""
    low, high = ends_of(cut, axis)
    direction = exact_rotation(cut)[:, axis]
    direction = direction if direction[np.abs(direction).argmax()] > 0 else -direction
    places = np.asarray(air.to_mesh64().vert_properties)[:, :3] @ direction
    decimals = DIGITS - int(np.ceil(np.log10(max(cut.size))))
    first, last = (round(float(place), decimals) for place in (places.min(), places.max()))
    ends = [low, high]
    for k, (end, new) in enumerate(((low, first), (high, last))):
        if abs(end - new) <= NOTHING * max(cut.size):
            continue
        spare = primitive_to_manifold(stretch(cut, axis, (min(end, new), max(end, new))), CHECK_SEGMENTS)
        if (spare ^ joined).volume() > NOTHING * spare.volume():
            ends[k] = new
    return stretch(cut, axis, (ends[0], ends[1]))
