"""Plainer features are taken for drawings where there is hardly more to read in them, and the part is the same."""

import math

import numpy as np
import pytest
from tests.planted import box, cone, cut, cylinder, mesh_of, union

from imdim.program.cost import count
from imdim.program.ellipse import Ellipse
from imdim.program.outline import Outline, circle
from imdim.program.rewrite.separation import separate_loops
from imdim.program.tree import Primitive, Program, combine_all
from imdim.reconstruction.observation import Observation, UnitBody, observe
from imdim.reconstruction.plain_program import (
    count_directions,
    count_numbers,
    count_odd_directions,
    count_shared_rims,
    has_drawings,
    is_hardly_longer,
    is_plainer,
    length_read_once,
    may_be_plain,
    reading_length,
    repeats_plainly,
)
from imdim.target.target import target_from

RECTANGLE = tuple((x, y, 0.0) for x, y in ((-0.4, -0.3), (0.4, -0.3), (0.4, 0.3), (-0.4, 0.3)))
HOLES = [(x, y) for x in (-0.3, 0.3) for y in (-0.2, 0.2)]
DRAWN = Primitive("extrude", (0.1,), outline=Outline((RECTANGLE, *(circle(0.05, x, y) for x, y in HOLES))))
PLAIN = cut(box(0.8, 0.6, 0.1), *(cylinder(0.05, 0.2, (x, y, 0.0)) for x, y in HOLES))
ROUNDED = Primitive("extrude", (0.1,), outline=Outline((tuple((x, y, 0.1 * (i % 2)) for i, (x, y, _) in enumerate(RECTANGLE)),)))


@pytest.fixture(scope="module")
def plate() -> Observation:
    return observe(UnitBody.of(target_from(mesh_of(PLAIN)), np.random.default_rng(0)), 2.5e-4, np.random.default_rng(0), outlines=True)


HALF = np.array([0.4, 0.3, 0.05])


def test_numbers_say_where_faces_are() -> None:
    assert count_numbers(box(0.8, 0.6, 0.1), -HALF, HALF) == 3
    assert count_numbers(PLAIN, -HALF, HALF) == 4  # of cutters the place in y alone: 0.3 and 0.05 were there, and they end outside
    assert count_numbers(DRAWN, -HALF, HALF) == 6  # arcs begin and end at 0.25 and 0.35 in place of 0.3
    assert count_numbers(Primitive("sphere", (0.1,), (0.2, 0.0, 0.0)), -HALF, HALF) == 2
    assert reading_length(PLAIN, -HALF, HALF) == 5 + 4 + 3
    assert reading_length(DRAWN, -HALF, HALF) == 1 + 6 + 3 + 0.5 * 8


def test_of_walls_that_lean_the_outline_counts_and_the_angle_once() -> None:
    """Two bosses of one drawing have as many numbers as two drawings: their level, four edges along x, one along y, and the draft."""
    loops = [((x - 0.1, -0.2, 0.0), (x + 0.1, -0.2, 0.0), (x + 0.1, 0.2, 0.0), (x - 0.1, 0.2, 0.0)) for x in (-0.15, 0.25)]
    one = Primitive("drafted", (0.06, 7.0), outline=Outline(tuple(loops)))
    two = separate_loops(one)
    assert count(two).primitives == 2
    assert count_numbers(one, -HALF, HALF) == count_numbers(two, -HALF, HALF) == 7


def test_cones_are_to_be_read_with_the_rims_that_they_end_at() -> None:
    pipe, flare = cylinder(0.1, 0.2), cone(0.1, 0.3, 0.2, (0.0, 0.0, 0.2))
    for high, rims in ((cylinder(0.3, 0.2, (0.0, 0.0, 0.4)), 2), (cylinder(0.25, 0.2, (0.0, 0.0, 0.4)), 1)):
        assert count_shared_rims(union(pipe, flare, high), 1e-6) == rims
    assert count_shared_rims(cut(union(pipe, cylinder(0.3, 0.2, (0.0, 0.0, 0.4))), flare), 1e-6) == 0, "what cuts does not go on in it"
    assert count_shared_rims(union(cylinder(0.1, 0.2), cylinder(0.1, 0.2, (0.0, 0.0, 0.2))), 1e-6) == 0
    assert count_shared_rims(union(pipe, cone(0.1, 0.05, 0.05, (0.0, 0.0, 0.125))), 1e-6) == 0, "a chamfer is read as such"


def test_tilted_boxes_have_directions_of_their_own() -> None:
    tilted = Primitive("box", (0.1, 0.1, 0.1), (0.2, 0.0, 0.0), (0.0, 0.0, 30.0))
    assert count_directions(PLAIN) == count_directions(DRAWN) == 3
    assert count_directions(cut(PLAIN, tilted)) == 5
    assert count_directions(Primitive("sphere", (0.1,))) == 0


def test_no_primitives_are_looked_for_in_place_of_the_hexagon_of_a_nut() -> None:
    corners = [(0.1 * math.cos(a), 0.1 * math.sin(a), 0.0) for a in np.radians(np.arange(0, 360, 60))]
    nut = Primitive("extrude", (0.05,), (0.0, 0.0, 0.025), outline=Outline((tuple(corners),)))
    assert may_be_plain(DRAWN, -HALF, HALF)
    assert not may_be_plain(cut(DRAWN, nut), -HALF, HALF)


@pytest.mark.parametrize(("degrees", "odd"), [(5.735, 2), (30.0, 0), (12.5, 0), (29.97, 2)])
def test_blocks_that_lean_at_odd_angles_are_never_plainer(degrees: float, odd: int) -> None:
    """A bar is a rectangle of any direction for one drawing, and four vertices are as many numbers as it has."""
    bar = Primitive("box", (0.5, 0.1, 0.1), rotation=(0.0, 0.0, degrees))
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    ring = tuple((c * x - s * y, s * x + c * y, 0.0) for x, y in ((-0.25, -0.05), (0.25, -0.05), (0.25, 0.05), (-0.25, 0.05)))
    drawn = Primitive("extrude", (0.1,), outline=Outline((ring,)))
    assert count_odd_directions(bar) == odd
    assert count_odd_directions(drawn) == 0
    assert is_hardly_longer(bar, drawn, -HALF, HALF) == (odd == 0)


def test_a_brace_is_a_line_of_its_bracket_and_no_block_that_is_held_back() -> None:
    """Two walls of a corner with a brace from one to the other."""
    ring = ((-0.4, -0.4), (0.4, -0.4), (0.4, -0.35), (0.1, -0.35), (-0.35, 0.1), (-0.35, 0.4), (-0.4, 0.4))
    drawn = Primitive("extrude", (0.4,), outline=Outline((tuple((x, y, 0.0) for x, y in ring),)))
    walls = union(box(0.8, 0.05, 0.4, (0.0, -0.375, 0.0)), box(0.05, 0.8, 0.4, (-0.375, 0.0, 0.0)))
    depth = 0.25 + 0.25 / math.sqrt(2)  # of the middle of a block of 0.5 behind the face of the brace
    brace = Primitive("box", (1.6, 0.5, 0.4), (-depth / math.sqrt(2), -depth / math.sqrt(2), 0.0), (0.0, 0.0, -45.0))
    half = np.array([0.4, 0.4, 0.2])
    held_back = combine_all("intersection", [union(walls, brace), box(0.8, 0.8, 0.4)])
    assert not is_hardly_longer(held_back, drawn, -half, half)
    assert is_hardly_longer(cut(walls, brace), drawn, -half, half)


def test_what_is_taken_apart_already_is_not_to_become_longer() -> None:
    """Three holes on a line of the plate say one number more than the drawing: hardly more, but more."""
    plain = cut(box(0.8, 0.6, 0.1), *(cylinder(0.05, 0.2, (x, y, 0.0)) for x, y in HOLES))
    skew = cut(box(0.8, 0.6, 0.1), *(cylinder(0.05, 0.2, (x, y + 0.01 * (x > 0 > y), 0.0)) for x, y in HOLES))
    assert reading_length(skew, -HALF, HALF) > reading_length(plain, -HALF, HALF)
    assert is_hardly_longer(skew, plain, -HALF, HALF)
    assert not is_hardly_longer(skew, plain, -HALF, HALF, 1.0)
    assert is_hardly_longer(plain, plain, -HALF, HALF, 1.0)


def test_a_turned_frame_has_the_numbers_of_its_own_directions() -> None:
    turned = Primitive("box", (0.6, 0.8, 0.1), (0.0, 0.0, 0.0), (0.0, 0.0, 90.0))
    assert count_numbers(turned, -HALF, HALF) == 3
    assert count_numbers(Primitive("box", (2.0, 0.8, 0.1), rotation=(0.0, 0.0, 90.0)), -HALF, HALF) == 2  # it ends outside


@pytest.mark.parametrize(
    ("plain", "drawn", "is_taken"),
    [
        (PLAIN, DRAWN, True),
        (cut(box(0.8, 0.6, 0.1), *(cylinder(0.05, 0.2, (x, y, 0.0)) for x, y in HOLES[:3])), DRAWN, False),  # another part
        (DRAWN, DRAWN, False),  # nothing plainer
        (cut(PLAIN, *(cylinder(0.05, 0.2, (x, y, 0.0)) for x, y in HOLES * 2)), DRAWN, False),  # more than a dozen
        (cut(PLAIN, *(cylinder(0.01 + 0.001 * k, 0.2 + 0.01 * k, HOLES[0] + (0.0,)) for k in range(6))), DRAWN, False),  # more to read
    ],
    ids=["same", "hole left out", "drawn", "long", "many numbers"],
)
def test_which_program_is_taken(plate: Observation, plain: Program, drawn: Program, is_taken: bool) -> None:
    assert is_plainer(plain, drawn, plate) is is_taken


def test_the_mesh_is_not_asked_where_two_programs_are_one_solid(plate: Observation, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Observation, "iou", lambda *_: pytest.fail("the mesh was asked"))
    assert is_plainer(PLAIN, DRAWN, plate)


def test_a_grid_of_holes_is_read_once() -> None:
    """Twenty-four holes are one of them with two counts and steps; as loops of a drawing each says where it is."""
    places = [(-0.35 + 0.14 * i, -0.24 + 0.16 * k) for i in range(6) for k in range(4)]
    drawn = Primitive("extrude", (0.1,), outline=Outline((RECTANGLE, *(circle(0.03, x, y) for x, y in places))))
    plain = cut(box(0.8, 0.6, 0.1), *(cylinder(0.03, 0.2, (x, y, 0.0)) for x, y in places))
    first = cut(box(0.8, 0.6, 0.1), cylinder(0.03, 0.2, (*places[0], 0.0)))
    assert length_read_once(plain, -HALF, HALF) == reading_length(first, -HALF, HALF) + 4
    assert reading_length(plain, -HALF, HALF) > 0.85 * reading_length(drawn, -HALF, HALF)
    seen = observe(UnitBody.of(target_from(mesh_of(plain)), np.random.default_rng(0)), 2.5e-4, np.random.default_rng(0), outlines=True)
    assert is_plainer(plain, drawn, seen)


def test_cells_are_read_once_and_walls_in_their_order() -> None:
    """A grid of pockets reads shorter than two long ones and two walls in them; six of three widths and places don't."""
    body = box(0.8, 0.6, 0.1)
    cells = cut(body, *(box(0.22, 0.24, 0.08, (x, y, 0.01)) for x in (-0.26, 0.0, 0.26) for y in (-0.14, 0.14)))
    long = cut(body, *(box(0.74, 0.24, 0.08, (0.0, y, 0.01)) for y in (-0.14, 0.14)))
    walls = union(long, *(box(0.04, 0.52, 0.08, (x, 0.0, 0.01)) for x in (-0.13, 0.13)))
    assert repeats_plainly(cells, walls, -HALF, HALF)
    assert not repeats_plainly(walls, cells, -HALF, HALF)
    assert not repeats_plainly(cells, cells, -HALF, HALF)
    columns = ((-0.37, -0.21), (-0.17, 0.0), (0.05, 0.37))
    unlike = cut(body, *(box(b - a, 0.24, 0.08, ((a + b) / 2, y, 0.01)) for a, b in columns for y in (-0.14, 0.14)))
    parted = union(long, *(box(b - a, 0.52, 0.08, ((a + b) / 2, 0.0, 0.01)) for a, b in ((-0.21, -0.17), (0.0, 0.05))))
    assert not repeats_plainly(unlike, parted, -HALF, HALF)


def test_primitives_are_looked_for_where_they_may_be_few() -> None:
    assert may_be_plain(DRAWN, -HALF, HALF)
    assert not may_be_plain(PLAIN, -HALF, HALF)
    many = Outline((RECTANGLE, *(circle(0.01 + 1e-4 * k, -0.35 + 0.02 * k, 0.0) for k in range(37))))
    assert not may_be_plain(Primitive("extrude", (0.1,), outline=many), -HALF, HALF)  # 38 features for one drawing
    windows = [(-0.35 + 0.04 * k, 0.0) for k in range(18)]
    row = Outline((RECTANGLE, *(tuple((x + u, y + v, 0.0) for u, v in ((0, 0), (0, 0.1), (0.02, 0.1), (0.02, 0))) for x, y in windows)))
    assert may_be_plain(Primitive("extrude", (0.1,), outline=row), -HALF, HALF)  # as many, but four curves for each


def test_a_hexagon_alone_reads_as_a_circle_does() -> None:
    corners = tuple((0.05 * np.cos(np.pi * k / 3), 0.05 * np.sin(np.pi * k / 3), 0.0) for k in range(6))
    nut = Primitive("extrude", (0.2,), outline=Outline((corners,)))
    assert not has_drawings(cut(PLAIN, nut))
    assert not may_be_plain(cut(PLAIN, nut), -HALF, HALF)  # three boxes are no plainer
    assert has_drawings(Primitive("extrude", (0.2,), outline=Outline((corners, circle(0.1)))))
    assert has_drawings(cut(DRAWN, nut))


def test_turned_drawings_need_a_primitive_for_each_wall() -> None:
    steps = [(0.0, 0.0), *((0.4 - 0.02 * (k // 2), 0.05 * ((k + 1) // 2)) for k in range(30)), (0.0, 0.75)]
    stepped = Primitive("revolve", (360.0,), outline=Outline((tuple((r, z, 0.0) for r, z in steps),)))
    half = np.array([0.4, 0.4, 0.375])
    assert not may_be_plain(stepped, -half, half)
    cone = Primitive("revolve", (360.0,), outline=Outline((((0.0, 0.0, 0.0), (0.4, 0.0, 0.0), (0.2, 0.75, 0.0), (0.0, 0.75, 0.0)),)))
    assert may_be_plain(cone, -half, half)


def test_a_regular_polygon_is_read_by_its_count_of_sides() -> None:
    """A nut is a hexagon, and not the intersection of three turned boxes."""
    corners = tuple((0.4 * np.cos(t), 0.4 * np.sin(t), 0.0) for t in np.radians(60.0 * np.arange(6)))
    nut = Primitive("extrude", (0.1,), outline=Outline((corners, circle(0.2, 0.0, 0.0))))
    half = np.array([0.4, 0.4 * np.sin(np.pi / 3), 0.05])
    assert count_numbers(nut, -half, half) == 3  # the radius of the corners, that of the hole, the thickness
    assert reading_length(nut, -half, half) == 1 + 3 + 3 + 0.5 * 2
    across = 0.8 * np.sin(np.pi / 3)
    boxes = [Primitive("box", (2.0, across, 0.1), rotation=(0.0, 0.0, turn)) for turn in (0.0, 60.0, 120.0)]
    turned = cut(combine_all("intersection", list(boxes)), cylinder(0.2, 0.2))
    assert reading_length(turned, -half, half) > 1.25 * reading_length(nut, -half, half)


def test_an_ellipse_alone_is_read_as_a_circle_is() -> None:
    """An elliptic hole has two radii where a round one has one, and no more."""
    half = np.array([0.5, 0.4, 0.05])
    plate, round_hole = box(1.0, 0.8, 0.1), cylinder(0.2, 0.1)
    oval = Primitive("extrude", (0.1,), outline=Outline((Ellipse(0.3, 0.2),)))
    assert reading_length(cut(plate, oval), -half, half) == reading_length(cut(plate, round_hole), -half, half) + 1


@pytest.mark.parametrize(("steps", "is_read"), [(9, True), (30, False)])
def test_more_than_two_dozen_features_stand_for_no_drawing(steps: int, is_read: bool) -> None:
    """Though there is less to read in them: blocks of a stair whose treads are rounded, each of another height."""
    heights = [0.02 * (k + 1) ** 1.3 for k in range(steps)]
    blocks = [box(0.1, 0.2, h, (0.1 * k, 0.0, h / 2)) for k, h in enumerate(heights)]
    around = [(x, h, 0.1) for k, h in enumerate(heights) for x in (0.1 * k - 0.05, 0.1 * k, 0.1 * k + 0.05)]
    ends = ((0.1 * steps - 0.05, 0.0, 0.0), (-0.05, 0.0, 0.0))
    drawn = Primitive("extrude", (0.2,), outline=Outline(((*around, *ends),)))
    low, high = np.array([-0.05, -0.1, 0.0]), np.array([0.1 * steps, 0.1, heights[-1]])
    plain = combine_all("union", blocks)
    assert reading_length(plain, low, high) < 0.85 * reading_length(drawn, low, high)
    assert is_hardly_longer(plain, drawn, low, high) is is_read
