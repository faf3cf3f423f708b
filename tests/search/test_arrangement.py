"""Directions, offsets and frames of parts whose planes can be counted by hand."""

import numpy as np
import pytest
from tests.planted import PARTS, box, carriers, cylinder, union
from tests.search.planted_families import arrangement_of

from imdim.search.arrangement import ArrangementConfig, arrange


def test_a_plate_with_holes():
    arrangement = arrangement_of(PARTS["plate with four holes"])
    assert sorted(np.argmax(np.abs(d.vector)) for d in arrangement.directions) == [0, 1, 2]
    assert len(arrangement.frames) == 1
    along = {int(np.argmax(np.abs(d.vector))): d.offsets[1:-1] * np.sign(d.vector.sum()) for d in arrangement.directions}
    # faces, and for each row of holes the centre and both tangents
    assert sorted(along[0]) == pytest.approx([-40, -33, -30, -27, 27, 30, 33, 40])
    assert sorted(along[1]) == pytest.approx([-25, -18, -15, -12, 12, 15, 18, 25])
    assert sorted(along[2]) == pytest.approx([-4, -3, 3, 4])


def test_sentinels_lie_beyond_the_part():
    arrangement = arrangement_of(PARTS["stepped shaft"])
    corners = np.array([[x, y, z] for x in (-12, 12) for y in (-12, 12) for z in (0, 60)])
    for direction in arrangement.directions:
        assert direction.offsets[0] < (corners @ direction.vector).min()
        assert direction.offsets[-1] > (corners @ direction.vector).max()
        assert (np.diff(direction.offsets) > 0).all()


def test_two_turned_boxes_have_two_frames():
    arrangement = arrangement_of(union(box(20, 10, 8), box(20, 10, 8, (0.0, 0.0, 10.0), (0.0, 0.0, 30.0))))
    assert len(arrangement.directions) == 5
    assert len(arrangement.frames) == 2
    for frame in arrangement.frames:
        vectors = np.stack([arrangement.directions[i].vector for i in frame])
        assert vectors @ vectors.T == pytest.approx(np.eye(3), abs=1e-9)


def test_a_lone_axis_gets_a_frame():
    arrangement = arrangement_of(cylinder(3, 10, rotation=(20.0, 30.0, 40.0)))
    assert len(arrangement.directions) == 3
    assert len(arrangement.frames) == 1
    assert abs(arrangement.directions[arrangement.axis_of[0]].vector @ arrangement.curved[0].axis) == pytest.approx(1)


def test_the_largest_planes_survive_a_limit():
    planes = carriers(PARTS["L bracket"])
    areas = [1.0 if abs(p.axis[0]) > 0.9 and abs(p.point[0] - 30) < 1e-9 else 0.1 for p in planes]
    bounds = np.array([[-30.0, -20.0, 0.0], [30.0, 20.0, 45.0]])
    few = arrange(planes, areas, bounds, ArrangementConfig(max_offsets=1))
    lying = next(d for d in few.directions if abs(d.vector[0]) > 0.9)
    assert np.abs(lying.offsets[1]) == pytest.approx(30)
    assert len(lying.offsets) == 3
