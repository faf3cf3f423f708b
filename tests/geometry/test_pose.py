"""Features of leaves against closed forms; their derivatives are tested through the constraints that use them."""

import numpy as np
import pytest
from tests.known_programs import EVERY

from imdim.geometry.lowering import lower
from imdim.geometry.pose import Pose, radii
from imdim.geometry.rotations import matrix_from_euler
from imdim.program.constraints import WORLD, Ref
from imdim.program.rewrite.containment import bounding_radius
from imdim.program.tree import KINDS, Primitive, leaves

TILTED = Primitive("box", (4.0, 3.0, 1.0), (1.0, 2.0, 3.0), (20.0, -35.0, 50.0))


def test_radii_are_those_of_bounding_balls():
    parts = [p for program, _ in EVERY.values() for p in leaves(program)]
    assert {p.kind for p in parts} == set(KINDS)
    for program, _ in EVERY.values():
        np.testing.assert_allclose(radii(lower(program)), [bounding_radius(p) for p in leaves(program)])


@pytest.mark.parametrize("face", ["+x", "-x", "+y", "-y", "+z", "-z"])
def test_a_face_lies_half_a_size_from_the_centre(face):
    axis, side = "xyz".index(face[1]), 1 if face[0] == "+" else -1
    frame = matrix_from_euler(TILTED.rotation)
    point = Pose.of(lower(TILTED)).position(Ref(0, face))
    np.testing.assert_allclose(point.value, TILTED.center + side * TILTED.size[axis] / 2 * frame[:, axis])


def test_axes_of_the_world_never_move():
    vector = Pose.of(lower(TILTED)).direction(WORLD, 1)
    assert vector.value.tolist() == [0.0, 1.0, 0.0]
    assert not vector.slope.any()
