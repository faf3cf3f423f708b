import numpy as np
import pytest
from program_samples import random_program

from imdim.program.cost import cost, count
from imdim.program.tree import Combine, Primitive

BALL = Primitive("sphere", (1.0,))
CUBE = Primitive("box", (1.0, 1.0, 1.0))


def test_counts_by_kind_and_operation():
    program = Combine("difference", Combine("union", CUBE, BALL), Combine("union", BALL, BALL))
    counts = count(program)
    assert counts.kinds == {"box": 1, "sphere": 3, "cylinder": 0, "cone": 0, "torus": 0, "ellipsoid": 0, "extrude": 0, "revolve": 0}
    assert counts.ops == {"union": 2, "intersection": 0, "difference": 1}
    assert (counts.primitives, counts.operations, cost(program)) == (4, 3, 7)


@pytest.mark.parametrize("k", [1, 2, 17])
def test_a_binary_tree_of_k_primitives_costs_2k_minus_1(k: int):
    assert cost(random_program(np.random.default_rng(k), k)) == 2 * k - 1
