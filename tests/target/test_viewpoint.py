"""Whether a cloud was seen from its origin, by simulated scans from one side and from all of them."""

import numpy as np
import pytest
from tests.planted import box, cut, cylinder, mesh_of, union

from imdim.target.scan import VIEWS, parse_condition, scan
from imdim.target.target import load_target, target_from
from imdim.target.viewpoint import certainly_one_side, find_camera, guess_camera

BRACKET = cut(union(box(60, 40, 8), box(60, 8, 30, (0, 16, 15))), *(cylinder(4, 40, (x, -6, 0)) for x in (-18, 18)))
FAR = 50_000.0  # from where a scan's parallel rays come


SHEET = union(box(60, 40, 0.6), box(60, 0.6, 30, (0, -20, 15)))  # bent of thin sheet: from its inner side all of it shows
HALF = 0.6  # tangent of half of what a camera sees


def cloud_of(condition, part=BRACKET):
    wanted = parse_condition(condition)
    assert wanted is not None
    return scan(mesh_of(part), wanted, np.random.default_rng(3))[0]


@pytest.mark.parametrize("condition", ["views=1", "noise=0.3%+views=1", "noise=0.5%+outliers=2%+views=1"])
def test_one_side_was_seen_from_where_its_camera_stood(condition):
    points = cloud_of(condition) - FAR * VIEWS[0]
    assert np.array_equal(find_camera(points), np.zeros((1, 3)))


@pytest.mark.parametrize("condition", ["cloud", "noise=0.5%+outliers=2%", "noise=0.3%+views=3"])
@pytest.mark.parametrize("way", VIEWS[:6])
def test_what_is_seen_from_all_around_was_not_seen_from_one_place(condition, way):
    assert find_camera(cloud_of(condition) - FAR * way) is None
    assert find_camera(cloud_of(condition) - 120.0 * way) is None


def test_one_side_was_not_seen_from_within_its_box_or_near_it():
    points = cloud_of("views=1")
    assert find_camera(points) is None
    assert find_camera(points - 30.0 * VIEWS[0]) is None


def test_one_side_was_not_seen_from_where_its_upright_wall_hides_its_floor():
    points = cloud_of("views=1", union(box(60, 60, 4), box(60, 4, 40, (0, -10, 20))))
    assert find_camera(points - FAR * VIEWS[0]) is not None
    assert find_camera(points - FAR * np.array([0.0, -0.96, 0.28])) is None


def test_a_cloud_from_a_camera_says_so(tmp_path):
    points = cloud_of("noise=0.3%+views=1") - FAR * VIEWS[0]
    target = target_from(points)
    assert np.array_equal(target.scanners, np.zeros((1, 3)))
    assert any("from the origin" in note for note in target.notes)
    np.savez(tmp_path / "told.npz", points=points, scanners=[[0.0, 0.0, 9.0]])
    assert np.array_equal(load_target(tmp_path / "told.npz").scanners, [[0.0, 0.0, 9.0]])  # who says so knows better


@pytest.mark.parametrize("condition", ["views=1", "noise=0.3%+views=1"])
@pytest.mark.parametrize("part", [BRACKET, box(40, 30, 20), cut(cylinder(20, 30), cylinder(12, 40))], ids=["bracket", "block", "tube"])
def test_the_way_that_one_side_was_seen_along_is_guessed(condition, part):
    points = cloud_of(condition, part)
    found = guess_camera(points)
    assert found is not None
    way = found[0] - points.mean(0)
    assert way @ VIEWS[0] > 0.7 * np.linalg.norm(way)  # several ways show all of it


@pytest.mark.parametrize("hollow", [True, False])
def test_a_camera_stood_on_the_side_where_its_points_lie_closer(hollow):
    """A dome, or a bowl, as seen by a depth camera: pixels of one angle, far ones apart. By its bulge a bowl is a dome from behind."""
    plane = np.stack(np.meshgrid(*[np.linspace(-HALF, HALF, 160)] * 2), axis=-1).reshape(-1, 2)
    sight = np.column_stack([plane, np.ones(len(plane))])
    middle = np.array([0.0, 0.0, 55.0 if hollow else 95.0])
    along, square = sight @ middle, np.einsum("ni,ni->n", sight, sight)
    root = along**2 - square * (middle @ middle - 40.0**2)
    hit = root > 0
    depth = (along[hit] + (1 if hollow else -1) * np.sqrt(root[hit])) / square[hit]
    points = depth[:, None] * sight[hit]
    points = points[points[:, 2] > 75.0] if hollow else points[points[:, 2] < 75.0]
    found = guess_camera(points - points.mean(0))
    assert found is not None
    assert found[0, 2] < 0
    assert certainly_one_side(points - points.mean(0), found)


@pytest.mark.parametrize("part", [BRACKET, box(40, 30, 20)], ids=["bracket", "block"])
def test_one_side_is_certain_where_even_thin_walls_would_show_another(part):
    points = cloud_of("views=1", part)
    found = guess_camera(points)
    assert found is not None
    assert certainly_one_side(points, found)


def test_both_sides_of_a_bent_sheet_are_not_one_side():
    points = cloud_of("cloud", SHEET)
    found = guess_camera(points)
    assert found is not None, "all of it can be seen along one way, but for the thickness"
    assert not certainly_one_side(points, found)
    flat = np.random.default_rng(0).uniform(-1, 1, (4000, 3)) * [40, 30, 0.05]
    assert not certainly_one_side(flat, np.array([[0.0, 0.0, FAR]])), "its other side may lie in the noise"


@pytest.mark.parametrize("condition", ["cloud", "noise=0.5%+outliers=2%", "noise=0.3%+views=3"])
def test_no_way_shows_what_is_seen_from_all_around(condition):
    assert guess_camera(cloud_of(condition)) is None


def test_a_heap_of_points_is_no_sheet_that_anybody_saw():
    assert guess_camera(np.random.default_rng(0).normal(size=(400, 3)) ** 3) is None
