import time
from dataclasses import replace

import numpy as np
import pytest
from manifold3d import Manifold
from tests.deadlines import PASSED
from tests.export.coincident import HOLE, MEANT, PLATE, POCKET, cut
from tests.known_programs import EVERY

from imdim.geometry.finish.overshoot import overshoot
from imdim.geometry.solid import to_manifold, volume
from imdim.program.tree import Combine, Primitive, combine_all, leaves, map_leaves


def difference(a: Manifold, b: Manifold) -> float:
    return (a - b).volume() + (b - a).volume()


@pytest.mark.parametrize("name", MEANT)
def test_the_solid_stays_and_the_skin_goes(name):
    program, exact, holes = MEANT[name]
    after = to_manifold(overshoot(program))
    assert difference(to_manifold(program), after) < 1e-6 * exact
    assert after.volume() == pytest.approx(exact, rel=1e-3)
    assert after.genus() + len(after.decompose()) - 1 == holes


@pytest.mark.parametrize("name", sorted(set(EVERY) - {"nothing"}))
def test_known_solids_stay(name):
    program, exact = EVERY[name]
    assert difference(to_manifold(program), to_manifold(overshoot(program))) < 1e-6 * exact


@pytest.mark.parametrize("name", MEANT)
def test_twice_is_once(name):
    once = overshoot(MEANT[name][0])
    assert once != MEANT[name][0]
    assert overshoot(once) == once


@pytest.mark.parametrize("name", MEANT)
def test_a_skin_left_by_noise_is_opened(name):
    program, exact, holes = MEANT[name]
    rng = np.random.default_rng(len(name))

    def shaken(_: int, leaf: Primitive) -> Primitive:
        x, y, z = (c + float(d) for c, d in zip(leaf.center, rng.normal(0, 1e-5, 3), strict=True))
        return replace(leaf, center=(x, y, z))

    solid = to_manifold(overshoot(map_leaves(program, shaken)))
    bodies = [body for body in solid.decompose() if body.volume() > 1e-9 * exact]
    assert sum(body.genus() for body in bodies) == holes
    assert solid.volume() == pytest.approx(exact, rel=1e-3)


def test_cutters_stick_out_by_a_round_number():
    _, hole = leaves(overshoot(cut(PLATE, HOLE)))
    assert (hole.size, hole.center) == ((5.0, 12.0), (20.0, 0.0, 0.0))
    _, pocket = leaves(overshoot(cut(PLATE, POCKET)))
    assert (pocket.size, pocket.center) == ((20.0, 20.0, 6.0), (-20.0, 0.0, 3.0))


def test_faces_that_are_kept_and_those_of_their_copies_stay():
    plate, hole = Primitive("box", (10.0, 10.0, 2.0)), Primitive("cylinder", (2.0, 2.0))
    program = Combine("difference", plate, hole)
    low, high = (2, -1), (2, 1)
    one = overshoot(program, kept=[(1, low)])
    assert one.right.center[2] + one.right.size[1] / 2 > 1.0
    assert one.right.center[2] - one.right.size[1] / 2 == pytest.approx(-1.0)
    assert overshoot(program, kept=[(1, low), (1, high)]) == program


def test_no_overshoot_into_other_material():
    roof = Primitive("box", (100.0, 60.0, 4.0), (0.0, 0.0, 7.0))
    blind = cut(combine_all("union", [PLATE, roof]), POCKET)
    assert list(leaves(overshoot(blind)))[2] == POCKET


def test_thirty_primitives_take_less_than_a_second_or_so():
    rng = np.random.default_rng(0)
    spots = rng.uniform(-45, 45, (29, 2)).tolist()
    program = cut(Primitive("box", (100.0, 100.0, 10.0)), *(Primitive("cylinder", (2.0, 10.0), (x, y, 0.0)) for x, y in spots))
    start = time.process_time()
    after = overshoot(program)
    assert time.process_time() - start < 3
    assert volume(after) == pytest.approx(volume(program), rel=1e-9)


def test_without_time_faces_stay():
    assert overshoot(cut(PLATE, HOLE), deadline=PASSED) == cut(PLATE, HOLE)
