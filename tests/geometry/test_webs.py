"""Webs in inner corners: each becomes an arc of the drawing that it rounds."""

import math

import pytest
from tests.deadlines import PASSED
from tests.planted import box, cut, union

from imdim.geometry.census import census_of
from imdim.geometry.finish.webs import draw_webs
from imdim.geometry.solid import join_touching, to_manifold, volume_iou
from imdim.program.cost import count
from imdim.program.outline import Outline, arc_radii
from imdim.program.tree import Primitive, leaves

RADIUS = 3.0
BEND = -math.tan(math.radians(90) / 4)  # of an inner corner's arc
L_SHAPE = ((0, 0, 0), (40, 0, 0), (40, 10, 0), (10, 10, 0), (10, 30, 0), (0, 30, 0))
ROUNDED = (*L_SHAPE[:3], (10 + RADIUS, 10, BEND), (10, 10 + RADIUS, 0), *L_SHAPE[4:])


def drawn(ring, depth=8.0, z=0.0):
    outline = Outline((tuple((float(x), float(y), float(b)) for x, y, b in ring),))
    (left, low), (right, high) = outline.bounds
    x, y = (left + right) / 2, (low + high) / 2
    return Primitive("extrude", (depth,), (x, y, z), outline=outline.shift(-x, -y))


def web(hair=0.0, depth=8.0, z=0.0):
    """What fills the inner corner, whose straight walls miss those of the drawing by a hair."""
    out = math.acos(1 - hair / RADIUS)
    end, bend = 10 + RADIUS - RADIUS * math.sin(out), -math.tan((math.pi / 2 - 2 * out) / 4)
    return drawn(((10 + hair, 10 + hair, 0), (end, 10 + hair, bend), (10 + hair, end, 0)), depth, z)


def radii(program):
    return [radius for leaf in leaves(program) for radius in arc_radii(leaf.outline)]


BODY, TRUTH = drawn(L_SHAPE), to_manifold(drawn(ROUNDED))


@pytest.mark.parametrize("hair", [0.0, 0.004])
def test_a_web_becomes_an_arc_that_touches_both_walls(hair):
    program = draw_webs(union(BODY, web(hair)), TRUTH)
    assert count(program).primitives == 1
    assert radii(program) == pytest.approx([RADIUS])
    assert volume_iou(to_manifold(program), TRUTH) > 1 - 1e-9


def test_webs_one_behind_the_other_are_one_arc():
    program = union(union(BODY, web(0.002, 5, -1.5)), web(0.003, 4, 2))
    assert count(draw_webs(program, TRUTH)).primitives == 1


def test_an_arc_that_ends_early_is_prolonged():
    """Where another part hides the end of the arc, the drawing of the web ends anywhere in there."""
    angle = math.radians(20)  # of the arc that is left out
    x, y = 10 + RADIUS - RADIUS * math.cos(angle), 10 + RADIUS - RADIUS * math.sin(angle)
    short = drawn(((1, 9, 0), (10 + RADIUS, 10, -math.tan(math.radians(70) / 4)), (x, y, 0), (1, y, 0)))
    post = box(4, 6, 8, (9, 14, 0))
    target = to_manifold(union(drawn(ROUNDED), post))
    program = draw_webs(union(union(BODY, short), post), target)
    assert count(program).primitives == 2
    assert volume_iou(to_manifold(program), target) > 1 - 1e-9


def test_a_pocket_is_rounded_as_a_body_is():
    plate = box(60, 50, 4, (20, 15, 0))
    target = to_manifold(cut(plate, drawn(ROUNDED)))
    program = draw_webs(cut(cut(plate, BODY), web(0.003)), target)
    assert count(program).primitives == 2
    assert radii(cut(program, BODY).left.right) == pytest.approx([RADIUS])


def test_what_is_no_web_of_the_drawing_stays():
    low = union(BODY, web(depth=4, z=-2))
    assert draw_webs(low, to_manifold(low)) is low  # it ends halfway up
    boss = union(BODY, drawn(((10, 9, 0), (16, 9, 0), (16, 14, 0), (10, 14, 0))))
    assert draw_webs(boss, to_manifold(boss)) is boss
    program = union(BODY, web(0.002))
    assert draw_webs(program, TRUTH, PASSED) is program


def test_a_slit_behind_a_web_goes_with_it():
    """Both walls of a web that misses the drawing by a hair, but for a bridge at its feet."""
    program = union(union(BODY, web(0.004)), drawn(((11, 9, 0), (11.5, 9, 0), (11.5, 10.5, 0), (11, 10.5, 0)), 2.0))
    assert census_of(join_touching(draw_webs(program, TRUTH))).kind == census_of(TRUTH).kind
