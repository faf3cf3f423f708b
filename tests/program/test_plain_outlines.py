"""Outlines that are a box, a cylinder or a torus: the same solid; others are refused by a state in one line."""

import numpy as np
import pytest
from tests.drawn import BRACKET, centred

from imdim.geometry import kernels
from imdim.program.outline import Outline, circle, rectangle
from imdim.program.plain_outlines import to_simple
from imdim.program.state import ShapeState
from imdim.program.tree import Combine, Primitive

PLACE = ((0.1, -0.2, 0.3), (20.0, -35.0, 50.0))
LEANING = Outline((((0.5, -0.1, 0.0), (0.9, 0.2, 0.0), (0.3, 1.0, 0.0), (-0.1, 0.7, 0.0)),))
TALL = Outline((((0.0, -0.2, 0.0), (0.0, 0.6, 0.0), (0.4, 0.6, 0.0), (0.4, -0.2, 0.0)),))
PLAIN = {
    "box": Primitive("extrude", (0.7,), *PLACE, rectangle(0.8, 0.5).shift(0.2, -0.1)),
    "leaning box": Primitive("extrude", (0.7,), *PLACE, LEANING),
    "cylinder": Primitive("extrude", (0.7,), *PLACE, Outline((circle(0.4, 0.1, 0.2),))),
    "cone": Primitive("drafted", (0.7, 20.0), *PLACE, Outline((circle(0.4, 0.1, 0.2),))),
    "turned cylinder": Primitive("revolve", (360.0,), *PLACE, TALL),
    "torus": Primitive("revolve", (360.0,), *PLACE, Outline((circle(0.2, 0.6, 0.1),))),
}


@pytest.mark.parametrize("name", PLAIN)
def test_the_solid_is_the_same(name):
    points = np.random.default_rng(0).uniform(-1.5, 1.5, (4000, 3))
    simple = to_simple(PLAIN[name])
    assert simple is not None
    assert simple.kind == name.split()[-1]
    if name == "cone":  # whose distance is not an estimate, as that of walls that lean is
        assert (kernels.inside(simple, points) == kernels.inside(PLAIN[name], points)).all()
        return
    assert np.abs(kernels.program_sdf(simple, points) - kernels.program_sdf(PLAIN[name], points)).max() < 1e-9


def test_a_state_writes_plain_outlines_and_refuses_others():
    program = Combine("difference", PLAIN["box"], PLAIN["cylinder"])
    assert ShapeState.from_program(program).to_program() == Combine("difference", *map(to_simple, (PLAIN["box"], PLAIN["cylinder"])))
    for other in (centred(BRACKET, 2.0), Primitive("revolve", (90.0,), *PLACE, TALL)):
        with pytest.raises(ValueError, match="knows no outlines") as refused:
            ShapeState.from_program(other)
        assert "\n" not in str(refused.value)
