"""Archives and arrays of numpy from files that nobody vouches for: what they promise is checked before memory is given to it."""

from __future__ import annotations

import io
import math
import tokenize
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import PurePosixPath, PureWindowsPath
from typing import IO

import numpy as np

MAX_MEMBERS = 10_000
MAX_UNPACKED = 4 << 30  # bytes
MAX_RATIO, FREE = 250, 64 << 20  # unpacked to packed, beyond FREE bytes; XML of a mesh packs to a tenth
METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)  # what 3MF and numpy write; LZMA may ask for gigabytes to begin with
ENCRYPTED = 0x1

ARRAY_ERRORS = (ValueError, EOFError, SyntaxError, TypeError, OverflowError, KeyError, MemoryError, RecursionError, tokenize.TokenError)
ARCHIVE_ERRORS = (zipfile.BadZipFile, zlib.error, EOFError, ValueError, NotImplementedError, RuntimeError, OverflowError)


class ArchiveError(ValueError):
    """An archive or an array is broken or hostile; the message is one line."""


@contextmanager
def open_archive(file: IO[bytes]) -> Iterator[zipfile.ZipFile]:
    """A zip archive whose members have plain names, are packed as usual and don't unpack to a flood. Raises ArchiveError."""
    try:
        archive = zipfile.ZipFile(file)
    except ARCHIVE_ERRORS as error:
        raise ArchiveError(f"not a zip archive: {_line(error)}") from error
    with archive:
        _check_members(archive.infolist())
        yield archive


def read_arrays(archive: zipfile.ZipFile) -> Mapping[str, np.ndarray]:
    """The arrays of an npz archive by name. Raises ArchiveError for a member that is no array of numbers."""
    return {info.filename.removesuffix(".npy"): read_member(archive, info) for info in archive.infolist() if info.filename.endswith(".npy")}


def read_member(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> np.ndarray:
    """One array of an npz archive; raises like `read_arrays`."""
    try:
        content = archive.read(info)
    except (*ARCHIVE_ERRORS, OSError) as error:
        raise ArchiveError(f"{_short(info.filename)}: {_line(error)}") from error
    return read_array(io.BytesIO(content), len(content), _short(info.filename))


def read_array(file: IO[bytes], size: int, name: str = "array") -> np.ndarray:
    """The numbers of an npy file of `size` bytes. Raises ArchiveError for anything else: no object is ever made."""
    try:
        version = np.lib.format.read_magic(file)
        read_header = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}.get(version)
        if read_header is None:
            raise ArchiveError(f"{name}: version {version[0]}.{version[1]}, plain numbers need none above 2.0")
        shape, _, dtype = read_header(file)
        if dtype.hasobject or dtype.itemsize == 0:
            raise ArchiveError(f"{name}: {_short(str(dtype))} where numbers are expected")
        wanted, left = math.prod(shape) * dtype.itemsize, size - file.tell()
        if min(shape, default=0) < 0 or wanted > left:
            raise ArchiveError(f"{name}: shape {_short(str(list(shape)))} needs {wanted:.4g} bytes, {left} are there")
        file.seek(0)
        return np.lib.format.read_array(file, allow_pickle=False)
    except ArchiveError:
        raise
    except ARRAY_ERRORS as error:
        raise ArchiveError(f"{name}: not an array: {_line(error)}") from error


def _check_members(members: list[zipfile.ZipInfo]) -> None:
    if len(members) > MAX_MEMBERS:
        raise ArchiveError(f"{len(members)} members, at most {MAX_MEMBERS}")
    names = [info.filename for info in members]
    for info in members:
        if not _plain(info.filename):
            raise ArchiveError(f"member {_short(info.filename)} leads out of the archive")
        if info.compress_type not in METHODS or info.flag_bits & ENCRYPTED:
            raise ArchiveError(f"member {_short(info.filename)} is encrypted or packed by method {info.compress_type}")
    if len(set(names)) < len(names):
        raise ArchiveError(f"{len(names) - len(set(names))} names occur twice")
    unpacked, packed = sum(info.file_size for info in members), sum(info.compress_size for info in members)
    if unpacked > MAX_UNPACKED or unpacked > FREE + MAX_RATIO * packed:
        raise ArchiveError(f"{packed} bytes would unpack to {unpacked}")


def _plain(name: str) -> bool:
    paths = (PurePosixPath(name), PureWindowsPath(name))
    return not any(path.is_absolute() or path.drive or path.root or ".." in path.parts for path in paths)


def _short(text: str) -> str:
    return repr(text if len(text) <= 60 else text[:57] + "...")


def _line(error: BaseException) -> str:
    return (" ".join(str(error).split()) or type(error).__name__)[:160]
