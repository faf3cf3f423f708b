"""Drawn leaves against finely sampled surfaces, against the kinds that they can stand for, and against differences."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import torch
from outlined_samples import random_drawn, random_outline, wraps
from program_samples import inside_primitive
from scipy.spatial import KDTree
from tests.known_programs import AWAY, DRAWN_LEAVES, HALF_DISC, TILT

from imdim.geometry import kernels, sdf
from imdim.geometry.finish.posed import PosedPrimitive
from imdim.geometry.lowering import Outlines, pack, pack_all
from imdim.geometry.pose import radii
from imdim.geometry.sampling import even_surface, leaf_surface, surface_points
from imdim.geometry.solid import primitive_to_manifold
from imdim.geometry.surface_map import surface_area
from imdim.program.drafting import shrink
from imdim.program.ellipse import Ellipse, ellipse_distance, holds_point
from imdim.program.motions import mirror, move_leaf, turn
from imdim.program.outline import Outline, circle, flatten_loop, has_ellipse, rectangle
from imdim.program.rewrite.containment import bounding_radius
from imdim.program.tree import OUTLINED, Combine, Primitive

STEP = 0.012


def dense(corners: list) -> np.ndarray:
    """Points [n, 2] of a closed polygon, less than STEP apart."""
    ring = np.array([*corners, corners[0]])
    sides = pairwise(ring)
    parts = [a + np.linspace(0, 1, 1 + math.ceil(np.linalg.norm(b - a) / STEP), endpoint=False)[:, None] * (b - a) for a, b in sides]
    return np.concatenate(parts)


def surface(leaf: Primitive) -> np.ndarray:
    """Points [n, 3] all over a drawn leaf's surface in its own frame; lines along the axis of what comes all round are none."""
    assert leaf.outline is not None
    ring = np.concatenate([dense(flatten_loop(loop, 1000)) for loop in leaf.outline.loops])
    (left, low), (right, high) = leaf.outline.bounds
    grid = np.stack(np.meshgrid(np.arange(left, right, STEP), np.arange(low, high, STEP)), -1).reshape(-1, 2)
    ends = np.concatenate([grid[wraps(leaf.outline, grid)], ring])
    if leaf.kind == "extrude":
        h = leaf.size[0]
        walls = [np.column_stack([ring, np.full(len(ring), z)]) for z in np.linspace(-h / 2, h / 2, math.ceil(h / STEP))]
        return np.concatenate([*walls, *(np.column_stack([ends, np.full(len(ends), z)]) for z in (-h / 2, h / 2))])
    if leaf.kind == "drafted":
        return drafted_surface(leaf, ring, ends)
    angle = math.radians(leaf.size[0])
    walls = [_turned(ring[ring[:, 0] > 0], a) for a in np.linspace(0, angle, math.ceil(angle * right / STEP))]
    return np.concatenate([*walls, *(_turned(ends, a) for a in ((0.0, angle) if leaf.size[0] < 360 else ()))])


def drafted_surface(leaf: Primitive, ring: np.ndarray, foot: np.ndarray) -> np.ndarray:
    """Sections from the foot to the top, of which the last is a face, as the foot is."""
    assert leaf.outline is not None
    height, draft = leaf.size
    insets = np.linspace(0.0, height, math.ceil(height / math.cos(math.radians(draft)) / STEP)) * math.tan(math.radians(draft))
    sections = [shrink(leaf.outline, inset) for inset in insets.tolist()]
    rings = [np.concatenate([dense(flatten_loop(loop, 1000)) for loop in section.loops]) for section in sections]
    walls = [np.column_stack([r, np.full(len(r), z)]) for r, z in zip(rings, np.linspace(-height / 2, height / 2, len(rings)), strict=True)]
    top = foot[wraps(sections[-1], foot)]
    return np.concatenate([*walls, *(np.column_stack([end, np.full(len(end), z)]) for end, z in ((foot, -height / 2), (top, height / 2)))])


def _turned(flat: np.ndarray, angle: float) -> np.ndarray:
    return np.column_stack([flat[:, 0] * math.cos(angle), flat[:, 0] * math.sin(angle), flat[:, 1]])


def drawn_leaves(kind: str, count: int) -> list[Primitive]:
    rng = np.random.default_rng(7)
    return [random_drawn(rng, kind, float(rng.uniform(0.05, 0.98))) for _ in range(count)]


@pytest.mark.parametrize("kind", OUTLINED)
def test_the_distance_is_that_to_a_finely_sampled_surface(kind):
    rng = np.random.default_rng(3)
    for leaf in drawn_leaves(kind, 12):
        points = rng.uniform(-1.5, 1.5, (400, 3))
        points[:40] *= (0.0, 0.0, 1.0)  # on the axis
        points[40:80, 1] = 0.0  # in the plane where turning starts
        found = kernels.program_sdf(leaf, points)
        away = KDTree(surface(leaf)).query(points)[0]
        # beside slanted edges that of a drafted one is an estimate
        slack = DRAFTED * away if kind == "drafted" else 0.0
        assert (np.abs(np.abs(found) - away) <= STEP + slack).all(), leaf
        clear = away > STEP
        assert ((found < 0) == inside_primitive(leaf, points))[clear].all(), leaf


def placed(kind: str, size: tuple[float, ...], *loops) -> Primitive:
    return Primitive(kind, size, AWAY, TILT, Outline(loops) if loops else None)


DRAFTED = 0.3  # of a distance, by which that beside a slanted edge may be off

SAME = [
    (placed("extrude", (0.4,), *rectangle(1.0, 0.7).loops), placed("box", (1.0, 0.7, 0.4))),
    (placed("extrude", (0.9,), circle(0.4)), placed("cylinder", (0.4, 0.9))),
    (placed("revolve", (360.0,), circle(0.2, 0.5)), placed("torus", (0.5, 0.2))),
    (placed("revolve", (360.0,), HALF_DISC), placed("sphere", (0.5,))),
    (placed("revolve", (360.0,), *rectangle(0.4, 0.9).shift(0.2, 0.0).loops), placed("cylinder", (0.4, 0.9))),
    (placed("revolve", (360.0,), ((0, -0.4, 0.0), (0.5, -0.4, 0.0), (0.2, 0.4, 0.0), (0, 0.4, 0.0))), placed("cone", (0.5, 0.2, 0.8))),
]


@pytest.mark.parametrize(("leaf", "like"), SAME, ids=[like.kind for _, like in SAME])
def test_what_is_drawn_is_what_it_draws(leaf, like):
    rng = np.random.default_rng(2)
    local = rng.uniform(-1, 1, (300, 3)) * rng.choice((0.0, 1.0), (300, 3))  # axes, chords and middles among them
    points = local @ PosedPrimitive(leaf).rotation.T + leaf.center
    np.testing.assert_allclose(kernels.program_sdf(leaf, points), kernels.program_sdf(like, points), atol=1e-12)
    assert surface_area(leaf.kind, leaf.size, leaf.outline) == pytest.approx(surface_area(like.kind, like.size), rel=1e-12)
    assert bounding_radius(leaf) >= bounding_radius(like) - 1e-12


def test_points_on_chords_and_levels_of_vertices_lie_on_the_right_side():
    leaf = Primitive("extrude", (1.0,), outline=Outline((circle(1.0), circle(0.5))))
    x = np.array([0.0, 0.25, -0.49, 0.51, 0.75, -0.99, 1.01])
    points = np.column_stack([x, np.zeros(7), np.zeros(7)])
    np.testing.assert_array_equal(kernels.inside(leaf, points), [False, False, False, True, True, True, False])
    turned = np.column_stack([x * math.cos(0.7), x * math.sin(0.7)])
    chord = (math.cos(0.7), math.sin(0.7))
    halves = Outline((((-chord[0], -chord[1], 1.0), (*chord, 1.0)),))
    assert (kernels.outline_sdf(Outlines.pack([halves]).curves, turned)[:6] < 0).all()


RINGED = [leaf for leaf in DRAWN_LEAVES if leaf.outline and not has_ellipse(leaf.outline)]
OVAL = [leaf for leaf in DRAWN_LEAVES if leaf.outline and has_ellipse(leaf.outline)]


@pytest.mark.parametrize("leaf", OVAL, ids=lambda p: f"{p.kind}{p.size}")
def test_torch_has_the_derivative_by_every_number_of_an_ellipse(leaf):
    points = torch.from_numpy(np.random.default_rng(1).uniform(-0.9, 0.9, (60, 3)))
    kinds, params = pack(leaf)
    outlines = Outlines.of([leaf])
    drawn = torch.tensor(outlines.curves[:, :5], requires_grad=True)
    weight = torch.linspace(0.2, 1.0, len(points), dtype=torch.float64)

    def measure(curves: torch.Tensor) -> torch.Tensor:
        return sdf.leaf_table(kinds, torch.from_numpy(params), points, outlines, curves)[0] @ weight

    (slope,) = torch.autograd.grad(measure(drawn), drawn)
    for i in np.flatnonzero(outlines.curves[:, 7] < 0).tolist():
        for k in range(5):
            steps = torch.zeros_like(drawn)
            steps[i, k] = 1e-6
            with torch.no_grad():
                difference = float(measure(drawn + steps) - measure(drawn - steps)) / 2e-6
            assert float(slope[i, k]) == pytest.approx(difference, abs=1e-5), (i, k)


def test_the_foot_on_an_ellipse_is_the_nearest_of_its_points():
    rng = np.random.default_rng(4)
    turns = np.linspace(0, 2 * np.pi, 200_001)
    for rx, ry in [(1.0, 1.0), (1.0, 0.999999), (2.0, 0.3), (0.02, 1.0), *rng.uniform(0.1, 1.0, (6, 2)).tolist()]:
        e = Ellipse(rx, ry, 0.1, -0.2, float(rng.uniform(-180, 180)))
        (c, s), (a, b) = e.along, (rx * np.cos(turns), ry * np.sin(turns))
        ring = np.column_stack([0.1 + c * a - s * b, -0.2 + s * a + c * b])
        flat = rng.uniform(-1.5, 1.5, (60, 2))
        axes = rng.uniform(-1.2, 1.2, 30)
        flat[:20] = np.column_stack([0.1 + c * axes[:20], -0.2 + s * axes[:20]])  # on the first axis, between the foci too
        flat[20:30] = np.column_stack([0.1 - s * axes[20:], -0.2 + c * axes[20:]])
        flat[30] = 0.1, -0.2
        away = KDTree(ring).query(flat)[0]
        found = kernels.outline_sdf(Outlines.pack([Outline((e,))]).curves, flat)
        # the ring's points are up to 6e-5 apart
        clear = away > 0.01
        np.testing.assert_allclose(np.abs(found)[clear], away[clear], atol=2e-7)
        np.testing.assert_allclose([ellipse_distance(e, (x, y)) for x, y in flat.tolist()], np.abs(found), atol=1e-12)
        np.testing.assert_array_equal(found < 0, [holds_point(e, x, y) for x, y in flat.tolist()])


@pytest.mark.parametrize("leaf", RINGED, ids=lambda p: f"{p.kind}{p.size}")
def test_torch_has_the_derivative_by_every_vertex(leaf):
    points = torch.from_numpy(np.random.default_rng(1).uniform(-0.9, 0.9, (60, 3)))
    kinds, params = pack(leaf)
    corners = torch.tensor([vertex for loop in leaf.outline.loops for vertex in loop], dtype=torch.float64, requires_grad=True)
    weight = torch.linspace(0.2, 1.0, len(points), dtype=torch.float64)

    def measure(vertices: torch.Tensor) -> torch.Tensor:
        loops = vertices.split([len(loop) for loop in leaf.outline.loops])
        curves = torch.cat([torch.cat([v[:, :2], v.roll(-1, 0)[:, :2], v[:, 2:]], 1) for v in loops])
        return sdf.leaf_table(kinds, torch.from_numpy(params), points, Outlines.of([leaf]), curves)[0] @ weight

    (slope,) = torch.autograd.grad(measure(corners), corners)
    # a line stays one, and what lies on the axis stays there: beside either the distance has a step
    free = [(i, k) for i, v in enumerate(corners.tolist()) for k in range(3) if v[k] != 0 or (k < 2 and leaf.kind == "extrude") or k == 1]
    for i, k in free:
        steps = torch.zeros_like(corners)
        steps[i, k] = 1e-6
        with torch.no_grad():
            difference = float(measure(corners + steps) - measure(corners - steps)) / 2e-6
        assert float(slope[i, k]) == pytest.approx(difference, abs=1e-5), (i, k)


def test_leaves_of_several_kinds_find_their_own_outlines():
    rng = np.random.default_rng(8)
    parts = [*drawn_leaves("extrude", 2), Primitive("sphere", (0.4,)), *drawn_leaves("revolve", 2), Primitive("box", (1.0, 0.5, 0.2))]
    points = rng.uniform(-1, 1, (50, 3))
    kinds, params = pack_all(parts)
    table = kernels.leaf_table(kinds, params, points, Outlines.of(parts))
    np.testing.assert_array_equal(table, [kernels.program_sdf(p, points) for p in parts])
    by_torch = sdf.leaf_table(kinds, torch.from_numpy(params), torch.from_numpy(points), Outlines.of(parts))
    np.testing.assert_allclose(table, by_torch, atol=1e-12)
    with pytest.raises(ValueError, match="6 leaves, some of them drawn, with the outlines of 0"):
        kernels.leaf_table(kinds, params, points)


@pytest.mark.parametrize("kind", OUTLINED)
def test_area_and_bounds_are_those_of_the_solid(kind):
    for leaf in drawn_leaves(kind, 8):
        leaf = replace(leaf, center=AWAY, rotation=TILT)
        solid = primitive_to_manifold(leaf, 400)
        assert surface_area(leaf.kind, leaf.size, leaf.outline) == pytest.approx(solid.surface_area(), rel=1e-4)
        low, high = PosedPrimitive(leaf).bounds
        corners = np.reshape(solid.bounding_box(), (2, 3))
        assert (low <= corners[0] + 1e-9).all()
        assert (corners[1] <= high + 1e-9).all()
        assert radii(kernels.lower(leaf))[0] == pytest.approx(bounding_radius(leaf), rel=1e-12)


@pytest.mark.parametrize("kind", OUTLINED)
def test_surface_points_of_cut_programs_show_where_the_solid_ends(kind):
    for leaf in drawn_leaves(kind, 3):
        program = Combine("difference", leaf, Primitive("sphere", (0.3,), (0.5, 0.1, 0.0)))
        points, normals = surface_points(program, 1500, np.random.default_rng(1))
        assert len(points) == 1500
        assert not kernels.inside(program, points + 1e-6 * normals).any()
        assert kernels.inside(program, points - 1e-6 * normals).all()


@pytest.mark.parametrize("leaf", DRAWN_LEAVES, ids=lambda p: f"{p.kind}{p.size}")
def test_even_samples_are_about_as_many_as_asked_for(leaf):
    assert len(even_surface(leaf, 4000)[0]) == pytest.approx(4000, rel=0.02)
    points, _ = leaf_surface(leaf, 100, np.random.default_rng(0))
    assert len(points) == 100


MOTIONS = [
    turn((0.1, 0.2, 0.3), (0.6, 0.0, 0.8), 77.0),
    mirror((0.3, 0.0, 0.1), (0.0, 0.6, 0.8)),
    mirror((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
    turn((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 90.0),
]


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("kind", OUTLINED)
def test_a_moved_leaf_is_the_moved_solid(kind, motion):
    points = np.random.default_rng(5).uniform(-1.5, 1.5, (300, 3))
    moved = points @ np.array(motion.linear).T + motion.shift
    for leaf in drawn_leaves(kind, 6):
        leaf = replace(leaf, center=AWAY, rotation=TILT)
        there = move_leaf(leaf, motion)
        np.testing.assert_allclose(kernels.program_sdf(there, moved), kernels.program_sdf(leaf, points), atol=1e-8)
        solid = primitive_to_manifold(leaf, 96).transform(np.column_stack([motion.linear, motion.shift]))
        other = primitive_to_manifold(there, 96)
        assert ((solid - other) + (other - solid)).volume() < 1e-3 * solid.volume()


def test_outlines_do_not_say_which_way_they_run():
    rng = np.random.default_rng(6)
    flat = rng.uniform(-1, 1, (300, 2))
    for _ in range(10):
        outline = random_outline(rng)
        rings = ((loop, isinstance(loop, Ellipse)) for loop in outline.loops)
        back = Outline(tuple(loop if oval else tuple((x, y, -b) for x, y, b in _from_last(loop)) for loop, oval in rings))
        one, other = (kernels.outline_sdf(Outlines.pack([o]).curves, flat) for o in (outline, back))
        np.testing.assert_allclose(one, other, atol=1e-12)


def _from_last(loop):
    """The vertices backwards, each with the bulge of the curve that led to it; there are none of an ellipse."""
    return [(*loop[i][:2], loop[i - 1][2]) for i in range(len(loop) - 1, -1, -1)]


@pytest.mark.parametrize("kind", OUTLINED)
def test_inside_is_the_sign_of_the_distance(kind: str) -> None:
    rng = np.random.default_rng(11)
    for leaf in drawn_leaves(kind, 12):
        program = Combine("difference", leaf, Primitive("sphere", (0.3,), (0.1, 0.2, 0.0)))
        reach = bounding_radius(leaf)
        points = leaf.center + rng.uniform(-reach, reach, (4000, 3))
        values = kernels.program_sdf(program, points)
        held = kernels.inside(program, points)
        assert 0 < held.sum() < len(held)
        assert (held == (values < 0))[np.abs(values) > 1e-12].all()
