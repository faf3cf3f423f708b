"""Points on the boundary of a whole program, walls of cuts included, and on that of one primitive; some of many; their spacing."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from imdim.geometry import kernels
from imdim.geometry.even_points import GOLDEN, PLASTIC, draw_even
from imdim.geometry.lowering import lower, pack
from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.surface_map import map_surface, surface_area
from imdim.geometry.swept_surface import draw_even_swept, sampling_areas
from imdim.program.rewrite.containment import bounding_radius
from imdim.program.tree import Primitive, Program, leaves

# A program whose boundary is a smaller share of its leaves' surfaces than about one in this many is taken to have none.
MAX_ROUNDS = 64
EIGHTH = 8  # neighbour whose distance tells the spacing of points


def surface_points(program: Program, n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """`n` area-weighted points [n, 3] on the boundary of the solid and its outward unit normals [n, 3].

    Every leaf's surface is sampled and a point is kept where the solid lies on one side of it only, so sheets between touching parts
    and skins of no thickness are no boundary. A boundary on which several leaves coincide is sampled once. A program without a
    boundary (everything is cut away) gives arrays of length zero.
    """
    parts, lowered = list(leaves(program)), lower(program)
    kinds, params = pack(program)
    areas = np.array([surface_area(p.kind, p.size, p.outline) for p in parts])
    reach = np.array([np.add(p.center, side * bounding_radius(p)) for p in parts for side in (-1, 1)])
    step = 1e-7 * float(np.ptp(reach, axis=0).max())
    kept: list[tuple[np.ndarray, np.ndarray]] = [(np.empty((0, 3)), np.empty((0, 3)))]
    found = 0
    for drawn in range(1, MAX_ROUNDS + 1):
        counts = rng.multinomial(max(n, 256), areas / areas.sum())
        samples = [leaf_surface(p, int(m), rng) for p, m in zip(parts, counts, strict=True)]
        points, normals = (np.concatenate(column) for column in zip(*samples, strict=True))
        behind, ahead = (kernels.inside(lowered, points + side * normals) for side in (-step, step))
        first = np.argmax(np.abs(kernels.leaf_table(kinds, params, points, lowered.outlines)) < step, axis=0)
        keep = (behind != ahead) & (first == np.repeat(np.arange(len(parts)), counts))
        kept.append((points[keep], np.where(behind, 1.0, -1.0)[keep, None] * normals[keep]))
        found += int(keep.sum())
        if found >= n or (found == 0 and drawn >= MAX_ROUNDS // 4):
            break
    points, normals = (np.concatenate(column) for column in zip(*kept, strict=True))
    # the rounds list leaf after leaf, so the surplus is dropped at random
    chosen = rng.permutation(len(points))[:n]
    return points[chosen], normals[chosen]


def even_surface(primitive: Primitive, n: int) -> tuple[np.ndarray, np.ndarray]:
    """About `n` points on one primitive and its outward unit normals, as `leaf_surface` gives them but as even as leaves about a stem.

    Multiples of the golden ratio are so far from all fractions that a lattice made of them stays even however it is stretched along its
    axes (Swinbank & Purser 2006 for the sphere), and each map stretches it so. Of a torus and an ellipsoid fewer than `n` are kept.
    """
    if primitive.outline is None:
        return draw_even([primitive], [n])[:2]
    # of an outline so many points are dropped that it would show
    drawn = (primitive.kind, primitive.size, primitive.outline)
    n = round(n * sampling_areas(*drawn).sum() / surface_area(*drawn))
    local, direction = draw_even_swept(*drawn, n, (GOLDEN, PLASTIC))
    rotation = matrix_from_euler(primitive.rotation)
    return local @ rotation.T + primitive.center, direction @ rotation.T


def even_surfaces(parts: Sequence[Primitive], counts: Sequence[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`even_surface` of all `parts`, about `counts` points each: points and normals [n, 3], one part after another, and where those of each
    part begin, int64 [k + 1]."""
    if all(part.outline is None for part in parts):
        return draw_even(parts, counts)
    plain = [i for i, part in enumerate(parts) if part.outline is None]
    points, normals, starts = draw_even([parts[i] for i in plain], [counts[i] for i in plain])
    found = {i: (points[a:b], normals[a:b]) for i, a, b in zip(plain, starts[:-1].tolist(), starts[1:].tolist(), strict=True)}
    drawn = [found[i] if i in found else even_surface(part, counts[i]) for i, part in enumerate(parts)]
    points, normals = (np.concatenate(column) for column in zip(*drawn, strict=True))
    return points, normals, np.cumsum([0, *(len(own) for own, _ in drawn)])


def leaf_surface(primitive: Primitive, n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """`n` area-weighted points [n, 3] on one primitive and its outward unit normals [n, 3], in world coordinates."""
    points, normals = np.empty((n, 3)), np.empty((n, 3))
    done = 0
    while done < n:
        u = rng.random((n - done, 3))
        local, direction, share = map_surface(primitive, u)
        keep = rng.random(n - done) < share
        stop = done + int(keep.sum())
        points[done:stop], normals[done:stop] = local[keep], direction[keep]
        done = stop
    rotation = matrix_from_euler(primitive.rotation)
    return points @ rotation.T + primitive.center, normals @ rotation.T


def subsample(points: np.ndarray, count: int) -> np.ndarray:
    """At most `count` of `points` [n, ...], evenly spaced by index, the first and the last among them.

    Steps of whole numbers would give up to twice as many, and beat with the rows of a scan.
    """
    return points if len(points) <= count else points[np.linspace(0, len(points) - 1, count).astype(np.int64)]


def surface_spacing(eighth: np.ndarray) -> float:
    """Side of the square that one point of a Poisson process on a surface stands for, by distances [n] to EIGHTH neighbours."""
    return float(np.median(eighth)) * math.sqrt(math.pi / EIGHTH)
