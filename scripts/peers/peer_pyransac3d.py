"""pyransac3d on a cloud of the part: fits one after another, each taking its points away; the solid is the union of the finite shapes.

The package fits one shape to a cloud and leaves the rest to its caller. What is added here, in its favour: a cylinder ends where its points
end; a shape counts the points near its own finite surface; one whose surface is mostly bare of points is refused. Planes bound nothing
alone and are not asked for. The package sees no normals, so it cannot tell a hole from a shaft: nothing is subtracted.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Iterator

import numpy as np
import pyransac3d
import trimesh
from scipy.spatial import KDTree

from imdim.geometry import kernels
from imdim.geometry.rotations import euler_from_matrix
from imdim.geometry.solid import primitive_to_manifold, to_trimesh
from imdim.program.tree import Primitive, Program, combine_all

POINTS = 2048
ITERATIONS = 1000  # of each fit
NEAR = 0.005  # of the diagonal: what a point of a shape may be off
FEWEST = 0.02  # of the points: a shape with fewer is none
BARE = 0.7  # of a shape's surface that may be without points
SPACINGS = 3.0  # between points, that a surface with points may be away from the next
MOST = 30  # shapes
TRIES = 3  # rounds of fits, before what is left holds no shape

Points = np.ndarray


def solve(mesh: trimesh.Trimesh, seed: int) -> tuple[Program, int, str]:
    """The union, and the number of shapes. Raises ValueError where none is found."""
    random.seed(seed)  # the package draws from here
    points = np.asarray(trimesh.sample.sample_surface(mesh, POINTS, seed=seed)[0], float)
    found, left = greedy(points, NEAR * float(np.linalg.norm(mesh.extents)), SPACINGS * (mesh.area / POINTS) ** 0.5)
    if not found:
        raise ValueError(f"no shape among {POINTS} points")
    return combine_all("union", found), len(found), f"{left / POINTS:.0%} of the points unexplained"


def greedy(points: Points, near: float, reach: float) -> tuple[list[Program], int]:
    """Shapes, each the one with most of the points that those before left over, and how many points are left in the end."""
    tree, found = KDTree(points), list[Program]()
    while len(points) >= FEWEST * tree.n and len(found) < MOST:
        for _ in range(TRIES):
            taken = {shape: np.abs(kernels.program_sdf(shape, points)) <= near for shape in shapes(points, near)}
            good = {shape: mine for shape, mine in taken.items() if mine.sum() >= FEWEST * tree.n and bare(shape, tree, reach) <= BARE}
            if good:
                break
        else:
            break
        best = max(good, key=lambda shape: good[shape].sum())
        found.append(best)
        points = points[~good[best]]
    return found, len(points)


def shapes(points: Points, near: float) -> Iterator[Primitive]:
    """What the package fits to `points`, as finite shapes."""
    for fit in FITS:
        try:
            with np.errstate(all="ignore"):  # it divides by zero where points it drew are in line
                shape = fit(points, near)
        except ValueError:  # its word for too few points, or for inliers without an area: no shape of this kind
            continue
        if shape is not None:
            yield shape


def bare(shape: Primitive, tree: KDTree, reach: float) -> float:
    """The share of a shape's surface that is farther than `reach` from every point."""
    surface = trimesh.sample.sample_surface(to_trimesh(primitive_to_manifold(shape)), 500, seed=0)[0]
    return float((tree.query(surface)[0] > reach).mean())


def _cuboid(points: Points, near: float) -> Primitive | None:
    found = pyransac3d.Cuboid().fit(points, near, ITERATIONS)
    if len(found.center) == 0:
        return None
    axes = np.asarray(found.axes)
    return _placed("box", found.extents, found.center, axes * [[1], [1], [np.linalg.det(axes)]])


def _cylinder(points: Points, near: float) -> Primitive | None:
    found = pyransac3d.Cylinder().fit(points, near, ITERATIONS)
    if len(found.center) == 0:
        return None
    along = (points[found.inliers] - found.center) @ found.axis
    center = found.center + (along.min() + along.max()) / 2 * np.asarray(found.axis)
    return _placed("cylinder", (found.radius, np.ptp(along)), center, _frame(np.asarray(found.axis)))


def _sphere(points: Points, near: float) -> Primitive | None:
    found = pyransac3d.Sphere().fit(points, near, ITERATIONS)
    return None if len(found.center) == 0 else _placed("sphere", (found.radius,), found.center, np.eye(3))


FITS: tuple[Callable[[Points, float], Primitive | None], ...] = (_cuboid, _cylinder, _sphere)


def _frame(axis: np.ndarray) -> np.ndarray:
    """A right-handed frame, one axis a row, whose last is `axis`."""
    side = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    side /= np.linalg.norm(side)
    return np.stack([side, np.cross(axis, side), axis])


def _placed(kind: str, size: Iterable[float], center: Iterable[float], axes: np.ndarray) -> Primitive | None:
    """None where the package's numbers are of no solid."""
    (x, y, z), sizes = map(float, center), tuple(map(float, size))
    if not (np.isfinite([x, y, z, *sizes]).all() and np.isfinite(axes).all() and min(sizes) > 0):
        return None
    return Primitive(kind, sizes, (x, y, z), euler_from_matrix(axes.T))
