"""Edges of known programs, with planted blends, as clouds tell of them."""

import numpy as np
import pytest
from tests.detection.test_edge_profile import seen, wedge_of

from imdim.deadline import Deadline
from imdim.detection.edge_profile import Profile
from imdim.detection.noise import NoiseModel
from imdim.geometry.edge_solids import solid_with_edges
from imdim.geometry.solid import to_trimesh
from imdim.program.edges import EdgeFeature, Face
from imdim.program.tree import Combine, Primitive
from imdim.reconstruction import cloud_edges
from imdim.reconstruction.cloud_edges import find_cloud_edges
from imdim.target.target import sample_surface

PLATE = Combine("union", Primitive("box", (50.0, 40.0, 10.0)), Primitive("cylinder", (9.0, 20.0), (0.0, 0.0, 10.0)))
RIM = EdgeFeature("chamfer", (1.5,), tuple((Face(0, "+z"), Face(0, side)) for side in ("+x", "-x", "+y", "-y")))
FOOT = EdgeFeature("fillet", (3.0,), ((Face(0, "+z"), Face(1, "side")),))
DIAGONAL = 70.0


def found_in(features, noise=0.0, count=9000, program=PLATE, **more):
    mesh = to_trimesh(solid_with_edges(program, features, 128))
    points = sample_surface(mesh.vertices, mesh.faces, count, np.random.default_rng(1))[0]
    points = points + np.random.default_rng(2).normal(0, noise, points.shape)
    return find_cloud_edges(program, points, NoiseModel(1.0, noise, DIAGONAL), **more)


def said(features):
    return {(f.kind, f.sizes, frozenset(frozenset(pair) for pair in f.edges)) for f in features}


def test_edges_of_a_calm_cloud_come_back():
    found = found_in([RIM, FOOT])
    assert said(found.features) == said([RIM, FOOT])
    assert not found.left_out
    assert {f.name for f in found.features} == {"chamfer", "fillet"}


def test_edges_of_a_noisy_cloud_come_back_with_intervals_that_hold():
    found = found_in([RIM, FOOT], 0.15)
    assert {f.kind for f in found.features} == {"chamfer", "fillet"}
    for feature, known in zip(found.features, found.measured, strict=True):
        true = RIM if feature.kind == "chamfer" else FOOT
        assert abs(known.sizes[0] - true.sizes[0]) < 1.5 * known.half
        assert known.half < 0.15
        assert abs(feature.sizes[0] - known.sizes[0]) <= known.half
        assert {frozenset(pair) for pair in feature.edges} == {frozenset(pair) for pair in true.edges}


@pytest.mark.parametrize("noise", [0.0, 0.15, 0.35])
def test_sharp_edges_stay_sharp(noise):
    assert not found_in([], noise).features


def test_two_distances_lie_along_the_faces_that_they_lay_along():
    true = EdgeFeature("chamfer", (1.0, 2.0), ((Face(0, "-z"), Face(0, "+x")), (Face(0, "-y"), Face(0, "-z"))))
    found = found_in([true])
    (feature,), (known,) = found.features, found.measured
    assert feature.sizes == pytest.approx((1.0, 2.0))
    assert known.sizes == pytest.approx(feature.sizes, rel=0.02)
    assert set(feature.edges) == set(true.edges)


def test_what_noise_leaves_open_is_told():
    """An arc and a bevel of less than two deviations differ by a tenth of one."""
    found = found_in([EdgeFeature("fillet", (0.8,), RIM.edges)], 0.3)
    assert not found.features
    (line,) = found.left_out
    assert "have a" in line
    assert "chamfer" in line
    assert "fillet" in line
    assert "the points do not tell which" in line


def test_too_few_points_and_too_little_time_are_told():
    few = found_in([], 0.1, count=60)
    assert not few.features
    assert "for lack of points" in few.left_out[0]
    late = found_in([RIM], deadline=Deadline(0.0, lambda: 1.0))
    assert not late.features
    assert "for lack of time" in late.left_out[0]


def test_a_bevel_that_leaves_a_face_by_less_than_the_noise_is_a_face_that_slants():
    """A wall that a program has upright where it leans became a bevel of 1.8 by 5.6, and took a fiftieth of the volume with it."""
    for sizes, told in (((0.4, 2.0), 1), ((1.0, 2.5), 2)):
        view = seen(Profile("chamfer", sizes), wedge_of(90.0), np.random.default_rng(3), 0.2, count=1500)
        found = cloud_edges._read_kind(view, "chamfer")
        assert found is not None
        assert len(found[0].sizes) == told
