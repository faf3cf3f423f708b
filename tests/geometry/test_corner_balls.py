"""Corners of three fillets against closed forms: a convex body rolled along by a ball has the volume that Steiner's formula says."""

import math

import pytest

from imdim.geometry.corner_balls import find_corner_balls
from imdim.geometry.edge_solids import with_edges
from imdim.geometry.edges import find_edges
from imdim.geometry.solid import to_manifold
from imdim.program.edges import EdgeFeature, Face
from imdim.program.outline import Outline
from imdim.program.tree import Combine, Primitive, Program

SIDES = ("+x", "-x", "+y", "-y")
SEGMENTS = 192


def pairs(leaf: int, *names: tuple[str, str]) -> tuple[tuple[Face, Face], ...]:
    return tuple((Face(leaf, a), Face(leaf, b)) for a, b in names)


UPRIGHT = tuple((x, y) for x in SIDES[:2] for y in SIDES[2:])


def volume(program: Program, *features: EdgeFeature) -> float:
    return to_manifold(with_edges(program, features), SEGMENTS).volume()


def rounded(a: float, b: float, c: float, r: float) -> float:
    """The volume of a box with all edges and corners rounded."""
    a, b, c = a - 2 * r, b - 2 * r, c - 2 * r
    return a * b * c + 2 * r * (a * b + b * c + c * a) + math.pi * r * r * (a + b + c) + 4 / 3 * math.pi * r**3


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (20.0, -35.0, 50.0)])
def test_a_box_with_all_edges_rounded(turn) -> None:
    box = Primitive("box", (10.0, 20.0, 30.0), (1.0, 2.0, 3.0), turn)
    every = pairs(0, *UPRIGHT, *((end, side) for end in ("+z", "-z") for side in SIDES))
    assert volume(box, EdgeFeature("fillet", (2.0,), every)) == pytest.approx(rounded(10, 20, 30, 2), rel=1e-4)


def test_a_prism_of_sixty_degrees_with_all_edges_rounded() -> None:
    """Steiner: V + S r + M r^2 + 4/3 pi r^3 of the prism within, M the edges' lengths times half their outer angles."""
    side, height, r = 10.0, 6.0, 1.0
    out = side / math.sqrt(3)
    corners = tuple((out * math.cos(t), out * math.sin(t), 0.0) for t in (0, 2 * math.pi / 3, 4 * math.pi / 3))
    prism = Primitive("extrude", (height,), outline=Outline((corners,)))
    walls = [f"wall[0][{k}]" for k in range(3)]
    every = pairs(0, *zip(walls, walls[1:] + walls[:1], strict=True), *((end, wall) for end in ("+z", "-z") for wall in walls))
    inner, h = side - 2 * r * math.sqrt(3), height - 2 * r
    base = inner * inner * math.sqrt(3) / 4
    bends = (3 * h * 2 * math.pi / 3 + 6 * inner * math.pi / 2) / 2
    expected = base * h + (2 * base + 3 * inner * h) * r + bends * r * r + 4 / 3 * math.pi * r**3
    assert volume(prism, EdgeFeature("fillet", (r,), every)) == pytest.approx(expected, rel=1e-4)


def test_the_bottom_corners_of_a_pocket_are_filled() -> None:
    pocket = Primitive("box", (20.0, 14.0, 14.0), (0.0, 0.0, 5.0))  # 12 deep, its floor and corners rounded: half a box twice as high
    block = Combine("difference", Primitive("box", (40.0, 40.0, 20.0)), pocket)
    feature = EdgeFeature("fillet", (2.0,), pairs(1, *UPRIGHT, *(("-z", side) for side in SIDES)))
    assert 40 * 40 * 20 - volume(block, feature) == pytest.approx(rounded(20, 14, 24, 2) / 2, rel=1e-4)


def balls(program: Program, *features: EdgeFeature) -> int:
    return len(list(find_corner_balls(find_edges(program, features).edges)))


def test_a_ball_rolls_into_each_corner_of_three_alike_alone() -> None:
    """Fillets of two radii mitre, and so do those of a plate as thin as the radius, where balls of its two faces would meet."""
    upright, top = pairs(0, *UPRIGHT), pairs(0, *(("+z", side) for side in SIDES))
    box, plate = Primitive("box", (10.0, 20.0, 30.0)), Primitive("box", (20.0, 20.0, 1.5))
    assert balls(box, EdgeFeature("fillet", (2.0,), (*upright, *top))) == 4
    assert balls(box, EdgeFeature("fillet", (2.0,), upright), EdgeFeature("fillet", (1.0,), top)) == 0
    assert balls(box, EdgeFeature("chamfer", (2.0,), (*upright, *top))) == 0
    assert balls(plate, EdgeFeature("fillet", (2.0,), (*upright, *top))) == 0
