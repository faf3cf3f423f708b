"""What is told of an edit: specks come and go unsaid, larger pieces do not, and a volume that stays has no sign."""

import pytest
from manifold3d import Manifold

from imdim.export.edit_report import EditReport

PLATE = Manifold.cube((100.0, 50.0, 20.0))
ASIDE = (0.0, 0.0, 30.0)


@pytest.mark.parametrize(("side", "said"), [(0.4, ""), (0.6, "1 body became 2")])
def test_a_loose_piece_is_told_from_a_millionth_of_the_volume_on(side, said):
    """A tenth of a cubic millimetre of 100,000."""
    loose = Manifold.cube((side, side, side)).translate(ASIDE)
    assert EditReport.of(PLATE, PLATE + loose).changes_in_kind == said


@pytest.mark.parametrize(("height", "change"), [(20.002, "(0.0%)"), (19.998, "(0.0%)"), (22.0, "(+10.0%)"), (18.0, "(-10.0%)")])
def test_a_volume_that_hardly_changes_has_no_sign(height, change):
    lines = EditReport.of(PLATE, Manifold.cube((100.0, 50.0, height))).lines()
    assert lines[1].endswith(change)
