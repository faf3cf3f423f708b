"""A part that comes through a pipe: its format is seen in its first bytes, since it has no name."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from imdim.target.target import Target

STDIN = "stdin"  # what the part is called
SEEN = 4096  # bytes, of a text
_MAGIC: Mapping[str, bytes] = {
    ".glb": rb"glTF",
    ".npy": rb"\x93NUMPY",
    ".ply": rb"ply\s",
    ".off": rb"\s*C?N?OFF\s",
    ".pcd": rb"(#[^\n]*\n)*VERSION\s",
}
_OBJ = re.compile(rb"^\s*(v|f|o|g|vn|vt|mtllib)\s", re.MULTILINE)


def load_piped(data: bytes) -> Target:
    """The part in the bytes of a file; raises InputError as `load_target` does."""
    from imdim.target.target import InputError, load_target

    with TemporaryDirectory() as folder:
        path = Path(folder, STDIN + guess_format(data))
        path.write_bytes(data)
        try:
            return load_target(path)
        except InputError as error:
            raise InputError(str(error).replace(str(path), path.name)) from error


def guess_format(data: bytes) -> str:
    """The suffix of a file with these bytes; that of a table of points where they are no format that says so."""
    for suffix, magic in _MAGIC.items():
        if re.match(magic, data[:SEEN]):
            return suffix
    if data[:4] == b"PK\x03\x04":
        return ".3mf" if b"3dmodel.model" in data else ".npz"
    if re.match(rb"\s*solid\b", data) or len(data) == 84 + 50 * int.from_bytes(data[80:84], "little"):
        return ".stl"
    text = data[:SEEN]
    if b"\0" in text:
        return ".stl"
    if _OBJ.search(text):
        return ".obj"
    return ".csv" if b"," in text else ".xyz"
