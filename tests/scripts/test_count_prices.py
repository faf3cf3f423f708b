"""The corpus of designs, and the counts that the package ships."""

import importlib
import json
import math
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from tests.planted import box, cut, union

from imdim.program.cost import CURVE
from imdim.program.outline import Outline
from imdim.program.patterns.weigh import WAY
from imdim.reconstruction.description import COUNTS, price_events
from imdim.reconstruction.design_events import GROUPS, PartBox, read_events

CORPUS = Path(__file__).parents[2] / "scripts" / "corpus"


@pytest.fixture(scope="module")
def counted():
    sys.path.insert(0, str(CORPUS))
    try:
        import count_prices

        yield count_prices
    finally:
        sys.path.remove(str(CORPUS))


def test_the_shipped_counts_are_of_that_corpus(counted):
    """Those of one design of each kind are the same each time, and like those of ten."""
    shipped = json.loads(COUNTS.read_text("utf-8"))
    few, again = counted.count_events(1), counted.count_events(1)
    assert few == again
    assert shipped["designs of each kind"] == counted.EACH
    assert set(shipped["counts"]) == set(GROUPS)
    # the first designs are among the ten
    assert all(n <= shipped["counts"][group][event] for group, events in few.items() for event, n in events.items())
    for group, least in (("feature", 20), ("level add", 20), ("add flat", 20), ("cut side", 20)):
        one, ten = Counter(few[group]), Counter(shipped["counts"][group])
        assert sum(one.values()) >= least
        assert all(abs(one[e] / sum(one.values()) - n / sum(ten.values())) < 0.2 for e, n in ten.items())


def test_designs_are_in_one_piece_and_of_45_kinds(counted):
    designs = list(counted.make_designs(1))
    assert len(designs) == len(counted.PLATES) + len(counted.ROUNDS) + len(counted.PROFILES) == 45
    assert all(part.size > 5 for _, part in designs)


def test_corners_are_rounded_and_circles_wrapped_by_arcs_that_touch(counted):
    features = importlib.import_module("features")
    square = features.round_off([(0, 0), (4, 0), (4, 4), (0, 4)], [1, 1, 1, 1])
    assert area(square) == pytest.approx(16 - 4 + math.pi)
    apart, big, small = 10.0, 3.0, 1.0
    lean = math.asin((big - small) / apart)
    belt = (math.pi / 2 + lean) * big**2 + (math.pi / 2 - lean) * small**2 + (big + small) * math.sqrt(apart**2 - (big - small) ** 2)
    assert area(features.wrap([(0, 0, big), (apart, 0, small)])) == pytest.approx(belt)
    # an L of 20 and 10 along the outside, 1 thick, whose bend is 2 inside and 3 outside
    bent = features.bend([(0, 0), (20, 0), (20, 10)], 1.0, 2.0)
    assert area(bent) == pytest.approx(17 + 7 + math.pi / 4 * (3**2 - 2**2))


def area(loop):
    return Outline((loop,)).area


def test_a_face_is_judged_by_what_of_it_is_within_the_part(counted):
    """A cutter of a shallow notch may stick out as far as it likes."""
    plate, part = box(20, 10, 4), PartBox(np.array([-10.0, -5, -2]), np.array([10.0, 5, 2]))
    near, far = (read_events(cut(plate, box(0.5 + out, 12, 2, ((out - 0.5) / 2 + 10, 0, 1))), part) for out in (0.5, 40.0))
    assert near.events == far.events


def test_what_is_rare_is_dear_and_what_never_was_has_a_price():
    prices = price_events({"copies": {"once": 7, "more": 0}})
    assert prices["copies", "once"] < prices["copies", "more"] == pytest.approx(3.17, abs=0.01)


def test_curves_and_ways_in_which_copies_go_on_cost_what_is_counted(counted):
    shares = counted.relative_prices(counted.count_events(2), 2)
    assert shares["a way"] == pytest.approx(WAY, abs=0.05)
    # the search charges less: it finds the drawings first whose plain features may be preferred to them
    assert CURVE < shares["a further curve"] < 0.5


def test_programs_are_alike_by_the_features_that_explain_the_same_points(counted):
    """Of three features here and two there two pairs are alike; what is explained twice has one pair."""
    judge = importlib.import_module("judge_choices")
    ours = np.array([[1, 1, 1, 1, 1, 0, 0, 0], [0, 0, 0, 0, 0, 1, 1, 0], [0, 0, 0, 0, 0, 1, 1, 0]], dtype=bool)
    theirs = np.array([[1, 1, 1, 1, 0, 0, 0, 0], [0, 0, 0, 0, 0, 1, 1, 0]], dtype=bool)
    assert judge.compare(ours, theirs) == pytest.approx(4 / 5)
    assert judge.compare(ours[:0], theirs) == 0.0


def test_decisions_are_right_where_the_closer_program_is_taken(counted):
    judge = importlib.import_module("judge_choices")
    bounds = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
    plain, long = box(1, 1, 1), union(*(box(0.1, 0.2, 0.3 + 0.01 * k, (0.013 * k, 0.0, 0.0)) for k in range(8)))
    right = judge.Decision(plain, long, bounds, 1.0, 0.5, 40.0, 90.0)
    wrong = judge.Decision(long, plain, bounds, 1.0, 0.75, 90.0, 40.0)
    assert judge.judge([right, right, wrong]) == (2, 0.25)
