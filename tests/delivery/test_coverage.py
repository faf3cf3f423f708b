"""What a cloud shows of a result, by planted parts of which one knows what was seen."""

import numpy as np
import pytest
import trimesh
from tests.planted import box, cut, cylinder, mesh_of, union

from imdim.delivery.coverage import _pattern_motions, cover, describe_coverage
from imdim.detection.noise import measure_noise
from imdim.program.patterns.detect import fold_repeats
from imdim.target.scan import parse_condition, scan

BLOCK = box(40, 30, 20)
SEEN_FROM = np.array([0.48, 0.60, 0.64])


def cloud_of(part, condition="noise=0.2%"):
    wanted = parse_condition(condition)
    assert wanted is not None
    return scan(mesh_of(part), wanted, np.random.default_rng(7))[0]


def covered(part, points, folded=None, scanners=None):
    model, _ = measure_noise(points, np.random.default_rng(0))
    return cover(part, mesh_of(part), points, model, folded, scanners)


def test_what_is_seen_from_all_sides_is_seen():
    found = covered(BLOCK, cloud_of(BLOCK))
    assert found.shares["seen"] > 0.99
    assert found.shares["unknown"] < 1e-3


def test_three_faces_of_a_block_tell_the_others_by_symmetry():
    """Half of the surface is seen, and a strip along its edges; each face seen is its own image in the block's mirror planes."""
    found = covered(BLOCK, cloud_of(BLOCK, "noise=0.2%+views=1"))
    assert found.shares["seen"] == pytest.approx(0.5, abs=0.05)
    assert found.by["symmetry"] == pytest.approx(0.5, abs=0.06)
    assert found.shares["unknown"] < 0.01
    assert found.regions[0].coverage == "inferred"
    assert "symmetry" in describe_coverage(found)


def test_one_face_tells_nothing_of_how_deep_a_block_is():
    points = cloud_of(BLOCK)
    found = covered(BLOCK, points[points[:, 2] > 9.5])
    top = 40 * 30 / (2 * (40 * 30 + 40 * 20 + 30 * 20))
    assert found.shares["seen"] == pytest.approx(top, abs=0.06)
    assert found.shares["unknown"] > 0.6
    assert found.regions[0].coverage == "unknown"


def test_a_face_that_is_seen_in_part_goes_on():
    points = cloud_of(BLOCK)
    found = covered(BLOCK, points[(points[:, 2] < 9) | (points[:, 0] < 0)])
    hidden = 40 * 30 / 2 + (40 + 2 * 30) / 2 * 0.5  # half of the top, and of what is level with it hardly any
    area = 2 * (40 * 30 + 40 * 20 + 30 * 20)
    assert found.by["its face goes on"] == pytest.approx(hidden / area, abs=0.03)
    assert found.shares["unknown"] == 0


def test_a_hidden_copy_is_known_by_its_pattern():
    """Of four pegs on a crooked plate, which no plane mirrors, one was not seen."""
    pegs = [cylinder(2, 10, (x, y, 7)) for x in (-14, 14) for y in (-10, 10)]
    plate = cut(box(44, 36, 4), box(9, 5, 10, (20, 3, 0)), cylinder(3, 10, (-8, 2, 0)))
    part = union(plate, *pegs)
    points = cloud_of(part, "noise=0.1%")
    hidden = (np.hypot(points[:, 0] - 14, points[:, 1] - 10) < 3.5) & (points[:, 2] > 2.3)
    folding = fold_repeats(part)
    assert folding is not None
    alone, folded = covered(part, points[~hidden]), covered(part, points[~hidden], folding.folded)
    peg = (2 * np.pi * 2 * 10 + np.pi * 4) / mesh_of(part).area
    assert alone.shares["unknown"] == pytest.approx(peg, rel=0.3)
    assert folded.by["pattern"] == pytest.approx(peg, rel=0.3)
    assert folded.shares["unknown"] < 0.1 * peg


def test_the_side_that_turns_away_from_a_scanner_is_not_seen_however_thin_the_plate():
    plate = box(60, 40, 0.4)
    points = cloud_of(plate, "noise=0.2%+views=1")
    assert covered(plate, points).shares["seen"] > 0.95
    assert covered(plate, points, scanners=1e5 * SEEN_FROM[None]).shares["seen"] == pytest.approx(0.5, abs=0.05)


def test_a_result_without_faces_is_refused():
    with pytest.raises(ValueError, match="without faces"):
        cover(BLOCK, trimesh.Trimesh(), cloud_of(BLOCK), measure_noise(cloud_of(BLOCK), np.random.default_rng(0))[0])


def test_motions_of_a_pattern_are_each_tried_once():
    """Of a grid of eight by eight copies 224 motions lead from one to another, not 64 times 63."""
    grid = union(*(box(2, 2, 2, (5.0 * x, 5.0 * y, 0)) for x in range(8) for y in range(8)))
    folding = fold_repeats(grid)
    assert folding is not None
    assert len([*_pattern_motions(folding.folded)]) == 15 * 15 - 1
