"""Every backend against the exact volumes of the known programs, and every derivative against autograd and differences."""

import math

import numpy as np
import pytest
import torch
from scripts.bench.speed_plain import tangent_from_params
from tests.known_programs import EVERY

from imdim.geometry import kernels, sdf, solid
from imdim.geometry.lowering import Outlines, pack
from imdim.geometry.points import is_inside
from imdim.numbers.likelihood import SurfaceSamples
from imdim.program.rewrite.containment import bounding_radius
from imdim.program.tree import KINDS, Program, fold, leaves

SAMPLES = 40_000


def by_torch(program: Program, points: np.ndarray) -> np.ndarray:
    _, params = pack(program)
    return sdf.program_sdf(program, torch.from_numpy(params), torch.from_numpy(points)).numpy() < 0


def by_points(program: Program, points: np.ndarray) -> np.ndarray:
    ops = {"union": torch.logical_or, "intersection": torch.logical_and, "difference": lambda a, b: a & ~b}
    return fold(program, lambda _, p: is_inside(p, torch.from_numpy(points)), ops).numpy()


MEMBERSHIP = {"torch": by_torch, "numba": kernels.inside, "points": by_points}


@pytest.mark.parametrize("backend", MEMBERSHIP)
@pytest.mark.parametrize("name", EVERY)
def test_volume_by_random_points(name, backend):
    program, volume = EVERY[name]
    rng = np.random.default_rng(11)
    reach = np.array([np.add(p.center, side * bounding_radius(p)) for p in leaves(program) for side in (-1, 1)])
    low, high = reach.min(axis=0), reach.max(axis=0)
    share = volume / np.prod(high - low)
    assert share <= 1
    inside = MEMBERSHIP[backend](program, rng.uniform(low, high, (SAMPLES, 3)))
    assert inside.mean() == pytest.approx(share, abs=4 * math.sqrt(share * (1 - share) / SAMPLES))


@pytest.mark.parametrize("name", EVERY)
def test_volume_of_the_exact_solid(name):
    program, volume = EVERY[name]
    measured = solid.to_manifold(program, segments=256).volume()
    # inscribed facets take away from solids and leave standing in holes, at most 0.1 % of the curved parts at 256 segments
    curved = sum(solid.to_manifold(p, segments=256).volume() for p in leaves(program))
    assert measured == pytest.approx(volume, abs=1e-3 * curved)


def program_gradient(program: Program, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Deciding leaf int64 [n], value [n] and its gradient [n, 9] with respect to that leaf's row of `params`."""
    leaf, value, tangent, _ = kernels.program_tangent(program, points)
    chain = np.stack([tangent_from_params(p.rotation) for p in leaves(program)])
    return leaf, value, np.einsum("ni,nij->nj", tangent, chain[leaf])


def random_program_points(name: str, n: int = 200) -> tuple[Program, np.ndarray]:
    return EVERY[name][0], np.random.default_rng(5).uniform(-1, 1, (n, 3))


@pytest.mark.parametrize("name", EVERY)
def test_kernels_agree_with_torch(name):
    program, points = random_program_points(name)
    kinds, params = pack(program)
    numbers, places = torch.tensor(params, requires_grad=True), torch.from_numpy(points)
    outlines = Outlines.of([*leaves(program)])
    table = sdf.leaf_table(kinds, numbers, places, outlines)
    np.testing.assert_allclose(kernels.leaf_table(kinds, params, points, outlines), table.detach(), atol=1e-12)
    value = sdf.program_sdf(program, numbers, places)
    leaf, measured, gradient = program_gradient(program, points)
    np.testing.assert_allclose(measured, value.detach(), atol=1e-12)
    for j in range(0, len(points), 10):
        (expected,) = torch.autograd.grad(value[j], numbers, retain_graph=True)
        dense = np.zeros_like(params)
        dense[leaf[j]] = gradient[j]
        np.testing.assert_allclose(dense, expected, atol=1e-9)


@pytest.mark.parametrize("name", EVERY)
def test_gradient_is_the_central_difference(name):
    program, points = random_program_points(name)
    kinds, params = pack(program)
    leaf, _, gradient = program_gradient(program, points)
    step = 1e-6
    rows = np.arange(len(points))
    for column in range(9):
        shifted = params.copy(), params.copy()
        shifted[0][:, column] -= step
        shifted[1][:, column] += step
        low, high = (kernels.leaf_table(kinds, p, points, Outlines.of([*leaves(program)]))[leaf, rows] for p in shifted)
        # the deciding leaf may be cut away: then its value enters with the opposite sign
        slope = np.abs(high - low) / (2 * step)
        smooth = np.abs(slope - np.abs(gradient[:, column])) < 1e-5
        # a difference taken across an edge of the distance is no derivative; such points are rare
        assert smooth.mean() > 0.98


@pytest.mark.parametrize("kind", KINDS)
def test_the_table_covers_every_kind(kind):
    assert (kind in sdf.LOCAL_SDF) != (kind in sdf.OUTLINED_SDF)
    assert any(p.kind == kind for program, _ in EVERY.values() for p in leaves(program))


@pytest.mark.parametrize("name", EVERY)
def test_tangents_of_samples_whose_leaf_is_known_are_those_of_the_program(name):
    program = EVERY[name][0]
    shown = SurfaceSamples.of(program, 0.01, most=1500)
    # on the surface itself the way out of a hole is not told by the distance
    beside = shown.points + 1e-6 * shown.normals
    leaf, _, tangent, _ = kernels.program_tangent(program, beside)
    own = leaf == shown.leaf
    assert own.sum() >= 0.98 * len(own)  # but where surfaces meet
    told = kernels.leaf_tangent(program, beside, shown.normals, shown.leaf)
    on = kernels.leaf_tangent(program, shown.points, shown.normals, shown.leaf)
    for one, other in ((told, tangent), (on, told)):  # beside an edge another face is the nearest
        assert np.isclose(one[own], other[own], atol=1e-3).all(1).sum() >= 0.99 * own.sum()


def test_what_an_outline_holds_is_where_its_distance_is_negative():
    rng = np.random.default_rng(0)
    for program, _ in EVERY.values():
        for outline in {p.outline for p in leaves(program)} - {None}:
            curves, flat = Outlines.pack([outline]).curves, rng.uniform(-1.5, 1.5, (2000, 2))
            np.testing.assert_array_equal(kernels.in_outline(curves, flat), kernels.outline_sdf(curves, flat) < 0)
