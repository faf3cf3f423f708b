"""Rows of numbers written as text, as scanners, spreadsheets and shells write them: any head and delimiter, quotes, UTF-8 or UTF-16."""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

DELIMITERS = (";", ",", "\t")
MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)  # with which Windows begins UTF-16
COMMA = re.compile(r"(?<=\d),(?=\d)")


def as_utf8(data: bytes) -> bytes:
    """The same text in UTF-8, without a mark at its beginning; what has no mark is left as it is."""
    if data.startswith(MARKS):
        return data.decode("utf-16").encode()
    return data.removeprefix(codecs.BOM_UTF8)


def read_rows(path: Path) -> tuple[np.ndarray, list[str]]:
    """The numbers [n, m], m at least 3, and the names of their columns, none where the last line before the numbers has not m names.

    Raises ValueError where no line has three numbers, where the lines differ in length, and for decimal commas.
    """
    with path.open("rb") as file:
        encoding = "utf-16" if file.read(2) in MARKS else "utf-8-sig"
    try:
        with path.open(encoding=encoding) as lines:
            skip, first, names = _read_head(lines)
        return np.loadtxt(path, ndmin=2, skiprows=skip, encoding=encoding, **_marks_of(first)), names
    except ValueError:
        with path.open(encoding=encoding) as lines:
            _refuse_decimal_commas(lines)
        raise


def _read_head(lines: Iterable[str]) -> tuple[int, str, list[str]]:
    """How many lines stand before the numbers, the first line of these, and the names of the columns in the last line before them."""
    names: list[str] = []
    count = 0
    for count, line in enumerate(lines, 1):
        fields = _split(line, line)
        if len(fields) >= 3 and all(map(_is_number, fields)):
            return count - 1, line, names if len(names) == len(fields) else []
        names = [field.strip("#/' ").lower() for field in _split(line.lstrip("#/ "), line)]
    raise ValueError(f"no row of at least 3 numbers among its {count} lines")


def _delimiter(line: str) -> str | None:
    """None stands for blanks."""
    return next((mark for mark in DELIMITERS if mark in line), None)


def _marks_of(line: str) -> dict[str, Any]:
    """How numpy is to read rows like this one; it knows one kind of comment alone beside quotes, and any blanks where it is told none."""
    delimiter = _delimiter(line)
    marks = {"quotechar": '"', "comments": "#"} if '"' in line else {"comments": ("#", "//")}
    return {"delimiter": None if delimiter == "\t" else delimiter, **marks}


def _split(text: str, line: str) -> list[str]:
    return [field.strip().strip('"').strip() for field in text.strip().split(_delimiter(line))]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _refuse_decimal_commas(lines: Iterable[str]) -> None:
    """A comma between digits may as well part two numbers: nobody but the file's owner can say which it is."""
    for line in lines:
        pointed = COMMA.sub(".", line.replace('"', ""))
        fields = re.split(r"[;\s]+", pointed.strip())
        if pointed != line and len(fields) >= 3 and all(map(_is_number, fields)):
            raise ValueError(f"numbers have decimal commas, as in {line.strip()[:60]!r}: write them with points")
