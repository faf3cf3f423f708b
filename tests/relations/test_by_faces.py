"""The metric in which faces move as little as may be."""

import numpy as np
import pytest
from tests.planted import ALONG_X, box, cylinder

from imdim.geometry.lowering import lower
from imdim.program.constraints import Constraint, Ref
from imdim.program.tree import combine_all
from imdim.relations.belief import by_faces
from imdim.relations.hold import onto


@pytest.mark.parametrize(("part", "axis"), [(cylinder(5.0, 20.0), 2), (cylinder(5.0, 20.0, rotation=ALONG_X), 0)])
def test_one_end_moves_and_the_other_stays(part, axis):
    plate = box(40.0, 40.0, 40.0)
    level = Constraint("coplanar", (Ref(0, "+" + "xyz"[axis]), Ref(1, "+z")), None, 0.0, "level")
    fixed = [Constraint("fixed", (Ref(0, name),), None, 40.0) for name in ("sx", "sy", "sz")]
    held = [Constraint("fixed", (Ref(0),), Ref(-1, name), 0.0) for name in "xyz"]
    numbers = onto(lower(combine_all("union", [plate, part])), [level, *fixed, *held], 60.0, by_faces([plate, part]))
    center, height = numbers.centers[1][axis], numbers.sizes[1][1]
    assert (center + height / 2, center - height / 2) == pytest.approx((20.0, -10.0), abs=1e-6)
    assert np.isfinite(numbers.centers).all()
