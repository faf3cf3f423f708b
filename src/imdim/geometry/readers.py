"""Files to bare arrays: one reader per format, nothing repaired and nothing judged but the file's syntax."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh


class InputError(ValueError):
    """The input cannot be used; the message is one line that names the file and the number."""


@dataclass(frozen=True, eq=False)
class Raw:
    """What a file says: `points` [n, 3] float64, `normals` [n, 3] or None, `faces` [m, 3] int64 or None."""

    points: np.ndarray
    normals: np.ndarray | None = None
    faces: np.ndarray | None = None


def read(path: Path) -> Raw:
    """The content of `path`, by its suffix; raises InputError for what is missing, unknown or broken."""
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    loaded = trimesh.load_scene(path).to_geometry()
    return Raw(np.asarray(loaded.vertices, float), faces=np.asarray(loaded.faces))
