"""Canonical rotations against the signed distance of the solid that they must keep."""

import numpy as np
import pytest
from tests.known_programs import LEAVES

from imdim.geometry import kernels
from imdim.geometry.axes import SYMMETRIES
from imdim.numbers.symmetry_normal_form import canonical, round_turns
from imdim.program.tree import KINDS, Primitive

SIZES = {
    "box": (0.9, 0.5, 0.3),
    "cone": (0.5, 0.2, 0.7),
    "torus": (0.6, 0.2),
    "ellipsoid": (0.7, 0.5, 0.2),
    "cylinder": (0.3, 0.8),
    "sphere": (0.6,),
}
POINTS = np.random.default_rng(0).uniform(-1, 1, (300, 3))


def same_solid(a: Primitive, b: Primitive) -> bool:
    return np.allclose(kernels.program_sdf(a, POINTS), kernels.program_sdf(b, POINTS), atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_canonical_keeps_the_solid_and_is_stable(kind):
    rng = np.random.default_rng(3)
    for _ in range(60):
        p = Primitive(kind, SIZES[kind], (0.1, 0.2, 0.0), tuple(rng.uniform(-400, 400, 3).tolist()))
        c = canonical(p)
        assert same_solid(p, c)
        assert canonical(c) == c


@pytest.mark.parametrize("kind", KINDS)
def test_right_angles_leave_one_simple_rotation(kind):
    simple = {(0.0, 0.0, 0.0)} | ({(90.0, 0.0, 0.0), (0.0, 90.0, 0.0)} if kind in ("cylinder", "cone", "torus") else set())
    for rx in (-90.0, 0.0, 90.0, 180.0):
        for ry in (-90.0, 0.0, 90.0, 180.0):
            for rz in (0.0, 90.0, 270.0):
                p = Primitive(kind, SIZES[kind], (0.1, 0.2, 0.0), (rx, ry, rz))
                c = canonical(p)
                assert c.rotation in simple
                assert sorted(c.size) == sorted(p.size)
                assert same_solid(p, c)


def test_a_cone_upside_down_swaps_its_radii():
    assert canonical(Primitive("cone", (0.5, 0.2, 0.7), rotation=(180.0, 0.0, 0.0))) == Primitive("cone", (0.2, 0.5, 0.7))


def test_there_are_24_cube_rotations():
    assert len({tuple(m.ravel()) for m in SYMMETRIES}) == 24
    assert all(np.allclose(m @ m.T, np.eye(3)) for m in SYMMETRIES)


@pytest.mark.parametrize("leaf", [p for p in LEAVES if p.kind != "sphere"], ids=lambda p: f"{p.kind}{p.size}")
@pytest.mark.parametrize(
    "typed", [(0.0, 0.0, 0.0), (0.0, 90.0, 0.0), (0.0, 0.0, 45.0), (0.0, 30.0, 0.0), (20.0, 0.0, 0.0), (0.0, 35.0, 50.0)]
)
def test_the_typed_rotation_is_among_the_offers(leaf, typed):
    rng = np.random.default_rng(4)
    plain = canonical(Primitive(leaf.kind, leaf.size, (0.1, 0.2, 0.0), typed))
    bent = Primitive(leaf.kind, leaf.size, (0.1, 0.2, 0.0), tuple(np.add(typed, rng.uniform(-0.2, 0.2, 3)).tolist()))
    assert any(same_solid(offer, plain) for offer in round_turns(canonical(bent), 3.0))


def test_offers_are_near():
    p = Primitive("box", SIZES["box"], rotation=(31.0, 12.0, 77.0))
    for offer in round_turns(p, 2.0):
        assert np.abs(kernels.program_sdf(p, POINTS) - kernels.program_sdf(offer, POINTS)).max() < np.radians(2.0) * 2
