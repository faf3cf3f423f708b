"""Copies that each win less than a step costs are found as one step, and take the place of steps that make up for them."""

import numpy as np
import pytest
from tests.planted import box, common, cut, cylinder, sphere, union
from tests.search.planted_families import families_of

from imdim.deadline import NEVER
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.patterns.detect import find_repeats
from imdim.program.patterns.weigh import WAY, weigh_once
from imdim.program.tree import leaves
from imdim.search.sequence import Pattern, cost, to_program
from imdim.search.structure import StructureConfig, search

PLATE = box(100, 60, 5)
GRID = [(14.0 * i - 35, 12.0 * j - 18) for i in range(6) for j in range(4)]
CIRCLE = [(36 * float(np.cos(a)), 36 * float(np.sin(a))) for a in np.radians(30 * np.arange(12))]
PARTS = {
    "grid": (cut(PLATE, *(cylinder(0.6, 7, (x, y, 0.0)) for x, y in GRID)), 2),
    "circle": (cut(cylinder(40, 8), *(cylinder(0.8, 4, (x, y, 4.0)) for x, y in CIRCLE)), 1),
    "row": (union(PLATE, *(sphere(0.8, (8.0 * i - 40, 0, 2.5)) for i in range(11))), 1),
    "mirror": (cut(PLATE, *(cylinder(0.9, 7, (x, 20.0, 0.0)) for x in (-40.0, 31.0))), 1),
}


def searched(program, patterns=True):
    families = families_of(program)
    return list(search(families, StructureConfig(patterns=patterns), np.random.default_rng(0), NEVER))[-1]


@pytest.mark.parametrize("name", PARTS)
def test_small_copies_are_one_step(name):
    program, ways = PARTS[name]
    found = searched(program)
    (pattern,) = (step.term.shape for step in found.sequence if isinstance(step.term.shape, Pattern))
    assert pattern.ways == ways
    assert len(pattern.copies) == len(list(leaves(program))) - 1
    assert cost(found.sequence) == pytest.approx(2 + WAY * ways)
    assert volume_iou(to_manifold(to_program(found.sequence, found.families)), to_manifold(program)) > 0.99999


def test_none_of_them_pays_alone():
    found = searched(PARTS["circle"][0], patterns=False)
    assert [len(step.term.halves) for step in found.sequence] == [1]


def test_what_does_not_repeat_is_left_out():
    loose = cut(PLATE, cylinder(0.6, 7, (-41, 3, 0)), cylinder(0.5, 7, (17, 21, 0)), cylinder(0.4, 7, (30, -13, 0)))
    assert [len(step.term.halves) for step in searched(loose).sequence] == [1]


def test_a_pattern_takes_the_place_of_slots_and_bars():
    """Of square pockets in a grid the slots across and along have the crossings in common, with fewer primitives than pockets."""
    across = union(*(box(100, 1.2, 20, (0, y, 0)) for y in (-18.0, -6.0, 6.0, 18.0)))
    along = union(*(box(1.2, 60, 20, (x, 0, 0)) for x in (-30.0, -18.0, -6.0, 6.0, 18.0, 30.0)))
    found = searched(cut(PLATE, common(across, along)))
    assert cost(found.sequence) == pytest.approx(2 + 2 * WAY)
    assert max(len(step.term.halves) for step in found.sequence) == 24


def test_repeats_are_found_among_parts():
    row = [cylinder(1, 5, (3.0 * i, 0.0, 0.0)) for i in range(4)]
    found = list(find_repeats([row[2], cylinder(2, 5), row[0], row[3], row[1], box(1, 2, 3), box(1, 2, 3, (9, 0, 0))], 1e-6))
    assert [(sorted(members), ways) for members, ways in found] == [([0, 2, 3, 4], 1), ([5, 6], 1)]


def test_copies_are_weighed_once():
    assert weigh_once(PARTS["grid"][0]) == pytest.approx(2 + 2 * WAY)
    assert weigh_once(PLATE) == 1
