import math
from dataclasses import replace

import numpy as np
import pytest
from tests.deadlines import PASSED
from tests.known_programs import EVERY

from imdim.delivery.films import find_film
from imdim.geometry.finish.cutter_walls import open_films
from imdim.geometry.solid import to_manifold, to_trimesh, volume_iou
from imdim.program.outline import Outline, circle, rectangle
from imdim.program.tree import Combine, Primitive, Program, leaves
from imdim.reconstruction.config import Settings
from imdim.reconstruction.methods import METHODS, MethodStep
from imdim.reconstruction.pipeline import reconstruct
from imdim.target.target import Frame, target_from

HAIR = 0.01  # by which a cutter is too short, of parts some 50 long
KEYHOLE = Outline((((-20.0, -4.0, 0.0), (14.0, -8.0, 2.0), (14.0, 8.0, 0.0), (-20.0, 4.0, 0.0)),))  # its round end as the stadium's
STADIUM = Outline((((-20.0, -10.0, 0.0), (20.0, -10.0, 1.0), (20.0, 10.0, 0.0), (-20.0, 10.0, 1.0)),))


def cut(body: Program, cutter: Primitive) -> Program:
    return Combine("difference", body, cutter)


def extrude(height: float, outline: Outline, center=(0.0, 0.0, 0.0), rotation=(0.0, 0.0, 0.0)) -> Primitive:
    return Primitive("extrude", (height,), center, rotation, outline)


def slot(front: float) -> Outline:
    """Open in front of y = 10, with a slanted wall beside the straight one."""
    return Outline((((-8.0, -4.0, 0.0), (6.0, -4.0, 0.0), (6.0 + (front + 4) / 4, front, 0.0), (-8.0, front, 0.0)),))


def bay(radius: float, half: float = 0.6) -> Outline:
    """Open at a round end, between two arcs about its middle that reach as far to either side."""
    x, y = 20 + radius * math.cos(half), radius * math.sin(half)
    u, v = 20 + 5 * math.cos(half), 5 * math.sin(half)
    return Outline((((x, -y, math.tan(half / 2)), (x, y, 0.0), (u, v, -math.tan(half / 2)), (u, -v, 0.0)),))


def neck(radius: float) -> Outline:
    """Of a turned cutter: a groove with a round bottom."""
    return Outline((((7.0, -2.0, 0.0), (radius, -2.0, 0.0), (radius, 2.0, 0.0), (7.0, 2.0, 0.4)),))


# name -> a body, and a cutter that ends so far short of where it should
CASES = {
    "straight wall": lambda short: (extrude(12.0, rectangle(50.0, 20.0)), extrude(12.0 + 2, slot(10.0 - short))),
    "round wall": lambda short: (extrude(12.0, STADIUM), extrude(8.0, bay(10.0 - short), (0.0, 0.0, 3.0))),
    "wall of more than half a turn": lambda short: (extrude(12.0, KEYHOLE), extrude(8.0, bay(10.0 - short, 2.0), (0.0, 0.0, 3.0))),
    "turned wall": lambda short: (Primitive("cylinder", (10.0, 40.0)), Primitive("revolve", (360.0,), outline=neck(10.0 - short))),
    "half turned": lambda short: (Primitive("cylinder", (10.0, 40.0)), Primitive("revolve", (150.0,), outline=neck(10.0 - short))),
    "face of a box": lambda short: (
        Primitive("box", (50.0, 20.0, 12.0)),
        Primitive("box", (10.0, 8.0 - short, 20.0), (3.0, 6.0 - short / 2, 0.0)),
    ),
    "end of a hole": lambda short: (
        Primitive("box", (50.0, 20.0, 12.0)),
        Primitive("cylinder", (4.0, 12.0 - short), (0.0, 0.0, -short / 2)),
    ),
}


def programs(name: str, short: float) -> Program:
    return cut(*CASES[name](short))


@pytest.fixture(params=sorted(CASES))
def name(request):
    return request.param


def test_a_film_is_opened(name):
    meant = target_from(to_trimesh(to_manifold(programs(name, -2.0))))
    closed = programs(name, HAIR)
    film = find_film(to_trimesh(to_manifold(closed)), meant, math.inf)
    assert film is not None
    assert film.thickness == pytest.approx(HAIR, rel=0.35)  # measured in steps of a quarter
    opened = open_films(closed, to_manifold(programs(name, -2.0)))
    assert find_film(to_trimesh(to_manifold(opened)), meant, math.inf) is None
    assert volume_iou(to_manifold(opened), to_manifold(programs(name, -2.0))) == pytest.approx(1, abs=1e-9)
    # the body stays as it is, and so does what the cutter is
    (body, cutter), (same, further) = leaves(closed), leaves(opened)
    assert same == body
    assert further.kind == cutter.kind


@pytest.mark.parametrize("hair", [1e-3, 1e-4, 1e-5])
def test_the_thinnest_films_are_opened_too(name, hair):
    """Down to where faces only just meet, which is for `overshoot`."""
    meant = to_manifold(programs(name, -2.0))
    opened = open_films(programs(name, hair), meant)
    assert opened != programs(name, hair)
    assert volume_iou(to_manifold(opened), meant) == pytest.approx(1, abs=1e-9)


def test_a_wall_that_is_meant_stays(name):
    thin = programs(name, HAIR)
    assert open_films(thin, to_manifold(thin)) is thin


def test_twice_is_once(name):
    meant = to_manifold(programs(name, -2.0))
    once = open_films(programs(name, HAIR), meant)
    assert open_films(once, meant) is once


def test_none_is_opened_past_the_deadline(name):
    closed = programs(name, HAIR)
    assert open_films(closed, to_manifold(programs(name, -2.0)), PASSED) is closed


@pytest.mark.parametrize("noise", [0.0, 1e-8, 1e-5])
def test_a_wall_that_only_meets_a_face_goes_on(noise):
    meant = to_manifold(programs("round wall", -2.0))
    body, cutter = CASES["round wall"](0.0)
    x, y, z = cutter.center
    opened = open_films(cut(body, replace(cutter, center=(x - noise, y, z))), meant)
    outline = list(leaves(opened))[1].outline
    assert outline is not None
    assert outline.curve_count == 4
    assert outline.bounds[1][0] - outline.bounds[0][0] > 6.5  # it was 5.9
    solid = to_manifold(opened)
    assert len(solid.decompose()) == 1
    assert solid.genus() == 0
    assert volume_iou(solid, meant) == pytest.approx(1, abs=1e-6)


def test_an_island_that_is_all_cut_away_is_cut_wider():
    body = extrude(10.0, Outline((*rectangle(40.0, 30.0).loops, circle(8.0))))
    pin = Primitive("cylinder", (5.0, 10.0))
    disc = extrude(11.0, Outline((circle(5.0),)), (0.0, 0.0, 0.0))
    whole = cut(Combine("union", body, pin), replace(disc, outline=Outline((circle(5.0 - HAIR),))))
    opened = open_films(whole, to_manifold(body))
    assert to_manifold(opened).volume() == pytest.approx(to_manifold(body).volume(), rel=1e-9)


@pytest.mark.parametrize("name", sorted(set(EVERY) - {"nothing"}))
def test_known_solids_stay(name):
    program, exact = EVERY[name]
    solid = to_manifold(program)
    after = to_manifold(open_films(program, solid))
    assert (solid - after).volume() + (after - solid).volume() < 1e-6 * exact


def test_no_film_is_seen_where_walls_are_thick_or_meant():
    rng = np.random.default_rng(0)
    plate = cut(Primitive("box", (60.0, 40.0, 5.0)), Primitive("box", tuple(rng.uniform(5, 30, 3)), (4.0, 2.0, 9.0)))
    surface = to_trimesh(to_manifold(plate))
    assert find_film(surface, target_from(surface), math.inf) is None
    # 4 % of the width is missing on one side: far from the target, but thick
    assert find_film(to_trimesh(to_manifold(Primitive("box", (62.4, 40.0, 5.0)))), target_from(surface), math.inf) is None


def test_a_fit_opens_what_its_search_leaves_closed(name, monkeypatch):
    meant = target_from(to_trimesh(to_manifold(programs(name, -2.0))), "part")
    found = MethodStep("search", Frame.of(meant).apply(programs(name, HAIR)))
    monkeypatch.setitem(METHODS, "tree", lambda run: iter([found]))
    *_, last = reconstruct(meant, Settings(method="tree", solver=False), np.random.default_rng(0))
    assert find_film(to_trimesh(to_manifold(last.program)), meant, math.inf) is None


def test_sides_that_a_move_leaves_where_they_are_do_not_send_the_end_of_a_step_out():
    """A step across the whole width of a bar ends in the air: further out its end opens nothing at its sides, which are along the bar's."""
    bar, step = Primitive("box", (15.0, 40.0, 10.0)), extrude(6.0, rectangle(15.0, 12.0), (0.0, -16.0, 4.0))
    stepped = cut(bar, step)
    assert open_films(stepped, to_manifold(stepped)) == stepped


def test_a_film_is_opened_as_far_as_there_is_room():
    """Behind a gap of a third of a step the target goes on."""
    front, back = Primitive("box", (50.0, 24.7, 12.0), (0.0, -2.65, 0.0)), Primitive("box", (50.0, 5.0, 12.0), (0.0, 12.5, 0.0))
    body = Combine("union", Combine("union", front, back), Primitive("box", (50.0, 30.0, 2.0), (0.0, 0.0, -7.0)))
    pocket = Primitive("box", (10.0, 8.0, 8.0), (0.0, 5.7, 2.0))
    meant = cut(body, pocket)
    closed = cut(body, replace(pocket, size=(10.0, 8.0 - HAIR, 8.0), center=(0.0, 5.7 - HAIR / 2, 2.0)))
    opened = open_films(closed, to_manifold(meant))
    assert volume_iou(to_manifold(opened), to_manifold(meant)) == pytest.approx(1, abs=1e-9)
    assert opened != closed
