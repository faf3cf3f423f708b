"""Outlines that were typed and then disturbed: every number is demanded back, and arcs touch exactly what they touched."""

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.drawn import BORED, DRAWN, PULLEY, SLOTTED, centred, noisy, slot

from imdim.geometry import kernels
from imdim.geometry.sampling import surface_points
from imdim.numbers.outline_values import snap_leaf, snap_outline
from imdim.numbers.snap import SnapConfig, snap
from imdim.program.outline import Outline, arc_center, arc_radius, loop_curves, rectangle
from imdim.program.regular_polygon import RegularPolygon, regular_of
from imdim.program.tree import Combine, Primitive, Program, leaves


def extent(outline: Outline) -> float:
    (left, low), (right, high) = outline.bounds
    return max(right - left, high - low)


def largest_difference(a: Outline, b: Outline) -> float:
    assert [len(loop) for loop in a.loops] == [len(loop) for loop in b.loops]
    return float(np.abs(np.concatenate(a.loops) - np.concatenate(b.loops)).max())


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", DRAWN)
def test_typed_numbers_come_back(name, seed):
    typed = DRAWN[name]
    given = noisy(typed, 1e-5, np.random.default_rng(seed))
    assert largest_difference(typed, given) > 1e-6 * extent(typed)
    assert largest_difference(typed, snap_outline(given, 5e-5 * extent(typed))) < 1e-13 * extent(typed)


def test_numbers_are_round_where_the_origin_of_the_part_is():
    given = noisy(SLOTTED, 1e-5, np.random.default_rng(0)).shift(-33.3337, 17.1713)
    snapped = snap_outline(given, 5e-3, (33.3337, -17.1713))
    assert largest_difference(SLOTTED.shift(-33.3337, 17.1713), snapped) < 1e-12
    # about its own origin the numbers would be others
    assert largest_difference(snap_outline(given, 5e-3), snapped) > 1e-4


def test_fillets_touch_their_lines_exactly():
    for name in ("bracket", "slots"):
        snapped = snap_outline(noisy(DRAWN[name], 1e-5, np.random.default_rng(1)), 5e-5 * extent(DRAWN[name]))
        touched = 0
        for loop in snapped.loops:
            curves = loop_curves(loop)
            for line, arc in [*zip(curves, [*curves[1:], curves[0]], strict=True), *zip([*curves[1:], curves[0]], curves, strict=True)]:
                if line[4] == 0 and arc[4] != 0:
                    (x, y), (a, b, u, v, _) = arc_center(arc), line
                    away = abs((u - a) * (y - b) - (v - b) * (x - a)) / math.hypot(u - a, v - b)
                    assert abs(away - arc_radius(arc)) < 1e-12 * extent(snapped)
                    touched += 1
        assert touched == (4 if name == "bracket" else 8)


def test_nothing_moves_by_more_than_the_tolerance_allows():
    rng = np.random.default_rng(5)
    odd = Outline((tuple((30 * math.cos(a) + rng.normal(), 20 * math.sin(a) + rng.normal(), 0.0) for a in np.arange(7) * 2 * math.pi / 7),))
    for tolerance in (1e-1, 1e-3):
        assert 0 < largest_difference(odd, snap_outline(odd, tolerance)) < 5 * tolerance


def test_an_outline_that_would_cross_itself_stays():
    thin = Outline((rectangle(10.0, 8.0).loops[0], slot(0.0, 3.6, 4.0, 0.399)))
    assert snap_outline(thin, 0.9) is thin


def test_edges_on_one_line_become_one():
    split = Outline((((0, 0, 0), (5, 1e-4, 0), (10, 0, 0), (10, 5, 0), (0, 5, 0)),))
    assert snap_outline(split, 1e-3) == Outline((((0, 0, 0), (10, 0, 0), (10, 5, 0), (0, 5, 0)),))


def test_a_lying_extrusion_has_round_places_in_the_world():
    """Its own x and y are the world's y and z, and its middle is nowhere round before."""
    leaf = replace(centred(SLOTTED, 8.0), rotation=(90.0, 0.0, 90.0), center=(2.0, 50.0, 30.0))
    given = replace(leaf, center=(2.0, 51.234, 28.766), outline=noisy(leaf.outline.shift(-1.234, 1.234), 1e-5, np.random.default_rng(2)))
    snapped = snap_leaf(given, 5e-3)
    assert snapped.center == leaf.center
    assert largest_difference(leaf.outline, snapped.outline) < 1e-12


class Distance:
    """Mean distance of a target's surface points to a candidate; counts its calls."""

    def __init__(self, target: Program) -> None:
        self.points, _ = surface_points(target, 2000, np.random.default_rng(0))
        self.calls = 0

    def __call__(self, program: Program) -> float:
        self.calls += 1
        return float(np.abs(kernels.program_sdf(program, self.points)).mean())


def test_snapping_a_program_rounds_its_outlines():
    plate, bore = leaves(BORED)
    rough = replace(plate, size=(8.0006,), center=(30.0007, 19.9995, 4.0003), outline=noisy(plate.outline, 1e-5, np.random.default_rng(3)))
    error = Distance(BORED)
    got = snap(Combine("difference", rough, replace(bore, size=(3.0004, 20.0))), error, config=SnapConfig(max_move=1e-3))
    (snapped, hole), calls = leaves(got), error.calls
    assert (snapped.size, snapped.center, hole) == (plate.size, plate.center, bore)
    assert largest_difference(plate.outline, snapped.outline) < 1e-12
    assert calls < 60


def test_a_turned_outline_becomes_round_and_its_angle_too():
    part = replace(PULLEY, size=(90.0,))
    rough = replace(part, size=(90.004,), center=(0.0002, -0.0001, 5.0003), outline=noisy(part.outline, 1e-5, np.random.default_rng(4)))
    got = snap(rough, Distance(part), config=SnapConfig(max_move=1e-3, rel_tolerance=0.1))
    assert isinstance(got, Primitive)
    assert (got.size, got.center) == (part.size, part.center)
    assert largest_difference(part.outline, got.outline) < 1e-12


def test_the_middle_of_a_lopsided_outline_is_a_round_place():
    """An arc's end at no round place must not make every other number odd."""
    outline = Outline((((0.0, 0.0, 0.0), (90.0, 0.0, 0.3), (90.0, 35.5, 0.0), (0.0, 35.5, 0.0)),))
    (left, _), (right, _) = outline.bounds
    middle = (left + right) / 2
    leaf = Primitive("extrude", (5.0,), (middle, 17.75, 2.5), (0.0, 0.0, 0.0), outline.shift(-middle, -17.75))
    snapped = snap_leaf(leaf, 1e-4)
    assert snapped.center[:2] == (round(middle), 17.75)
    assert sorted(y for _, y, _ in snapped.outline.loops[0]) == [-17.75, -17.75, 17.75, 17.75]
    assert min(x for x, _, _ in snapped.outline.loops[0]) == -round(middle), "no longer minus the odd middle"


@pytest.mark.parametrize("seed", range(3))
def test_a_cone_in_a_turned_outline_has_the_radii_and_levels_that_were_typed(seed):
    """Its slope is a round number of nothing: what was typed are its ends."""
    typed = Outline((((10.0, -15.5, 0.0), (25.5, -15.5, 0.0), (18.0, -0.5, 0.0), (18.0, 15.5, 0.0), (13.5, 15.5, 0.0), (10.0, 8.5, 0.0)),))
    rng = np.random.default_rng(seed)
    moved = Outline(tuple(tuple((x + rng.normal(0, 2e-3), y + rng.normal(0, 2e-3), b) for x, y, b in loop) for loop in typed.loops))
    found = snap_leaf(Primitive("revolve", (360.0,), outline=moved), 0.02)
    assert largest_difference(found.outline, typed) < 1e-9


def test_circles_run_one_way_whatever_they_bound():
    """Texts call them rings, by radius and place."""
    hole = tuple((x, y, -b) for x, y, b in SLOTTED.loops[-1]) if len(SLOTTED.loops[-1]) == 2 else ((-3.0, 0.0, -1.0), (3.0, 0.0, -1.0))
    found = snap_outline(Outline((rectangle(20.0, 20.0).loops[0], hole)), 0.01)
    assert [b for _, _, b in found.loops[1]] == [1.0, 1.0]


def test_one_arc_that_would_no_longer_meet_its_line_leaves_the_others_round():
    """A line and the flat cap of an arc that just dips under it: at round numbers the circle only touches the line."""
    radius, dip, low = 5.0021, 0.0035, 9e-4
    half = math.sqrt(2 * radius * dip - dip * dip)
    cap = ((10.0 - half, low, dip / half), (10.0 + half, low, 0.0))
    outline = Outline((((1e-4, low, 0.0), *cap, (30.0002, low, 0.0), (30.0002, 19.9999, 0.0), (1e-4, 19.9999, 0.0)),))
    (loop,) = snap_outline(outline, 3e-3).loops
    assert [(x, y) for x, y, _ in loop if x < 1 or x > 29] == [(0.0, 0.0), (30.0, 0.0), (30.0, 20.0), (0.0, 20.0)]
    assert np.allclose(np.array(loop)[1:3], cap, atol=5e-2), "the cap stays"


def test_an_outline_that_a_mesh_tells_to_its_last_bits_is_not_rounded_further():
    """Walls and a round end in hundredths, a radius on no grid: the tolerance would bear tenths, and make one wall of two."""
    radius = 3.0712345
    hole = ((8.03 - radius, 4.51, 1.0), (8.03 + radius, 4.51, 1.0))
    walls = ((0.0, 0.0, 0.0), (40.03, 0.0, 0.0), (40.03, 9.02, 0.0), (20.01, 9.02, 0.0), (20.01, 9.07, 0.0), (0.0, 9.07, 0.0))
    single = Outline(tuple(tuple((float(np.float32(x)), float(np.float32(y)), b) for x, y, b in loop) for loop in (walls, hole)))
    found, bold = snap_outline(single, 0.1, bits=4e-6), snap_outline(single, 0.1)
    assert {v for x, y, _ in found.loops[0] for v in (x, y)} == {0.0, 20.01, 40.03, 9.02, 9.07}
    ((start, end),) = found.loops[1:]
    assert ((start[0] + end[0]) / 2, start[1]) == pytest.approx((8.03, 4.51), abs=1e-12)
    assert (end[0] - start[0]) / 2 == pytest.approx(3.0, abs=0.1)
    assert {v for x, y, _ in bold.loops[0] for v in (x, y)} != {0.0, 20.01, 40.03, 9.02, 9.07}


@pytest.mark.parametrize("radius", [3.35, 5.5 / math.sqrt(3)])  # typed as it is, or as 5.5 across flats
def test_sockets_of_nuts_stay_regular(radius):
    """Line by line each side would be rounded by itself, and by another amount."""
    sockets = [RegularPolygon(6, radius, (x, y), 0.0) for x in (-16.0, 16.0) for y in (-16.0, 16.0)]
    given = noisy(Outline(tuple(s.ring() for s in sockets)), 3e-8, np.random.default_rng(0))
    found = [regular_of(loop, 1e-9) for loop in snap_outline(given, 0.035, bits=4e-6).loops]
    for got, typed in zip(found, sockets, strict=True):
        assert got is not None
        assert got.center == pytest.approx(typed.center, abs=1e-9)
        assert (got.radius, got.angle) == (pytest.approx(radius, abs=1e-9), pytest.approx(0.0, abs=1e-9))


def test_a_loop_that_is_nearly_regular_is_left_as_it_is():
    """A hexagon that is a hundredth wider than regular."""
    ring = tuple((1.01 * x, y, b) for x, y, b in RegularPolygon(6, 10.0, (0.0, 0.0), 0.0).ring())
    (loop,) = snap_outline(Outline((ring,)), 0.02).loops
    assert max(x for x, _, _ in loop) == pytest.approx(10.1, abs=1e-3)


def test_an_arc_that_would_cross_the_axis_with_round_numbers_keeps_its_own():
    corners = ((4.8558979, -11.7899476, 0.0), (20.3487769, -11.7799476, 0.0), (20.1, 11.7899476, 0.0), (4.8544009, 11.8677426, 0.3971844))
    near = Primitive("revolve", (360.0,), (0.0, 0.0, -4.1908552), (0.0, 0.0, 0.0), Outline((corners,)))
    assert near.outline.bounds[0][0] == pytest.approx(0.16, abs=0.01)
    assert snap_leaf(near, 1.0) == near


def test_arcs_of_one_boss_stay_on_one_circle_and_its_fillet_follows():
    """A boss that turns by more than half is drawn as two arcs. The fillet at its foot, whose centre is poorly known, had moved the one
    that it touches, and where both no longer met they kept the numbers of the mesh, a hair beside the boss that stands there."""
    boss, fillet, floor = 3.1, 1.0, -4.0
    beside = -math.sqrt((boss + fillet) ** 2 - (floor + fillet) ** 2)
    low, touch, split = math.atan2(-math.sqrt(boss**2 - 4), 2.0), math.atan2(floor + fillet, beside) + 2 * math.pi, math.radians(100.0)
    off = 4e-4  # by which the mesh has the fillet elsewhere
    loop = (
        (2.0, floor, 0.0),
        (boss * math.cos(low), boss * math.sin(low), math.tan((split - low) / 4)),
        (boss * math.cos(split), boss * math.sin(split), math.tan((touch - split) / 4)),
        (boss * math.cos(touch) + off, boss * math.sin(touch) - off, -math.tan((touch - math.pi / 2) / 4) + off),
        (beside - off, floor, 0.0),
        *((-10.0, floor, 0.0), (-10.0, -8.0, 0.0), (10.0, -8.0, 0.0), (10.0, floor, 0.0)),
    )
    snapped = snap_outline(Outline((loop,)), 1e-3)
    arcs = [curve for curve in loop_curves(snapped.loops[0]) if curve[4]]
    assert [arc_radius(arc) for arc in arcs] == pytest.approx([boss, boss, fillet], abs=1e-9)
    assert [c for arc in arcs[:2] for c in arc_center(arc)] == pytest.approx([0.0] * 4, abs=1e-9)
    assert math.dist(arc_center(arcs[2]), (0.0, 0.0)) == pytest.approx(boss + fillet, abs=1e-9)
