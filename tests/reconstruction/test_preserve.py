"""What is delivered is what was found: each step after the search is judged by exact booleans over all that it changes."""

from dataclasses import replace

import pytest
from tests.planted import PARTS, box, common, cut, cylinder, mesh_of, union

from imdim.deadline import Deadline
from imdim.delivery import finish as delivery
from imdim.delivery.finish import finish
from imdim.geometry.solid import volume
from imdim.program.constraints import Constraint, Ref
from imdim.program.patterns.detect import Folding, fold_repeats
from imdim.program.tree import leaves, map_leaves
from imdim.reconstruction import body_state, fitting, one_body, pipeline
from imdim.reconstruction.pipeline import reconstruct_best
from imdim.reconstruction.preserve import is_same, preserve
from imdim.target.target import target_from

PLATE = cut(box(40, 30, 6), cylinder(3, 8, (-12.0, 0.0, 0.0)), cylinder(2, 8, (12.0, 0.0, 0.0)))

# a nine-sided prism: two boxes and their mirror images, all of which end at the same two faces
NINE_SIDES = common(
    *(box(1.83, 0.95, 2.34, (0.095, 0.0, -0.23 * side), (0.0, -22.4 * side, 0.0)) for side in (1, -1)),
    *(box(2.84, 0.95, 2.35, (-0.097, 0.0, 0.23 * side), (0.0, -23.0 * side, 0.0)) for side in (1, -1)),
)


def grown(program, *numbers):
    """Boxes and cylinders of these numbers (by default all) a third longer."""
    longer = {"box": lambda s: (s[0] * 4 / 3, *s[1:]), "cylinder": lambda s: (s[0] * 4 / 3, s[1])}
    return map_leaves(program, lambda i, p: replace(p, size=longer[p.kind](p.size)) if not numbers or i in numbers else p)


def test_mirrored_parts_of_an_intersection_do_not_all_leave_one_end_to_the_others():
    found = finish(NINE_SIDES)
    assert found.folded is not None
    assert volume(found.program) == pytest.approx(volume(NINE_SIDES), rel=1e-9)
    assert is_same(NINE_SIDES, found.program, 1e-9)
    assert found.program != NINE_SIDES


def test_what_keeps_the_solid_is_taken():
    longer = map_leaves(PLATE, lambda _, p: replace(p, size=(p.size[0], 9.0)) if p.kind == "cylinder" else p)
    assert preserve(PLATE, longer) == longer


def test_without_time_a_step_is_taken_whole_or_not():
    over = Deadline(0.0, lambda: 1.0)
    longer = map_leaves(PLATE, lambda _, p: replace(p, size=(p.size[0], 9.0)) if p.kind == "cylinder" else p)
    assert preserve(PLATE, longer, deadline=over) == longer
    assert preserve(PLATE, grown(longer, 1), deadline=over) == PLATE


def test_what_changes_the_solid_is_held_back_alone():
    longer = map_leaves(PLATE, lambda _, p: replace(p, size=(p.size[0], 9.0)) if p.kind == "cylinder" else p)
    kept = list(leaves(preserve(PLATE, grown(longer, 1))))
    assert kept == [*list(leaves(PLATE))[:2], list(leaves(longer))[2]]


def test_moves_that_are_only_right_apart_are_not_taken_together():
    both = common(box(10, 10, 10), box(12, 10, 10))
    higher = map_leaves(both, lambda _, p: replace(p, size=(p.size[0], 10, 12)))
    assert [p.size[2] for p in leaves(preserve(both, higher))] in ([12, 10], [10, 12])
    assert preserve(both, higher, together=[[0, 1]]) == both


def test_another_structure_is_taken_or_not():
    assert preserve(PLATE, box(40, 30, 6)) == PLATE
    double = union(PLATE, box(5, 5, 5, (0.0, 0.0, 0.0)))
    assert preserve(double, PLATE) == PLATE


def test_turned_facets_are_no_change():
    turned = replace(cylinder(5, 10), rotation=(0.0, 0.0, 1.7))
    assert preserve(cylinder(5, 10), turned) == turned


def test_simplifying_wrongly_is_refused(monkeypatch):
    monkeypatch.setattr(one_body, "reduce_program", lambda program, deadline: box(1, 1, 1))
    last = reconstruct_best(target_from(mesh_of(PLATE)))
    assert is_same(last.program, PLATE, 1e-3)


def test_of_relations_that_change_the_solid_those_stay_that_hold_anyway(monkeypatch):
    """Walls that coincide make a solid differ by more than the hair that one relation moves them by; the others say what they said."""
    right = fitting.relations_of(PLATE)[1]
    wrong = Constraint("equal", (Ref(1, "r"), Ref(2, "r")))
    monkeypatch.setattr(fitting, "relations_of", lambda program, _: (grown(program), (*right, wrong)))
    assert fitting.find_relations(PLATE, target_from(mesh_of(PLATE))) == (PLATE, right)


def test_an_overshoot_into_material_is_held_back(monkeypatch):
    monkeypatch.setattr(delivery, "overshoot", lambda program, folded, deadline, kept: grown(program, 0))
    assert finish(PLATE).program == PLATE


def test_repeats_that_change_the_solid_are_not_written(monkeypatch):
    row = cut(box(60, 20, 5), *(cylinder(3, 8, (x, 0.0, 0.0)) for x in (-20.0, 0.0, 20.0)))
    right = fold_repeats(row)
    wrong = fold_repeats(grown(row, 1, 2, 3))
    assert right is not None
    assert wrong is not None
    monkeypatch.setattr(delivery, "fold_repeats", lambda *_: Folding(wrong.folded, wrong.order))
    assert finish(row).folded is None


def test_the_last_error_is_that_of_the_program_it_carries(monkeypatch):
    def shortened(program, *_):
        return map_leaves(program, lambda i, p: replace(p, size=(0.75 * p.size[0], *p.size[1:])) if i == 1 else p), ()

    monkeypatch.setattr(pipeline, "find_relations", shortened)
    last = reconstruct_best(target_from(mesh_of(union(box(10, 20, 30), box(5, 5, 48, (40.0, 0.0, 0.0))))))
    assert last.error == pytest.approx(0.25 * 1200 / 7200, rel=0.1)


def test_a_guess_of_nothing_has_an_error():
    nothing = cut(box(1, 1, 1), box(2, 2, 2))
    state = body_state.BodyState("policy", nothing, 1.0, 0.0, lambda _: 1.0)
    assert body_state.measure_apart(nothing, [state]) == 1.0


@pytest.mark.parametrize("name", ["plate with four holes", "stepped shaft"])
def test_delivery_keeps_planted_parts(name):
    assert is_same(PARTS[name], finish(PARTS[name]).program, 1e-5)
