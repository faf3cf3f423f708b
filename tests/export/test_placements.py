"""Equal sizes of one role have one name where the features are placed alike, and names of their own far apart."""

import pytest
from tests.export.test_hole_names import opened
from tests.planted import ALONG_X, box, cut, cylinder, union

PLATE = box(80, 50, 6)
WALL = box(6, 50, 40, (-37, 0, 17))
STEP = box(20, 50, 20, (50, 0, 7))


@pytest.mark.parametrize(
    ("part", "names"),
    [
        (
            cut(union(PLATE, WALL), cylinder(3, 20, (20, 10, 0)), cylinder(3, 20, (-37, 5, 25), ALONG_X)),
            {"hole_diameter", "hole2_diameter"},
        ),
        (cut(union(PLATE, STEP), cylinder(3, 8, (-20, 7, 3)), cylinder(3, 8, (52, -9, 17))), {"hole_diameter", "hole2_diameter"}),
        (cut(PLATE, cylinder(3, 20, (20, 10, 0)), cylinder(3, 20, (-17, 5, 0))), {"hole_diameter"}),
        (cut(PLATE, cylinder(3, 20, (-34, 5, 0), ALONG_X), cylinder(3, 20, (34, 5, 0), ALONG_X)), {"hole_diameter"}),
        (union(PLATE, cylinder(4, 20, (20, 10, 9)), cylinder(4, 20, (-17, 5, 9))), {"boss_diameter"}),
    ],
    ids=["plate and wall", "two levels", "one plate", "both ends", "bosses"],
)
def test_equal_diameters_are_one_where_features_are_placed_alike(part, names):
    assert {name for name in opened(part).values if name.endswith("_diameter")} == names
