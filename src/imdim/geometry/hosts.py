"""Which feature a cut serves: of all that add, the one in whose material most of the faces lie that it makes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from imdim.geometry import kernels
from imdim.geometry.lowering import lower
from imdim.geometry.sampling import even_surface
from imdim.program.rewrite.containment import bounding_radius
from imdim.program.roles import signs
from imdim.program.tree import Program, leaves

ON_A_CUT = 120  # points
SKIN = 1e-4  # of the part's size, outside a cutter, where the material is that it leaves


def hosts_of_cuts(program: Program) -> list[int | None]:
    """For each leaf that cuts the number of the leaf that it serves, the first of several that hold as much; None for what adds, and for
    cuts that make no face."""
    parts, sign, solid = list(leaves(program)), signs(program), lower(program)
    adding = [i for i, s in enumerate(sign) if s > 0]
    hosts: list[int | None] = [None] * len(parts)
    skin = SKIN * max(map(bounding_radius, (parts[i] for i in adding)), default=0.0)
    for i in (i for i, s in enumerate(sign) if s < 0):
        points, normals = even_surface(parts[i], ON_A_CUT)
        beside = points + skin * normals
        shown = beside[kernels.inside(solid, beside)]
        if len(shown):
            held = np.stack([kernels.inside(parts[k], shown) for k in adding]).sum(axis=1)
            hosts[i] = adding[int(np.argmax(held))]
    return hosts


def order_by_host(program: Program, terms: Sequence[Program], first: int) -> list[int]:
    """The order of `terms` that cut, of which the first begins with leaf `first` of a `program`: by what they serve, alike ones together,
    else as they stand. A term serves what its first leaf serves."""
    hosts = hosts_of_cuts(program)
    last = len(hosts)
    keys: list[tuple[int, int]] = []
    alike: dict[tuple[int, object], int] = {}
    for number, term in enumerate(terms):
        host = hosts[first]
        served = last if host is None else host
        shape = next(leaves(term))
        keys.append((served, alike.setdefault((served, (shape.kind, shape.size, shape.outline)), number)))
        first += sum(1 for _ in leaves(term))
    return sorted(range(len(terms)), key=lambda k: keys[k])
