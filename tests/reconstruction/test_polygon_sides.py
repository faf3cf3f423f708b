"""Hexagons of which a search drew five sides get the sixth, where the target has it."""

import math
from dataclasses import replace

import pytest

from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.outline import Outline, reverse_ring
from imdim.program.regular_polygon import RegularPolygon, regular_of
from imdim.program.tree import Combine, Primitive, leaves
from imdim.reconstruction.polygon_sides import complete_polygons

SIZE = 5.5 / math.sqrt(3)


def _plate(ring, sign="difference"):
    pocket = Primitive("extrude", (5.0,), (12.0, -7.0, 5.0), (0.0, 0.0, 20.0), Outline((ring,)))
    return Combine(sign, Primitive("box", (60.0, 40.0, 10.0)), pocket)


def _without(sides, taken, angle=10.0):
    """A polygon without some of its sides: those beside them go on until they meet."""
    polygon = RegularPolygon(sides, SIZE, (1.0, 2.0), angle)
    flats = [math.radians(angle + 360 * (k + 0.5) / sides) for k in range(sides) if k not in taken]
    away = SIZE * math.cos(math.pi / sides)
    corners = []
    for a, b in zip(flats, flats[1:] + flats[:1], strict=True):
        middle, half = (a + b) / 2 + (math.pi if b < a else 0.0), ((b - a) % (2 * math.pi)) / 2
        reach = away / math.cos(half)
        corners.append((1.0 + reach * math.cos(middle), 2.0 + reach * math.sin(middle), 0.0))
    return tuple(corners), polygon


def _scores(target):
    solid = to_manifold(target)
    return lambda program: volume_iou(to_manifold(program), solid)


@pytest.mark.parametrize(("sides", "taken"), [(6, {2}), (6, {0, 3}), (8, {5}), (6, {0, 2, 4})])
@pytest.mark.parametrize("turned", [False, True])
def test_sides_that_the_target_has_are_drawn(sides, taken, turned):
    ring, polygon = _without(sides, taken)
    found = complete_polygons(_plate(reverse_ring(ring) if turned else ring), _scores(_plate(polygon.ring())))
    _, pocket = leaves(found)
    drawn = regular_of(pocket.outline.loops[0], 1e-6)
    assert drawn is not None
    assert (drawn.sides, *drawn.center, drawn.radius) == pytest.approx((sides, 1.0, 2.0, SIZE))


def test_what_has_no_further_side_stays_as_it_is():
    ring, _ = _without(6, {2})
    pentagon = _plate(ring)
    assert complete_polygons(pentagon, _scores(pentagon)) is pentagon
    _, pocket = leaves(pentagon)
    moved = tuple((x + (0.2 if k == 1 else 0.0), y, b) for k, (x, y, b) in enumerate(ring))
    askew = Combine("difference", next(iter(leaves(pentagon))), replace(pocket, outline=Outline((moved,))))
    hexagon = _plate(RegularPolygon(6, SIZE, (1.0, 2.0), 10.0).ring())
    assert complete_polygons(askew, _scores(hexagon)) is askew, "its lines touch no one circle"


def test_where_nobody_knows_the_target_nothing_is_tried():
    ring, _ = _without(6, {2})
    pentagon = _plate(ring)
    assert complete_polygons(pentagon, lambda _: None) is pentagon
