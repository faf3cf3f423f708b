"""Whether a primitive matters in a region, against cases where the eye sees it and against the volume of what changes."""

from dataclasses import replace

import numpy as np
import pytest

from imdim.geometry import kernels
from imdim.geometry.finish import active_zone
from imdim.geometry.finish.active_zone import change_with, matters
from imdim.geometry.finish.posed import PosedPrimitive
from imdim.geometry.solid import to_manifold, volume
from imdim.program.tree import Combine, Primitive, leaves, map_leaves

PLATE = Primitive("box", (10.0, 10.0, 2.0))
HOLE = Primitive("cylinder", (2.0, 2.0))
ABOVE, IN_THE_HOLE = Primitive("box", (1.0, 1.0, 1.0), (0.0, 0.0, 1.5)), Primitive("box", (1.0, 1.0, 1.0))
BLOCK = Primitive("box", (4.0, 4.0, 4.0), (0.0, 0.0, 3.0))


def asked(program, index, region):
    return matters(program, [PosedPrimitive(leaf) for leaf in leaves(program)], index, region)


def test_a_hole_matters_inside_the_plate_and_not_above():
    bored = Combine("difference", PLATE, HOLE)
    assert asked(bored, 1, IN_THE_HOLE)
    assert not asked(bored, 1, ABOVE)
    assert asked(Combine("difference", Combine("union", PLATE, BLOCK), HOLE), 2, ABOVE)


def test_a_part_matters_where_no_other_has_material():
    joined = Combine("union", PLATE, BLOCK)
    assert not asked(joined, 1, IN_THE_HOLE)
    assert asked(joined, 1, ABOVE)
    assert not asked(Combine("intersection", joined, HOLE), 1, ABOVE)


def test_whole_numbers_ask_for_no_kernel_of_their_own():
    """It would be compiled for twelve seconds where a program that is written in Python has them."""
    assert asked(Combine("union", PLATE, BLOCK), 1, ABOVE)
    before = {*kernels._program_inside.signatures}
    assert asked(Combine("union", Primitive("box", (10, 10, 2)), Primitive("box", (4, 4, 4), (0, 0, 3))), 1, ABOVE)
    assert {*kernels._program_inside.signatures} == before


@pytest.mark.parametrize("probed", [True, False])
def test_random_programs_agree_with_what_changes(probed, monkeypatch):
    """The volume that differs in the region between the primitive taken as all of it and as nothing."""
    if not probed:
        monkeypatch.setattr(active_zone, "_shows_at_probes", lambda *_: False)
    rng, found = np.random.default_rng(0), []
    for _ in range(60):
        program = _random(rng, 4)
        index = int(rng.integers(4))
        own = list(leaves(program))[index]
        region = replace(own, size=tuple(0.3 * s for s in own.size))
        everywhere, nowhere = (
            to_manifold(map_leaves(program, lambda i, p, s=size: replace(p, size=s, center=region.center) if i == index else p), 64)  # noqa: B023
            for size in ((9.0, 9.0, 9.0), (1e-6, 1e-6, 1e-6))
        )
        inside = to_manifold(region, 64)
        changed = ((everywhere - nowhere) ^ inside).volume() + ((nowhere - everywhere) ^ inside).volume()
        found.append(changed > 1e-6 * inside.volume())
        assert asked(program, index, region) == found[-1]
    assert 10 < sum(found) < 50


def _random(rng, n):
    """Boxes and cylinders about one place; the primitive asked about is made a box."""
    if n > 1:
        ops = ("union", "intersection", "difference")
        return Combine(ops[rng.integers(3)], _random(rng, n // 2), _random(rng, n - n // 2))
    center, turn = rng.normal(0, 0.3, 3).tolist(), rng.uniform(-90, 90, 3).tolist()
    return Primitive("box", tuple(rng.uniform(0.4, 1.2, 3).tolist()), tuple(center), tuple(turn))


def test_the_change_by_a_larger_leaf_is_that_of_the_volume():
    rng, changed = np.random.default_rng(4), []
    for _ in range(40):
        program = Primitive("box", tuple(rng.uniform(4, 6, 3)))
        for _ in range(4):
            kind, size = ("box", rng.uniform(1, 3, 3)) if rng.random() < 0.5 else ("cylinder", rng.uniform(0.5, 3, 2))
            turn = tuple(rng.choice([0.0, 30.0, 90.0], 3).tolist())
            leaf = Primitive(kind, tuple(size.tolist()), tuple(rng.uniform(-3, 3, 3).tolist()), turn)
            program = Combine(str(rng.choice(["union", "difference"])), program, leaf)
        index = int(rng.integers(5))
        old = list(leaves(program))[index]
        larger = replace(old, size=tuple(s * rng.uniform(1.0, 1.3) for s in old.size))
        trial = map_leaves(program, lambda i, leaf, index=index, larger=larger: larger if i == index else leaf)
        changed.append(change_with(program, index, larger))
        assert changed[-1] == pytest.approx(abs(volume(trial) - volume(program)), abs=1e-9)
    assert sum(c > 1e-3 for c in changed) > 20


def test_the_change_by_a_larger_leaf_asks_only_what_reaches_there(monkeypatch):
    far = Combine("union", Combine("union", PLATE, BLOCK), Primitive("sphere", (1.0,), (30.0, 0.0, 0.0)))
    made = []
    monkeypatch.setattr(PosedPrimitive, "solid", property(lambda part: made.append(part.leaf.kind) or to_manifold(part.leaf)))
    assert change_with(far, 1, replace(BLOCK, size=(5.0, 4.0, 4.0))) == pytest.approx(16.0)
    assert "sphere" not in made
