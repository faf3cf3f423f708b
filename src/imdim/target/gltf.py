"""glTF 2.0, as text and as GLB: triangles and points of the scene, every node in its place. Materials and pictures are never looked at.

What would change the shape and is not read is refused by name: compressed geometry and other extensions that a file requires, instances,
skins and morph targets.
"""

from __future__ import annotations

import base64
import binascii
import json
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote

import numpy as np

MAX_BRACKETS = 1_000_000
MAX_FACES = 20_000_000
MAX_MESHES = 200_000  # placed, over all nodes
JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942
KINDS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
POINTS, TRIANGLES, STRIP, FAN = 0, 4, 5, 6
# of what files may require, those that leave the shape as it is: looks, and numbers of other kinds, which accessors tell anyway
HARMLESS = (
    "KHR_materials_",
    "KHR_texture_",
    "KHR_lights_",
    "KHR_xmp",
    "EXT_texture_",
    "KHR_mesh_quantization",
    "EXT_lights_",
    "MSFT_texture_",
)
SHAPING = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression", "EXT_mesh_gpu_instancing")


def read_gltf(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices [n, 3] float64 and triangles [m, 3] int64 of all that the scene shows; where it has no triangles, its points.

    Raises ValueError, one line, for what is broken, needs what is not read here, or asks for files elsewhere.
    """
    document, binary = _open(path.read_bytes())
    return _Reader(document, binary, path.parent).read()


def _open(data: bytes) -> tuple[dict[str, Any], bytes | None]:
    """The JSON document and the binary chunk, if any."""
    text, binary = data, None
    if data[:4] == b"glTF":
        chunks = dict(reversed(list(_chunks(data))))  # the first of a kind counts
        if JSON_CHUNK not in chunks:
            raise ValueError("it has no chunk of JSON")
        text, binary = chunks[JSON_CHUNK], chunks.get(BINARY_CHUNK)
    many = text.count(b"[") + text.count(b"{")
    if many > MAX_BRACKETS:  # Python's collector of garbage takes minutes over them
        raise ValueError(f"{many} lists and objects in its JSON, at most {MAX_BRACKETS}")
    document = json.loads(text)
    if not isinstance(document, dict):
        raise ValueError("its JSON is no object")
    return document, binary


def _chunks(data: bytes) -> Iterator[tuple[int, bytes]]:
    version = int.from_bytes(data[4:8], "little")
    if version != 2:
        raise ValueError(f"version {version} of GLB, 2 is read")
    at = 12
    while at + 8 <= len(data):
        size, kind = int.from_bytes(data[at : at + 4], "little"), int.from_bytes(data[at + 4 : at + 8], "little")
        if at + 8 + size > len(data):
            raise ValueError(f"a chunk of {size} bytes where {len(data) - at - 8} are left")
        yield kind, data[at + 8 : at + 8 + size]
        at += 8 + size


class _Reader:
    """Of one document."""

    def __init__(self, document: dict[str, Any], binary: bytes | None, folder: Path) -> None:
        self._document, self._binary, self._folder = document, binary, folder
        self._buffers: dict[int, np.ndarray] = {}
        self._meshes: dict[int, list[tuple[np.ndarray, np.ndarray]]] = {}

    def read(self) -> tuple[np.ndarray, np.ndarray]:
        """See `read_gltf`."""
        with np.errstate(all="ignore"):  # what is not finite is refused later
            return self._read()

    def _read(self) -> tuple[np.ndarray, np.ndarray]:
        for name in self._document.get("extensionsRequired", []):
            if not str(name).startswith(HARMLESS):
                raise ValueError(f"it requires {str(name)[:60]}, which is not read: export it without compression or extensions")
        placed, points, faces, base, many = 0, [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], 0, 0
        for mesh, place in self._nodes():
            for vertices, triangles in self._mesh(mesh):
                placed, many = placed + 1, many + max(len(triangles), len(vertices))
                if placed > MAX_MESHES or many > MAX_FACES:
                    raise ValueError(f"its nodes grow to more than {MAX_MESHES} meshes or {MAX_FACES} faces")
                points.append(vertices @ place[:3, :3].T + place[:3, 3])
                turned = np.linalg.det(place[:3, :3]) < 0
                faces.append((triangles[:, ::-1] if turned else triangles) + base)
                base += len(vertices)
        return np.concatenate(points), np.concatenate(faces)

    def _get(self, kind: str, index: Any) -> dict[str, Any]:
        """One entry of a list of the document."""
        entries = self._document.get(kind, [])
        if not isinstance(index, int) or isinstance(index, bool) or not 0 <= index < len(entries):
            raise ValueError(f"{kind} has no entry {str(index)[:40]} among its {len(entries)}")
        if not isinstance(entries[index], dict):
            raise ValueError(f"entry {index} of {kind} is no object")
        return entries[index]

    def _nodes(self) -> Iterator[tuple[int, np.ndarray]]:
        """The mesh of each node that the scene shows, with its place [4, 4]; a file without scenes shows the nodes that are no children."""
        nodes = self._document.get("nodes", [])
        if self._document.get("scenes"):
            roots = self._get("scenes", self._document.get("scene", 0)).get("nodes", [])
        elif nodes:
            inner = {child for i in range(len(nodes)) for child in self._get("nodes", i).get("children", [])}
            roots = [i for i in range(len(nodes)) if i not in inner]
        else:
            yield from ((mesh, np.eye(4)) for mesh in range(len(self._document.get("meshes", []))))
            return
        seen: set[int] = set()
        stack = [(root, np.eye(4)) for root in reversed(roots)]
        while stack:
            index, outer = stack.pop()
            node = self._get("nodes", index)
            if index in seen:
                raise ValueError(f"node {index} has two parents, or is its own")
            seen.add(index)
            extra = next((name for name in node.get("extensions", {}) if name in SHAPING), "a skin" if "skin" in node else None)
            if extra is not None:
                raise ValueError(f"node {index} has {extra}, which is not read")
            place = outer @ _transform(node)
            if "mesh" in node:
                yield node["mesh"], place
            stack += [(child, place) for child in reversed(node.get("children", []))]

    def _mesh(self, index: Any) -> list[tuple[np.ndarray, np.ndarray]]:
        """Vertices and triangles of each primitive of a mesh, read once however many nodes show it."""
        mesh = self._get("meshes", index)
        if index not in self._meshes:
            self._meshes[index] = [found for given in mesh["primitives"] for found in self._primitive(given)]
        return self._meshes[index]

    def _primitive(self, given: dict[str, Any]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """None for lines; points have no triangles."""
        extra = next((name for name in given.get("extensions", {}) if name in SHAPING), "morph targets" if given.get("targets") else None)
        if extra is not None:
            raise ValueError(f"a mesh has {extra}, which is not read: export it without")
        mode = given.get("mode", TRIANGLES)
        if mode not in (POINTS, TRIANGLES, STRIP, FAN) or "POSITION" not in given.get("attributes", {}):
            return
        vertices = self._accessor(given["attributes"]["POSITION"]).astype(float)
        if vertices.shape[1] != 3:
            raise ValueError(f"places of {vertices.shape[1]} numbers, 3 are needed")
        if mode == POINTS:
            yield vertices, np.zeros((0, 3), np.int64)
            return
        corners = self._accessor(given["indices"]) if "indices" in given else np.arange(len(vertices))[:, None]
        if corners.dtype.kind == "f" or corners.shape[1] != 1:
            raise ValueError("corners that are no whole numbers")
        corners = corners[:, 0].astype(np.int64)
        bad = int((corners >= len(vertices)).sum() + (corners < 0).sum())
        if bad:
            raise ValueError(f"{bad} of {len(corners)} corners name a vertex that is not among the {len(vertices)}")
        yield vertices, _triangles(corners, mode)

    def _accessor(self, index: Any) -> np.ndarray:
        """The numbers [n, w] of an accessor: those of its view, or zeros, with the sparse ones in their places."""
        given = self._get("accessors", index)
        count, width, kind = _whole(given["count"]), WIDTHS[given["type"]], np.dtype(KINDS[given["componentType"]])
        if "bufferView" in given:
            numbers = self._view(given["bufferView"], _whole(given.get("byteOffset", 0)), count, width, kind)
        elif count * width > MAX_FACES:
            raise ValueError(f"{count} rows of zeros, at most {MAX_FACES}")
        else:
            numbers = np.zeros((count, width), kind)
        if "sparse" in given:
            sparse = given["sparse"]
            some, where, what = _whole(sparse["count"]), sparse["indices"], sparse["values"]
            rows = self._view(where["bufferView"], _whole(where.get("byteOffset", 0)), some, 1, np.dtype(KINDS[where["componentType"]]))
            rows = rows[:, 0].astype(np.int64)
            if rows.size and (rows.min() < 0 or rows.max() >= count):
                raise ValueError(f"a sparse row that is not among the {count}")
            numbers = numbers.copy()
            numbers[rows] = self._view(what["bufferView"], _whole(what.get("byteOffset", 0)), some, width, kind)
        if given.get("normalized") and kind.kind in "iu":
            return np.maximum(numbers.astype(float) / np.iinfo(kind).max, -1.0)
        return numbers

    def _view(self, index: Any, offset: int, count: int, width: int, kind: np.dtype) -> np.ndarray:
        """`count` rows [count, width] of a view of a buffer."""
        view = self._get("bufferViews", index)
        if any(name in SHAPING for name in view.get("extensions", {})):
            raise ValueError("its buffers are compressed, which is not read: export it without compression")
        data = self._buffer(view["buffer"])
        start, length = _whole(view.get("byteOffset", 0)), _whole(view["byteLength"])
        row = kind.itemsize * width
        stride = _whole(view.get("byteStride", 0)) or row
        needed = offset + (stride * (count - 1) + row if count else 0)
        if stride < row or needed > length or start + length > len(data):
            raise ValueError(f"{count} rows need {needed} bytes of a view that has {min(length, max(len(data) - start, 0))}")
        if not count:
            return np.zeros((0, width), kind)
        rows = np.lib.stride_tricks.as_strided(data[start + offset :], (count, row), (stride, 1), writeable=False)
        return np.ascontiguousarray(rows).view(kind)

    def _buffer(self, index: Any) -> np.ndarray:
        given = self._get("buffers", index)
        if index not in self._buffers:
            self._buffers[index] = np.frombuffer(self._content(given.get("uri")), np.uint8)
        return self._buffers[index]

    def _content(self, uri: Any) -> bytes:
        """Of the GLB itself, of the address itself, or of a file beside the document: never from anywhere else."""
        if uri is None:
            if self._binary is None:
                raise ValueError("a buffer has no content")
            return self._binary
        head, comma, rest = str(uri).partition(",")
        if head.startswith("data:") and comma:
            if not head.endswith(";base64"):
                raise ValueError("a buffer whose data is not base64")
            try:
                return base64.b64decode(rest)
            except binascii.Error as error:
                raise ValueError(f"a buffer that is no base64: {error}") from error
        name = PurePosixPath(unquote(str(uri)))
        if ":" in str(uri) or "\\" in str(uri) or name.is_absolute() or ".." in name.parts:
            raise ValueError(f"a buffer lies elsewhere: {str(uri)[:60]!r}")
        path = self._folder / name
        if not path.resolve().is_relative_to(self._folder.resolve()) or not path.is_file():
            raise ValueError(f"a buffer is not beside it: {str(uri)[:60]!r}")
        return path.read_bytes()


def _transform(node: dict[str, Any]) -> np.ndarray:
    """Of a node in its parent [4, 4]: a matrix by columns, or scaled, then turned by a quaternion (x, y, z, w), then moved."""
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    out = np.eye(4)
    if "rotation" in node:
        x, y, z, w = (float(v) for v in node["rotation"])
        length = (x * x + y * y + z * z + w * w) ** 0.5
        if not length > 0:
            raise ValueError("a rotation of length 0")
        x, y, z, w = x / length, y / length, z / length, w / length
        out[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    if "scale" in node:
        out[:3, :3] *= np.array(node["scale"], float).reshape(3)
    if "translation" in node:
        out[:3, 3] = np.array(node["translation"], float).reshape(3)
    return out


def _triangles(corners: np.ndarray, mode: int) -> np.ndarray:
    """Corners of triangles, of a strip, every other of whose triangles is turned, or of a fan."""
    if mode == TRIANGLES:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    if len(corners) < 3:
        return np.zeros((0, 3), np.int64)
    if mode == FAN:
        return np.stack([np.full(len(corners) - 2, corners[0]), corners[1:-1], corners[2:]], axis=1)
    strip = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
    strip[1::2] = strip[1::2, [1, 0, 2]]
    return strip


def _whole(number: Any) -> int:
    if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number < 1 << 40:
        raise ValueError(f"{str(number)[:40]} where a count is expected")
    return number
