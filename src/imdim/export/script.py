"""A build123d script: the program as Python that a modeller can edit, parameters first, then one line per primitive.

build123d's primitives are centred with their axis along z, as ours are. Rotations are written one axis at a time, since its
three-angle `Rot` turns about the moved axes and OpenSCAD's about the fixed ones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from imdim.export.expressions import Expression, write_expression
from imdim.export.numbers import Rounding
from imdim.export.parameters import Parameters
from imdim.export.script_loops import SIGN, ScriptLoops, chain
from imdim.program.nary import fold_nary
from imdim.program.repeats import Folded
from imdim.program.tree import Primitive, Program

_SHAPE: Mapping[str, Callable[..., str]] = {
    "box": lambda x, y, z: f"Box({x}, {y}, {z})",
    "sphere": lambda r: f"Sphere({r})",
    "cylinder": lambda r, h: f"Cylinder({r}, {h})",
    "cone": lambda bottom, top, h: f"Cone({bottom}, {top}, {h})" if bottom != top else f"Cylinder({bottom}, {h})",
    "torus": lambda major, minor: f"Torus({major}, {minor})",
    "ellipsoid": lambda x, y, z: f"scale(Sphere(1), by=({x}, {y}, {z}))",
}

_HEAD = '''"""CSG program as a build123d script: pip install build123d, then run this file to write part.step."""

{standard}from build123d import {names}

'''

_REDUCE = """from functools import reduce
from operator import and_

"""

_NAMES = ("Box", "Cone", "Cylinder", "Part", "Plane", "Pos", "Rot", "Sphere", "Torus", "export_step", "mirror", "scale")
_LOOPS = ("Part", "Plane", "mirror")  # what plain scripts do without

_TAIL = """)

if __name__ == "__main__":
    export_step(part, "part.step")
"""


def to_script(program: Program, parameters: Parameters | None = None, folded: Folded | None = None) -> str:
    """Python text that builds `program` as `part` with build123d, in the program's own units (build123d takes them for mm).

    Numbers follow `parameters` if given. `folded`, which `program` is the expansion of, gives it loops.
    """
    rounding, named = Rounding.of(program), parameters or Parameters.none(program, folded)

    def line(number: int, leaf: Primitive) -> list[str]:
        return [_primitive(leaf, rounding, named.sizes[number], named.centers[number])]

    writer = ScriptLoops(rounding, named, line)
    lines = fold_nary(program, line, {op: chain(sign) for op, sign in SIGN.items()}) if folded is None else writer.lines(folded, 0)
    names = [*named.lines(rounding.size), *named.count_lines()]
    body = [*names, *([""] if names else []), *writer.parts, "part = (", *("    " + text for text in lines)]
    used = [n for n in _NAMES if n not in _LOOPS or any(f"{n}(" in text for text in body)]
    reduces = any("reduce(" in text for text in body)
    return _HEAD.format(standard=_REDUCE if reduces else "", names=", ".join(used)) + "\n".join(body) + "\n" + _TAIL


def _primitive(leaf: Primitive, rounding: Rounding, sizes: Sequence[Expression], center: Sequence[Expression]) -> str:
    place = [write_expression(c, rounding.length) for c in center]
    steps = [f"Pos({', '.join(place)})"] if any(c != "0" for c in place) else []
    for axis in (2, 1, 0):
        angle = rounding.angle(leaf.rotation[axis])
        if angle != "0":
            steps.append(f"Rot({', '.join(angle if a == axis else '0' for a in range(3))})")
    texts = [write_expression(s, rounding.length if s.terms else rounding.size) for s in sizes]
    return " * ".join([*steps, _SHAPE[leaf.kind](*texts)])
