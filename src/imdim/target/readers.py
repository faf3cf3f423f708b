"""Files to bare arrays: one reader per format, nothing repaired and nothing judged but the file's syntax."""

from __future__ import annotations

import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from imdim.target.archives import open_archive, read_array, read_arrays
from imdim.target.gltf import read_gltf
from imdim.target.obj import read_obj
from imdim.target.off import read_off
from imdim.target.ply import read_ply
from imdim.target.text_rows import as_utf8, read_rows
from imdim.target.threemf import read_model


class InputError(ValueError):
    """The input cannot be used; the message is one line that names the file and the number."""


@dataclass(frozen=True, eq=False)
class Raw:
    """What a file says: `points` [n, 3] float64, `normals` [n, 3] or None, `faces` [m, 3] int64 or None, `scanners` [k, 3] or None.

    `notes`, one sentence each, say what is read in another way than it is written.
    """

    points: np.ndarray
    normals: np.ndarray | None = None
    faces: np.ndarray | None = None
    notes: tuple[str, ...] = ()
    scanners: np.ndarray | None = None


# what numpy's and trimesh's parsers raise on files that break their format
SYNTAX_ERRORS = (
    *(ValueError, KeyError, IndexError, TypeError, AttributeError, EOFError, SyntaxError, NotImplementedError, OverflowError),
    *(struct.error, zlib.error, zipfile.BadZipFile, RecursionError, MemoryError, StopIteration, UnboundLocalError),
)


def read(path: Path) -> Raw:
    """The content of `path`, by its suffix; raises InputError for what is missing, unknown or broken."""
    reader = FORMATS.get(path.suffix.lower())
    try:
        if not path.exists():
            raise InputError(f"{path}: no such file")
        if reader is None:
            raise InputError(f"{path}: unknown format {path.suffix!r}; known are {', '.join(FORMATS)}")
        if path.stat().st_size == 0:
            raise InputError(f"{path}: the file is empty (0 bytes)")
        raw = reader(path)
    except OSError as error:
        name = str(path) if len(str(path)) <= 160 else f"{str(path)[:157]}..."
        raise InputError(f"{name}: cannot be opened: {error.strerror or error}") from error
    except InputError:
        raise
    except SYNTAX_ERRORS as error:
        raise InputError(f"{path}: not a readable {path.suffix.lower()[1:].upper()} file: {_one_line(error)}") from error
    return _check_raw(raw, path)


def _one_line(error: Exception) -> str:
    text = " ".join(str(error).split()) or type(error).__name__
    return text if len(text) <= 160 else text[:157] + "..."


def _check_raw(raw: Raw, path: Path) -> Raw:
    faces = raw.faces
    for what, table in (
        ("coordinates", raw.points),
        ("normals", raw.normals),
        ("corners", faces),
        ("numbers of scanners", raw.scanners),
    ):
        if table is not None and len(table) and (table.ndim != 2 or table.shape[1] != 3):
            raise InputError(f"{path}: 3 {what} each are needed, the shape is {list(table.shape)}")
    if raw.normals is not None and len(raw.normals) != len(raw.points):
        raise InputError(f"{path}: {len(raw.normals)} normals for {len(raw.points)} points")
    if faces is None or not len(faces):
        return Raw(raw.points, raw.normals, notes=raw.notes, scanners=_finite(raw.scanners, path))
    bad = int(((faces < 0) | (faces >= len(raw.points))).any(axis=1).sum())
    if bad:
        raise InputError(f"{path}: {bad} of {len(faces)} faces name a vertex that is not among the {len(raw.points)}")
    return raw


def _finite(scanners: np.ndarray | None, path: Path) -> np.ndarray | None:
    if scanners is not None and not np.isfinite(scanners).all():
        raise InputError(f"{path}: {int((~np.isfinite(scanners)).any(1).sum())} of {len(scanners)} scanners are nowhere (NaN or infinite)")
    return scanners


def read_stl(path: Path) -> Raw:
    """Binary or ASCII, told apart by the length that a binary header promises: some binary files begin with "solid"."""
    data = path.read_bytes()
    if 84 + 50 * int.from_bytes(data[80:84], "little") != len(data):
        data = as_utf8(data)
    count, held = int.from_bytes(data[80:84], "little"), (len(data) - 84) // 50
    is_text = data.lstrip()[:5].lower() == b"solid"
    notes = ()
    if 84 + 50 * count != len(data) and (is_text or b"facet" in data[:1000].lower()):
        corners = _text_points(data, b"(?i:vertex)")
    else:
        if count > held or held < 1:
            raise InputError(f"{path}: not a whole STL file: {count} triangles need {84 + 50 * count} bytes, {len(data)} are there")
        if count < held and len(data) == 84 + 50 * held:  # nothing but triangles lies behind those that the header counts
            notes = (f"The header counts {count} triangles, the file has {held}: all were read.",)
            count = held
        record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("extra", "<u2")])
        corners = np.frombuffer(data, record, count, offset=84)["corners"].reshape(-1, 3).astype(float)
    if not len(corners) or len(corners) % 3:
        raise InputError(f"{path}: not a readable STL file: {len(corners)} corners found, {len(data)} bytes")
    return Raw(corners, faces=np.arange(len(corners)).reshape(-1, 3), notes=notes)


def _text_points(data: bytes, pattern: bytes) -> np.ndarray:
    """Three numbers [n, 3] after each keyword."""
    rows = re.findall(pattern + rb"\s+(\S+)\s+(\S+)\s+(\S+)", data, re.MULTILINE)
    return np.array(rows, dtype="S32").astype(float).reshape(-1, 3)


def read_scene(path: Path) -> Raw:
    """GLB and glTF: every mesh in its place, or, where there is none, every cloud."""
    points, faces = read_gltf(path)
    return Raw(points, faces=faces)


def read_objects(path: Path) -> Raw:
    """OBJ and OFF: all objects of a file as one mesh, or a cloud where none has a face."""
    points, faces = (read_off if path.suffix.lower() == ".off" else read_obj)(as_utf8(path.read_bytes()))
    return Raw(points, faces=faces)


def read_threemf(path: Path) -> Raw:
    """Every mesh that is built, in its place. Trimesh needs a kilobyte per face for its tree of nodes."""
    with path.open("rb") as file, open_archive(file) as archive:
        points, faces, notes = read_model(archive)
    return Raw(points, faces=faces, notes=notes)


def read_polygons(path: Path) -> Raw:
    """PLY: a mesh where there are faces, a cloud where there are none."""
    points, normals, faces = read_ply(as_utf8(path.read_bytes()))
    return Raw(points, normals, faces)


def read_text(path: Path) -> Raw:
    """Rows of x y z, with commas, semicolons or blanks; normals where a header names them or three columns have unit length.

    A header of any length is passed over; colours are told from normals by their length.
    """
    table, names = read_rows(path)
    return _by_columns(table, names)


def _by_columns(table: np.ndarray, names: list[str]) -> Raw:
    if {"x", "y", "z"} <= set(names):
        normals = table[:, [names.index(n) for n in ("nx", "ny", "nz")]] if {"nx", "ny", "nz"} <= set(names) else None
        return Raw(table[:, [names.index(n) for n in "xyz"]], normals)
    for start in (3, 6, 7):
        candidate = table[:, start : start + 3]
        if candidate.shape[1] == 3 and np.mean(np.abs(np.linalg.norm(candidate, axis=1) - 1) < 0.02) > 0.9:
            return Raw(table[:, :3], candidate)
    return Raw(table[:, :3])


def read_numpy(path: Path) -> Raw:
    """NPY: [n, 3], or [n, 6] with normals. NPZ: `points` (or vertices, xyz, pos), `normals`, `faces`, `scanners`. Pickles are refused."""
    with path.open("rb") as file:
        if file.read(2) != b"PK":
            file.seek(0)
            return _by_columns(_table(read_array(file, path.stat().st_size), path), [])
        with open_archive(file) as archive:
            entries = {name.lower(): array for name, array in read_arrays(archive).items()}
    pick = [next((entries[n] for n in names if n in entries), None) for names in NPZ_NAMES]
    if pick[0] is None:
        raise InputError(f"{path}: none of {', '.join(NPZ_NAMES[0])} among its {len(entries)} arrays")
    points, normals, faces, scanners = (None if a is None else _table(a, path) for a in pick)
    assert points is not None
    raw = _by_columns(points, [])
    normals, faces = normals if normals is not None else raw.normals, None if faces is None else _whole_numbers(faces, path)
    return Raw(raw.points, normals, faces, scanners=scanners)


NPZ_NAMES = (("points", "vertices", "xyz", "pos", "positions"), ("normals", "normal"), ("faces", "triangles"), ("scanners",))


def _whole_numbers(faces: np.ndarray, path: Path) -> np.ndarray:
    bad = int((~((faces == np.round(faces)) & (np.abs(faces) < 1 << 53))).any(axis=1).sum())
    if bad:
        raise InputError(f"{path}: {bad} of {len(faces)} faces have corners that are no whole numbers")
    return faces.astype(np.int64)


def _table(array: np.ndarray, path: Path) -> np.ndarray:
    if array.ndim != 2 or array.shape[1] < 3 or array.dtype.kind not in "fiu":
        raise InputError(f"{path}: expected numbers of shape [n, 3] or [n, 6], got {array.dtype} of shape {list(array.shape)}")
    return array.astype(float)


def _read_pcd(path: Path) -> Raw:
    from imdim.target.pcd import read_pcd

    table, names, scanners = read_pcd(path.read_bytes())
    return replace(_by_columns(table, names), scanners=scanners)


FORMATS: Mapping[str, Callable[[Path], Raw]] = {
    ".stl": read_stl,
    ".obj": read_objects,
    ".off": read_objects,
    ".ply": read_polygons,
    ".3mf": read_threemf,
    ".glb": read_scene,
    ".gltf": read_scene,
    ".xyz": read_text,
    ".txt": read_text,
    ".csv": read_text,
    ".pcd": _read_pcd,
    ".npy": read_numpy,
    ".npz": read_numpy,
}
