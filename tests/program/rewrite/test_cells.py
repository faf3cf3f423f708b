"""Walls between pockets and bars of lattices become cavities; what is proposed is compared with the solid it came from."""

from dataclasses import replace
from itertools import product

import pytest
from tests.planted import box, cut, cylinder, union

from imdim.geometry.solid import SEGMENTS, to_manifold
from imdim.program.motions import euler, move_program, turn
from imdim.program.outline import Outline, arc_radii, circle, rectangle
from imdim.program.rewrite.cells import count_runs, end_cuts_with_the_solid, propose_cells
from imdim.program.tree import Primitive, Program, leaves
from imdim.search.outline_areas import draw_area

BODY = box(0.6, 0.4, 0.2)
CELLS = [(x, y) for x in (-0.19, 0.0, 0.19) for y in (-0.095, 0.095)]
TRAY = cut(BODY, *(box(0.17, 0.17, 0.18, (x, y, 0.01)) for x, y in CELLS))
LONG = [box(0.55, 0.17, 0.18, (0.0, y, 0.01)) for y in (-0.095, 0.095)]
ACROSS = [box(0.02, 0.36, 0.18, (x, 0.0, 0.01)) for x in (-0.095, 0.095)]
WALLED = union(cut(BODY, *LONG), *ACROSS)
UPRIGHT = [box(0.04, 0.6, 0.1, (x, 0.0, 0.0)) for x in (-0.28, -0.1, 0.1, 0.28)]
BARS = UPRIGHT + [box(0.6, 0.04, 0.1, (0.0, y, 0.0)) for y in (-0.28, 0.0, 0.28)]
TURNED = [((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.0), ((0.1, -0.2, 0.05), (0.6, 0.0, 0.8), 37.0)]


def differ(a: Program, b: Program, segments: int = SEGMENTS) -> float:
    """The volume that one of them has and the other has not, of the second's."""
    one, other = to_manifold(a, segments), to_manifold(b, segments)
    volumes = one.volume(), other.volume()
    return (sum(volumes) - 2 * (one ^ other).volume()) / volumes[1]


def proposals(program: Program) -> list[Program]:
    return list(propose_cells(program, draw_area))


def kinds(program: Program) -> list[str]:
    return [leaf.kind for leaf in leaves(program)]


@pytest.mark.parametrize("motion", TURNED, ids=["straight", "turned"])
def test_walls_across_pockets_leave_the_cells_between_them(motion) -> None:
    walled = move_program(WALLED, turn(*motion))
    (found,) = proposals(walled)
    assert kinds(found) == ["box"] * 7
    assert differ(found, move_program(TRAY, turn(*motion))) == pytest.approx(0, abs=1e-9)
    assert {leaf.rotation for leaf in leaves(found)} == {next(leaves(walled)).rotation}  # boxes lie as the body does


def test_cells_stand_where_the_cutters_stood() -> None:
    """Slots that come after the walls go on cutting through them, and a step before the pockets stays before."""
    slots = [box(0.08, 0.5, 0.06, (x, 0.0, -0.02)) for x in (-0.19, 0.19)]
    step = box(0.2, 0.5, 0.05, (-0.3, 0.0, 0.1))
    walled = cut(union(cut(BODY, step, *LONG), *ACROSS), *slots)
    (found,) = proposals(walled)
    assert kinds(found) == ["box"] * 10
    assert differ(found, walled) == pytest.approx(0, abs=1e-9)


def test_pockets_of_two_depths_share_their_walls() -> None:
    """A wall that goes deeper than the shallow row does stands in the floor there."""
    shallow = box(0.55, 0.17, 0.1, (0.0, 0.095, 0.05))
    walled = union(cut(BODY, LONG[0], shallow), *ACROSS)
    (found,) = proposals(walled)
    assert kinds(found) == ["box"] * 7
    assert differ(found, walled) == pytest.approx(0, abs=1e-9)


def test_what_is_cut_may_be_walled_too() -> None:
    rows = [box(0.17, 0.36, 0.18, (x, 0.0, 0.01)) for x in (-0.19, 0.0, 0.19)]
    walled = cut(BODY, cut(union(*rows), box(0.7, 0.02, 0.3)))
    (found,) = [p for p in proposals(walled) if kinds(p) == ["box"] * 7]
    assert differ(found, TRAY) == pytest.approx(0, abs=1e-9)


def test_a_round_pocket_with_a_wall_is_two_drawn_ones() -> None:
    walled = union(cut(BODY, cylinder(0.15, 0.3)), box(0.5, 0.04, 0.2))
    (found,) = proposals(walled)
    halves = [leaf for leaf in leaves(found) if leaf.outline]
    assert len(halves) == 2
    for half in halves:
        assert half.outline is not None
        assert arc_radii(half.outline) == pytest.approx([0.15])
    assert differ(found, walled) < 1e-5


@pytest.mark.parametrize(
    "walled",
    [
        union(cut(BODY, *LONG), box(0.02, 0.36, 0.1, (0.0, 0.0, -0.03))),  # lower than the pockets
        union(cut(BODY, *LONG), box(0.02, 0.1, 0.18, (0.0, 0.095, 0.01))),  # a post in the middle of one
        cut(BODY, *LONG),
        cut(union(BODY, cylinder(0.1, 0.5)), cylinder(0.05, 0.7)),  # a bored boss
        BODY,
    ],
    ids=["low", "post", "no walls", "boss", "one leaf"],
)
def test_walls_that_part_nothing_stay(walled) -> None:
    assert proposals(walled) == []


def test_a_wall_that_stands_out_is_seen_to_be_another_solid() -> None:
    walled = union(cut(BODY, *LONG), box(0.02, 0.36, 0.3, (0.0, 0.0, 0.07)))
    assert all(differ(found, walled) > 1e-4 for found in proposals(walled))


@pytest.mark.parametrize("motion", TURNED, ids=["straight", "turned"])
def test_bars_leave_the_windows_of_a_plate(motion) -> None:
    lattice = move_program(union(*BARS), turn(*motion))
    (found,) = proposals(lattice)
    assert kinds(found) == ["box"] * 7
    assert differ(found, lattice) == pytest.approx(0, abs=1e-9)


def test_a_lattice_keeps_its_arcs() -> None:
    """Bars across a ring: the plate is a circle, and the windows beside its rim have an arc of it each."""
    ring = Primitive("extrude", (0.1,), outline=Outline((circle(0.4), circle(0.36))))
    lattice = union(ring, *(box(0.02, 0.74, 0.1, (x, 0.0, 0.0)) for x in (-0.15, 0.0, 0.15)))
    (found,) = proposals(lattice)
    plate, *_ = leaves(found)
    radii = plate.size[:1] if plate.outline is None else arc_radii(plate.outline)
    assert sorted({round(r, 9) for r in radii}) == [0.36, 0.4]
    assert differ(found, lattice, 1000) < 1e-5  # arcs that end elsewhere have other corners


def test_bars_of_other_levels_are_no_lattice() -> None:
    lifted = [replace(bar, center=(*bar.center[:2], 0.05 * (bar.size[0] > bar.size[1]))) for bar in BARS]
    assert proposals(union(*lifted)) == []
    assert proposals(union(*UPRIGHT)) == []  # a row of them leaves no window


def test_equal_areas_of_a_drawing_are_cells() -> None:
    places = list(product((-0.2, 0.0, 0.2), (-0.1, 0.1)))
    drawn = Primitive("extrude", (0.3,), outline=Outline(tuple(circle(0.08, x, y) for x, y in places)))
    (found,) = proposals(cut(BODY, drawn))
    assert kinds(found) == ["box"] + ["cylinder"] * 6
    assert differ(found, cut(BODY, drawn)) < 1e-6
    unlike = Primitive("extrude", (0.3,), outline=Outline(tuple(circle(0.05 + 0.1 * abs(x), x, y) for x, y in places)))
    assert proposals(cut(BODY, unlike)) == []


def test_cutters_end_with_the_solid() -> None:
    apart = cut(BODY, box(0.1, 0.9, 0.1, (0.1, 0.2, 0.1)), cylinder(0.05, 0.7, (-0.1, 0.0, 0.2)))
    ended = end_cuts_with_the_solid(apart)
    _, slot, bore = leaves(ended)
    assert slot.size == pytest.approx((0.1, 0.4, 0.05))
    assert slot.center == pytest.approx((0.1, 0.0, 0.075))
    assert bore.size == pytest.approx((0.05, 0.2))
    assert differ(ended, apart) == pytest.approx(0, abs=1e-9)


def test_runs_are_counted_wherever_they_are() -> None:
    assert count_runs(BODY) == 0
    assert count_runs(TRAY) == 1
    assert count_runs(WALLED) == 2
    assert count_runs(cut(BODY, cut(union(*LONG), *ACROSS))) == 3


def test_an_area_is_drawn_with_the_curves_it_is_given() -> None:
    plate, hole = rectangle(0.4, 0.2), Outline((circle(0.05),))
    drawn = draw_area([plate, plate.shift(0.1, 0.0)], [hole])
    assert drawn is not None
    assert drawn.area == pytest.approx(0.5 * 0.2 - 3.14159265 * 0.05**2)
    assert drawn.curve_count == 5
    assert draw_area([hole], [plate]) is None


def test_walls_that_all_but_coincide_are_two() -> None:
    """A cutter that ends 1e-5 inside leaves a strip: what is drawn is what is given, and not what is near it."""
    strip = draw_area([rectangle(0.4, 0.2)], [rectangle(0.5, 0.2 - 2e-5)])
    assert strip is not None
    assert strip.area == pytest.approx(0.4 * 2e-5, rel=1e-3)


def test_frames_of_cells_have_their_bodys_angles() -> None:
    """A wall's frame may be another turn of the same directions."""
    turned = euler((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    walled = union(cut(BODY, *(box(0.17, 0.18, 0.55, (0.0, y, 0.01), turned) for y in (-0.095, 0.095))), *ACROSS)
    (found,) = proposals(walled)
    assert kinds(found) == ["box"] * 7
    assert differ(found, TRAY) == pytest.approx(0, abs=1e-9)
