import math

import pytest

from imdim.app.lab import edits
from imdim.app.lab.edits import ConstrainedProgram
from imdim.app.lab.solving import TURN, Lock, violations
from imdim.app.lab.state import ONE_EDIT_S, History
from imdim.geometry.solid import volume
from imdim.program.constraints import Constraint, ConstraintError, Ref
from imdim.program.tree import Combine, Primitive, leaves

PLATE = Primitive("box", (80.0, 50.0, 8.0))
HOLES = [Primitive("cylinder", (3.0, 20.0), (x, 0.0, 0.0)) for x in (-30.0, 30.0)]
PART = Combine("difference", Combine("difference", PLATE, HOLES[0]), HOLES[1])
EQUAL = Constraint("equal", (Ref(1, "r"), Ref(2, "r")))
LEVEL = Constraint("aligned", (Ref(1), Ref(2)), Ref(-1, "y"))
THEORY = ConstrainedProgram(PART, (EQUAL, LEVEL))


def radii(theory):
    return [p.size[0] for p in leaves(theory.program)][1:]


def test_a_number_changes_alone_or_with_what_is_related_to_it():
    alone = edits.with_number(THEORY, 1, "r", 5.0)
    assert radii(alone) == [5.0, 3.0]
    assert violations(alone.program, alone.constraints)[0] > 1e-3
    both = edits.with_number(THEORY, 1, "r", 5.0, follow=True)
    assert radii(both) == [5.0, 5.0]
    exact = 80 * 50 * 8 - 2 * math.pi * 25 * 8
    assert volume(both.program, 512) == pytest.approx(exact, rel=1e-5)
    assert max(violations(both.program, both.constraints)) < 1e-9


def test_what_follows_an_edit_leaves_locked_numbers():
    theory = edits.with_lock(THEORY, Lock(2, "r"), True)
    with pytest.raises(ConstraintError, match="cannot hold together"):
        edits.with_number(theory, 1, "r", 5.0, follow=True)
    free = edits.with_lock(theory, Lock(2, "r"), False)
    assert radii(edits.with_number(free, 1, "r", 5.0, follow=True)) == [5.0, 5.0]


def test_a_turn_and_a_place_change():
    turned = edits.with_number(THEORY, 0, "turn_z", 90.0)
    assert next(leaves(turned.program)).rotation == (0.0, 0.0, 90.0)
    moved = edits.with_number(THEORY, 1, "y", 4.0, follow=True)
    assert [p.center[1] for p in leaves(moved.program)] == [0.0, 4.0, 4.0]


def test_a_value_that_a_constraint_gives_is_the_new_one():
    theory = ConstrainedProgram(PART, (Constraint("value", (Ref(1, "r"),), value=3.0), EQUAL))
    after = edits.with_number(theory, 1, "r", 4.0, follow=True)
    assert after.constraints[0].value == 4.0
    assert radii(after) == [4.0, 4.0]


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_impossible_sizes_are_refused(value):
    with pytest.raises(edits.LabEditError, match="positive r"):
        edits.with_number(THEORY, 1, "r", value)


def test_operations():
    assert [edits.operation(PART, i) for i in range(3)] == [None, "difference", "difference"]
    filled = edits.with_operation(THEORY, 1, "union")
    assert volume(filled.program) > volume(PART) + 500
    with pytest.raises(edits.LabEditError, match="no operation"):
        edits.with_operation(THEORY, 0, "union")


def test_a_primitive_is_added_last_and_removed_with_what_was_said_of_it():
    more = edits.with_added(THEORY, "union", Primitive("sphere", (5.0,)))
    assert [p.kind for p in leaves(more.program)] == ["box", "cylinder", "cylinder", "sphere"]
    locked = edits.with_lock(edits.with_constraint(more, Constraint("concentric", (Ref(2), Ref(3)))), Lock(3, TURN), True)
    less = edits.without_leaf(locked, 1)
    assert [p.kind for p in leaves(less.program)] == ["box", "cylinder", "sphere"]
    assert less.constraints == (Constraint("concentric", (Ref(1), Ref(2))),)
    assert less.locks == {Lock(2, TURN)}
    with pytest.raises(edits.LabEditError, match="last primitive"):
        edits.without_leaf(ConstrainedProgram(PLATE), 0)


def test_what_is_cut_out_of_a_removed_primitive_goes_with_it():
    gone = edits.without_leaf(ConstrainedProgram(Combine("union", Combine("difference", PLATE, HOLES[0]), HOLES[1])), 0)
    assert gone.program == HOLES[1]


def test_constraints_are_read_as_they_are_written():
    assert edits.read_constraint("equal", "1.r, 2.r") == EQUAL
    assert edits.read_constraint("aligned", "1 2", "world.y") == LEVEL
    assert edits.read_constraint("value", "1.r", "", 3.0).value == 3.0
    for bad in (("equal", "1.q, 2.r"), ("equal", "1.r"), ("equal", "1.r, 9.r"), ("aligned", "1, 2")):
        with pytest.raises((edits.LabEditError, ConstraintError)):
            edits.with_constraint(THEORY, edits.read_constraint(*bad))
    with pytest.raises(edits.LabEditError, match="unknown kind 'same'"):
        edits.read_constraint("same", "1.r, 2.r")


def test_a_relation_holds_from_the_moment_it_is_added():
    wider = edits.with_number(THEORY, 1, "r", 4.0)
    value = edits.read_constraint("value", "2.r", "", 3.5)
    moved = edits.with_constraint(ConstrainedProgram(wider.program), value)
    assert [p.size[0] for p in leaves(moved.program)][1:] == [4.0, 3.5]
    assert violations(moved.program, moved.constraints) == pytest.approx([0.0], abs=1e-9)
    assert edits.with_constraint(moved, edits.read_constraint("value", "1.r", "", 4.0)).program == moved.program, "it held"


def test_a_relation_that_cannot_hold_is_refused():
    locked = edits.with_lock(ConstrainedProgram(PART), Lock(1, "r"), True)
    with pytest.raises(edits.LabEditError, match="diameter of hole is 18: cannot hold"):
        edits.with_constraint(locked, edits.read_constraint("value", "1.r", "", 9.0))


def test_undo_and_redo():
    history = History()
    steps = [THEORY, edits.with_number(THEORY, 1, "r", 4.0), edits.with_number(THEORY, 1, "r", 5.0)]
    for step in steps:
        history.push("step", step)
    assert history.undo() == "step"
    assert history.theory == steps[1]
    assert history.redo() == "step"
    assert history.theory == steps[2]
    assert history.redo() is None
    history.undo()
    history.push("other", steps[0])
    assert history.redo() is None
    history.undo()
    history.undo()
    assert history.theory == THEORY
    assert history.undo() is None


def test_keystrokes_in_one_number_are_one_edit():
    history = History()
    history.push("fit", THEORY)
    for i, value in enumerate((1.0, 12.0)):
        history.push("number 1 r", edits.with_number(THEORY, 1, "r", value), now=10.0 + 0.3 * i)
    history.push("number 1 r", edits.with_number(THEORY, 1, "r", 2.0), now=11.0 + ONE_EDIT_S)
    history.undo()
    assert radii(history.theory)[0] == 12.0
    history.undo()
    assert history.theory == THEORY


def test_a_drag_is_one_step_however_long_it_takes():
    history = History()
    history.push("found", THEORY)
    for i, what in enumerate(("drag 1", "drag 1", "drag 2")):
        history.push(what, edits.with_number(THEORY, 1, "r", 4.0 + i), 10.0 * i)
    history.undo()
    assert radii(history.theory) == [5.0, 3.0]
    history.undo()
    assert history.theory == THEORY
