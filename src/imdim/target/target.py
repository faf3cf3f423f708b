"""The target of a reconstruction: what a file, an array or a mesh becomes before anything is fitted to it.

`Target` always has sample points; a mesh target also keeps its mesh, in original units. `Frame` maps a target to the
unit frame that every fitting stage works in (box centre at the origin, box diagonal 1) and maps programs back.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import trimesh

from imdim.program.codec import Meta
from imdim.program.motions import IDENTITY, Matrix, Motion, move_leaf
from imdim.program.tree import Primitive, Program, Vec3, map_leaves, map_lengths
from imdim.program.units import UNSPECIFIED
from imdim.target.bodies import compact, face_normals, split_faces
from imdim.target.readers import InputError, Raw, read
from imdim.target.repair import clean_mesh
from imdim.target.viewpoint import find_camera

__all__ = ["Frame", "InputError", "Target", "frame_meta", "in_unit_frame", "load_target", "split_bodies", "target_from", "with_mesh"]

SURFACE_SAMPLES = 20_000
SAMPLE_SEED = 0
LEAST_SAMPLES, FULLY_SAMPLED = 500, 100  # of each of very many bodies; so many bodies have all
MIN_POINTS = 50
MAX_POINTS = 100_000
SAY_UNITS = (".3mf",)  # files that do, and are read as millimetres
LARGEST = 1e30  # squares of coordinates and of their inverses stay finite


@dataclass(frozen=True, eq=False)
class Target:
    """A thing to reconstruct, in its own units.

    `points` [n, 3] float64 lie on the surface; `normals` [n, 3] are unit and point outward, or None where the file had none.
    `mesh` is None for a cloud. `is_solid` says that the mesh is closed, encloses a positive volume and is oriented
    outward, so that "inside" is exact; otherwise it is the generalised winding number's opinion. `notes` say, one sentence
    each, what loading had to change. `units` is a word of 3MF: "millimeter", or "unspecified" where nobody said. `scanners` [k, 3] are the
    places that a cloud was seen from, None where nobody said.
    """

    name: str
    points: np.ndarray
    normals: np.ndarray | None
    mesh: trimesh.Trimesh | None
    is_solid: bool
    notes: tuple[str, ...] = ()
    units: str = UNSPECIFIED
    scanners: np.ndarray | None = None


@dataclass(frozen=True)
class Frame:
    """The similarity ``unit = turn.T @ (world - center) * scale``; the columns of `turn` are the unit frame's axes in the world."""

    center: Vec3
    scale: float
    turn: Matrix = IDENTITY

    @staticmethod
    def of(target: Target) -> Frame:
        """Box centre, and 1 / box diagonal, of the mesh if there is one, of the points if not."""
        corners = target.points if target.mesh is None else target.mesh.vertices
        low, high = np.min(corners, axis=0), np.max(corners, axis=0)
        x, y, z = ((low + high) / 2).tolist()
        return Frame((x, y, z), float(1 / np.linalg.norm(high - low)))

    def normalise(self, target: Target) -> Target:
        """The target in the unit frame; normals only turn."""
        mesh = target.mesh
        if mesh is not None:
            mesh = trimesh.Trimesh(self.to_unit(mesh.vertices), mesh.faces, process=False)
        scanners = None if target.scanners is None else self.to_unit(target.scanners)
        normals = target.normals if target.normals is None or self.turn == IDENTITY else target.normals @ np.array(self.turn)
        return replace(target, points=self.to_unit(target.points), normals=normals, mesh=mesh, scanners=scanners)

    def within(self, outer: Frame) -> Frame:
        """The frame of the world that this one is of what is in the unit frame of `outer`."""
        x, y, z = outer.to_world(np.array([self.center]))[0].tolist()
        return Frame((x, y, z), self.scale * outer.scale, as_matrix(np.array(outer.turn) @ np.array(self.turn)))

    def to_unit(self, points: np.ndarray) -> np.ndarray:
        """World points [n, 3] in the unit frame."""
        moved = np.asarray(points, float) - self.center
        return (moved if self.turn == IDENTITY else moved @ self.turn) * self.scale

    def to_world(self, points: np.ndarray) -> np.ndarray:
        """Points [..., 3] in the unit frame, in the target's units and place."""
        return self.turn_back(np.asarray(points, float)) / self.scale + self.center

    def turn_back(self, directions: np.ndarray) -> np.ndarray:
        """Directions [..., 3] of the unit frame in the world."""
        return directions if self.turn == IDENTITY else directions @ np.transpose(self.turn)

    def undo(self, program: Program) -> Program:
        """A program in the unit frame, put back into the target's units and place."""
        return map_leaves(program, lambda _, leaf: self._undo_leaf(leaf))

    def apply(self, program: Program) -> Program:
        """A program in the target's units, in the unit frame."""
        return map_leaves(program, lambda _, leaf: self._apply_leaf(leaf))

    def _apply_leaf(self, leaf: Primitive) -> Primitive:
        x, y, z = ((c - origin) * self.scale for c, origin in zip(leaf.center, self.center, strict=True))
        scaled = map_lengths(leaf, lambda s: s * self.scale, (x, y, z))
        return scaled if self.turn == IDENTITY else move_leaf(scaled, Motion(as_matrix(np.transpose(self.turn)), (0.0, 0.0, 0.0)))

    def _undo_leaf(self, leaf: Primitive) -> Primitive:
        leaf = leaf if self.turn == IDENTITY else move_leaf(leaf, Motion(self.turn, (0.0, 0.0, 0.0)))
        x, y, z = (c / self.scale + origin for c, origin in zip(leaf.center, self.center, strict=True))
        return map_lengths(leaf, lambda s: s / self.scale, (x, y, z))


def as_matrix(rows: np.ndarray) -> Matrix:
    """A matrix [3, 3] of plain floats."""
    first, second, third = ((float(x), float(y), float(z)) for x, y, z in rows)
    return first, second, third


def in_unit_frame(target: Target) -> tuple[Target, Frame]:
    """The target in its unit frame, and that frame."""
    frame = Frame.of(target)
    return frame.normalise(target), frame


def frame_meta(target: Target) -> Meta:
    """What files say of the target's frame."""
    frame = Frame.of(target)
    return Meta(target.units, frame.center, frame.scale)


def load_target(path: str | Path, max_points: int = MAX_POINTS) -> Target:
    """Read a mesh or a cloud from `path`; see `readers.FORMATS` for what is known.

    Raises InputError, one line with the file and the number, for anything that cannot be reconstructed.
    """
    path = Path(path)
    try:
        target = _target(read(path), printable(path.name), max_points)
        return replace(target, units="millimeter") if path.suffix.lower() in SAY_UNITS else target
    except InputError as error:
        raise InputError(printable(str(error))) from error


def printable(name: str) -> str:
    """A name in one line, for pictures, texts and tables: line breaks, controls and bytes that are no text become question marks."""
    return "".join(letter if letter.isprintable() else "?" for letter in name)


def target_from(points_or_mesh: np.ndarray | trimesh.Trimesh, name: str = "target", max_points: int = MAX_POINTS) -> Target:
    """A target from points [n, 3], points with normals [n, 6] or a trimesh; raises InputError as `load_target` does."""
    if isinstance(points_or_mesh, trimesh.Trimesh):
        return _target(Raw(np.asarray(points_or_mesh.vertices, float), faces=np.asarray(points_or_mesh.faces)), name, max_points)
    table = np.asarray(points_or_mesh)
    if table.ndim != 2 or table.shape[1] not in (3, 6) or table.dtype.kind not in "fiu":
        raise InputError(f"{name}: expected numbers of shape [n, 3] or [n, 6], got {table.dtype} of shape {list(table.shape)}")
    table = table.astype(float)
    return _target(Raw(table[:, :3], normals=table[:, 3:] if table.shape[1] == 6 else None), name, max_points)


def with_mesh(target: Target, mesh: trimesh.Trimesh) -> Target:
    """A mesh target with another mesh, which bounds a solid, and points on that."""
    changed = _mesh_target(target.name, np.asarray(mesh.vertices, float), np.asarray(mesh.faces), True, target.notes)
    return replace(changed, units=target.units)


def split_bodies(target: Target) -> list[Target]:
    """One target per separate body of a mesh target, largest volume first; nested cavities stay with their outer body.

    A cloud, or a mesh of one body, comes back as it is.
    """
    if target.mesh is None:
        return [target]
    groups = split_faces(target.mesh.vertices, target.mesh.faces)
    if len(groups) == 1:
        return [target]
    bodies = (compact(target.mesh.vertices, target.mesh.faces[faces]) for faces in groups)
    samples = max(SURFACE_SAMPLES * FULLY_SAMPLED // max(len(groups), FULLY_SAMPLED), LEAST_SAMPLES)
    return [_mesh_target(f"{target.name} body {i}", *body, target.is_solid, target.notes, samples) for i, body in enumerate(bodies, 1)]


def _target(raw: Raw, name: str, max_points: int) -> Target:
    _check_numbers(raw.points, name)
    if raw.faces is not None and len(raw.faces):
        cleaned = clean_mesh(raw.points, raw.faces, name)
        return _mesh_target(name, cleaned.vertices, cleaned.faces, cleaned.is_solid, (*raw.notes, *cleaned.notes))
    return _cloud_target(raw, name, max_points)


def _check_numbers(points: np.ndarray, name: str) -> None:
    if not len(points):
        raise InputError(f"{name}: no points in the file (0)")
    bad = int((~np.isfinite(points)).any(axis=1).sum())
    if bad:
        raise InputError(f"{name}: {bad} of {len(points)} points are not finite (NaN or infinite)")
    largest = float(np.abs(points).max())
    if largest > LARGEST:
        raise InputError(f"{name}: a coordinate of {largest:.3g} is beyond {LARGEST:g}")
    extent = float(np.ptp(points, axis=0).max())
    if extent < 1 / LARGEST or extent <= 1e-9 * largest:
        raise InputError(f"{name}: all {len(points)} points lie in one place, the box measures {extent:.3g}")


def _mesh_target(
    name: str, vertices: np.ndarray, faces: np.ndarray, is_solid: bool, notes: Iterable[str], samples: int = SURFACE_SAMPLES
) -> Target:
    points, normals = sample_surface(vertices, faces, samples, np.random.default_rng(SAMPLE_SEED))
    return Target(name, points, normals, trimesh.Trimesh(vertices, faces, process=False), is_solid, tuple(notes))


def sample_surface(vertices: np.ndarray, faces: np.ndarray, count: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Area-weighted uniform samples [count, 3] and their face normals [count, 3], at any scale of coordinates."""
    normals, areas = face_normals(vertices, faces)
    total = np.cumsum(areas)
    # stratified along the cumulative area: every face of more than 1 / count of the area gets a sample
    at = (np.arange(count) + rng.random(count)) / count * total[-1]
    face = np.minimum(np.searchsorted(total, at, side="right"), len(faces) - 1)
    u, v = rng.random((2, count, 1))
    root = np.sqrt(u)
    a, b, c = (np.asarray(vertices, float)[faces[face, i]] for i in range(3))
    return (1 - root) * a + root * (1 - v) * b + root * v * c, normals[face]


def _cloud_target(raw: Raw, name: str, max_points: int) -> Target:
    points, normals, notes = raw.points, raw.normals, list(raw.notes)
    if len(points) < MIN_POINTS:
        raise InputError(f"{name}: {len(points)} points are too few, at least {MIN_POINTS} are needed")
    if np.linalg.matrix_rank((points - points.mean(0)) / np.ptp(points, axis=0).max(), tol=1e-6 * len(points) ** 0.5) < 3:
        raise InputError(f"{name}: all {len(points)} points lie in one plane, the volume is 0")
    if normals is not None:
        normals, note = _unit_normals(normals)
        notes += note
    if len(points) > max_points:
        keep = voxel_subsample(points, max_points)
        notes.append(f"{len(points)} points thinned to {len(keep)}, one per voxel.")
        points, normals = points[keep], None if normals is None else normals[keep]
    scanners = raw.scanners
    if scanners is None and (scanners := find_camera(points)) is not None:
        notes.append("All points can be seen from the origin, where depth cameras stand: what lies behind them is taken to be unseen.")
    return Target(name, np.ascontiguousarray(points, float), normals, None, False, tuple(notes), scanners=scanners)


def _unit_normals(normals: np.ndarray) -> tuple[np.ndarray | None, list[str]]:
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    bad = int((~(np.isfinite(length) & (length > 1e-12))).sum())
    if bad:
        return None, [f"{bad} of {len(normals)} normals are zero or not finite: all were left out."]
    return normals / length, []


def voxel_subsample(points: np.ndarray, count: int) -> np.ndarray:
    """Ascending indices of at most `count` points [n, 3], the first in each cell of the finest cubic grid that is coarse enough."""
    extent, shifted = float(np.ptp(points, axis=0).max()), points - points.min(axis=0)

    def keys(cells: int) -> np.ndarray:
        cell = np.minimum(shifted * (cells / extent), cells - 1).astype(np.int64)
        return (cell[:, 0] << 42) | (cell[:, 1] << 21) | cell[:, 2]

    coarse, fine = 1, 1 << 20
    while fine - coarse > max(1, coarse // 50):
        cells = (coarse + fine) // 2 if fine - coarse < coarse else int((coarse * fine) ** 0.5)
        if _distinct(keys(cells)) > count:
            fine = cells
        else:
            coarse = cells
    return np.sort(np.unique(keys(coarse), return_index=True)[1])


def _distinct(keys: np.ndarray) -> int:
    # sorting alone is several times faster than sorting with the places kept, which only the last grid needs
    keys.sort()
    return 1 + int(np.count_nonzero(keys[1:] != keys[:-1]))
