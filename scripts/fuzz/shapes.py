"""Valid clouds and meshes of every format to break, and their reader."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from kind import refused


def load(path: Path) -> bool:
    from imdim.target.target import InputError, load_target

    return refused((InputError,), lambda: load_target(path))


def meshes(suffix: str, **options: object) -> Callable[[Path], list[bytes]]:
    def seeds(folder: Path) -> list[bytes]:
        two = trimesh.util.concatenate([trimesh.creation.box((1, 2, 3)), trimesh.creation.icosphere(1).apply_translation((4, 0, 0))])
        out = []
        for mesh in (trimesh.creation.cylinder(1.0, 2.0, sections=12), two):
            found = mesh.export(file_type=suffix, **options)
            out.append(found.encode() if isinstance(found, str) else found)
        return out

    return seeds


def _cloud() -> np.ndarray:
    points, faces = trimesh.sample.sample_surface(trimesh.creation.box((1, 2, 3)), 200, seed=0)
    return np.hstack([points, trimesh.creation.box((1, 2, 3)).face_normals[faces]])


def texts(_: Path) -> list[bytes]:
    table = _cloud()
    rows = ["\n".join(d.join(f"{v:.6g}" for v in row) for row in t) + "\n" for d, t in ((" ", table[:, :3]), (",", table), (";", table))]
    return [rows[0].encode(), ("x,y,z,nx,ny,nz\n" + rows[1]).encode(), ("# a scan\n" + rows[2]).encode(), ("\ufeff" + rows[0]).encode()]


def ply_clouds(_: Path) -> list[bytes]:
    table = _cloud().astype("<f4")
    head = "ply\nformat {} 1.0\nelement vertex 200\n" + "".join(f"property float {n}\n" for n in ("x", "y", "z", "nx", "ny", "nz"))
    text = "\n".join(" ".join(f"{v:.5g}" for v in row) for row in table)
    return [
        (head.format("ascii") + "end_header\n" + text + "\n").encode(),
        (head.format("binary_little_endian") + "end_header\n").encode() + table.tobytes(),
    ]


def pcds(_: Path) -> list[bytes]:
    table = _cloud().astype("<f4")
    head = "VERSION .7\nFIELDS x y z normal_x normal_y normal_z\nSIZE 4 4 4 4 4 4\nTYPE F F F F F F\nCOUNT 1 1 1 1 1 1\n"
    head += "WIDTH 200\nHEIGHT 1\nPOINTS 200\nDATA {}\n"
    text = "\n".join(" ".join(f"{v:.5g}" for v in row) for row in table)
    columns = table.T.tobytes()
    literal = b"".join(bytes([len(columns[i : i + 32]) - 1]) + columns[i : i + 32] for i in range(0, len(columns), 32))
    sizes = np.array([len(literal), len(columns)], "<u4").tobytes()
    return [
        (head.format("ascii") + text + "\n").encode(),
        head.format("binary").encode() + table.tobytes(),
        head.format("binary_compressed").encode() + sizes + literal,
    ]


def npys(_: Path) -> list[bytes]:
    out = []
    for table in (_cloud(), _cloud()[:, :3].astype("<f4"), np.asfortranarray(_cloud())):
        buffer = io.BytesIO()
        np.save(buffer, table)
        out.append(buffer.getvalue())
    return out


def npzs(_: Path) -> list[bytes]:
    box = trimesh.creation.box((1, 2, 3))
    out = []
    for save, arrays in (
        (np.savez, {"points": _cloud()[:, :3], "normals": _cloud()[:, 3:]}),
        (np.savez_compressed, {"vertices": np.asarray(box.vertices), "faces": np.asarray(box.faces)}),
    ):
        buffer = io.BytesIO()
        save(buffer, **arrays)
        out.append(buffer.getvalue())
    return out
