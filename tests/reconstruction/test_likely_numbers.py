"""Numbers and relations that make the points of a noisy cloud likely."""

from dataclasses import replace

from tests.planted import cut, cylinder
from tests.reconstruction.test_mdl import cloud

from imdim.deadline import NEVER, Deadline
from imdim.numbers.em import maximise_likelihood
from imdim.numbers.likelihood import Noise
from imdim.reconstruction.likely_numbers import hold_relations


def test_relations_are_judged_by_the_samples_that_judge_the_fit_without_them():
    """The likelihood of the best of many rounds is that of its samples too: coaxial cylinders were left apart by less than these differ."""
    truth = cut(cylinder(15, 8), cylinder(12, 20))
    apart = cut(cylinder(15, 8), cylinder(12, 20, (0.02, 0.01, 0.0)))
    points = cloud(truth, 0.004)
    likely = maximise_likelihood(apart, points, Noise(0.15))
    for flattered in (likely, replace(likely, nll=likely.nll - 0.01)):
        assert "coaxial" in [c.kind for c in hold_relations(flattered, points, NEVER)[1]]
    # the search's last round may have ended late
    late = Deadline(0.0, lambda: 1.0)
    assert "coaxial" in [c.kind for c in hold_relations(likely, points, late)[1]]
