"""Which plane ends of leaves go where a face goes that is seen, so that no edit of that brings them in sight."""

from __future__ import annotations

from imdim.export.elimination import LinearSystem, vector
from imdim.export.outline_rows import add_outlines
from imdim.export.seats import End, seats
from imdim.export.seen import find_hidden_ends
from imdim.export.wall_seats import seats_at_walls
from imdim.program.roles import signs
from imdim.program.tree import Program, leaves, longest


def find_followed_ends(program: Program) -> list[End]:
    """The ends that have a seat at a face or a wall of which something is seen."""
    hidden, parts = find_hidden_ends(program), list(leaves(program))
    found = [seat.own for seat in seats(program) if (seat.face.leaf, seat.face.axis, seat.face.side) not in hidden]
    system = LinearSystem(vector(parts).tolist(), 6 * len(parts), longest(parts))
    add_outlines(system, parts, None, signs(program))
    return found + [own for own, _, _ in seats_at_walls(program, system.walls, hidden)]
