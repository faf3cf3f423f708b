"""Handles that move and resize a primitive."""

from dataclasses import replace

import numpy as np
import pytest

from imdim.app.lab import edits
from imdim.app.lab.edits import ConstrainedProgram
from imdim.app.lab.handles import find_handles, measure_drag, nice_step
from imdim.geometry import kernels
from imdim.program.outline import Outline, circle, rectangle
from imdim.program.tree import SIMPLE, SIZE_NAMES, Primitive, leaves

SIZES = {
    "box": (8.0, 6.0, 4.0),
    "sphere": (5.0,),
    "cylinder": (3.0, 8.0),
    "cone": (4.0, 2.0, 6.0),
    "torus": (6.0, 2.0),
    "ellipsoid": (5.0, 4.0, 3.0),
}
PLACE = {"center": (1.0, 2.0, 3.0), "rotation": (20.0, 30.0, 40.0)}
PARTS = [Primitive(kind, SIZES[kind], **PLACE) for kind in SIMPLE]
PARTS.append(Primitive("extrude", (4.0,), outline=Outline((rectangle(6.0, 4.0).loops[0], circle(1.0, 2.0))), **PLACE))


@pytest.mark.parametrize("part", PARTS, ids=lambda part: part.kind)
def test_each_size_has_a_knob_on_a_face_that_goes_with_it(part):
    knobs = {handle.name: handle for handle in find_handles(part, 0.5) if handle.axis is None}
    assert set(knobs) == set(SIZE_NAMES[part.kind])
    for name, knob in knobs.items():
        on_face = kernels.program_sdf(part, knob.point[None])[0]
        assert on_face == pytest.approx(0.0, abs=1e-5), f"{name} lies on the surface"
        assert knob.value == part.size[SIZE_NAMES[part.kind].index(name)]
        larger = edits.with_number(ConstrainedProgram(part), 0, name, knob.value * 1.1)
        moved = next(h for h in find_handles(next(leaves(larger.program)), 0.5) if h.name == name)
        assert (moved.point - knob.point) @ knob.direction > 0, f"{name} goes outwards as it grows"


@pytest.mark.parametrize("part", PARTS, ids=lambda part: part.kind)
def test_three_arrows_stand_beside_it(part):
    arrows = [handle for handle in find_handles(part, 0.5) if handle.axis is not None]
    assert [handle.name for handle in arrows] == ["x", "y", "z"]
    for handle in arrows:
        assert kernels.program_sdf(part, handle.point[None])[0] > 0, "outside"
        assert handle.value == part.center[handle.axis]
        shifted = tuple(v + 2.0 * (i == handle.axis) for i, v in enumerate(part.center))
        moved = next(h for h in find_handles(replace(part, center=shifted), 0.5) if h.name == handle.name)
        assert moved.point - handle.point == pytest.approx(2.0 * handle.direction)


def test_a_turned_outline_has_arrows_alone():
    part = Primitive("revolve", (360.0,), outline=Outline((((2.0, -1.0, 0.0), (4.0, -1.0, 0.0), (4.0, 1.0, 0.0), (2.0, 1.0, 0.0)),)))
    assert [handle.name for handle in find_handles(part, 0.5)] == ["x", "y", "z"]


def test_a_drag_is_read_along_its_direction():
    """The pointer is seen on the plane through the handle, across the view, as the toolkit tells it."""
    eye, start, direction = np.array([0.0, -10.0, 4.0]), np.array([1.0, 0.0, 0.0]), np.array([0.6, -0.8, 0.0])
    for far in (-2.0, 0.0, 3.0):
        there = start + far * direction  # nearer to the eye than its plane, or farther
        across = (start - eye) / np.linalg.norm(start - eye)
        seen = eye + (there - eye) * ((start - eye) @ across) / ((there - eye) @ across)
        assert measure_drag(start, seen, direction, eye) == pytest.approx(far)
        assert measure_drag(start, seen + 0.5 * np.cross(direction, across), direction, eye) == pytest.approx(far, abs=0.3), (
            "beside the line"
        )
    assert measure_drag(start, start + 0.1, (start - eye) / np.linalg.norm(start - eye), eye) == 0.0


def test_numbers_go_in_round_steps():
    assert [nice_step(v) for v in (0.7, 1.0, 3.9, 0.05, 49.0)] == pytest.approx([0.5, 1.0, 2.0, 0.05, 20.0])
