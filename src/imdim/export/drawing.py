"""Outlines as the texts write them: lists of loops, of vertices ``[x, y]`` from which a line runs, and ``[x, y, bulge]`` for an arc."""

from __future__ import annotations

from collections.abc import Iterable

from imdim.export.numbers import Rounding, plain
from imdim.program.outline import Loop, regions
from imdim.program.tree import Primitive


def write_loops(leaf: Primitive, rounding: Rounding) -> list[str]:
    """The loops of an outlined leaf as one list, rounded; nothing for other leaves."""
    outline = rounding.primitive(leaf).outline
    return [] if outline is None else [_list(map(_loop, outline.loops))]


def write_regions(leaf: Primitive, rounding: Rounding) -> list[str]:
    """Of each separate area of an outlined leaf the outer loop and its holes, as a list; nothing for other leaves."""
    outline = rounding.primitive(leaf).outline
    return [] if outline is None else [_list(map(_loop, region)) for region in regions(outline)]


def _loop(loop: Loop) -> str:
    return _list(_list(map(plain, vertex if vertex[2] else vertex[:2])) for vertex in loop)


def _list(texts: Iterable[str]) -> str:
    return f"[{', '.join(texts)}]"
