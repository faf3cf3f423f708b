"""The best candidate for a place in a tree: exact, over all boxes, cylinders, cones, spheres and tori that the arrangement allows.

`search/sequence.py` does so for signed sequences; a tree has more places. A node decides a cell where a change of its value there
changes the solid. What a candidate at the node would win is then a sum of one field over its cells, which `Families.best` maximises.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from imdim.geometry.surface import signed_distance
from imdim.program.paths import Path, leaf_paths, nodes, replace_at, without
from imdim.program.tree import Combine, Op, Primitive, Program, leaves
from imdim.search.bits import unpack_words
from imdim.search.candidate_families import Candidate
from imdim.search.cells import CUTS, HULLS, PIECES, TRUE
from imdim.search.evolve.scene import Scene
from imdim.search.sequence import OCCUPANCY, field_of

WEIGHTS = (TRUE, TRUE, TRUE, HULLS, CUTS, PIECES)  # under which parts are put in, by chance
MOST_REGROWN = 3  # leaves taken out at once
PROMISING = 4  # places whose best candidates are worked out


@dataclass(frozen=True)
class NodeView:
    """A node: its cells [m], the cells that it decides, and +1 or -1 as filling it fills or empties the solid."""

    path: Path
    node: Program
    value: np.ndarray
    deciding: np.ndarray
    sign: int


@dataclass(frozen=True)
class Place:
    """A node and an operation with a new right part, which wins `potential` at most."""

    view: NodeView
    op: Op
    potential: float

    def field(self, gain: np.ndarray) -> tuple[np.ndarray, float]:
        """What a part at this place wins: the sum of a field [m] over its cells, and a constant; `gain` [m] is that of filling a cell."""
        return field_of(self.op, self.view.deciding, self.view.value, self.view.sign * gain)


def views(program: Program, cells: dict[Primitive, np.ndarray]) -> list[NodeView]:
    """All nodes, parents first."""
    order = nodes(program)
    value: dict[Path, np.ndarray] = {}
    for path, node in reversed(order):
        value[path] = cells[node] if isinstance(node, Primitive) else OCCUPANCY[node.op](value[*path, 0], value[*path, 1])
    everything = np.ones_like(value[()])
    deciding: dict[Path, tuple[np.ndarray, int]] = {(): (everything, 1)}
    for path, node in order:
        if isinstance(node, Combine):
            here, sign = deciding[path]
            left, right = value[*path, 0], value[*path, 1]
            deciding[*path, 0] = (here & right if node.op == "intersection" else here & ~right, sign)
            deciding[*path, 1] = (here & ~left if node.op == "union" else here & left, -sign if node.op == "difference" else sign)
    return [NodeView(path, node, value[path], *deciding[path]) for path, node in order]


def places(seen: list[NodeView], gain: np.ndarray) -> list[Place]:
    """The three operations at each node of a program, `gain` [m] being what filling a cell wins."""
    filled = seen[0].value
    # a change in a deciding cell that wins anything is in a cell that is wrong now: usually few
    wrong = np.flatnonzero(np.where(filled, -gain, gain) > 0)
    weight = np.abs(gain[wrong])
    out: list[Place] = []
    for view in seen:
        deciding, value = weight * view.deciding[wrong], view.value[wrong]
        empties, fills = float(deciding @ value), float(deciding @ ~value)
        out += [Place(view, "union", fills), Place(view, "difference", empties), Place(view, "intersection", empties)]
    return out


def cells_of(program: Program, scene: Scene) -> dict[Primitive, np.ndarray]:
    """The cells [m] of each leaf."""
    columns = scene.cells
    assert columns is not None
    parts = list(leaves(program))
    return dict(zip(parts, unpack_words(columns.of(parts), columns.count), strict=True))


def draw_gain(scene: Scene, rng: np.random.Generator) -> np.ndarray:
    """What filling each cell wins [m], under weights drawn by chance; nothing where there are no cells."""
    return scene.families.cells.gain_under(WEIGHTS[rng.integers(len(WEIGHTS))]) if scene.families else np.zeros(0)


def with_best_insertion(program: Program, scene: Scene, gain: np.ndarray, rng: np.random.Generator, bold: bool = False) -> Program | None:
    """The program with the best single candidate at one of its promising places, or with a good one (`bold`); None where none pays."""
    families = scene.families
    if families is None:
        return None
    least = scene.scorer.config.size_weight * families.cells.volume
    every = [p for p in places(views(program, cells_of(program, scene)), gain) if p.potential > least]
    every.sort(key=lambda p: -p.potential)
    if bold and every:
        weight = np.array([p.potential for p in every])
        every = [every[i] for i in rng.choice(len(every), min(2, len(every)), replace=False, p=weight / weight.sum())]
    best, chosen = least, None
    for place in every[:PROMISING]:
        field, constant = place.field(gain)
        for value, candidate in families.best(field, 1, max(best - constant, 0.0)):
            if value + constant > best:
                best, chosen = value + constant, (place, candidate)
    if chosen is None:
        return None
    place, candidate = chosen
    return replace_at(program, place.view.path, Combine(place.op, place.view.node, families.primitive(candidate)))


def with_best_refit(program: Program, scene: Scene, gain: np.ndarray, rng: np.random.Generator) -> Program | None:
    """One leaf replaced by the candidate that serves best in its place; outlines, which no family has, stay."""
    families = scene.families
    if families is None:
        return None
    seen = [v for v in views(program, cells_of(program, scene)) if isinstance(v.node, Primitive) and v.node.outline is None]
    if not seen:
        return None
    view = seen[rng.integers(len(seen))]
    found = families.best(np.where(view.deciding, view.sign * gain, 0.0), 1)
    if not found:
        return None
    candidate = max(found, key=lambda f: f[0])[1]
    return replace_at(program, view.path, families.primitive(candidate))


def regrown(program: Program, scene: Scene, rng: np.random.Generator) -> Program | None:
    """Related leaves taken out, as many or one fewer or more put back, each the best for its place (Shaw 1998, large neighbourhoods)."""
    taken = _without_related(program, scene, rng) if scene.families else None
    if scene.families is None or taken is None:
        return None
    shorter, count = taken
    gain, true = draw_gain(scene, rng), scene.families.cells.gain
    for step in range(count + int(rng.integers(-1, 2))):
        longer = with_best_insertion(shorter, scene, gain if step == 0 else true, rng, bold=step == 0)
        if longer is None:
            break
        shorter = longer
    return shorter


def _without_related(program: Program, scene: Scene, rng: np.random.Generator) -> tuple[Program, int] | None:
    """The program without a random leaf and some that share cells with it, and how many went."""
    every = leaf_paths(program)
    if len(every) < 2:
        return None
    cells = cells_of(program, scene)
    first = cells[every[rng.integers(len(every))][1]]
    near = np.array([float((cells[p] & first).sum()) + 1e-3 for _, p in every]) * rng.random(len(every))
    count = int(rng.integers(1, min(MOST_REGROWN, len(every) - 1) + 1))
    shorter = without(program, [every[i][0] for i in np.argsort(-near)[:count]])
    return (shorter, count) if shorter else None


def random_candidate(scene: Scene, point: np.ndarray, rng: np.random.Generator) -> Candidate | None:
    """A random candidate that covers the place of `point` [3]: any curved family around it, or any box of slabs."""
    families = scene.families
    assert families is not None
    arrangement = families.arrangement
    at = [int(d.bins(point[None])[0]) for d in arrangement.directions]
    inside = [i for i, surface in enumerate(arrangement.curved) if signed_distance(surface, point[None])[0] < 0]
    if inside and (not arrangement.frames or rng.random() < 0.5):
        index = inside[rng.integers(len(inside))]
        axis = arrangement.axis_of[index]
        return Candidate(("curved", index), (_range(at[axis], len(arrangement.directions[axis].offsets), rng),) if axis >= 0 else ((0, 1),))
    if not arrangement.frames:
        return None
    frame = int(rng.integers(len(arrangement.frames)))
    axes = arrangement.frames[frame]
    return Candidate(("box", frame), tuple(_range(at[a], len(arrangement.directions[a].offsets), rng) for a in axes))


def _range(slab: int, offsets: int, rng: np.random.Generator) -> tuple[int, int]:
    """Offset indices around a slab, near ones more likely."""
    low, high = (int(rng.geometric(0.4)) - 1 for _ in range(2))
    return max(slab - low, 0), min(slab + 1 + high, offsets - 1)
