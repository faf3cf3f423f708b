"""A candidate's cells and its solid are the same set of points."""

import numpy as np
import pytest
from tests.planted import PARTS, box, cone, cut, cylinder, ellipsoid, sphere, torus, union
from tests.search.planted_families import families_of, planted, random_candidates

from imdim.geometry import kernels
from imdim.search.candidate_families import Candidate

TILT = (20.0, -35.0, 50.0)
TURNED = {
    "turned": cut(box(60, 40, 20, (1.0, 2.0, 3.0), TILT), cylinder(5, 40, (1.0, 2.0, 3.0), TILT), sphere(8, (5.0, 0.0, 9.0))),
    "hollows": cut(box(60, 40, 40), ellipsoid(18, 12, 6, (4.0, -2.0, 5.0), TILT), ellipsoid(5, 5, 9, (-20.0, 0.0, 8.0))),
    "ring and cones": union(torus(20, 5, (0.0, 0.0, 3.0), TILT), cone(6, 2, 10), cone(0, 7, 12, (3.0, 3.0, 20.0))),
}


@pytest.mark.parametrize("name", [*PARTS, *TURNED])
def test_masks_and_solids_agree(name):
    families = planted(name) if name in PARTS else families_of(TURNED[name])
    points = families.cells.points
    for candidate in random_candidates(families, 40, np.random.default_rng(2)):
        solid = families.primitive(candidate)
        value = kernels.program_sdf(solid, points)
        clear = np.abs(value) > 1e-9
        assert np.array_equal((value < 0)[clear], families.mask(candidate)[clear]), candidate
        assert clear.mean() > 0.99


def test_a_range_is_the_drawn_height():
    families = planted("stepped shaft")
    axis = families.arrangement.axis_of[0]
    offsets = families.arrangement.directions[axis].offsets
    lo, hi = (int(np.argmin(np.abs(offsets - z))) for z in (20.0, 40.0))
    index = [s.sizes[0] for s in families.arrangement.curved].index(8)
    shaft = families.primitive(Candidate(("curved", index), ((lo, hi),)))
    assert shaft.kind == "cylinder"
    assert shaft.size == pytest.approx((8, 20))
    assert shaft.center == pytest.approx((0, 0, 30))


def test_a_cone_ends_at_its_apex():
    # radius 6 at z = -5 and 2 at z = 5: the apex is at z = 10, inside the long box
    families = families_of(union(cone(6, 2, 10), box(1, 1, 40)))
    (axis,) = families.arrangement.axis_of
    last = len(families.arrangement.directions[axis].offsets) - 1
    solid = families.primitive(Candidate(("curved", 0), ((0, last),)))
    assert solid.kind == "cone"
    assert min(solid.size[:2]) == pytest.approx(0, abs=1e-9)
    assert max(solid.size[:2]) == pytest.approx(0.4 * solid.size[2])
    assert solid.center[2] + solid.size[2] / 2 == pytest.approx(10)
