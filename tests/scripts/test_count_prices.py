"""The corpus of designs, and the counts that the package ships."""

import importlib
import json
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from tests.planted import box, union

from imdim.program.cost import CURVE
from imdim.program.patterns.weigh import WAY
from imdim.reconstruction.description import COUNTS, price_events
from imdim.reconstruction.design_events import GROUPS

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


def test_designs_are_in_one_piece_and_of_thirty_kinds(counted):
    designs = list(counted.make_designs(1))
    assert len(designs) == len(counted.PLATES) + len(counted.ROUNDS) == 30
    assert all(part.size > 5 for _, part in designs)


def test_what_is_rare_is_dear_and_what_never_was_has_a_price():
    prices = price_events({"copies": {"once": 7, "more": 0}})
    assert prices["copies", "once"] < prices["copies", "more"] == pytest.approx(3.17, abs=0.01)


def test_a_way_in_which_copies_go_on_costs_what_is_counted(counted):
    shares = counted.relative_prices(counted.count_events(2), 2)
    assert shares["a way"] == pytest.approx(WAY, abs=0.05)
    assert CURVE < shares["a curve"] < 1


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
    right = judge.Decision(plain, long, bounds, 1.0, 0.5)
    wrong = judge.Decision(long, plain, bounds, 1.0, 0.75)
    assert judge.judge([right, right, wrong]) == (2, 0.25)
