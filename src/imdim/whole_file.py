"""A file that appears whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path


def replace_whole(path: Path, content: bytes | memoryview) -> None:
    """Write a file beside `path`, bring it to the disk and put it in place of `path`; a failure leaves nothing, and an older file whole."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}.part")
    try:
        with part.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    except OSError as error:
        raise type(error)(error.errno, error.strerror, str(path)) from error
    finally:
        part.unlink(missing_ok=True)


def write_text_whole(path: Path, text: str) -> None:
    """As `replace_whole`, a text in UTF-8; what is no Unicode in the names of files is written as escapes."""
    replace_whole(path, text.encode("utf-8", "backslashreplace"))
