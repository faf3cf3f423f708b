"""Two floors that any method must beat: the axis-aligned bounding box, and voxels merged greedily into boxes."""

from __future__ import annotations

import numpy as np
import trimesh

from imdim.geometry.winding import Interior
from imdim.program.tree import Primitive, Program, combine_all

CELLS = 32  # along the longest side

Found = tuple[Program, int, str]


def bounding(mesh: trimesh.Trimesh, _: int) -> Found:
    """The bounding box."""
    return _box(*np.asarray(mesh.bounds, float)), 1, ""


def cover(mesh: trimesh.Trimesh, _: int) -> Found:
    """The union of boxes that holds the voxels whose centres lie inside. Raises ValueError where none does."""
    low, cell, full = voxels(mesh)
    boxes = merged(full)
    if not boxes:
        raise ValueError(f"none of {full.size} voxels has its centre inside")
    parts: list[Program] = [_box(low + np.array(start) * cell, low + np.array(stop) * cell) for start, stop in boxes]
    return combine_all("union", parts), len(parts), f"{int(full.sum())} of {full.size} voxels"


def voxels(mesh: trimesh.Trimesh, cells: int = CELLS) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The grid's low corner [3], the sides of a cell [3], and which cells are full, bool [x, y, z]."""
    low, high = np.asarray(mesh.bounds, float)
    counts = np.maximum(np.rint(cells * (high - low) / (high - low).max()), 1).astype(int)
    cell = (high - low) / counts
    centres = low + (np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1) + 0.5) * cell
    return low, cell, Interior(mesh).contains(centres.reshape(-1, 3)).reshape(counts)


def merged(full: np.ndarray) -> list[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Disjoint boxes, from a first cell to one past the last, that hold just the full cells: the first free cell, grown along each axis."""
    free, boxes = full.copy(), []
    while free.any():
        start = np.unravel_index(int(free.argmax()), free.shape)
        stop = [int(i) + 1 for i in start]
        for axis in (2, 1, 0):
            while stop[axis] < free.shape[axis] and _slab(free, start, stop, axis).all():
                stop[axis] += 1
        free[tuple(map(slice, start, stop))] = False
        boxes.append((tuple(map(int, start)), tuple(map(int, stop))))
    return boxes


def _slab(free: np.ndarray, start: tuple, stop: list[int], axis: int) -> np.ndarray:
    """The layer just past `stop` along `axis`."""
    window = list(map(slice, start, stop))
    window[axis] = slice(stop[axis], stop[axis] + 1)
    return free[tuple(window)]


def _box(low: np.ndarray, high: np.ndarray) -> Primitive:
    size, center = (high - low).tolist(), ((low + high) / 2).tolist()
    return Primitive("box", tuple(size), tuple(center))
