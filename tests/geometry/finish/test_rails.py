"""A frame between posts is four rails, each from the middle of one post to that of the next."""

import math
from dataclasses import replace

import pytest
from tests.deadlines import PASSED
from tests.planted import box, cylinder

from imdim.geometry.finish.rails import part_at_posts
from imdim.geometry.rotations import euler_from_matrix, matrix_from_euler
from imdim.geometry.solid import to_manifold
from imdim.program.outline import Outline
from imdim.program.tree import Primitive, Program, combine_all, leaves, map_leaves

RADIUS, HALF, THICK, HEIGHT = 2.5, 10.0, 1.0, 6.0  # of posts; of the square that they stand in; half a rail
SINE = math.asin(THICK / RADIUS)


def frame() -> Primitive:
    """A square ring with the posts' arcs at its corners, as a search draws it."""
    end, outer, inner = HALF - math.sqrt(RADIUS**2 - THICK**2), HALF + THICK, HALF - THICK
    rings = []
    for out, turn in ((outer, 3 * math.pi / 2 - 2 * SINE), (inner, 2 * SINE - math.pi / 2)):
        around = math.tan(turn / 4)
        lines = (((-end, -out), (end, -out)), ((out, -end), (out, end)), ((end, out), (-end, out)), ((-out, end), (-out, -end)))
        rings.append(tuple(vertex for start, stop in lines for vertex in ((*start, 0.0), (*stop, around))))
    return Primitive("extrude", (HEIGHT,), outline=Outline(tuple(rings)))


def posts(height: float, radius: float = RADIUS) -> list[Program]:
    return [cylinder(radius, height, (x, y, (height - HEIGHT) / 2)) for x in (-HALF, HALF) for y in (-HALF, HALF)]


def placed(program: Program) -> Program:
    """Turned and moved as a whole."""
    turn = matrix_from_euler((20.0, -35.0, 50.0))
    return map_leaves(
        program,
        lambda _, p: replace(
            p, center=tuple((turn @ p.center + (3.0, -2.0, 1.0)).tolist()), rotation=euler_from_matrix(turn @ matrix_from_euler(p.rotation))
        ),
    )


def is_same(new: Program, old: Program, segments: int = 768) -> bool:
    a, b = to_manifold(new, segments), to_manifold(old, segments)
    return (a - b).volume() + (b - a).volume() < 1e-5 * b.volume()


# booleans of fine facets that all but coincide take a minute
@pytest.mark.parametrize(("place", "segments"), [(lambda p: p, 768), (placed, 96)], ids=["flat", "turned"])
def test_a_frame_between_posts_becomes_rails(place, segments) -> None:
    drawn = place(combine_all("union", [frame(), *posts(9.0)]))
    after = part_at_posts(drawn, lambda new, old: is_same(new, old, segments))
    rails = [leaf for leaf in leaves(after) if leaf.kind == "box"]
    assert len(rails) == 4
    assert is_same(after, drawn, segments)
    assert all(sorted(rail.size) == pytest.approx([2 * THICK, HEIGHT, 2 * HALF]) for rail in rails)


def test_square_posts_part_a_frame_too() -> None:
    ring = ((-11.0, -11.0, 0.0), (11.0, -11.0, 0.0), (11.0, 11.0, 0.0), (-11.0, 11.0, 0.0))
    hole = tuple((x * 9 / 11, y * 9 / 11, 0.0) for x, y, _ in ring)
    square = [box(4.0, 4.0, 9.0, (x, y, 1.5)) for x in (-HALF, HALF) for y in (-HALF, HALF)]
    drawn = combine_all("union", [Primitive("extrude", (HEIGHT,), outline=Outline((ring, hole))), *square])
    after = part_at_posts(drawn, is_same)
    assert sum(leaf.kind == "extrude" for leaf in leaves(after)) == 0
    assert is_same(after, drawn)


@pytest.mark.parametrize(
    "others",
    [posts(4.0), posts(9.0, 1.0), posts(9.0)[:1], [box(40.0, 40.0, 9.0)]],
    ids=["too short", "too thin", "one alone", "all of it hidden"],
)
def test_what_posts_do_not_part_stays(others: list[Program]) -> None:
    drawn = combine_all("union", [frame(), *others])
    assert part_at_posts(drawn, is_same) == drawn


def test_whoever_asks_decides_and_time_ends_it() -> None:
    drawn = combine_all("union", [frame(), *posts(9.0)])
    assert part_at_posts(drawn, lambda new, old: False) == drawn
    assert part_at_posts(drawn, is_same, PASSED) == drawn
