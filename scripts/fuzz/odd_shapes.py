"""Valid files of what writers rarely write: polygons, objects with materials, scenes of nodes, units and support material, odd names."""

from __future__ import annotations

import io
import json
import os
import struct
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import trimesh
from kind import refused

OUTLINE = ((4, 0), (4, 3), (2, 3), (2, 1), (0, 1), (0, 0))  # concave
SPACE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"


def _prism() -> tuple[list[tuple[float, ...]], list[tuple[int, ...]]]:
    """Points, and polygons of six, four and three corners."""
    n = len(OUTLINE)
    points = [(x, y, z) for z in (0.0, 2.0) for x, y in OUTLINE]
    sides = [(i, (i + 1) % n, n + (i + 1) % n, n + i) for i in range(1, n)]
    return points, [tuple(range(n))[::-1], tuple(range(n, 2 * n)), *sides, (0, 1, n + 1), (0, n + 1, n)]


def objects(_: Path) -> list[bytes]:
    """OBJ of several objects and materials, which counts forwards and backwards, and goes on in the next line."""
    points, polygons = _prism()
    places = [f"v {x:g} {y:g} {z:g}" for x, y, z in points]
    forwards = ["o one", *places, "vn 0 0 1", *(f"usemtl m{k}\nf " + " ".join(f"{i + 1}//1" for i in q) for k, q in enumerate(polygons))]
    backwards = ["g two", *places, *("f " + " \\\n".join(f"{i - len(points)}/1/1" for i in q) for q in polygons), "l 1 2"]
    return ["\n".join(rows).encode() + b"\n" for rows in (["mtllib a.mtl", *forwards], ["mtllib a.mtl", *backwards])]


def polygons(make: Callable[[], Iterator[bytes]]) -> Callable[[Path], list[bytes]]:
    return lambda _: list(make())


def plys() -> Iterator[bytes]:
    points, loops = _prism()
    for form, order in (("ascii", ""), ("binary_little_endian", "<"), ("binary_big_endian", ">")):
        head = f"ply\nformat {form} 1.0\nelement vertex {len(points)}\nproperty double x\nproperty double y\nproperty double z\n"
        head += f"element face {len(loops)}\nproperty uchar red\nproperty list ushort int vertex_index\nend_header\n"
        if order:
            body = np.asarray(points, f"{order}f8").tobytes() + b"".join(struct.pack(f"{order}BH{len(q)}i", 9, len(q), *q) for q in loops)
        else:
            body = "\n".join([*(" ".join(map(str, p)) for p in points), *(" ".join(map(str, (9, len(q), *q))) for q in loops)]).encode()
        yield head.encode() + body


def offs() -> Iterator[bytes]:
    points, loops = _prism()
    rows = [*(" ".join(map(str, p)) for p in points), *(" ".join(map(str, (len(q), *q, 255, 0, 0))) for q in loops)]
    yield "\n".join([f"OFF\n# odd\n{len(points)} {len(loops)} 0", *rows]).encode()


def scenes(_: Path) -> list[bytes]:
    """GLB of nodes in nodes, strips, sparse numbers and points."""
    box = trimesh.creation.box((1, 2, 3))
    top = np.flatnonzero(box.vertices[:, 2] > 0)
    strip = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], "<f4")
    parts = [
        box.vertices.astype("<f4").tobytes(),
        box.faces.astype("<u2").tobytes(),
        top.astype("<u2").tobytes(),
        (box.vertices[top] + [0, 0, 2]).astype("<f4").tobytes(),
        strip.tobytes(),
        np.array([0, 1, 2, 3, 0, 1], "<u2").tobytes(),
    ]
    starts = np.cumsum([0, *map(len, parts)])
    sparse = {"count": len(top), "indices": {"bufferView": 2, "componentType": 5123}, "values": {"bufferView": 3}}
    solid = {"attributes": {"POSITION": 0}, "indices": 1}
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0, 2]}],
        "nodes": [{"children": [1], "rotation": [0, 0, 0.6, 0.8]}, {"mesh": 0, "scale": [2, 1, -1]}, {"mesh": 1, "translation": [9, 0, 0]}],
        "meshes": [{"primitives": [solid]}, {"primitives": [{"attributes": {"POSITION": 2}, "indices": 3, "mode": 5}]}],
        "buffers": [{"byteLength": int(starts[-1])}],
        "bufferViews": [{"buffer": 0, "byteOffset": int(s), "byteLength": len(p)} for s, p in zip(starts, parts, strict=False)],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3", "sparse": sparse},
            {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"},
            {"bufferView": 4, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 5, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
    }
    text, binary = (data + pad * (-len(data) % 4) for data, pad in ((json.dumps(document).encode(), b" "), (b"".join(parts), b"\0")))
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    return [b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks]


def print_files(_: Path) -> list[bytes]:
    """3MF in inches with support material."""
    box = trimesh.creation.box((1, 2, 3))
    vertices = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in box.vertices)
    triangles = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in box.faces)
    mesh = f"<mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh>"
    resources = f'<object id="1">{mesh}</object><object id="2" type="support">{mesh}</object>'
    items = '<item objectid="1"/><item objectid="2" transform="1 0 0 0 1 0 0 0 1 5 0 0"/>'
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        text = f'<model unit="inch" xmlns="{SPACE}"><resources>{resources}</resources><build>{items}</build></model>'
        archive.writestr("3D/3dmodel.model", text)
    return [buffer.getvalue()]


def names(_: Path) -> list[bytes]:
    return [b"part.stl", b"${oc.env:HOME}.stl", b"two\nlines \xff.stl", b"=cmd|calc!A1.stl", b'"); import os; ("' + b"n" * 200 + b".stl"]


def load_named(path: Path) -> bool:
    """A box under the name that the file's bytes are: as a setting, as a target, and in a table."""
    from imdim.app.batch.table import csv_text
    from imdim.reconstruction.config import ConfigError, from_arguments
    from imdim.target.target import InputError, load_target

    name = os.fsdecode(path.read_bytes().replace(b"/", b"_").replace(b"\0", b"_")) or "part"
    part = path.parent / "named" / name

    def read() -> None:
        settings = from_arguments([], input=str(part))
        if settings.input != str(part):
            raise AssertionError(f"{settings.input!r} is not the name that was given")
        part.parent.mkdir(exist_ok=True)
        if name not in (".", "..") and len(os.fsencode(name)) <= 255:
            part.write_bytes(trimesh.creation.box().export(file_type="stl"))
        target = load_target(part)
        if not target.name.isprintable() or csv_text(("part",), [(target.name,)]).splitlines()[1][:1] in "=+-@":
            raise AssertionError(f"{target.name!r} is shown as it is")

    return refused((InputError, ConfigError), read)
