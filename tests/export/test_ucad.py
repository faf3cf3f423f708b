"""µcad text: golden files, and the same solid when the text is read by the definitions of µcad's standard library (`Reader`)."""

import re
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from manifold3d import CrossSection, Manifold, OpType
from tests.export.test_parameters import FLANGE, MOUNT, parametrised
from tests.planted import PARTS, box, common, cone, cut, cylinder, sphere, torus, union

from imdim.export.ucad import to_ucad
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.tree import Primitive

GOLDEN = Path(__file__).parent / "golden"
SEGMENTS = 48
SHAPES = cut(
    union(
        common(box(20, 30, 40, (1e-7, 2.5, 0)), sphere(18)),
        cone(0, 6, 9, (0, 0, 25)),
        cone(5, 0, 8, (30, 0, 0)),
        torus(20, 3, (0, 0, -4), (90.0, 0.0, 30.0)),
        Primitive("ellipsoid", (4.0, 6.0, 3.0), (-25.0, 0.0, 0.0), (10.0, 20.0, 30.0)),
    ),
    cylinder(3, 60, rotation=(0.0, 90.0, 0.0)),
    cone(6, 2, 70, (0, 4, 0)),
)


class Model:
    """A solid with the operations of µcad's library: `std::ops` and the operators between models."""

    def __init__(self, solid: Manifold) -> None:
        self.solid = solid

    def rotate(self, x=0.0, y=0.0, z=0.0) -> "Model":
        assert [np.any(a) for a in (x, y, z)].count(True) <= 1, "µcad applies z first where several angles are given"
        return self._each(Manifold.rotate, x, y, z)

    def translate(self, x=0.0, y=0.0, z=0.0) -> "Model":
        return self._each(Manifold.translate, x, y, z)

    def _each(self, move, *arguments) -> "Model":
        """Argument multiplicity: a copy for every combination of the values of arrays."""
        return Model(Manifold.batch_boolean([move(self.solid, v) for v in product(*map(np.atleast_1d, arguments))], OpType.Add))

    def scale(self, x: float, y: float, z: float) -> "Model":
        return Model(self.solid.scale((x, y, z)))

    def __or__(self, other: "Model") -> "Model":
        return Model(self.solid + other.solid)

    def __and__(self, other: "Model") -> "Model":
        return Model(self.solid ^ other.solid)

    def __sub__(self, other: "Model") -> "Model":
        return Model(self.solid - other.solid)


def cube(size_x: float, size_y: float, size_z: float) -> Model:
    return Model(CrossSection.square((size_x, size_y), True).extrude(size_z).translate((0, 0, -size_z / 2)))


def cylinder_of(height: float, radius: float = 0.0, radius_bottom: float = 0.0, radius_top: float = 0.0, offset: float = 0.0) -> Model:
    """Centred by a radius; from `offset` up by two, as a circle extruded with a scale, which is undefined for no radius at the bottom."""
    if radius:
        radius_bottom, radius_top, offset = radius, radius, -height / 2
    s = radius_top / radius_bottom
    return Model(CrossSection.circle(radius_bottom, SEGMENTS).extrude(height, scale_top=(s, s)).translate((0, 0, offset)))


def ring(major_radius: float, minor_radius: float) -> Model:
    return Model(CrossSection.circle(minor_radius, SEGMENTS).translate((major_radius, 0)).revolve(SEGMENTS))


def read(text: str) -> Manifold:
    """The model of a text, of which names, sums, calls and operators are what they are in Python."""
    scope = {"np": np, "Cube": cube, "Torus": ring, "Cylinder": cylinder_of}
    scope["Sphere"] = lambda radius: Model(Manifold.sphere(radius, SEGMENTS))
    body = re.sub(r"//.*|use .*;", "", text)
    assert not re.search(r"\d[eE]", body)
    lengths = re.sub(r"(?<=\d)(mm|°)", "", body)
    # a range has both of its ends
    lengths = re.sub(r"\[1\.\.(\w+)\]", r"np.arange(1, \1 + 1)", lengths)
    *names, model = [statement.strip() for statement in lengths.split(";") if statement.strip()]
    exec("\n".join(names), scope)
    return eval(f"({model})", scope).solid


@pytest.mark.parametrize("name", ["mount", "shapes"])
def test_golden(name):
    text = to_ucad(*parametrised(MOUNT)) if name == "mount" else to_ucad(SHAPES)
    assert text == (GOLDEN / f"{name}.ucad").read_text(encoding="utf-8")


@pytest.mark.parametrize("program", [*PARTS.values(), MOUNT, FLANGE, SHAPES], ids=[*PARTS, "mount", "flange", "shapes"])
def test_the_text_is_the_same_solid(program):
    delivered, parameters = parametrised(program)
    for text in (to_ucad(delivered), to_ucad(delivered, parameters)):
        assert volume_iou(read(text), to_manifold(delivered, SEGMENTS)) == pytest.approx(1, abs=1e-6)


def test_the_head_has_the_version_and_the_names_with_their_unit():
    lines = to_ucad(*parametrised(MOUNT)).splitlines()
    assert lines[0] == "// µcad 0.5"
    assert "hole_diameter = 6mm;" in lines
    assert "hole_spacing_x = 60mm;" in lines


def test_every_length_has_a_unit_and_no_exponent():
    text = to_ucad(box(1e-7, 2, 3, (1e5, -1e-8, 0)))
    assert "size_x = 0.0000001mm" in text
    assert "translate(x = 100000mm, y = -0.00000001mm)" in text


def test_rotations_compose_as_fixed_axes():
    turned = Primitive("box", (1.0, 2.0, 3.0), rotation=(30.0, 50.0, 70.0))
    ours, theirs = (np.sort(np.array(s.to_mesh64().vert_properties), 0) for s in (read(to_ucad(turned)), to_manifold(turned)))
    assert ours == pytest.approx(theirs)
