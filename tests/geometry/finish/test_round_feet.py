"""Boxes that end where their edges meet a round wall begin at a wall farther in, or at the axis."""

import math
from dataclasses import replace

import pytest
from tests.deadlines import PASSED
from tests.planted import box, cut, cylinder, union

from imdim.geometry.finish.round_feet import begin_in_round_walls
from imdim.program.outline import Outline
from imdim.program.tree import Primitive, Program, leaves

POST, WIDTH, OUT = 10.0, 3.0, 25.0
MEETS = math.sqrt(POST**2 - (WIDTH / 2) ** 2)


def ribs(count: int, inner: float = MEETS, width: float = WIDTH) -> list[Primitive]:
    middle, turns = (inner + OUT) / 2, [2 * math.pi * k / count for k in range(count)]
    flat = [(middle * math.cos(t), middle * math.sin(t), 5.0) for t in turns]
    return [replace(box(OUT - inner, width, 6.0, at), rotation=(0.0, 0.0, math.degrees(t))) for at, t in zip(flat, turns, strict=True)]


def inner_ends(program: Program) -> list[float]:
    """How far from the axis of the post the nearer ends of its boxes are."""
    return [math.hypot(*leaf.center[:2]) - leaf.size[0] / 2 for leaf in leaves(program) if leaf.kind == "box"]


@pytest.mark.parametrize("count", [1, 5])
def test_ribs_of_a_post_begin_at_its_axis(count: int) -> None:
    out = begin_in_round_walls(union(cylinder(POST, 20.0, (0.0, 0.0, 10.0)), *ribs(count)))
    assert inner_ends(out) == pytest.approx([0.0] * count, abs=1e-9)
    outer = [math.hypot(*leaf.center[:2]) + leaf.size[0] / 2 for leaf in leaves(out) if leaf.kind == "box"]
    assert outer == pytest.approx([OUT] * count, abs=1e-9)


def test_those_of_a_tube_begin_at_its_bore() -> None:
    tube = cut(cylinder(POST, 20.0, (0.0, 0.0, 10.0)), cylinder(7.0, 30.0, (0.0, 0.0, 10.0)))
    assert inner_ends(begin_in_round_walls(union(tube, *ribs(4)))) == pytest.approx([7.0] * 4, abs=1e-9)


def test_a_turned_wall_is_one_too() -> None:
    ring = Outline((((8.0, -10.0, 0.0), (POST, -10.0, 0.0), (POST, 10.0, 0.0), (8.0, 10.0, 0.0)),))
    turned = Primitive("revolve", (360.0,), (0.0, 0.0, 10.0), outline=ring)
    assert inner_ends(begin_in_round_walls(union(turned, *ribs(3)))) == pytest.approx([8.0] * 3, abs=1e-9)


def test_what_would_be_seen_stays() -> None:
    """A wall thinner than a rib is wide at its corners: the next face in is the bore's, and it would come out there."""
    thin = cut(cylinder(POST, 20.0, (0.0, 0.0, 10.0)), cylinder(9.9, 30.0, (0.0, 0.0, 10.0)))
    wide = 8.0
    program = union(thin, *ribs(4, math.sqrt(POST**2 - (wide / 2) ** 2), wide))
    assert begin_in_round_walls(program) == program


def test_those_of_one_size_move_together() -> None:
    """A slot in the post, where one of its ribs would come out."""
    slot = box(4.0, 1.0, 4.0, (5.0, 0.0, 5.0))
    program = union(cut(cylinder(POST, 20.0, (0.0, 0.0, 10.0)), slot), *ribs(4))
    assert begin_in_round_walls(program) == program


def test_other_ends_and_cuts_stay() -> None:
    post = cylinder(POST, 20.0, (0.0, 0.0, 10.0))
    for program in (union(post, *ribs(4, 9.0)), cut(post, *ribs(4)), union(post, box(OUT, WIDTH, 6.0, (MEETS + OUT / 2, 0.1, 5.0)))):
        assert begin_in_round_walls(program) == program


def test_none_move_once_time_is_up() -> None:
    program = union(cylinder(POST, 20.0, (0.0, 0.0, 10.0)), *ribs(4))
    assert begin_in_round_walls(program, PASSED) == program
