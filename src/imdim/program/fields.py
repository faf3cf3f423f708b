"""Strict reading of parsed JSON: every error is one line with the JSON path and the number or word at fault."""

from __future__ import annotations

import difflib
import math
from typing import Any

from imdim.program.tree import Vec3


def record(value: object, path: str, needed: tuple[str, ...], optional: tuple[str, ...] = ()) -> dict[str, Any]:
    """An object that has all of `needed`, and nothing but these and `optional`."""
    if not isinstance(value, dict):
        raise ValueError(f"{shorten(path)}: expected an object, got {show(value)}")
    for key in needed:
        if key not in value:
            raise ValueError(f"{shorten(path)}: {key!r} is missing")
    for key in value:
        if key not in needed and key not in optional:
            near = difflib.get_close_matches(str(key)[:40], [*needed, *optional], 1)
            raise ValueError(f"{shorten(path)}: unknown key {show(key)}" + (f"; did you mean {near[0]!r}?" if near else ""))
    return value


def choice(value: object, path: str, known: tuple[str, ...]) -> str:
    """One of the `known` words."""
    if not isinstance(value, str) or value not in known:
        raise ValueError(f"{shorten(path)}: expected {' or '.join(known)}, got {show(value)}")
    return value


def vector(value: object, path: str) -> Vec3:
    """A list of three finite numbers."""
    if not isinstance(value, list) or len(value) != 3:
        got = f"{len(value)} entries" if isinstance(value, list) else show(value)
        raise ValueError(f"{path}: expected a list of 3 numbers, got {got}")
    x, y, z = (number(v, f"{path}[{i}]") for i, v in enumerate(value))
    return x, y, z


def number(value: object, path: str) -> float:
    """A finite number."""
    # bool is an int to Python, not to JSON
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{path}: expected a number, got {show(value)}")
    try:
        found = float(value)
    except OverflowError:
        found = math.inf
    if not math.isfinite(found):
        raise ValueError(f"{path}: expected a finite number, got {show(value)}")
    return found


def show(value: object) -> str:
    """A short one-line picture of hostile input."""
    if isinstance(value, dict | list):
        return f"{'an object' if isinstance(value, dict) else 'a list'} of {len(value)}"
    if isinstance(value, int) and abs(value) > 10**20:
        return f"an integer of {value.bit_length()} bits"
    text = repr(value[:40] if isinstance(value, str) else value)
    return text if len(text) <= 60 else text[:60] + "..."


def shorten(path: str) -> str:
    """A path of bounded length."""
    return path if len(path) <= 200 else f"{path[:100]}...{path[-60:]}"
