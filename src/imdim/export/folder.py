"""The results folder: written whole or not at all, and never at the cost of files that are not results."""

from __future__ import annotations

import secrets
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

FILES = (
    "program.json",
    "program.scad",
    "program.loops.scad",
    "program.step",
    "program.py",
    "program.ucad",
    "mesh.stl",
    "mesh.glb",
    "mesh.3mf",
    "preview.png",
    "front.json",
    "report.json",
    "report.html",
)


class OutputError(OSError):
    """A results folder cannot be written; the message is one line that names it."""


def check_writable(folder: Path) -> None:
    """Raise OutputError unless `folder` can be made, or is empty or holds nothing but earlier results; leaves nothing behind."""
    folder = folder.resolve()
    _check_contents(folder)
    if folder == Path.cwd() or folder in Path.cwd().parents or folder.is_mount():
        raise OutputError(f"output folder {folder} cannot be replaced as a whole: give a folder inside it")
    ancestor = next(place for place in folder.parents if place.exists())
    try:
        Path(tempfile.mkdtemp(prefix=".imdim-", dir=ancestor)).rmdir()
    except OSError as error:
        raise OutputError(f"output folder {folder} cannot be written: {error.strerror} ({ancestor})") from error


@contextmanager
def replacing(folder: Path) -> Iterator[Path]:
    """A new folder beside `folder` to write into; it takes the place of `folder` if the block ends well, else it is removed.

    Raises OutputError where `check_writable` does, and where a file in the block cannot be written.
    """
    check_writable(folder)
    folder = folder.resolve()
    partial = folder.with_name(f".{folder.name}-{secrets.token_hex(4)}")
    try:
        partial.mkdir(parents=True)
        yield partial
        _swap(partial, folder)
    except OSError as error:
        raise OutputError(f"output folder {folder} cannot be written: {error}") from error
    finally:
        _remove(partial)


def _check_contents(folder: Path) -> None:
    if not folder.exists():
        return
    if not folder.is_dir():
        raise OutputError(f"output {folder} is a file, not a folder")
    foreign = next((entry.name for entry in sorted(folder.iterdir()) if entry.name not in FILES or not entry.is_file()), None)
    if foreign is not None:
        raise OutputError(f"output folder {folder} holds {foreign}, which is no result of imdim: give another folder")


def _swap(partial: Path, folder: Path) -> None:
    """Two renames; the earlier results come back if the second fails."""
    _check_contents(folder)
    if not folder.exists():
        partial.rename(folder)
        return
    earlier = partial.with_name(partial.name + "-earlier")
    folder.rename(earlier)
    try:
        partial.rename(folder)
    except OSError:
        earlier.rename(folder)
        raise
    _remove(earlier)


def _remove(folder: Path) -> None:
    """Remove a folder of results: its known files, then itself."""
    if not folder.exists():
        return
    for name in FILES:
        (folder / name).unlink(missing_ok=True)
    folder.rmdir()
