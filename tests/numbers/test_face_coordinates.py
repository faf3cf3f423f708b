"""Numbers that were moved on the lowered arrays, read back into the program."""

from dataclasses import replace

import pytest

from imdim.geometry.lowering import lower
from imdim.numbers.face_coordinates import lift_numbers
from imdim.program.outline import Outline
from imdim.program.tree import Primitive

WEDGE = Primitive("drafted", (0.5, 4.0), outline=Outline((((0.1, -0.4, 0.0), (0.5, -0.2, 0.0), (0.3, 0.4, 0.0)),)))


@pytest.mark.parametrize(("height", "kept"), [(0.6, 0.6), (50.0, 0.5)])
def test_a_drafted_outline_keeps_its_height_where_its_walls_would_meet(height: float, kept: float) -> None:
    before = lower(WEDGE)
    sizes, centers = before.sizes.copy(), before.centers + 0.25
    sizes[0, 0] = height
    lifted = lift_numbers(WEDGE, before, replace(before, sizes=sizes, centers=centers))
    assert lifted == replace(WEDGE, size=(kept, 4.0), center=(0.25, 0.25, 0.25))
