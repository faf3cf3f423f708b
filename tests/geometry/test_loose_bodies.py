"""Crumbs and parts that miss each other: one face moves, where the target hangs together."""

import pytest
from tests.deadlines import PASSED
from tests.planted import box, cut, cylinder, sphere, union

from imdim.geometry.census import census_of
from imdim.geometry.finish.loose_bodies import join_bodies
from imdim.geometry.solid import join_touching, to_manifold, volume_iou
from imdim.program.outline import Outline
from imdim.program.tree import Primitive, leaves

PLATE = box(60, 40, 6)
RIB = box(10, 40, 20, (0, 0, 13))
LOW, SLANTED = box(20, 50, 8, (0, 0, 16)), box(20, 50, 20, (0, 0, 30.3))  # what is left of the rib between them and above is loose


def bodies(program):
    return census_of(to_manifold(program)).bodies


def test_a_crumb_between_two_cuts_goes():
    truth = to_manifold(union(PLATE, box(10, 40, 9, (0, 0, 7.5))))
    program = cut(union(PLATE, RIB), LOW, SLANTED)
    assert bodies(program) == 2
    mended = join_bodies(program, truth)
    assert bodies(mended) == 1
    assert volume_iou(to_manifold(mended), truth) > 1 - 1e-6
    assert sum(a != b for a, b in zip(leaves(mended), leaves(program), strict=True)) == 1


@pytest.mark.parametrize("gap", [1e-9, 3e-4, 0.01])
def test_parts_that_miss_each_other_by_a_hair_are_joined(gap):
    truth = to_manifold(union(PLATE, box(10, 10, 20, (0, 0, 13)), cylinder(3, 10, (20, 0, 7))))
    program = union(PLATE, box(10, 10, 20, (0, 0, 13 + gap)), cylinder(3, 10, (20, 0, 7)))
    assert bodies(program) == 2
    mended = join_bodies(program, truth)
    assert bodies(mended) == 1
    assert volume_iou(to_manifold(mended), truth) > volume_iou(to_manifold(program), truth) - 2e-5


def test_a_feature_that_stands_in_the_air_goes():
    program = union(cut(PLATE, cylinder(4, 6)), cylinder(1, 2))
    assert join_bodies(program, to_manifold(cut(PLATE, cylinder(4, 6)))) == cut(PLATE, cylinder(4, 6))
    assert join_bodies(program, to_manifold(program)) is program


def test_a_crumb_that_hangs_on_by_the_last_digits_goes():
    """On the grid of files it is a body of its own."""
    crumb = box(0.3, 0.3, 6, (30.15 - 1e-9, 20.15 - 1e-9, 0))
    program = union(cut(PLATE, cylinder(4, 6)), crumb)
    assert bodies(program) == 1
    assert census_of(join_touching(program)).bodies == 2
    assert join_bodies(program, to_manifold(cut(PLATE, cylinder(4, 6)))) == cut(PLATE, cylinder(4, 6))


def test_what_the_target_has_apart_stays_apart():
    apart = union(PLATE, box(10, 10, 20, (0, 0, 13.01)))
    assert join_bodies(apart, to_manifold(apart)) is apart
    whole = union(PLATE, RIB)
    assert join_bodies(whole, to_manifold(whole)) is whole


def test_no_hole_is_closed_for_it_and_time_is_kept():
    far = union(PLATE, box(10, 10, 20, (0, 0, 15)))
    truth = to_manifold(union(PLATE, box(10, 10, 20, (0, 0, 13))))
    assert join_bodies(far, truth) is far
    program = cut(union(PLATE, RIB), LOW, SLANTED)
    assert join_bodies(program, truth, PASSED) is program


def test_a_drawn_wall_is_moved_where_no_level_can_be():
    """A tab beside a plate, of which both are drawn, and are kept from each other by a wall."""

    def drawn(*corners, height):
        return Primitive("extrude", (height,), (0, 0, 0), outline=Outline((tuple((x, y, 0.0) for x, y in corners),)))

    plate = drawn((0, 0), (60, 0), (50, 40), (0, 40), height=6)
    tab = [(59.999, 0), (80, 0), (80, 30), (52.499, 30)]
    truth = to_manifold(union(plate, drawn(*tab, height=4)))
    program = union(plate, drawn(*((x + 0.004, y) for x, y in tab), height=4))
    assert bodies(program) == 2
    mended = join_bodies(program, truth)
    assert bodies(mended) == 1
    assert volume_iou(to_manifold(mended), truth) > volume_iou(to_manifold(program), truth) - 3e-4


def test_slivers_along_a_round_wall_go_where_a_cut_is_rounder():
    """Between a round end and a round cut that should take all of it away, but is flatter by a little."""

    def drawn(sagitta, height, z=0.0):
        corners = ((-30.0, -20.0, 0.0), (30.0, -20.0, 0.0), (30.0, 0.0, sagitta / 30), (-30.0, 0.0, 0.0))
        return Primitive("extrude", (height,), (0, 0, z), outline=Outline((corners,)))

    above = [box(80, 80, 1, (0, 0, 1)), box(10, 80, 8, (0, 0, 5)), box(40, 80, 8, (45, 0, 5)), box(40, 80, 8, (-45, 0, 5))]
    program = cut(drawn(12.0, 10), drawn(11.98, 6, 4.0), *above)
    assert bodies(program) == 3
    mended = join_bodies(program, to_manifold(cut(drawn(12.0, 10), box(80, 80, 5, (0, 0, 3)))))
    assert bodies(mended) == 1
    changed = [b for a, b in zip(leaves(program), leaves(mended), strict=True) if a != b]
    assert len(changed) == 1
    assert changed[0].kind == "extrude"


def test_a_wide_face_that_bears_little_goes_on_by_less():
    """All of a plate under a ball, which has no face that could move, is raised by a ten thousandth of its thickness."""
    truth = to_manifold(union(PLATE, sphere(8, (0, 0, 10.99))))
    program = union(PLATE, sphere(8, (0, 0, 11.0001)))
    assert bodies(program) == 2
    mended = join_bodies(program, truth)
    assert bodies(mended) == 1
    assert volume_iou(to_manifold(mended), truth) > volume_iou(to_manifold(program), truth) - 3e-4


def test_parts_that_are_joined_at_two_places_have_a_hole_between_them():
    """A bridge that misses both its feet by a hair."""
    feet = cut(box(60, 10, 26, (0, 0, 10)), box(40, 12, 21, (0, 0, 13.5)))
    bridge = box(60, 10, 4, (0, 0, 25.0001))
    truth = to_manifold(union(box(60, 10, 6), box(60, 10, 25, (0, 0, 14.5))))
    program = union(feet, bridge)
    assert bodies(program) == 2
    mended = join_bodies(program, truth)
    assert (census_of(to_manifold(mended)).bodies, census_of(to_manifold(mended)).through) == (1, 1)


def test_a_crumb_beside_a_drawn_cut_goes():
    """What a drawn cut leaves of one of two drawn ribs; one of the walls goes on past it."""

    def drawn(*corners, depth):
        return Primitive("extrude", (depth,), (0, 0, 13), (90, 0, 0), outline=Outline((tuple((x, y, 0.0) for x, y in corners),)))

    ribs = drawn((-5, -15), (25, -15), (25, 10), (15, 10), (15, -11), (5, -11), (5, 10), (-5, 9), depth=40)
    window = drawn((-7, -9.9), (4, -9.9), (4, 12), (-7, 11), depth=50)
    slit = drawn((-9, -11), (9, -9), (9, -8), (-9, -9.5), depth=50)
    program = cut(union(PLATE, ribs), slit, window)
    truth = to_manifold(union(PLATE, box(10, 40, 26, (20, 0, 10))))
    assert bodies(program) == 2
    mended = join_bodies(program, truth)
    assert bodies(mended) == 1
    assert volume_iou(to_manifold(mended), truth) > volume_iou(to_manifold(program), truth)


def test_a_wrong_hole_may_end_where_parts_are_joined():
    pad = box(10, 10, 20, (0, 0, 13.001))
    truth = to_manifold(cut(union(PLATE, box(10, 10, 20, (0, 0, 13))), cylinder(2, 9, (20, 0, 0))))
    program = union(cut(PLATE, cylinder(1, 9)), pad)
    assert bodies(program) == 2
    mended = join_bodies(program, truth)
    assert (census_of(to_manifold(mended)).bodies, census_of(to_manifold(mended)).through) == (1, 0)


def test_crumbs_beyond_a_turned_cut_go():
    """A ring is cut from a plate down to a disc, and does not quite reach its corners."""
    ring = Primitive("revolve", (360.0,), outline=Outline((((14.0, -6.0, 0.0), (20.8, -6.0, 0.0), (20.8, 6.0, 0.0), (14.0, 6.0, 0.0)),)))
    program = cut(box(30, 30, 10), ring)
    target = to_manifold(cylinder(14, 10))
    assert bodies(program) == 5
    joined = join_bodies(program, target)
    assert bodies(joined) == 1
    assert volume_iou(to_manifold(joined), target) > 0.999
    _, cutter = leaves(joined)
    assert cutter.outline.bounds[0][0] == 14.0
