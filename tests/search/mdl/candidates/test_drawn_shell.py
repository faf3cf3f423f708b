"""Walls along drawings that run between both skins of a thin wall."""

import math

import numpy as np
import pytest

from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.sampling import surface_points
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Outline, circle, loop_area
from imdim.program.tree import Combine, Primitive
from imdim.search.mdl.candidates.drawn_shell import draw_shells, grow_loop
from imdim.search.mdl.candidates.shell_slot import compounds
from imdim.search.mdl.primitive_selection import Cloud

SIGMA, WALL = 0.4, 1.0
SLOT = ((-20.0, -8.0, 0.0), (20.0, -8.0, 1.0), (20.0, 8.0, 0.0), (-20.0, 8.0, 1.0))
CORNER = ((0.0, 0.0, 0.0), (30.0, 0.0, 0.0), (30.0, 10.0, 0.0), (10.0, 10.0, 0.0), (10.0, 25.0, 0.0), (0.0, 25.0, 0.0))
LOOPS = {"slot": SLOT, "corner": CORNER, "circle": circle(9.0, 3.0, 1.0), "ellipse": Ellipse(20.0, 11.0, 1.0, 2.0, 30.0)}


@pytest.mark.parametrize("loop", LOOPS.values(), ids=LOOPS.keys())
def test_a_loop_grows_by_its_length_times_the_distance(loop):
    """And a loop that runs the other way does, too."""
    for way in (loop, loop if isinstance(loop, Ellipse) else tuple((x, y, -b) for (x, y, _), b in reversed_with_bulges(loop))):
        area, more, less = (abs(loop_area(way if by == 0 else grow_loop(way, by))) for by in (0.0, 0.5, -0.5))
        assert less < area < more
        length = more - less  # of a strip that is one wide
        assert length == pytest.approx(perimeter(loop), rel=0.03 if isinstance(loop, Ellipse) else 5e-3)  # no ellipse lies beside one


def reversed_with_bulges(ring):
    """The vertices of a ring from the last to the first, each with the bulge of the curve that ends in it."""
    return [(ring[k], ring[k - 1][2]) for k in range(len(ring) - 1, -1, -1)]


def perimeter(loop) -> float:
    if isinstance(loop, Ellipse):
        turn = np.linspace(0.0, 2 * math.pi, 20001)
        return float(np.hypot(np.diff(loop.rx * np.cos(turn)), np.diff(loop.ry * np.sin(turn))).sum())
    out = 0.0
    for (x, y, b), (u, v, _) in zip(loop, [*loop[1:], loop[0]], strict=True):
        chord, half = math.dist((x, y), (u, v)), 2 * math.atan(abs(b))
        out += chord * half / math.sin(half) if b else chord
    return out


def test_what_is_too_narrow_or_too_sharp_has_no_walls():
    spike = ((0.0, 0.0, 0.0), (40.0, 0.5, 0.0), (0.0, 1.0, 0.0))
    assert grow_loop(spike, 0.2) is None
    assert grow_loop(((0.0, 0.0, 0.0), (10.0, 0.0, 0.0), (10.0, 2.0, 0.0), (0.0, 2.0, 0.0)), -1.2) is None
    assert grow_loop(circle(1.0), -1.5) is None
    assert grow_loop(Ellipse(3.0, 1.0), -1.5) is None


def cloud_of(program, rng) -> Cloud:
    points = surface_points(program, 4000, rng)[0]
    return Cloud.of(points + SIGMA * rng.standard_normal(points.shape), SIGMA)


@pytest.mark.parametrize("loop", LOOPS.values(), ids=LOOPS.keys())
@pytest.mark.parametrize("open_ends", [(), (1,), (-1, 1)])
def test_walls_are_open_where_the_cloud_is(loop, open_ends):
    """The shell that is meant is among those that are offered in the place of the drawing in its middle."""
    middle = Primitive("extrude", (40.0,), (1.0, 2.0, 3.0), (20.0, 30.0, 40.0), outline=Outline((loop,)))
    meant = shell_about(middle, open_ends)
    cloud = cloud_of(meant, np.random.default_rng(1))
    offered = list(draw_shells(middle, WALL, cloud, SIGMA))
    assert max(volume_iou(to_manifold(shell), to_manifold(meant)) for shell in offered) > 0.9
    assert any(program in offered for program in compounds([middle], cloud, WALL / 3))


def shell_about(middle: Primitive, ends) -> Combine:
    """The solid within half a wall outside the middle, less what lies half a wall inside, open at the ends."""
    turned = [grow_loop(loop, side * WALL / 2) for loop in middle.outline.loops for side in (1, -1)]
    along = matrix_from_euler(middle.rotation)[:, 2]
    low, high = (20.0 + (0.0 if sign in ends else WALL / 2) for sign in (-1, 1))
    near, far = (20.0 + (3.0 if sign in ends else -WALL / 2) for sign in (-1, 1))

    def between(loop, below, above):
        center = tuple(np.array(middle.center) + along * (above - below) / 2)
        return Primitive("extrude", (below + above,), center, middle.rotation, outline=Outline((loop,)))

    return Combine("difference", between(turned[0], low, high), between(turned[1], near, far))


def test_other_parts_have_none():
    box = Primitive("box", (10.0, 10.0, 10.0))
    cloud = cloud_of(box, np.random.default_rng(0))
    assert list(draw_shells(box, WALL, cloud, SIGMA)) == []
    turned = Primitive("revolve", (360.0,), outline=Outline((((0.0, 0.0, 0.0), (5.0, 0.0, 0.0), (0.0, 9.0, 0.0)),)))
    assert list(draw_shells(turned, WALL, cloud, SIGMA)) == []
