"""Programs as signed sequences and back."""

import numpy as np
import pytest
from program_samples import left_fold
from tests.planted import box, common, cone, cut, cylinder, sphere, union

from imdim.program.cost import count
from imdim.program.sequence import Step, flatten, map_terms, of_primitives, to_program, to_sequence, with_leaves
from imdim.program.tree import Primitive, leaves, map_leaves

PARTS = box(4, 4, 4), sphere(1), cylinder(1, 9), cone(2, 1, 3)


@pytest.mark.parametrize("seed", range(10))
def test_a_left_fold_comes_back_from_every_reading(seed: int):
    program = left_fold(np.random.default_rng(seed), 1 + seed)
    sequence = of_primitives(to_sequence(program))
    assert sequence is not None
    assert sequence == to_sequence(program, apart=True) == flatten(program)
    assert [p for _, p in sequence] == list(leaves(program))
    assert to_program(sequence) == program


def test_parts_stay_whole_where_they_are_no_union():
    program = union(cut(common(box(4, 4, 4), sphere(2.4)), cylinder(1, 9)), cut(box(1, 1, 9), sphere(1)))
    sequence = to_sequence(program, apart=True)
    assert [count(p).primitives for _, p in sequence] == [2, 1, 2]
    assert [op for op, _ in sequence] == ["union", "difference", "union"]
    assert to_program(sequence) == program
    assert of_primitives(sequence) is None


def test_unions_on_the_right_are_taken_apart_on_demand():
    a, b, c, d = PARTS
    both = union(b, union(c, d))
    assert to_sequence(cut(a, both)) == (Step("union", a), Step("difference", both))
    assert to_sequence(union(a, both), apart=True) == tuple(Step("union", p) for p in PARTS)
    assert [op for op, _ in to_sequence(cut(a, both), apart=True)] == ["union", "difference", "difference", "difference"]
    assert to_sequence(union(a, cut(b, c)), apart=True)[1] == Step("union", cut(b, c))


def test_intersections_are_steps_too():
    sequence = Step("union", PARTS[0]), Step("intersection", PARTS[1])
    assert to_program(sequence) == common(*PARTS[:2])


@pytest.mark.parametrize("op", ["difference", "intersection"])
def test_nothing_comes_of_what_begins_with_no_union(op):
    with pytest.raises(ValueError, match=f"begins with a union, got a {op}"):
        to_program((Step(op, sphere(1)),))
    with pytest.raises(ValueError, match="empty"):
        to_program(())


def test_terms_and_numbers_are_exchanged_in_their_places():
    program = cut(union(*PARTS[:2]), PARTS[2])
    moved = map_leaves(program, lambda i, p: Primitive(p.kind, p.size, (float(i), 0.0, 0.0)))
    sequence = of_primitives(to_sequence(program))
    assert sequence is not None
    assert to_program(with_leaves(sequence, moved)) == moved
    assert to_program(map_terms(map_terms(sequence, PARTS.index), PARTS.__getitem__)) == program
    with pytest.raises(ValueError, match="longer"):
        with_leaves(sequence, union(*PARTS[:2]))
