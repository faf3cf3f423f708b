import numpy as np
import pytest
from program_samples import random_program

from imdim.program.cost import cost, count, describe_size, weigh
from imdim.program.outline import Outline, circle
from imdim.program.tree import Combine, Primitive

BALL = Primitive("sphere", (1.0,))
CUBE = Primitive("box", (1.0, 1.0, 1.0))
DISC = Primitive("extrude", (1.0,), outline=Outline((circle(2.0),)))
# a plate of eight curves with a slot of four and a hole, which is one
ROUNDED = tuple((x, y, 0.3 * (i % 2)) for i, (x, y) in enumerate(((1, 0), (9, 0), (10, 1), (10, 7), (9, 8), (1, 8), (0, 7), (0, 1))))
SLOT = ((2.0, 2.0, 0.0), (4.0, 2.0, 1.0), (4.0, 3.0, 0.0), (2.0, 3.0, 1.0))
PLATE = Primitive("extrude", (1.0,), outline=Outline((ROUNDED, SLOT, circle(0.5, 8.0, 5.0))))


def test_counts_by_kind_and_operation():
    program = Combine("difference", Combine("union", CUBE, BALL), Combine("union", BALL, BALL))
    counts = count(program)
    assert counts.kinds == {
        "box": 1,
        "sphere": 3,
        "cylinder": 0,
        "cone": 0,
        "torus": 0,
        "ellipsoid": 0,
        "extrude": 0,
        "revolve": 0,
        "drafted": 0,
    }
    assert counts.ops == {"union": 2, "intersection": 0, "difference": 1}
    assert (counts.primitives, counts.operations, cost(program)) == (4, 3, 7)


@pytest.mark.parametrize("k", [1, 2, 17])
def test_a_binary_tree_of_k_primitives_costs_2k_minus_1(k: int):
    assert cost(random_program(np.random.default_rng(k), k)) == 2 * k - 1


@pytest.mark.parametrize(
    ("program", "features", "curves", "words"),
    [
        (CUBE, 1, 0, "1 primitive"),
        (Combine("union", CUBE, BALL), 2, 0, "2 primitives"),
        (DISC, 1, 1, "1 feature, 1 curve in outlines"),
        (Combine("difference", PLATE, BALL), 2, 13, "2 features, 13 curves in outlines"),
        (Combine("union", PLATE, Combine("union", DISC, PLATE)), 3, 27, "3 features, 27 curves in outlines"),
    ],
)
def test_the_size_in_words_tells_features_and_curves_where_there_are_outlines(program, features, curves, words):
    counts = count(program)
    assert (counts.primitives, counts.curves, str(counts)) == (features, curves, words)
    assert counts.drawn == ({"features": features, "curves": curves} if curves else {})
    assert describe_size(features, curves, features) == words


def test_the_size_in_words_tells_what_is_no_copy():
    assert describe_size(101, 506, 7) == "101 features (7 without copies), 506 curves in outlines"
    assert describe_size(7, None, 3) == "7 primitives (3 without copies)"


def test_curves_beyond_the_first_four_of_an_outline_weigh_a_tenth_or_nothing():
    program = Combine("difference", PLATE, BALL)
    assert weigh(program) == pytest.approx(2.9)  # 13 curves
    assert weigh(program, curve=0.0) == 2
    assert weigh(Combine("union", CUBE, BALL)) == 2
