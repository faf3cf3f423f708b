"""Read back the flat OpenSCAD that `openscad.py` writes, so that the delivered file itself can be measured.

One statement per primitive: ``translate([..]) rotate([..]) SHAPE``, any of the two optional, inside nested union, difference and
intersection blocks. Anything else raises ValueError: this is a check of our own files, not an OpenSCAD interpreter.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

from imdim.program.tree import OPS, Op, Primitive, Program, Vec3, combine_all

_NUMBER = r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
_VECTOR = rf"\[({_NUMBER}), ({_NUMBER}), ({_NUMBER})\]"
_PLACED = re.compile(rf"(?:translate\({_VECTOR}\) )?(?:rotate\({_VECTOR}\) )?(.*);")

_SHAPES: Mapping[str, tuple[re.Pattern[str], Callable[..., tuple[float, ...]]]] = {
    "box": (re.compile(rf"cube\({_VECTOR}, center = true\)"), lambda *s: s),
    "sphere": (re.compile(rf"sphere\(r = ({_NUMBER})\)"), lambda r: (r,)),
    "cylinder": (re.compile(rf"cylinder\(h = ({_NUMBER}), r = ({_NUMBER}), center = true\)"), lambda h, r: (r, h)),
    "cone": (
        re.compile(rf"cylinder\(h = ({_NUMBER}), r1 = ({_NUMBER}), r2 = ({_NUMBER}), center = true\)"),
        lambda h, bottom, top: (bottom, top, h),
    ),
    "torus": (
        re.compile(rf"rotate_extrude\(\) translate\(\[({_NUMBER}), 0, 0\]\) circle\(r = ({_NUMBER})\)"),
        lambda major, minor: (major, minor),
    ),
    "ellipsoid": (re.compile(rf"scale\({_VECTOR}\) sphere\(r = 1\)"), lambda *s: s),
}


def read_openscad(text: str) -> Program:
    """The program in a text that `to_openscad` wrote; raises ValueError with the line's number for anything else."""
    open_blocks: list[tuple[Op, list[Program]]] = [("union", [])]
    for number, raw in enumerate(text.splitlines(), start=1):
        line = raw.partition("//")[0].strip()
        if not line or line.startswith("$fn = "):
            continue
        if line == "}" and len(open_blocks) > 1 and open_blocks[-1][1]:
            op, parts = open_blocks.pop()
            open_blocks[-1][1].append(combine_all(op, parts))
        elif line.removesuffix("() {") in OPS and line.endswith("() {"):
            open_blocks.append((_op(line), []))
        else:
            open_blocks[-1][1].append(_primitive(line, number))
    if len(open_blocks) != 1 or not open_blocks[0][1]:
        raise ValueError(f"OpenSCAD text ends with {len(open_blocks) - 1} open blocks and {len(open_blocks[0][1])} solids")
    return combine_all(*open_blocks[0])


def _op(line: str) -> Op:
    return next(op for op in OPS if line.startswith(op))


def _primitive(line: str, number: int) -> Primitive:
    placed = _PLACED.fullmatch(line)
    if placed is None:
        raise ValueError(f"line {number} is not flat OpenSCAD of ours: {line!r}")
    values = placed.groups()
    for kind, (pattern, size) in _SHAPES.items():
        found = pattern.fullmatch(values[6])
        if found is not None:
            return Primitive(kind, size(*map(float, found.groups())), _vector(values[:3]), _vector(values[3:6]))
    raise ValueError(f"line {number} is no primitive of ours: {line!r}")


def _vector(texts: tuple[str | None, ...]) -> Vec3:
    x, y, z = (float(text or 0) for text in texts)
    return (x, y, z)
