"""Body first, then what is cut into it: cuts of one part that another part fills again.

A cup with a tube in it may be found as (cup - hollow) | (tube - bore), where the bore ends anywhere in the cup's floor, which fills it. Who
edits it wants ((cup - hollow) | tube) - bore, with a bore that ends where one sees it end: on the floor. So cuts of joined parts are made
last where they can be, shortened to the air that they make.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from manifold3d import Manifold, OpType

from imdim.deadline import NEVER, Deadline
from imdim.geometry.finish.cutter_extent import ends_of, round_reach, stretch
from imdim.geometry.finish.overlap import surely_overlap
from imdim.geometry.finish.section import CHECK_SEGMENTS
from imdim.geometry.finish.step_order import gather_steps
from imdim.geometry.finish.tolerances import NOTHING
from imdim.geometry.hosts import order_by_host
from imdim.geometry.solid import bounds_of, primitive_to_manifold, symmetric_difference_volume, to_manifold
from imdim.program.rewrite.containment_rules import parts, spine
from imdim.program.tree import FLAT_ENDS, Primitive, Program, combine_all, leaves

ROUNDS = 4  # of nested parts that are joined


def cut_last(program: Program, deadline: Deadline = NEVER) -> Program:
    """The same solid, with cuts of joined parts made after these are joined, as far as that is possible.

    A cut that another part fills again ends where that part begins, and what a cut leaves standing in the body is joined to it. Past the
    `deadline` (by default never) the other cuts stay.
    """
    if deadline.has_passed() or isinstance(program, Primitive):
        return program
    solid = to_manifold(program, CHECK_SEGMENTS)
    for _ in range(ROUNDS):
        flatter = program if deadline.has_passed() else _cut_late(_join_islands(gather_steps(program, deadline), solid), deadline)
        made = to_manifold(flatter, CHECK_SEGMENTS)
        if flatter == program or symmetric_difference_volume(made, solid) > NOTHING * solid.volume():
            break
        program = flatter
    return program


def lead_with_body(program: Program) -> Program:
    """The same solid, whose joined parts begin with the one whose box has the largest face: what the others stand on, and are placed by. A
    boss may hold more than its plate."""
    base, cuts = spine(program)
    terms = parts(base, "union")
    if len(terms) < 2:
        return program
    boxes = [np.ptp(bounds_of(to_manifold(term, CHECK_SEGMENTS)), axis=0) for term in terms]
    sizes = [float(np.prod(np.sort(box)[1:])) for box in boxes]
    body = next(i for i, size in enumerate(sizes) if size >= max(sizes) * (1 - NOTHING))
    if body == 0:
        return program
    return combine_all("difference", [combine_all("union", [terms[body], *terms[:body], *terms[body + 1 :]]), *cuts])


def group_cuts(program: Program) -> Program:
    """The same solid, whose last cuts stand by what they serve: those of the body, then those of the second part, and so on; alike ones
    together. What is cut from one solid may be cut in any order."""
    base, cuts = spine(program)
    terms = [term for node in cuts for term in parts(node, "union")]
    order = order_by_host(program, terms, sum(1 for _ in leaves(base))) if len(terms) > 1 else []
    return combine_all("difference", [base, *(terms[k] for k in order)]) if order != sorted(order) else program


def _join_islands(program: Program, solid: Manifold) -> Program:
    """a - (b - c) as (a - b) | c, for what stands in the body that is cut.

    What rises above the body, or above what a later cut leaves of it, ends where the `solid` does; a later cut that had no more to do than
    that goes.
    """
    base, cuts = spine(program)
    for i, node in enumerate(cuts):
        cutter, left = spine(node)
        islands = [_end_inside(island, base, solid) for island in left]
        if left and all(island is not None for island in islands):
            first, later = combine_all("difference", [base, *cuts[:i], cutter]), cuts[i + 1 :]
            joined = combine_all("union", [first, *(island for island in islands if island is not None)])
            return combine_all("difference", [joined, *_needed(joined, later, solid)])
    return program


def _end_inside(island: Program, body: Program, solid: Manifold) -> Program | None:
    """What stands in a body, shorter where it rises above what the `solid` has of it; None for what lies beside the body too."""
    if _stands_in(island, body):
        return island
    if not isinstance(island, Primitive) or island.kind not in FLAT_ENDS:
        return None
    own = primitive_to_manifold(island, CHECK_SEGMENTS)
    seen = own ^ solid
    if seen.is_empty():
        return None
    ends, least = [], NOTHING * own.volume()
    for axis in FLAT_ENDS[island.kind]:
        low, high = ends_of(island, axis)
        first, last = round_reach(seen, island, axis, max(island.size))
        for k, (end, new) in enumerate(((low, first), (high, last))):
            shorter = stretch(island, axis, (new, high) if k == 0 else (low, new))
            if abs(end - new) > NOTHING * max(island.size) and (seen - primitive_to_manifold(shorter, CHECK_SEGMENTS)).volume() <= least:
                ends.append(shorter)
    return next((shorter for shorter in ends if _stands_in(shorter, body)), None)


def _needed(joined: Program, later: list[Program], solid: Manifold) -> list[Program]:
    """The later cuts without those that take nothing that the `solid` has not lost already."""
    kept = list(later)
    for cut in later:
        rest = [other for other in kept if other is not cut]
        made = to_manifold(combine_all("difference", [joined, *rest]), CHECK_SEGMENTS)
        if symmetric_difference_volume(made, solid) <= NOTHING * solid.volume():
            kept = rest
    return kept


def _stands_in(island: Program, body: Program) -> bool:
    solid = to_manifold(island, CHECK_SEGMENTS)
    return (solid - to_manifold(body, CHECK_SEGMENTS)).volume() <= NOTHING * solid.volume()


class _Joined(NamedTuple):
    """Parts that are joined: as a program, and their solid, which is made when somebody asks for it."""

    program: Program
    solid: Manifold

    def meets(self, part: Program, own: Manifold, volume: float | None = None) -> bool:
        """Whether it holds some of a part, whose `own` solid that is: more than nothing of a `volume`, by default that of the part."""
        least = NOTHING * (own.volume() if volume is None else volume)
        return surely_overlap([part, self.program], bounds_of(own), least) or (own ^ self.solid).volume() > least


def _cut_late(program: Program, deadline: Deadline) -> Program:
    base, cuts = spine(program)
    terms = parts(base, "union")
    if len(terms) < 2 or all(isinstance(term, Primitive) for term in terms):
        return program
    solids = [to_manifold(term, CHECK_SEGMENTS) for term in terms]
    joined = _Joined(base, Manifold.batch_boolean(solids, OpType.Add))
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


def _cut_after(cut: Program, body: Manifold, beside: Manifold, joined: _Joined) -> Program | None:
    """A cut that takes out of all that is `joined` what it takes out of one `body` and what is `beside` leaves empty."""
    solid = to_manifold(cut, CHECK_SEGMENTS)
    if not joined.meets(cut, solid):
        return cut
    air = (solid ^ body) - beside
    if not isinstance(cut, Primitive) or cut.kind not in FLAT_ENDS or air.volume() <= NOTHING * solid.volume():
        return None
    for axis in FLAT_ENDS[cut.kind]:
        cut = _shorten(cut, axis, air, joined)
    shorter = primitive_to_manifold(cut, CHECK_SEGMENTS)
    return cut if not joined.meets(cut, shorter, solid.volume()) and (air - shorter).volume() <= NOTHING * solid.volume() else None


def _shorten(cut: Primitive, axis: int, air: Manifold, joined: _Joined) -> Primitive:
    """The cut with ends where the `air` ends that it makes, where it meets material beyond."""
    low, high = ends_of(cut, axis)
    first, last = round_reach(air, cut, axis, max(cut.size))
    ends = [low, high]
    for k, (end, new) in enumerate(((low, first), (high, last))):
        if abs(end - new) <= NOTHING * max(cut.size):
            continue
        spare = stretch(cut, axis, (min(end, new), max(end, new)))
        if joined.meets(spare, primitive_to_manifold(spare, CHECK_SEGMENTS)):
            ends[k] = new
    return stretch(cut, axis, (ends[0], ends[1]))
