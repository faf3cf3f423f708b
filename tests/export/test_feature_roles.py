"""Ribs, slots and bores by what lies around them, and what their sizes are called."""

import math

import pytest
from tests.export.test_hole_names import opened
from tests.planted import PARTS, box, cut, cylinder, union

from imdim.delivery.finish import finish
from imdim.delivery.report import describe_repeat
from imdim.export.edit import change_values, solid_of
from imdim.export.feature_roles import feature_roles
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.motions import move_program, turn
from imdim.program.outline import Outline
from imdim.program.repeats import repeats
from imdim.program.tree import Primitive

PLATE = box(80, 50, 6)
RIBS = [box(4, 20, 12, (x, 5, 9)) for x in (-20, 20)]
BOSS = union(PLATE, cylinder(12, 20, (0, 0, 10)))


def stadium(length, width, height=20.0):
    a, r = (length - width) / 2, width / 2
    return Primitive("extrude", (height,), (5.0, 4.0, 0.0), outline=Outline((((-a, -r, 0.0), (a, -r, 1.0), (a, r, 0.0), (-a, r, 1.0)),)))


def test_ribs_have_a_thickness_a_height_and_a_length():
    values = opened(union(PLATE, *RIBS)).values
    assert {"rib_thickness": 4.0, "rib_length": 20.0, "rib_height": 12.0, "rib_spacing": 40.0}.items() <= values.items()


def test_slots_have_a_width_and_a_length():
    values = opened(cut(PLATE, box(30, 6, 20, (10, 3, 0)))).values
    assert {"slot_width": 6.0, "slot_length": 30.0}.items() <= values.items()


def test_a_slot_with_round_ends_is_as_long_as_it_is_over_them():
    delivered = opened(cut(PLATE, stadium(22.0, 6.0)))
    assert {"slot_width": 6.0, "slot_length": 22.0}.items() <= delivered.values.items()
    edited = solid_of(change_values(delivered, {"slot_width": 8.0, "slot_length": 30.0}))
    assert volume_iou(edited, to_manifold(cut(PLATE, stadium(30.0, 8.0)), 64)) == pytest.approx(1, abs=1e-6)


def test_a_bore_is_the_large_hole_about_the_axis_of_a_boss_or_a_turned_part():
    assert opened(cut(BOSS, cylinder(7.1, 60))).values["bore_diameter"] == pytest.approx(14.2)
    assert opened(cut(cylinder(20, 30), cylinder(9.1, 60))).values["bore_diameter"] == pytest.approx(18.2)


def test_a_short_wall_between_a_boss_and_its_plate_is_a_rib():
    """Hardly longer than thick, but held on two sides; the same block that stands alone is none."""
    assert feature_roles(union(BOSS, box(5, 6, 14, (0, 14, 8)))) == ["plate", "boss", "rib"]
    assert feature_roles(union(BOSS, box(5, 6, 14, (30, 14, 8)))) == ["plate", "boss", "block"]


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.6, 0.0, 0.8)])
def test_a_tilted_part_has_the_same_roles(axis):
    part = cut(union(PLATE, *RIBS), box(30, 6, 20, (0, -15, 0)))
    assert feature_roles(move_program(part, turn((3.0, 4.0, 5.0), axis, 30.0))) == feature_roles(part) == ["plate", "rib", "rib", "slot"]


@pytest.mark.parametrize(
    ("part", "roles"),
    [
        (PARTS["L bracket"], ["plate", "block"]),
        (union(PLATE, box(4, 4, 20, (0, 0, 13))), ["plate", "block"]),
        (cut(box(60, 40, 20), box(80, 10, 10, (0, 0, 8))), ["body", "pocket"]),
        (cut(box(60, 40, 20), box(40, 8, 10, (0, 0, 8))), ["body", "pocket"]),
        (cut(PLATE, box(20, 16, 20)), ["plate", "pocket"]),
        (cut(PLATE, cylinder(7.1, 60)), ["plate", "hole"]),
        (cut(BOSS, cylinder(2.05, 60)), ["plate", "boss", "hole"]),
        (cut(BOSS, *(cylinder(4.1, 60, (x, 0, 0)) for x in (-30, 0, 30))), ["plate", "boss", "hole", "hole", "hole"]),
    ],
    ids=["flange", "post", "channel", "blind", "window", "no boss", "small", "one of three"],
)
def test_other_features_keep_their_names(part, roles):
    assert feature_roles(part) == roles


@pytest.mark.parametrize(("count", "word", "said"), [(8, "tooth", "8 teeth on a circle"), (7, "profile", "7 profiles on a circle")])
def test_eight_drawn_parts_on_a_circle_are_teeth(count, word, said):
    tooth = Outline((((-3.0, -2.0, 0.0), (3.0, -1.0, 0.0), (3.0, 1.0, 0.0), (-3.0, 2.0, 0.0)),))
    turns = [360.0 * k / count for k in range(count)]
    places = [(20 * math.cos(math.radians(t)), 20 * math.sin(math.radians(t)), 0.0) for t in turns]
    found = finish(
        union(cylinder(19, 10), *(Primitive("extrude", (10.0,), p, (0.0, 0.0, t), tooth) for p, t in zip(places, turns, strict=True)))
    )
    assert [label for label in found.labels if label == word] == [word] * count
    ((first, repeat),) = repeats(found.folded)
    assert describe_repeat(repeat, found.labels[first]) == said


@pytest.mark.parametrize(("radius", "word"), [(60.0, "scoop"), (20.0, "hole")])
def test_a_round_cut_wider_than_all_it_cuts_is_a_scoop(radius, word):
    dished = cut(PLATE, cylinder(radius, 60.0, (0, 0, 3.0 + radius - 1.0), (90.0, 0.0, 0.0)))
    assert feature_roles(dished)[1] == word


def test_the_cavity_of_a_ring_is_none():
    ring = cut(cylinder(28, 18, (0, 0, 9)), cylinder(20, 14, (0, 0, 7)))
    assert feature_roles(ring)[1] != "scoop"
