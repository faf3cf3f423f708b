"""Imperfect sequences against the programs they were spoilt from, by exact booleans."""

import numpy as np
import pytest
from tests.deadlines import PASSED
from tests.planted import ALONG_X, PARTS, box, cone, cut, cylinder, mesh_of, sphere, union

from imdim.geometry.rotations import euler_from_matrix, matrix_from_euler
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.sequence import Step, map_terms, of_primitives, to_sequence
from imdim.program.tree import SIZE_NAMES, Primitive
from imdim.search.mdl.candidates.residual import missing, trim
from imdim.search.mdl.primitive_selection import Cloud, PoolConfig, PrimitivePool
from imdim.search.mdl.repair import settle
from imdim.target.target import sample_surface

NAMES = ["plate with four holes", "tube on a flange", "open box", "stepped shaft"]


def cloud_of(program, n=2048, noise=0.0, seed=0):
    mesh = mesh_of(program)
    rng = np.random.default_rng(seed)
    points, _ = sample_surface(mesh.vertices, mesh.faces, n, rng)
    return points + noise * np.linalg.norm(np.ptp(points, axis=0)) * rng.normal(size=points.shape)


def spoilt(signed, sigma, rng):
    """Numbers off by `sigma`, lengths in units of the whole part's largest size, angles in radians."""
    scale = max(max(p.size) for _, p in signed)

    def jittered(p: Primitive) -> Primitive:
        size = tuple(float(max(s + sigma * scale * rng.normal(), 0.3 * s)) for s in p.size)
        x, y, z = (float(c + sigma * scale * rng.normal()) for c in p.center)
        rx, ry, rz = np.degrees(sigma * rng.normal(size=3)).tolist()
        return Primitive(p.kind, size, (x, y, z), euler_from_matrix(matrix_from_euler(p.rotation) @ matrix_from_euler((rx, ry, rz))))

    return map_terms(signed, jittered)


def to_signed(program):
    return of_primitives(to_sequence(program))


def iou(found, truth):
    return volume_iou(to_manifold(found), to_manifold(truth))


@pytest.mark.parametrize("name", NAMES)
def test_spoilt_numbers_come_back(name):
    rng = np.random.default_rng(1)
    truth = to_signed(PARTS[name])
    found = settle([spoilt(truth, 0.03, rng) for _ in range(6)], cloud_of(PARTS[name]), 0.0)
    assert iou(found[0].program, PARTS[name]) >= 0.98
    assert [f.cost for f in found] == sorted(f.cost for f in found)


@pytest.mark.parametrize("name", NAMES)
def test_a_missing_primitive_is_found_and_a_foreign_one_dropped(name):
    rng = np.random.default_rng(2)
    truth = to_signed(PARTS[name])
    size = max(max(p.size) for _, p in truth)
    foreign = Step("union", sphere(0.2 * size, (0.3 * size, 0.1 * size, 0.2 * size)))
    candidates = [(*spoilt(truth[:-1], 0.02, rng), foreign) for _ in range(4)]
    found = settle(candidates, cloud_of(PARTS[name]), 0.0)[0]
    assert iou(found.program, PARTS[name]) >= 0.95
    assert len(found.signed) <= len(truth) + 1


def test_a_wrong_sign_and_a_wrong_order_are_repaired():
    truth = cut(union(box(60, 40, 10), cylinder(12, 30, (0.0, 0.0, 10.0))), cylinder(6, 60))
    plate, boss, hole = (p for _, p in to_signed(truth))
    found = settle([tuple(Step("union", p) for p in (plate, hole, boss))], cloud_of(truth), 0.0)[0]
    assert iou(found.program, truth) >= 0.99


def test_a_turned_part_needs_its_axes():
    turn = (20.0, -35.0, 50.0)
    truth = cut(box(60, 40, 10, rotation=turn), box(30, 10, 40, rotation=turn))
    plain = to_signed(box(50, 50, 20, rotation=turn))
    found = settle([plain], cloud_of(truth), 0.0, axes=matrix_from_euler(turn))[0]
    assert iou(found.program, truth) >= 0.98


def test_noise_is_not_fitted():
    truth = cut(box(60, 40, 20), cylinder(10, 60))
    points = cloud_of(truth, noise=0.01)
    found = settle([to_signed(truth)], points, 0.01 * float(np.linalg.norm(np.ptp(points, axis=0))))[0]
    assert len(found.signed) == 2
    assert iou(found.program, truth) >= 0.93


def test_the_same_input_gives_the_same_program():
    rng = np.random.default_rng(3)
    candidates = [spoilt(to_signed(PARTS["L bracket"]), 0.03, rng) for _ in range(3)]
    points = cloud_of(PARTS["L bracket"])
    assert settle(candidates, points, 0.0) == settle(candidates, points, 0.0)


def test_no_candidate_still_gives_a_program():
    found = settle([], cloud_of(cylinder(10, 30, rotation=ALONG_X)), 0.0)[0]
    assert iou(found.program, cylinder(10, 30, rotation=ALONG_X)) >= 0.98


def test_the_cost_of_the_truth_is_its_price_and_that_of_sheets_is_not():
    part = box(60, 40, 20)
    cloud = Cloud.of(cloud_of(part), 0.0)
    pool = PrimitivePool.of([part, box(60, 40, 20)], cloud, PoolConfig())
    price = PoolConfig().price
    assert pool.cost((Step("union", 0),)) == pytest.approx(price, abs=0.03)
    # the box cut away leaves nothing, though its faces still run through every point
    assert pool.cost((Step("union", 0), Step("difference", 1))) > 0.9
    assert pool.costs([(Step("union", 0),)], limit=price)[0] == np.inf


def test_half_of_the_surface_without_points_is_half_of_the_surface():
    """A box twice as long as the cloud bears points on the cloud's own surface but for one end, which lies within."""
    part, longer = box(40, 40, 20), box(80, 40, 20, (20.0, 0.0, 0.0))
    cloud = Cloud.of(cloud_of(part), 0.0)
    pool = PrimitivePool.of([longer], cloud, PoolConfig(price=0.0, explained=1e-3))
    own, end, whole = 2 * (40 * 40 + 2 * 40 * 20), 40 * 20, 2 * (80 * 40 + 80 * 20 + 40 * 20)
    expected = (whole - (own - end) + end) / own
    assert pool.cost((Step("union", 0),)) == pytest.approx(expected, rel=0.25)


def test_missing_guesses_are_near_what_is_missing():
    hole = cylinder(6, 60, (10.0, 0.0, 0.0))
    truth = cut(box(60, 40, 20), hole)
    cloud = Cloud.of(cloud_of(truth), 0.0)
    guesses = missing(box(60, 40, 20), cloud, np.eye(3), 0.01 * cloud.diagonal)
    assert any(
        g.kind == "cylinder" and abs(g.size[0] - 6) < 0.3 and np.abs(np.subtract(g.center, hole.center))[:2].max() < 0.5 for g in guesses
    )


def test_trimming_ends_where_the_points_end():
    short = cloud_of(box(40, 40, 20))
    sizes = [t.size for t in trim(box(80, 40, 20, (20.0, 0.0, 0.0)), short)]
    assert min(s[0] for s in sizes) == pytest.approx(40, abs=0.5)
    assert trim(sphere(10), short) == []


def test_trimming_a_cone_keeps_its_slope():
    long = cone(5.0, 15.0, 40.0)
    points = cloud_of(long)
    (shorter,) = trim(long, points[points[:, 2] < 10.0])
    bottom, top, height = shorter.size
    assert (top - bottom) / height == pytest.approx(0.25, rel=0.02)
    assert bottom == pytest.approx(5.0, abs=0.1)
    assert height == pytest.approx(30.0, abs=0.5)
    assert shorter.center[2] == pytest.approx(-5.0, abs=0.3)


@pytest.mark.parametrize("kind", ["torus", "ellipsoid"])
def test_what_has_no_ends_is_not_trimmed(kind):
    part = Primitive(kind, (10.0, 4.0, 6.0)[: len(SIZE_NAMES[kind])])
    assert trim(part, cloud_of(part) + np.array((0.0, 0.0, 3.0))) == []


def test_without_time_the_cheapest_candidate_stays_as_it_is():
    truth = to_signed(PARTS["L bracket"])
    found = settle([truth, truth[:1]], cloud_of(PARTS["L bracket"]), 0.0, deadline=PASSED)[0]
    assert iou(found.program, PARTS["L bracket"]) > 0.99
