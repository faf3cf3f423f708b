"""Many points, each with a surface of its own: the same distances and normals as of one surface after the other."""

import numpy as np
import pytest

from imdim.geometry.surface import SURFACE_KINDS, Surface, SurfaceTable, normals, signed_distance, unit

SIZES = {
    "plane": (),
    "sphere": (2.0,),
    "cylinder": (1.5,),
    "cone": (0.4,),
    "torus": (3.0, 0.7),
    "ellipsoid": (2.0, 1.0, 3.0),
    "elliptic": (2.0, 1.0),
}


def test_each_point_has_its_own_surface():
    rng = np.random.default_rng(0)
    surfaces = []
    for kind in [*SURFACE_KINDS, *SURFACE_KINDS]:
        axis, across = np.linalg.qr(rng.normal(size=(3, 2)))[0].T
        surfaces.append(Surface(kind, tuple(rng.normal(size=3)), tuple(axis), SIZES[kind], tuple(across)))
    points, own = rng.normal(0, 3, (400, 3)), rng.integers(0, len(surfaces), 400)
    away, out = SurfaceTable(surfaces).look(points, own)
    assert len(np.unique(own)) == len(surfaces)
    for point, which, off, normal in zip(points, own, away, out, strict=True):
        assert off == pytest.approx(signed_distance(surfaces[which], point[None])[0], abs=1e-12)
        assert normal == pytest.approx(normals(surfaces[which], point[None])[0], abs=1e-12)
    assert np.allclose(unit(out), out)
