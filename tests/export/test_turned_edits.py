"""Edits by a tenth of what is turned: its walls stay beside each other, bores in their tubes, and cuts from the side in the walls."""

import math
from functools import partial, reduce

import pytest
from tests.export.test_collisions import _read

from imdim.export.edit import change_values, solid_of
from imdim.geometry.census import census_of
from imdim.program.outline import Loop, Outline
from imdim.program.tree import Combine, Primitive, leaves


def _turned(*corners, center=(0.0, 0.0, 0.0)):
    return Primitive("revolve", (360.0,), center, outline=Outline((tuple((x, y, 0.0) for x, y in corners),)))


def _tenths(part):
    return [(name, change_values(part, {name: factor * value})) for name, value in part.values.items() for factor in (0.9, 1.1)]


def test_a_band_stays_wider_than_what_is_beside_it():
    """By half a millimetre in 40: a tenth of either diameter is eight times that."""
    part = _read(_turned((0, -15), (19.5, -15), (19.5, -5), (20, -4), (20, 5), (19.5, 5), (19.5, 15), (0, 15)))
    assert part.values["turned_part_shoulder"] == pytest.approx(0.5)
    for name, edited in _tenths(part):
        (leaf,) = leaves(edited.program)
        radii = sorted({round(x, 6) for x, _, _ in leaf.outline.loops[0] if x > 0})
        assert len(radii) == 2, name
        assert radii[1] == max(x for x, y, _ in leaf.outline.loops[0] if abs(y) < 10), name


def test_a_bore_that_all_but_fills_a_tube_leaves_a_wall():
    tube = _turned((0, -40), (20.5, -40), (20.5, 30), (40, 30), (40, 40), (0, 40))
    part = _read(Combine("difference", tube, Primitive("cylinder", (18.5, 82.0))))
    assert [v for name, v in part.values.items() if name.endswith("wall_thickness")] == pytest.approx([2.0])
    for name, edited in _tenths(part):
        assert census_of(solid_of(edited)).kind == (1, 1, 0), name


def test_what_is_turned_is_cut_off_still_where_its_clip_ends():
    """A socket that a cylinder cuts off shortly before its own end, which nobody sees."""
    socket = _turned((0, -40), (20, -40), (20, 30), (60, 30), (60, 40), (0, 40))
    part = _read(Combine("intersection", socket, Primitive("cylinder", (60.0, 80.0), (0.0, 0.0, 0.3))))
    assert 80.0 not in part.values.values()
    for name, edited in _tenths(part):
        turned, clip = leaves(edited.program)
        assert clip.center[2] - clip.size[1] / 2 - (turned.center[2] + turned.outline.bounds[0][1]) == pytest.approx(0.3), name


def test_a_bore_goes_through_what_a_nut_is_turned_from():
    """A round top, and a hexagon that it is cut to and that reaches beyond it, as does the bore by a hair: both follow the top."""
    round_top = ((0, -20, 0.0), (20, -20, 0.0), (20, -8, 0.0), (14, -8, 0.0), (14, 10, math.tan(math.pi / 8)), (4, 20, 0.0), (0, 20, 0.0))
    around = ((-16, -9), (0, -18), (16, -9), (16, 9), (0, 18), (-16, 9))
    hexagon = Primitive("extrude", (40.0,), (0.0, 0.0, 2.0), outline=Outline((tuple((x, y, 0.0) for x, y in around),)))
    nut = Combine("intersection", Primitive("revolve", (360.0,), outline=Outline((round_top,))), hexagon)
    part = _read(Combine("difference", nut, Primitive("cylinder", (5.0, 40.01), (0.0, 0.0, 0.0))))
    for name, edited in _tenths(part):
        turned, hexagon, _ = leaves(edited.program)
        top = turned.center[2] + turned.outline.bounds[1][1]
        assert hexagon.center[2] + hexagon.size[0] / 2 == pytest.approx(top + 2.0), name
        assert census_of(solid_of(edited)).kind == (1, 1, 0), name


@pytest.mark.parametrize("start", [11.0, 11.8])
def test_a_hole_from_the_side_of_a_collar_goes_from_its_bore_to_the_outside(start):
    """One that begins well inside the bore, and one of which the rim of that end is seen."""
    collar = Combine("difference", Primitive("cylinder", (20.0, 16.0)), Primitive("cylinder", (12.0, 18.0)))
    screw = Primitive("cylinder", (3.0, 21.0 - start), ((21.0 + start) / 2, 0.0, 0.0), (0.0, 90.0, 0.0))
    part = _read(Combine("difference", collar, screw))
    for name, edited in _tenths(part):
        disc, bore, hole = leaves(edited.program)
        ends = hole.center[0] - hole.size[1] / 2, hole.center[0] + hole.size[1] / 2
        assert ends == pytest.approx((bore.size[0] - 12.0 + start, disc.size[0] + 1.0)), name


def test_a_peg_on_a_shaft_stays_sunk_in_it():
    peg = Primitive("cylinder", (3.0, 12.0), (25.0, 0.0, 0.0), (0.0, 90.0, 0.0))
    part = _read(Combine("union", Primitive("cylinder", (20.0, 60.0)), peg))
    for name, edited in _tenths(part):
        assert census_of(solid_of(edited)).kind == (1, 0, 0), name


def test_a_bar_between_two_posts_reaches_from_axis_to_axis():
    plate = Primitive("box", (60.0, 60.0, 4.0))
    posts = [Primitive("cylinder", (5.0, 18.0), (x, 0.0, 9.0)) for x in (-15.0, 20.0)]
    bar = Primitive("box", (35.0, 4.0, 6.0), (2.5, 0.0, 14.0))
    part = _read(Combine("union", Combine("union", Combine("union", plate, posts[0]), posts[1]), bar))
    assert {-15.0, 20.0} <= set(part.values.values())
    for name, edited in _tenths(part):
        _, left, right, bar = leaves(edited.program)
        ends = bar.center[0] - bar.size[0] / 2, bar.center[0] + bar.size[0] / 2
        assert ends == pytest.approx((left.center[0], right.center[0])), name


def test_a_countersink_in_a_collar_stays_at_its_wall():
    collar = Combine("difference", Primitive("cylinder", (20.0, 16.0)), Primitive("cylinder", (12.0, 18.0)))
    sunk = Primitive("cone", (3.0, 5.0, 1.8), (20.1, 0.0, 0.0), (0.0, 90.0, 0.0))
    screw = Primitive("cylinder", (3.0, 20.0), (17.0, 0.0, 0.0), (0.0, 90.0, 0.0))
    part = _read(Combine("difference", Combine("difference", collar, screw), sunk))
    for name, edited in _tenths(part):
        disc, _, _, cone = leaves(edited.program)
        assert cone.center[0] + cone.size[2] / 2 == pytest.approx(disc.size[0] + 1.0), name


def test_what_is_stacked_end_on_end_stays_so():
    """With a hair of overlap, as people write it."""
    parts = [Primitive("cylinder", (5.0 + i, 8.0), (0.0, 0.0, 4.0 + 7.995 * i)) for i in (0, 1, 2)]
    part = _read(Combine("union", Combine("union", parts[0], parts[1]), parts[2]))
    for name, edited in _tenths(part):
        first, second, third = leaves(edited.program)
        for low, high in ((first, second), (second, third)):
            assert low.center[2] + low.size[1] / 2 - (high.center[2] - high.size[1] / 2) == pytest.approx(0.005), name


def test_cones_end_at_the_rims_that_they_end_at_whatever_is_edited():
    """A hopper of three pieces, whose bores go on in each other."""
    outer = [Primitive("cylinder", (8.0, 30.0), (0, 0, 15)), Primitive("cone", (8.0, 40.0, 35.0), (0, 0, 47.5))]
    outer.append(Primitive("cylinder", (40.0, 5.0), (0, 0, 67.5)))
    inner = [Primitive("cylinder", (6.0, 31.0), (0, 0, 15.5)), Primitive("cone", (6.0, 38.0, 35.0), (0, 0, 48.5))]
    inner.append(Primitive("cylinder", (38.0, 4.0), (0, 0, 68.0)))
    program = reduce(partial(Combine, "union"), outer)
    part = _read(reduce(partial(Combine, "difference"), inner, program))
    assert sorted(v for name, v in part.values.items() if name.endswith("diameter")) == [12.0, 16.0, 76.0, 80.0]
    assert not any("cone" in name and name.endswith("diameter") for name in part.values), "the pipes have the diameters"
    for name, edited in _tenths(part):
        parts = list(leaves(edited.program))
        for low, middle, high in (parts[:3], parts[3:]):
            ends = (middle.center[2] - middle.size[2] / 2, middle.center[2] + middle.size[2] / 2)
            assert (middle.size[0], middle.size[1]) == pytest.approx((low.size[0], high.size[0])), name
            assert ends == pytest.approx((low.center[2] + low.size[1] / 2, high.center[2] - high.size[1] / 2)), name


def test_a_countersunk_hole_has_one_diameter():
    plate, hole = Primitive("box", (40.0, 30.0, 4.0)), Primitive("cylinder", (2.1, 6.0))
    sunk = Primitive("cone", (2.1, 4.3, 2.2), (0.0, 0.0, 0.9))
    part = _read(Combine("difference", Combine("difference", plate, hole), sunk))
    assert [name for name, v in part.values.items() if v == pytest.approx(4.2)] == ["hole_diameter"]
    _, hole, sunk = leaves(change_values(part, {"hole_diameter": 4.0}).program)
    assert (hole.size[0], sunk.size[0]) == pytest.approx((2.0, 2.0))


def test_a_cut_aslant_that_ends_in_the_air_on_both_sides_has_no_depth():
    bar = Primitive("box", (60.0, 20.0, 10.0))
    hole = Primitive("cylinder", (2.0, 33.3), (0.0, 0.0, 0.0), (0.0, 30.0, 0.0))
    assert 33.3 not in _read(Combine("difference", bar, hole)).values.values()


def test_a_tab_at_the_rim_of_a_flange_stays_there():
    """It is wider than it is sunk in, so that its foot is seen in part."""
    flange = _turned((90, 0), (100, 0), (100, 4), (94, 4), (94, 40), (90, 40))
    part = _read(Combine("union", flange, Primitive("box", (20.02, 24.0, 2.0), (109.9, 0.0, 2.0))))
    for name, edited in _tenths(part):
        ring, tab = leaves(edited.program)
        radius = max(x for x, _, _ in ring.outline.loops[0])
        assert tab.center[0] - tab.size[0] / 2 == pytest.approx(radius - 0.11), name


def test_a_rod_through_a_tube_sticks_out_of_it_as_far_as_it_does():
    """By 10 on both sides of a tube 250 wide: a rod a tenth shorter would end inside it."""
    tube = _turned((110, -40), (125, -40), (125, 30), (129, 30), (129, 40), (110, 40))
    rod = Primitive("cylinder", (4.0, 270.0), (0.0, 0.0, -10.0), (0.0, 90.0, 0.0))
    part = _read(Combine("union", tube, rod))
    assert 270.0 not in part.values.values()
    assert [value for name, value in part.values.items() if name.endswith("offset")] == pytest.approx([10.0])
    for name, edited in _tenths(part):
        tube, rod = leaves(edited.program)
        assert rod.size[1] / 2 > max(x for x, y, _ in tube.outline.loops[0] if y < 0) + 5.0, name


def test_a_drilled_hole_is_as_deep_as_it_goes_from_its_face():
    """Not from where its cutter ends in the air."""
    plate = Primitive("box", (40.0, 30.0, 12.0), (0.0, 0.0, -6.0))
    bit = Outline((((2.0, 5.0, 0.0), (0.0, 5.0, 0.0), (0.0, -5.0, 0.0), (2.0, -3.8, 0.0)),))
    part = _read(Combine("difference", plate, Primitive("revolve", (360.0,), (6.0, 4.0, -4.0), outline=bit)))
    name, *others = [name for name, value in part.values.items() if value == pytest.approx(9.0)]
    assert name.endswith("_depth")
    assert not others
    assert not [name for name, value in part.values.items() if value == pytest.approx(10.0)]
    _, deeper = leaves(change_values(part, {name: 10.5}).program)
    lowest = min(y for _, y, _ in deeper.outline.loops[0]) + deeper.center[2]
    assert lowest == pytest.approx(-10.5)


def test_a_thin_ring_that_is_cut_is_as_thick_as_it_is_however_large():
    """Two diameters that differ by less than a tenth would let no tenth more of one through."""
    plate = Primitive("cylinder", (40.0, 10.0))
    grooves = Primitive("revolve", (360.0,), (0.0, 0.0, 4.5), outline=Outline((_ring(24, 25, 0.5), _ring(27, 28.5, 0.5))))
    part = _read(Combine("difference", plate, grooves))
    assert sorted(value for name, value in part.values.items() if "thickness" in name) == pytest.approx([1.0, 1.5])
    for name, edited in _tenths(part):
        _, cut = leaves(edited.program)
        inner, outer = ([x for x, _, _ in loop] for loop in cut.outline.loops)
        assert max(inner) - min(inner) == pytest.approx(1.0, rel=0.11), name
        assert max(outer) - min(outer) == pytest.approx(1.5, rel=0.11), name


def _ring(inner: float, outer: float, half: float) -> Loop:
    return tuple((float(x), z, 0.0) for x, z in ((inner, -half), (outer, -half), (outer, half), (inner, half)))
