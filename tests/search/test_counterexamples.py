"""What few samples missed is found by counterexamples, and counted once."""

import numpy as np
import pytest
from tests.planted import box, common, cut, cylinder, union
from tests.search.planted_families import arrangement_of, cells_of

from imdim.deadline import NEVER
from imdim.geometry import kernels
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.cost import count
from imdim.program.sequence import Step
from imdim.search.candidate_families import Families
from imdim.search.cells import pool_cells
from imdim.search.counterexamples import Sharpener, transfer
from imdim.search.lns import LocalConfig, rate_sequence
from imdim.search.outline_families import PricedPlanes, find_faces, find_planes
from imdim.search.sequence import Covered, Price, error, run, to_program
from imdim.search.structure import StructureConfig, search

FEW = 1500  # samples, for some thousand cells
TABS = [box(2, 2, 3, (x, y, 2.0)) for x, y in ((-16.0, -9.0), (-9.0, 8.0), (11.0, -8.0), (17.0, 6.0))]
HOLES = [cylinder(1.2, 10, (x, y, 0.0)) for x, y in ((-13.0, 3.0), (0.0, 1.0))]
PLATE = cut(union(box(40, 24, 2), *TABS), *HOLES)


def few_samples(program=PLATE, seed=0, samples=FEW, weight=2.5e-4):
    families = Families(arrangement_of(program), cells_of(arrangement_of(program), program, samples))
    price = weight * families.cells.volume
    return families, Sharpener(families, lambda p: kernels.inside(program, p).astype(float), samples, price, np.random.default_rng(seed))


def searched(families, sharpener, seed=0):
    *_, last = search(families, StructureConfig(local=LocalConfig(rounds=60)), np.random.default_rng(seed), NEVER, sharpener)
    return last


def quality(found):
    program = to_program(found.sequence, found.families)
    return volume_iou(to_manifold(program), to_manifold(PLATE)), count(program).primitives


def test_what_few_samples_missed_is_found():
    sharp = []
    for seed in range(3):
        families, sharpener = few_samples(seed=seed)
        blind, _ = quality(searched(families, None, seed))
        sharp.append(quality(searched(families, sharpener, seed)))
        assert blind < 0.99 < 0.995 < sharp[-1][0]
    assert np.median([primitives for _, primitives in sharp]) <= count(PLATE).primitives


def test_the_same_seeds_find_the_same():
    a, b = (searched(*few_samples(seed=4)) for _ in range(2))
    assert a.sequence[0].term == b.sequence[0].term
    assert a.objective == b.objective
    assert len(a.sequence) == len(b.sequence)


def plain_plate(families):
    """The plate alone, as a sequence: wrong about all tabs and holes."""
    best = max(families.best(families.cells.gain, 1), key=lambda f: f[0])[1]
    assert best.source[0] == "box"
    return rate_sequence((Step("union", Covered.of(best, families)),), families, Price(0.0))


@pytest.mark.parametrize("looks", [1, 3, 6])
def test_counterexamples_are_counted_once(looks):
    """However often it is looked, the error of a wrong sequence stays near the truth, where plain adding would multiply it."""
    estimates, truths = [], []
    for seed in range(6):
        families, sharpener = few_samples(seed=seed, samples=6000)
        found = plain_plate(families)
        for _ in range(looks):
            families = sharpener.sharpen([found]) or families
        sequence = transfer(found.sequence, families)
        estimates.append(error(sequence, families))
        plate = to_manifold(to_program(sequence, families))
        truth = to_manifold(PLATE)
        truths.append((plate - truth).volume() + (truth - plate).volume())
    assert np.mean(estimates) == pytest.approx(np.mean(truths), rel=0.15)


def test_a_right_sequence_has_no_counterexamples():
    whole = box(40, 24, 2)
    families, sharpener = few_samples(whole)
    assert sharpener.sharpen([plain_plate(families)]) is None


def test_every_known_cell_stays_and_what_is_right_and_new_is_left_out():
    families, sharpener = few_samples()
    found = plain_plate(families)
    sharper = sharpener.sharpen([found])
    assert sharper is not None
    _, place = pool_cells(sharper.cells, families.cells, (1.0, 1.0))
    old = place[len(sharper.cells.points) :]
    assert set(old) <= set(place[: len(sharper.cells.points)])
    new = ~np.isin(place[: len(sharper.cells.points)], old)
    filled = run(transfer(found.sequence, sharper), len(sharper.cells.points))
    wrong = np.where(filled, sharper.cells.w_out, sharper.cells.w_in) > 0
    assert new.any()
    assert wrong[new].all()
    assert len(sharpener.every.cells.points) > len(sharper.cells.points)


def test_pooled_cells_keep_their_codes_and_sum_their_volumes():
    program = common(cylinder(5, 30), box(20, 20, 8))
    arrangement = arrangement_of(program)
    a, b = cells_of(arrangement, program, 500), cells_of(arrangement, program, 900)
    both, place = pool_cells(a, b, (0.25, 0.75))
    assert both.volume == pytest.approx(0.25 * a.volume + 0.75 * b.volume)
    assert np.array_equal(both.slabs[place], np.concatenate([a.slabs, b.slabs]))
    assert np.array_equal(both.inside[place], np.concatenate([a.inside, b.inside]))


def test_families_with_counterexamples_know_the_faces_that_they_would_find():
    arrangement = arrangement_of(PLATE)
    planes = PricedPlanes(find_planes(arrangement), 1e-3)
    families = Families(arrangement, cells_of(arrangement, PLATE, FEW), planes)
    sharpener = Sharpener(families, lambda p: kernels.inside(PLATE, p).astype(float), FEW, 1e-3, np.random.default_rng(0))
    found = plain_plate(families)
    for _ in range(3):
        sharper = sharpener.sharpen([found])
        assert sharper is not None
        for known in (sharper, sharpener.every):
            assert len(known.outlines.faces) == len(planes.planes) > 0
            for face, expected in zip(known.outlines.faces, find_faces(planes.planes, known.cells), strict=True):
                assert np.array_equal(face, expected)
