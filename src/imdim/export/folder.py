"""The results folder: written whole or not at all, and never at the cost of files that are not results.

A process that is killed leaves a hidden folder beside it. The next one that writes to the same place sweeps it: the name tells the
machine and the process that wrote it.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import platform
import re
import secrets
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

EDIT_PICTURE = "edit.png"  # of an edit alone: a fit writes none
FILES = (
    "program.json",
    "program.scad",
    "program.loops.scad",
    "program.step",
    "program.py",
    "program.cq.py",
    "program.FCMacro",
    "program.ucad",
    "mesh.stl",
    "mesh.glb",
    "mesh.3mf",
    "preview.png",
    EDIT_PICTURE,
    "front.json",
    "report.json",
    "report.html",
)
LONGEST_NAME = 150  # bytes of a results folder's name that its hidden neighbours repeat; file systems allow 255
EDITABLE = tuple(file for file in FILES if file.startswith("program.") and file != "program.step")  # by hand
DIGESTS = "digests"  # of these, in the report
EARLIER = "-earlier"  # how the name of results ends that stand aside while new ones take their place


class OutputError(OSError):
    """A results folder cannot be written; the message is one line that names it."""


def check_writable(folder: Path) -> None:
    """Raise OutputError unless `folder` can be made, or is empty or holds nothing but earlier results; leaves nothing behind."""
    try:
        folder = folder.resolve()
        _check_contents(folder)
    except OutputError:
        raise
    except (OSError, ValueError) as error:  # a name too long, or with a byte of 0
        raise OutputError(
            f"output folder {_shorten(str(folder))} cannot be written: {getattr(error, 'strerror', None) or error}"
        ) from error
    if folder == Path.cwd() or folder in Path.cwd().parents or folder.is_mount():
        raise OutputError(f"output folder {folder} cannot be replaced as a whole: give a folder inside it")
    ancestor = next(place for place in folder.parents if place.exists())
    try:
        Path(tempfile.mkdtemp(prefix=".imdim-", dir=ancestor)).rmdir()
    except OSError as error:
        raise OutputError(f"output folder {folder} cannot be written: {error.strerror} ({ancestor})") from error


def digests_of(folder: Path) -> dict[str, str]:
    """Sums of the texts in `folder`, by which `check_untouched` knows them again."""
    return {name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in EDITABLE if (folder / name).is_file()}


def check_untouched(folder: Path) -> None:
    """Raise OutputError if a text among earlier results is not as it was written: somebody works on it."""
    try:
        written = json.loads((folder / "report.json").read_bytes()).get(DIGESTS, {})
        now = digests_of(folder)
        changed = [name for name, digest in now.items() if written.get(name, digest) != digest]
    except (OSError, ValueError, AttributeError):
        return  # no results, or none that can be told: `check_writable` says what may be replaced
    if changed:
        raise OutputError(f"output folder {folder}: {' and '.join(changed)} changed since it was written: give another folder, or --force")


@contextmanager
def replacing(folder: Path) -> Iterator[Path]:
    """A new folder beside `folder` to write into; it takes the place of `folder` if the block ends well, else it is removed.

    Raises OutputError where `check_writable` does, and where a file in the block cannot be written.
    """
    check_writable(folder)
    folder = folder.resolve()
    _sweep(folder)
    partial = folder.with_name(f".{_stem(folder)}-{_machine()}-{os.getpid()}-{secrets.token_hex(4)}")
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
    earlier = partial.with_name(partial.name + EARLIER)
    folder.rename(earlier)
    try:
        partial.rename(folder)
    except OSError:
        earlier.rename(folder)
        raise
    _remove(earlier)


def _stem(folder: Path) -> str:
    """The folder's name, or a sum of it where names made of it would be too long."""
    name = os.fsencode(folder.name)
    return folder.name if len(name) <= LONGEST_NAME else f"{zlib.crc32(name):08x}"


def _shorten(text: str) -> str:
    return text if len(text) <= 160 else text[:157] + "..."


def _machine() -> str:
    return f"{zlib.crc32(platform.node().encode()):08x}"


def _sweep(folder: Path) -> None:
    """Remove what processes of this machine that are no more left beside `folder`; results that they had only set aside come back."""
    if not folder.parent.is_dir():
        return
    left = re.compile(rf"\.{re.escape(_stem(folder))}-{_machine()}-(\d+)-[0-9a-f]{{8}}({EARLIER})?")
    for place in sorted(folder.parent.iterdir(), reverse=True):
        found = left.fullmatch(place.name)
        if found is None or _runs(int(found[1])):
            continue
        # what cannot be swept is no reason to write nothing
        with contextlib.suppress(OSError):
            if found[2] and not folder.exists():
                place.rename(folder)
            else:
                _remove(place)


def _runs(process: int) -> bool:
    if os.name == "nt":
        return True  # where signal 0 is no question
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True


def _remove(folder: Path) -> None:
    """Remove a folder of results: its known files, then itself."""
    if not folder.exists():
        return
    for name in FILES:
        (folder / name).unlink(missing_ok=True)
    folder.rmdir()
