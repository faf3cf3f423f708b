"""Hidden walls of drawings: further out, as far as there is as much room again, and nowhere else."""

import pytest

from imdim.geometry.census import census_of
from imdim.geometry.finish.far_walls import reach_walls_far
from imdim.geometry.solid import to_manifold
from imdim.program.outline import Outline
from imdim.program.tree import Combine, Primitive, leaves


def _drawn(*corners, height=10.0, center=(0.0, 0.0, 0.0)):
    return Primitive("extrude", (height,), center, outline=Outline((tuple((float(x), float(y), 0.0) for x, y in corners),)))


WEDGE = _drawn((-30, -20), (0, -20), (10, 20), (-30, 20))


def _far(second, op="union"):
    program = Combine(op, WEDGE, second)
    after = reach_walls_far(program)
    assert to_manifold(after).volume() == pytest.approx(to_manifold(program).volume())
    first, far = leaves(after)
    assert first == WEDGE
    return far.outline.loops[0]


def test_a_slanted_wall_sinks_into_what_it_touches():
    """Then a step of the other wall leaves no slit: an edit of either keeps one body."""
    arm = _drawn((2.5, -10), (30, -10), (30, 10), (7.5, 10))
    sunk = _far(arm)
    assert (sunk[1], sunk[2]) == ((30.0, -10.0, 0.0), (30.0, 10.0, 0.0))
    assert sunk[0][:2] == pytest.approx((2.5 - 5 * 17**0.5 / 4, -10))  # 5 further out, across a slope of 4: a tenth of 72 is more than that
    shrunk = _drawn((-30, -20), (-2, -20), (8, 20), (-30, 20))
    moved = Primitive("extrude", arm.size, outline=Outline((sunk,)))
    assert census_of(to_manifold(Combine("union", shrunk, moved))).kind == (1, 0, 0)


def test_a_wall_that_is_seen_stays():
    higher = _drawn((2.5, -10), (30, -10), (30, 10), (7.5, 10), height=14.0)
    assert _far(higher) == higher.outline.loops[0]


def test_a_cut_goes_on_in_the_air():
    notch = _drawn((-10, 10), (0, 10), (0, 21), (-10, 21), height=12.0)
    assert max(y for _, y, _ in _far(notch, "difference")) == 26.0


def test_what_other_material_is_beyond_stays_out_of_reach():
    part = Combine("union", WEDGE, _drawn((-30, 26), (10, 26), (10, 40), (-30, 40)))
    notch = _drawn((-10, 10), (0, 10), (0, 21), (-10, 21), height=12.0)
    *_, after = leaves(reach_walls_far(Combine("difference", part, notch)))
    assert max(y for _, y, _ in after.outline.loops[0]) == 23.0  # of 5 mm that are left less than half


def test_a_ring_sinks_into_the_disc_that_it_touches():
    disc = Primitive("cylinder", (20.0, 10.0))
    ring = Primitive("revolve", (360.0,), outline=Outline((((20.0, -5.0, 0.0), (24.0, -5.0, 0.0), (24.0, -3.0, 0.0), (20.0, -3.0, 0.0)),)))
    _, sunk = leaves(reach_walls_far(Combine("union", disc, ring)))
    assert sunk.outline.bounds[0][0] < 19.0
    assert sunk.outline.bounds[1] == (24.0, -3.0)
    bored = Combine("difference", Combine("union", disc, ring), Primitive("cylinder", (19.9, 20.0)))
    assert (
        list(leaves(reach_walls_far(Combine("union", Combine("difference", disc, Primitive("cylinder", (19.9, 20.0))), ring))))[-1] == ring
    )
    assert to_manifold(reach_walls_far(bored)).volume() == pytest.approx(to_manifold(bored).volume(), rel=1e-3)
