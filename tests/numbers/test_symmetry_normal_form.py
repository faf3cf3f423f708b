"""Canonical rotations against the signed distance of the solid that they must keep."""

from dataclasses import replace

import numpy as np
import pytest
from tests.drawn import BRACKET, PULLEY, centred
from tests.known_programs import LEAVES

from imdim.geometry import kernels
from imdim.geometry.axes import SYMMETRIES
from imdim.geometry.rotations import matrix_from_euler
from imdim.numbers.symmetry_normal_form import canonical, round_turns, turn_over
from imdim.program.outline import Outline
from imdim.program.tree import KINDS, OUTLINED, SIMPLE, Primitive, Vec3, map_lengths

SIZES = {
    "box": (0.9, 0.5, 0.3),
    "cone": (0.5, 0.2, 0.7),
    "torus": (0.6, 0.2),
    "ellipsoid": (0.7, 0.5, 0.2),
    "cylinder": (0.3, 0.8),
    "sphere": (0.6,),
    "extrude": (0.5,),
    "revolve": (250.0,),
    "drafted": (0.5, 4.0),
}
OUTLINE = Outline((((0.1, -0.4, 0.0), (0.5, -0.2, 0.3), (0.3, 0.4, 0.0)),))
LINES = Outline((((0.1, -0.4, 0.0), (0.5, -0.2, 0.0), (0.3, 0.4, 0.0)),))  # an arc that meets another curve in a corner has no draft


def sized(kind: str, *pose: Vec3) -> Primitive:
    return Primitive(kind, SIZES[kind], *pose, **({"outline": LINES if kind == "drafted" else OUTLINE} if kind in OUTLINED else {}))


POINTS = np.random.default_rng(0).uniform(-1, 1, (300, 3))


def same_solid(a: Primitive, b: Primitive) -> bool:
    return np.allclose(kernels.program_sdf(a, POINTS), kernels.program_sdf(b, POINTS), atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_canonical_keeps_the_solid_and_is_stable(kind):
    rng = np.random.default_rng(3)
    for _ in range(60):
        p = sized(kind, (0.1, 0.2, 0.0), tuple(rng.uniform(-400, 400, 3).tolist()))
        c = canonical(p)
        assert same_solid(p, c)
        assert canonical(c) == c


@pytest.mark.parametrize("kind", SIMPLE)
def test_right_angles_leave_one_simple_rotation(kind):
    simple = {(0.0, 0.0, 0.0)} | ({(90.0, 0.0, 0.0), (0.0, 90.0, 0.0)} if kind in ("cylinder", "cone", "torus") else set())
    for rx in (-90.0, 0.0, 90.0, 180.0):
        for ry in (-90.0, 0.0, 90.0, 180.0):
            for rz in (0.0, 90.0, 270.0):
                p = sized(kind, (0.1, 0.2, 0.0), (rx, ry, rz))
                c = canonical(p)
                assert c.rotation in simple
                assert sorted(c.size) == sorted(p.size)
                assert same_solid(p, c)


def test_a_cone_upside_down_swaps_its_radii():
    assert canonical(Primitive("cone", (0.5, 0.2, 0.7), rotation=(180.0, 0.0, 0.0))) == Primitive("cone", (0.2, 0.5, 0.7))


@pytest.mark.parametrize("leaf", [*(p for p in LEAVES if p.kind in ("cylinder", "cone", "torus")), PULLEY], ids=lambda p: p.kind)
def test_what_is_turned_over_is_the_same_solid(leaf):
    points = np.random.default_rng(0).uniform(-30, 30, (400, 3)) + leaf.center
    over = turn_over(leaf)
    assert np.allclose(kernels.program_sdf(over, points), kernels.program_sdf(leaf, points), atol=1e-9)
    assert np.allclose(matrix_from_euler(over.rotation)[:, 2], -matrix_from_euler(leaf.rotation)[:, 2])


@pytest.mark.parametrize("leaf", [PULLEY, replace(PULLEY, size=(100.0,)), centred(BRACKET, 20.0)], ids=["round", "sector", "extruded"])
def test_outlines_keep_their_solid_and_round_ones_point_up(leaf):
    leaf = map_lengths(leaf, lambda length: length / 40, (0.1, 0.2, 0.0))
    rng = np.random.default_rng(4)
    for _ in range(30):
        p = replace(leaf, rotation=tuple(rng.uniform(-400, 400, 3).tolist()))
        c = canonical(p)
        assert same_solid(p, c)
        assert canonical(c) == c
    over = canonical(replace(leaf, rotation=(180.0, 0.0, 30.0)))
    assert same_solid(over, replace(leaf, rotation=(180.0, 0.0, 30.0)))
    assert (over.rotation == (0.0, 0.0, 0.0)) == (leaf.size == (360.0,))
    near = list(round_turns(replace(leaf, rotation=(0.4, -0.3, 0.2)), 3.0))
    assert near
    assert all(turned.outline is not None for turned in near)


def test_there_are_24_cube_rotations():
    assert len({tuple(m.ravel()) for m in SYMMETRIES}) == 24
    assert all(np.allclose(m @ m.T, np.eye(3)) for m in SYMMETRIES)


@pytest.mark.parametrize(
    "leaf", [*(p for p in LEAVES if p.kind != "sphere"), *(sized(kind) for kind in OUTLINED)], ids=lambda p: f"{p.kind}{p.size}"
)
@pytest.mark.parametrize(
    "typed", [(0.0, 0.0, 0.0), (0.0, 90.0, 0.0), (0.0, 0.0, 45.0), (0.0, 30.0, 0.0), (20.0, 0.0, 0.0), (0.0, 35.0, 50.0)]
)
def test_the_typed_rotation_is_among_the_offers(leaf, typed):
    rng = np.random.default_rng(4)
    plain = canonical(replace(leaf, center=(0.1, 0.2, 0.0), rotation=typed))
    bent = replace(leaf, center=(0.1, 0.2, 0.0), rotation=tuple(np.add(typed, rng.uniform(-0.2, 0.2, 3)).tolist()))
    assert any(same_solid(offer, plain) for offer in round_turns(canonical(bent), 3.0))


def test_offers_are_near():
    p = Primitive("box", SIZES["box"], rotation=(31.0, 12.0, 77.0))
    for offer in round_turns(p, 2.0):
        assert np.abs(kernels.program_sdf(p, POINTS) - kernels.program_sdf(offer, POINTS)).max() < np.radians(2.0) * 2


@pytest.mark.parametrize("size", [(0.5, 0.5, 0.8), (0.5, 0.8, 0.5), (0.8, 0.5, 0.5)])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_an_ellipsoid_of_revolution_has_no_spin(size, axis):
    """Spun about its axis it is the same solid, and so is written the same."""
    spun = tuple(37.0 * (i == size.index(0.8)) for i in range(3))
    plain, turned = Primitive("ellipsoid", size), Primitive("ellipsoid", size, rotation=spun)
    assert same_solid(plain, turned)
    assert canonical(turned).rotation == canonical(plain).rotation == (0.0, 0.0, 0.0)
    tilted = replace(turned, rotation=tuple(20.0 * (i == axis) for i in range(3)))
    assert same_solid(canonical(tilted), tilted)


@pytest.mark.parametrize("tilt", [1e-10, 1e-4, 0.2, 4.0])
@pytest.mark.parametrize("way", [10.0, 100.0, 200.0, 300.0])
@pytest.mark.parametrize("kind", ["cylinder", "cone", "torus"])
def test_what_stands_nearly_upright_hardly_turns(kind, way, tilt):
    """A tilt of a hair came with a turn about z of any angle, -71.3 degrees for one."""
    tilted = sized(kind, (0.1, -0.2, 0.3), (0.0, tilt, way))
    found = canonical(tilted)
    assert same_solid(found, tilted)
    assert found.rotation[2] == 0.0
    assert max(map(abs, found.rotation)) <= tilt + 1e-9
