import sys
from types import ModuleType

import numpy as np
import pytest
from manifold3d import CrossSection, Manifold
from tests.export.coincident import MEANT
from tests.export.hole_solids import HOLES
from tests.known_programs import KNOWN

from imdim.export.script import to_script
from imdim.geometry.solid import to_manifold, volume_iou


class Place:
    """What build123d documents for Pos and Rot about one axis: a location, applied by `*` from the right."""

    def __init__(self, matrix: np.ndarray) -> None:
        self.matrix = matrix

    def __mul__(self, other):
        if isinstance(other, Place):
            return Place(self.matrix @ other.matrix)
        return Solid(other.manifold.transform(self.matrix[:3]))


class Solid:
    def __init__(self, manifold: Manifold) -> None:
        self.manifold = manifold

    def __add__(self, other):
        return Solid(self.manifold + other.manifold)

    def __sub__(self, other):
        return Solid(self.manifold - other.manifold)

    def __and__(self, other):
        return Solid(self.manifold ^ other.manifold)


def pos(x, y, z):
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return Place(matrix)


def rot(x, y, z):
    axis = np.flatnonzero([x, y, z])[0]
    a, b = (axis + 1) % 3, (axis + 2) % 3
    angle = np.deg2rad(max(x, y, z, key=abs))
    matrix = np.eye(4)
    matrix[[a, b, a, b], [a, b, b, a]] = np.cos(angle), np.cos(angle), -np.sin(angle), np.sin(angle)
    return Place(matrix)


@pytest.fixture
def build123d(monkeypatch):
    """A stand-in that knows the documented meaning of the names that the script uses."""
    module = ModuleType("build123d")
    names = {
        "Box": lambda x, y, z: Solid(Manifold.cube((x, y, z), True)),
        "Sphere": lambda r: Solid(Manifold.sphere(r, 96)),
        "Cylinder": lambda r, h: Solid(Manifold.cylinder(h, r, r, 96, True)),
        "Cone": lambda bottom, top, h: Solid(Manifold.cylinder(h, bottom, top, 96, True)),
        "Torus": lambda major, minor: Solid(CrossSection.circle(minor, 96).translate((major, 0)).revolve(96)),
        **{name: (lambda *numbers, cut=cut: Solid(cut(96, *numbers))) for name, cut in HOLES.items()},
        "scale": lambda solid, by: Solid(solid.manifold.scale(by)),
        "Pos": pos,
        "Rot": rot,
        "export_step": None,
    }
    for name, meaning in names.items():
        setattr(module, name, meaning)
    monkeypatch.setitem(sys.modules, "build123d", module)


@pytest.mark.parametrize("name", sorted(set(KNOWN) - {"nothing"}) + sorted(MEANT))
@pytest.mark.usefixtures("build123d")
def test_the_script_builds_the_same_solid(name):
    program = (KNOWN.get(name) or MEANT[name])[0]
    scope = {"__name__": "program"}
    exec(compile(to_script(program), "program.py", "exec"), scope)
    assert volume_iou(scope["part"].manifold, to_manifold(program)) == pytest.approx(1, abs=1e-6)


def test_one_line_per_primitive_or_hole():
    """Of the bracket's seven primitives three make two holes."""
    text = to_script(MEANT["bracket"][0])
    lines = [line.strip() for line in text.splitlines()]
    assert "- Pos(20, 0, 5) * CounterSinkHole(5, 8, 10, 90)" in lines
    assert "- Pos(0, 20, 25) * Hole(3, 30)" in lines
    assert sum(text.count(f"{kind}(") for kind in ("Box", "Cylinder", "Cone")) == 4
