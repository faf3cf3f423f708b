"""Mutations of numbers: faces moved by the scale of the local error, values made equal, faces put on detected offsets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from imdim.geometry.rotations import euler_from_matrix, matrix_from_euler
from imdim.geometry.surface import vec
from imdim.program.paths import leaf_paths, replace_at
from imdim.program.tree import FLAT_ENDS, Primitive, Program, envelope, map_lengths
from imdim.search.arrangement import PARALLEL
from imdim.search.evolve.scene import Scene

LEAST_STEP = 1e-4  # of the diagonal; what fits already still tries this
# which local axis each size spans from face to face; sizes that are not listed are radii, or the angle of a turned outline
_SPANS = {kind: {size: axis for axis, size in ends.items()} for kind, ends in FLAT_ENDS.items()}
_RADII = {"sphere": (0,), "cylinder": (0,), "cone": (0, 1), "torus": (0, 1), "ellipsoid": (0, 1, 2)}


def jitter(program: Program, scene: Scene, rng: np.random.Generator) -> Program | None:
    """One leaf's numbers moved by about its local error."""
    every = leaf_paths(program)
    errors = scene.local_errors(program)
    # leaves that are wrong are changed more often
    weight = errors + 0.1 * errors.mean() + 1e-12
    i = int(rng.choice(len(every), p=weight / weight.sum()))
    path, leaf = every[i]
    sigma = max(float(errors[i]), LEAST_STEP * scene.diagonal) * float(rng.choice((0.3, 1.0, 3.0)))
    change = (_face_moved, _face_moved, _shift, _turn, _scale)[rng.integers(5)]
    return _with(program, path, change(leaf, sigma, rng), scene)


def share_number(program: Program, scene: Scene, rng: np.random.Generator) -> Program | None:
    """A value of one leaf given to another: a radius or an edge, the orientation, or the place along an axis (equal sizes, coaxial)."""
    every = leaf_paths(program)
    if len(every) < 2:
        return None
    i, j = rng.choice(len(every), 2, replace=False)
    path, leaf = every[i]
    give = (_same_size, lambda leaf, other, _: replace(leaf, rotation=other.rotation), _same_coordinate)[rng.integers(3)]
    return _with(program, path, give(leaf, every[j][1], rng), scene)


def snap_number(program: Program, scene: Scene, rng: np.random.Generator) -> Program | None:
    """A face put on one of the nearest detected offsets, or a radius made that of a detected surface."""
    if scene.families is None:
        return None
    every = leaf_paths(program)
    path, leaf = every[rng.integers(len(every))]
    snap = _snap_radius if leaf.kind in _RADII and rng.random() < 0.5 else _snap_face
    return _with(program, path, snap(leaf, scene, rng), scene)


def _with(program: Program, path: tuple[int, ...], leaf: Primitive | None, scene: Scene) -> Program | None:
    return replace_at(program, path, leaf) if leaf is not None and scene.holds(leaf) else None


def make_valid(make: Callable[[], Primitive]) -> Primitive | None:
    """The primitive, or None where its sizes are refused."""
    try:
        return make()
    except ValueError:
        return None


def face_at(leaf: Primitive, index: int, axis: int, end: int, shift: float) -> Primitive | None:
    """One of the two faces of a span moved outwards by `shift`, the other one held."""
    size = tuple(s + shift if i == index else s for i, s in enumerate(leaf.size))
    direction = matrix_from_euler(leaf.rotation)[:, axis] * (0.5 * shift * (1 if end else -1))
    return make_valid(lambda: replace(leaf, size=size, center=vec(np.asarray(leaf.center) + direction)))


def _face_moved(leaf: Primitive, sigma: float, rng: np.random.Generator) -> Primitive | None:
    index = int(rng.integers(len(leaf.size)))
    shift = float(rng.normal(0, sigma))
    if index in _SPANS.get(leaf.kind, {}):
        return face_at(leaf, index, _SPANS[leaf.kind][index], int(rng.integers(2)), shift)
    return make_valid(lambda: replace(leaf, size=tuple(s + shift if i == index else s for i, s in enumerate(leaf.size))))


def _shift(leaf: Primitive, sigma: float, rng: np.random.Generator) -> Primitive:
    return replace(leaf, center=vec(np.asarray(leaf.center) + rng.normal(0, sigma, 3)))


def _turn(leaf: Primitive, sigma: float, rng: np.random.Generator) -> Primitive:
    """Turned so that its far ends move by about `sigma`."""
    angle = np.degrees(min(sigma / max(envelope(leaf).size), 1.0)) * rng.normal(0, 1, 3)
    return replace(leaf, rotation=euler_from_matrix(matrix_from_euler(leaf.rotation) @ matrix_from_euler(vec(angle))))


def _scale(leaf: Primitive, sigma: float, rng: np.random.Generator) -> Primitive | None:
    factor = float(np.exp(rng.normal(0, min(sigma / max(envelope(leaf).size), 0.5))))
    return make_valid(lambda: map_lengths(leaf, lambda length: length * factor, leaf.center))


def _same_size(leaf: Primitive, other: Primitive, rng: np.random.Generator) -> Primitive | None:
    if (leaf.kind == "revolve") != (other.kind == "revolve"):
        return None  # one is an angle, the other a length
    i, value = int(rng.integers(len(leaf.size))), other.size[rng.integers(len(other.size))]
    return make_valid(lambda: replace(leaf, size=tuple(value if k == i else s for k, s in enumerate(leaf.size))))


def _same_coordinate(leaf: Primitive, other: Primitive, rng: np.random.Generator) -> Primitive:
    """The centre moved along one of the other's axes to its height, or, coaxial, onto its third axis."""
    axes = matrix_from_euler(other.rotation)
    gap = (np.asarray(other.center) - leaf.center) @ axes
    kept = np.eye(3)[rng.integers(3)] if rng.random() < 0.5 else np.array([1.0, 1.0, 0.0])
    return replace(leaf, center=vec(np.asarray(leaf.center) + axes @ (kept * gap)))


def _snap_face(leaf: Primitive, scene: Scene, rng: np.random.Generator) -> Primitive | None:
    assert scene.families is not None
    spans = _SPANS.get(leaf.kind)
    if not spans:
        return None
    index = list(spans)[rng.integers(len(spans))]
    vector = matrix_from_euler(leaf.rotation)[:, spans[index]]
    end = int(rng.integers(2))
    for direction in scene.families.arrangement.directions:
        cosine = float(direction.vector @ vector)
        if abs(cosine) > PARALLEL:
            # the end's offset along the direction, whichever way that points
            at = float(np.asarray(leaf.center) @ direction.vector) + (0.5 if end else -0.5) * leaf.size[index] * np.sign(cosine)
            near = direction.offsets[np.argsort(np.abs(direction.offsets - at))[:3]]
            shift = (float(near[rng.integers(len(near))]) - at) * np.sign(cosine) * (1 if end else -1)
            return face_at(leaf, index, spans[index], end, shift)
    return None


def _snap_radius(leaf: Primitive, scene: Scene, rng: np.random.Generator) -> Primitive | None:
    assert scene.families is not None
    radii = np.array([s for c in scene.families.arrangement.curved if c.kind != "cone" for s in c.sizes])
    if not len(radii):
        return None
    index = int(rng.choice(_RADII[leaf.kind]))
    near = radii[np.argsort(np.abs(radii - leaf.size[index]))[:3]]
    value = float(near[rng.integers(len(near))])
    return make_valid(lambda: replace(leaf, size=tuple(value if k == index else s for k, s in enumerate(leaf.size))))
