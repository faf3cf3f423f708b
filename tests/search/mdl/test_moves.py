"""Changes of a choice among parts."""

import numpy as np
from tests.planted import box, cut, cylinder, union

from imdim.deadline import NEVER
from imdim.geometry.sampling import surface_points
from imdim.numbers.em import maximise_likelihood
from imdim.numbers.likelihood import Noise
from imdim.program.sequence import Step, to_sequence
from imdim.search.mdl.moves import holes_for_posts
from imdim.search.mdl.search import REFIT, shorten

BLOCK, POCKET, POST, HOLE, BESIDE = range(5)


def test_what_stands_in_a_pocket_may_be_holes_in_a_block():
    start = (Step("union", BLOCK), Step("difference", HOLE), Step("difference", POCKET), Step("union", POST), Step("union", BESIDE))
    meet = [{BLOCK, POCKET, POST, HOLE}, {BLOCK, POST, POCKET}, {BLOCK, POCKET, POST}, {BLOCK, HOLE}, {BESIDE}]
    (turned,) = holes_for_posts(start, meet)
    assert turned == (Step("union", BLOCK), Step("difference", HOLE), Step("difference", POST), Step("union", BESIDE))


def test_a_search_gets_from_posts_to_holes_at_once():
    places = [(x, y) for x in (-20.0, 0.0, 20.0) for y in (-10.0, 10.0)]
    holes = [cylinder(7, 28, (x, y, 4.0)) for x, y in places]
    truth = cut(box(64, 44, 30), *holes)
    rng = np.random.default_rng(0)
    points = surface_points(truth, 3000, rng)[0] + rng.normal(0, 0.4, (3000, 3))
    posts = union(cut(box(64, 44, 30), box(58, 38, 26, (0.0, 0.0, 3.0))), *holes)
    likely = maximise_likelihood(posts, points, Noise(0.4), REFIT, NEVER)
    found, _ = next(shorten(likely, points, [], np.eye(3), NEVER))
    assert [step.op for step in to_sequence(found.program, apart=True)] == ["union", *["difference"] * len(holes)]
