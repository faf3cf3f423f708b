"""Distances against nearest surface samples, shapes and batches of the torch reference, packing."""

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree
from tests.known_programs import BOX, CYLINDER, ELLIPSOID, FRUSTUM, KNOWN, POINTED, SPHERE, TORUS

from imdim.geometry import sdf
from imdim.geometry.lowering import pack, postfix, unpack
from imdim.geometry.sampling import leaf_surface
from imdim.program.tree import Combine, Primitive

# more samples where the surface is larger, so that the nearest one is within about 0.02 of the foot
DENSE = 40_000


def values_of(primitive: Primitive, points: np.ndarray) -> torch.Tensor:
    kinds, params = pack(primitive)
    return sdf.leaf_table(kinds, torch.from_numpy(params), torch.from_numpy(points))[0]


@pytest.mark.parametrize("primitive", [BOX, SPHERE, CYLINDER, FRUSTUM, POINTED, TORUS], ids=lambda p: p.kind)
def test_distance_is_that_of_the_nearest_surface_point(primitive):
    rng = np.random.default_rng(2)
    points = rng.uniform(-1, 1, (2000, 3))
    surface, _ = leaf_surface(primitive, DENSE, rng)
    nearest, _ = cKDTree(surface).query(points)
    measured = values_of(primitive, points).abs().numpy()
    # a sample at distance s from the foot is farther by at most s, and by about s^2 / 2d where d >> s
    assert (nearest >= measured - 1e-9).all()
    assert (nearest - measured).max() < 0.03
    assert np.median(nearest - measured) < 1e-3


def test_ellipsoid_has_the_right_sign_and_bounds():
    rng = np.random.default_rng(3)
    points = rng.uniform(-1, 1, (4000, 3))
    surface, normals = leaf_surface(ELLIPSOID, DENSE, rng)
    value = values_of(ELLIPSOID, points).numpy()
    nearest, index = cKDTree(surface).query(points)
    outside = ((points - surface[index]) * normals[index]).sum(1) > 0
    clear = nearest > 0.02
    assert ((value > 0) == outside)[clear].all()
    assert value.min() >= -min(ELLIPSOID.size)
    assert (value <= np.linalg.norm(points - ELLIPSOID.center, axis=1) - min(ELLIPSOID.size) + 1e-12).all()
    np.testing.assert_allclose(values_of(ELLIPSOID, surface), 0, atol=1e-12)
    close = nearest < 0.1
    np.testing.assert_allclose(np.abs(value[close]), nearest[close], atol=0.03)


def test_values_at_centres_are_finite_and_so_are_their_gradients():
    for primitive in (BOX, SPHERE, CYLINDER, FRUSTUM, TORUS, ELLIPSOID):
        kinds, params = pack(primitive)
        numbers = torch.tensor(params, requires_grad=True)
        value = sdf.leaf_table(kinds, numbers, torch.tensor([primitive.center], dtype=torch.float64))
        value.sum().backward()
        assert torch.isfinite(value).all()
        assert torch.isfinite(numbers.grad).all()


def test_leading_axes_broadcast():
    program = KNOWN["countersink"][0]
    kinds, params = pack(program)
    many = torch.from_numpy(params) + torch.linspace(0, 0.1, 5, dtype=torch.float64)[:, None, None]
    points = torch.rand(5, 7, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    batched = sdf.program_sdf(program, many, points)
    assert batched.shape == (5, 7)
    for b in range(5):
        torch.testing.assert_close(batched[b], sdf.program_sdf(program, many[b], points[b]))
    assert sdf.leaf_table(kinds, many.float(), points.float()).dtype == torch.float32


def test_pack_and_unpack_are_inverse():
    for program, _ in KNOWN.values():
        _, params = pack(program)
        assert unpack(program, params) == program
    with pytest.raises(ValueError, match="positive"):
        unpack(SPHERE, -pack(SPHERE)[1])


def test_postfix_lists_leaves_in_order_and_operands_first():
    program = Combine("difference", Combine("union", BOX, SPHERE), Combine("intersection", CYLINDER, TORUS))
    assert postfix(program).tolist() == [0, 1, -1, 2, 3, -2, -3]
