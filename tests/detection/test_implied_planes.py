"""Rims of thin fins hold no points; the ends of the faces beside them must tell where they are."""

import numpy as np
import pytest

from imdim.detection.implied_planes import closing_planes
from imdim.geometry.surface import Patch, Surface

SPACING = 0.05


def face(axis: int, offset: float, low: tuple[float, float, float], high: tuple[float, float, float]) -> Patch:
    """A grid of points `SPACING` apart on the rectangle low..high across a coordinate axis, half a spacing from its edges."""
    ticks = [np.arange(a + SPACING / 2, b, SPACING) for a, b in zip(low, high, strict=True)]
    ticks[axis] = np.array([offset])
    points = np.stack(np.meshgrid(*ticks, indexing="ij"), -1).reshape(-1, 3)
    normal = np.eye(3)[axis]
    return Patch(Surface("plane", tuple(offset * normal), tuple(normal)), points, SPACING**2 * len(points))


def fin(rim: bool = False) -> list[Patch]:
    """A fin 2 x 0.02 x 1 on the ground z = 0: its long sides are seen, its rims at x = -1, x = 1 and z = 1 hold no points."""
    sides = [face(1, y, (-1, 0, 0), (1, 0, 1)) for y in (-0.01, 0.01)]
    ground = face(2, 0.0, (-2, -1.5, 0), (2, 1.5, 0))
    return [ground, *sides, *([face(2, 1.0, (-1, -0.3, 0), (1, 0.3, 0))] if rim else [])]


def offsets(surfaces: list[Surface], axis: int) -> list[float]:
    return sorted(float(np.dot(s.point, s.axis) * s.axis[axis]) for s in surfaces if abs(s.axis[axis]) > 0.999)


def test_the_rim_of_a_fin_is_where_its_sides_end():
    assert offsets(closing_planes(fin(), SPACING), 2) == pytest.approx([1.0], abs=SPACING / 4)


def test_a_detected_rim_is_not_doubled():
    assert offsets(closing_planes(fin(rim=True), SPACING), 2) == []


def test_one_face_alone_closes_nothing():
    ground, side, _ = fin()
    assert closing_planes([ground, side], SPACING) == []


def test_sides_that_end_apart_close_nothing():
    ground, side, _ = fin()
    shorter = face(1, 0.01, (-1, 0, 0), (1, 0, 0.6))
    assert closing_planes([ground, side, shorter], SPACING) == []


def test_no_patches_close_nothing():
    assert closing_planes([], SPACING) == []
