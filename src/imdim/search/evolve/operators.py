"""Variation: what makes children of parents. Every operator returns a valid tree within the bounds, or None where it does not apply.

Design, section 3.1. Mutations that know the arrangement (`insertion.py`) make the search memetic: they solve the choice of one primitive
exactly. Blind ones keep it from being greedy. Crossover swaps subtrees by the region that they explain.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from imdim.geometry.finish.posed import PosedPrimitive
from imdim.geometry.rotations import euler_from_matrix, matrix_from_euler
from imdim.program.paths import Path, at, leaf_paths, nodes, polarity, replace_at, without
from imdim.program.tree import OPS, Combine, Primitive, Program
from imdim.search.evolve.insertion import draw_gain, regrown, with_best_insertion, with_best_refit
from imdim.search.evolve.numbers import face_at, jitter, make_valid, share_number, snap_number
from imdim.search.evolve.proposals import KINDS, propose
from imdim.search.evolve.scene import TURNS, Scene
from imdim.search.front.fitness import Scorer

Operator = Callable[[Program, Scene, np.random.Generator], Program | None]


def add(program: Program, scene: Scene, rng: np.random.Generator) -> Program | None:
    """A proposed primitive united with, cut from or intersected with a random node."""
    new = propose(program, scene, rng)
    if new is None:
        return None
    every = nodes(program)
    path, node = every[0] if rng.random() < 0.5 else every[rng.integers(len(every))]
    return replace_at(program, path, Combine(OPS[rng.choice(3, p=(0.45, 0.4, 0.15))], node, new))


def add_best(program: Program, scene: Scene, rng: np.random.Generator) -> Program | None:
    """The best candidate of all at a promising place, under the true weights or discounted ones."""
    return with_best_insertion(program, scene, draw_gain(scene, rng), rng, bold=rng.random() < 0.5)


def refit(program: Program, scene: Scene, rng: np.random.Generator) -> Program | None:
    """One primitive replaced by the best candidate for its place."""
    return with_best_refit(program, scene, draw_gain(scene, rng), rng)


def remove(program: Program, scene: Scene, rng: np.random.Generator) -> Program | None:
    """A leaf gone, sometimes a whole subtree."""
    every = nodes(program)[1:] if rng.random() < 0.2 else leaf_paths(program)
    return without(program, [every[rng.integers(len(every))][0]]) if len(every) > 1 else None


def split(program: Program, scene: Scene, rng: np.random.Generator) -> Program | None:
    """A box, cylinder or cone cut in two along an axis, and the outer face of one half moved."""
    every = [(p, leaf) for p, leaf in leaf_paths(program) if leaf.kind in ("box", "cylinder", "cone")]
    if not every:
        return None
    path, leaf = every[rng.integers(len(every))]
    index = int(rng.integers(3)) if leaf.kind == "box" else len(leaf.size) - 1
    axis, share = (index if leaf.kind == "box" else 2), float(rng.uniform(0.15, 0.85))
    halves = [_shorten(leaf, index, axis, end, share) for end in (0, 1)]
    moved = halves[1] and _radially(halves[1], rng)
    if not halves[0] or not moved or not (scene.holds(halves[0]) and scene.holds(moved)):
        return None
    return replace_at(program, path, Combine("union", halves[0], moved))


def _shorten(leaf: Primitive, index: int, axis: int, end: int, share: float) -> Primitive | None:
    """The lower `share` of a leaf along an axis (end 0), or the rest (end 1)."""
    length = leaf.size[index]
    cut = face_at(leaf, index, axis, 1 - end, -length * (1 - share if end == 0 else share))
    if cut is None or leaf.kind != "cone":
        return cut
    rim = leaf.size[0] + share * (leaf.size[1] - leaf.size[0])
    return make_valid(lambda: replace(cut, size=(leaf.size[0], rim, cut.size[2]) if end == 0 else (rim, leaf.size[1], cut.size[2])))


def _radially(leaf: Primitive, rng: np.random.Generator) -> Primitive | None:
    """A half made wider or narrower across its axis."""
    factor = float(np.exp(rng.normal(0, 0.3)))
    across = range(int(rng.integers(3)), 3) if leaf.kind == "box" else range(len(leaf.size) - 1)
    return make_valid(lambda: replace(leaf, size=tuple(s * factor if i in across else s for i, s in enumerate(leaf.size))))


def merge(program: Program, scene: Scene, rng: np.random.Generator) -> Program | None:
    """Two leaves of one polarity become one: the first, grown to hold both; those with outlines stay."""
    every = leaf_paths(program)
    if len(every) < 2:
        return None
    i = int(rng.integers(len(every)))
    mates = [k for k in range(len(every)) if k != i and polarity(program, every[k][0]) == polarity(program, every[i][0])]
    mates = [k for k in mates if every[k][1].outline is None]
    if not mates:
        return None
    j = mates[rng.integers(len(mates))]
    joint = hull(every[i][1], every[j][1])
    if joint is None or not scene.holds(joint):
        return None
    return without(replace_at(program, every[i][0], joint), [every[j][0]])


def hull(a: Primitive, b: Primitive) -> Primitive | None:
    """A primitive of `a`'s kind and orientation around both; a torus, which has no inside to grow, and an outline are refused."""
    if a.kind == "torus" or a.outline is not None:
        return None
    axes = matrix_from_euler(a.rotation)
    spans = np.array([_span(p, axes) for p in (a, b)])  # [2, 3 axes, 2 ends]
    low, high = spans[..., 0].min(0), spans[..., 1].max(0)
    x, y, z = (high - low).tolist()
    width = max(x, y) / 2
    size = {
        "box": (x, y, z),
        "sphere": (max(x, y, z) / 2,),
        "cylinder": (width, z),
        "cone": (width, width, z),
        "ellipsoid": (x / 2, y / 2, z / 2),
    }[a.kind]
    return make_valid(lambda: Primitive(a.kind, size, tuple((axes @ ((low + high) / 2)).tolist()), a.rotation))  # type: ignore[arg-type]


def _span(leaf: Primitive, axes: np.ndarray) -> np.ndarray:
    """From where to where the box around a leaf reaches [3, 2] along `axes`."""
    half = np.abs(axes.T @ matrix_from_euler(leaf.rotation)) @ PosedPrimitive(leaf).half
    center = np.asarray(leaf.center) @ axes
    return np.stack([center - half, center + half], axis=1)


def substitute(program: Program, scene: Scene, rng: np.random.Generator) -> Program | None:
    """A primitive replaced by another kind of the same extents, or by a proposed one; outlines stay."""
    every = leaf_paths(program)
    path, leaf = every[rng.integers(len(every))]
    if leaf.outline is not None:
        return None
    new = propose(program, scene, rng) if rng.random() < 0.4 else _other_kind(leaf, rng)
    return replace_at(program, path, new) if new and scene.holds(new) else None


def _other_kind(leaf: Primitive, rng: np.random.Generator) -> Primitive | None:
    kind = str(rng.choice([k for k in KINDS if k != leaf.kind]))
    turn = list(TURNS[rng.integers(3)])  # a cylinder may stand in for a box along any of its axes
    x, y, z = (2 * PosedPrimitive(leaf).half)[turn].tolist()
    width, taper = min(x, y) / 2, float(rng.uniform(0, 1))
    tube = min(z, width) / 2
    size = {
        "box": (x, y, z),
        "sphere": (min(x, y, z) / 2,),
        "cylinder": (width, z),
        "cone": (width, taper * width, z) if rng.random() < 0.5 else (taper * width, width, z),
        "torus": (width - tube, tube),
    }[kind]
    rotation = euler_from_matrix(matrix_from_euler(leaf.rotation)[:, turn])
    return make_valid(lambda: Primitive(kind, size, leaf.center, rotation))


def change_operation(program: Program, scene: Scene, rng: np.random.Generator) -> Program | None:
    """One operation becomes another; a difference may also turn round."""
    every = [(p, n) for p, n in nodes(program) if isinstance(n, Combine)]
    if not every:
        return None
    path, node = every[rng.integers(len(every))]
    op = str(rng.choice([o for o in OPS if o != node.op]))
    turn = "difference" in (op, node.op) and rng.random() < 0.3
    left, right = (node.right, node.left) if turn else (node.left, node.right)
    return replace_at(program, path, Combine(op, left, right))  # type: ignore[arg-type]


def move(program: Program, scene: Scene, rng: np.random.Generator) -> Program | None:
    """A subtree detached and attached elsewhere, with the operation that it had or another."""
    every = nodes(program)
    if len(every) < 5:
        return None
    path, node = every[1 + rng.integers(len(every) - 1)]
    parent = at(program, path[:-1])
    rest = without(program, [path])
    if rest is None:
        return None
    op = parent.op if isinstance(parent, Combine) and rng.random() < 0.7 else OPS[rng.integers(3)]
    places = nodes(rest)
    where, host = places[rng.integers(len(places))]
    return replace_at(rest, where, Combine(op, host, node))


MUTATIONS: Mapping[str, tuple[float, Operator]] = {
    "add": (1.0, add),
    "add_best": (3.0, add_best),
    "refit": (2.5, refit),
    "regrow": (3.0, regrown),
    "remove": (1.5, remove),
    "split": (0.5, split),
    "merge": (0.7, merge),
    "substitute": (0.7, substitute),
    "change_operation": (0.5, change_operation),
    "move": (1.0, move),
    "jitter": (1.5, jitter),
    "share": (0.7, share_number),
    "snap": (0.7, snap_number),
}


def crossover(a: Program, b: Program, scorer: Scorer, rng: np.random.Generator) -> Program | None:
    """`a` with a subtree of `b` that lies where `b` is right and `a` is wrong.

    It takes the place of the subtree of `a` that explains most of the same region, or joins `a` as what it was: a part or a cut.
    """
    filled = scorer.fill([a, b])
    better = (filled[0] ^ scorer.label) & ~(filled[1] ^ scorer.label)
    if not better.any():
        return None
    donors = nodes(b)
    regions = scorer.fill([node for _, node in donors])
    # of two donors that mend as much, the smaller one says more about the place
    mends = np.bitwise_count(regions & better).sum(1) / np.sqrt(np.bitwise_count(regions).sum(1) + 1.0)
    if not mends.any():
        return None
    chosen = int(rng.choice(len(donors), p=mends / mends.sum()))
    path, subtree = donors[chosen]
    if rng.random() < 0.4:
        return Combine("union" if polarity(b, path) > 0 else "difference", a, subtree)
    return replace_at(a, _most_alike(a, regions[chosen], scorer), subtree)


def _most_alike(program: Program, region: np.ndarray, scorer: Scorer) -> Path:
    """The node that shares most of its samples with a region (Jaccard index)."""
    every = nodes(program)
    own = scorer.fill([node for _, node in every])
    alike = np.bitwise_count(own & region).sum(1) / np.maximum(np.bitwise_count(own | region).sum(1), 1)
    return every[int(np.argmax(alike))][0]
