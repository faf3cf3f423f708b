"""Names of a part that is turned as a whole, along its own directions."""

import math

import numpy as np
import pytest
from tests.planted import box, cut, cylinder, union

from imdim.export.delivered import texts_of
from imdim.export.edit import change_values, open_delivered
from imdim.export.own_directions import find_own_directions
from imdim.export.parameters import parametrise
from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.program.codec import dumps, parse
from imdim.program.motions import Motion, move_program
from imdim.program.patterns.detect import fold_repeats
from imdim.program.tree import Program
from imdim.target.target import as_matrix

TURNS = [(0.0, 0.0, 27.0), (0.0, 25.0, 0.0), (20.0, 30.0, 40.0)]


def clamp() -> Program:
    """A plate with a block on its end, a hole through the block, and a row of three through the plate."""
    plate, block = box(30.0, 20.0, 4.0, (0.0, 0.0, 2.0)), box(6.0, 20.0, 16.0, (12.0, 0.0, 8.0))
    row = [cylinder(1.5, 6.0, (x, 0.0, 2.0)) for x in (-10.0, -4.0, 2.0)]
    return cut(union(plate, block), cylinder(2.5, 8.0, (12.0, 0.0, 11.0), (0.0, 90.0, 0.0)), *row)


def turned(program: Program, turn: tuple[float, float, float]) -> Program:
    return move_program(program, Motion(as_matrix(matrix_from_euler(turn)), (0.0, 0.0, 0.0)))


def edit(program: Program, name: str, value: float) -> Program:
    return change_values(open_delivered(parse(dumps(program)), {}), {name: value}).program


@pytest.mark.parametrize("turn", TURNS)
def test_a_turned_part_has_the_names_that_it_has_otherwise(turn: tuple[float, float, float]) -> None:
    straight, aslant = clamp(), turned(clamp(), turn)
    named, known = parametrise(aslant, (), aslant), parametrise(straight, (), straight)
    assert named.values == pytest.approx(known.values)
    text, other = (texts_of(p, n, None, 48)["program.scad"].splitlines() for p, n in ((aslant, named), (straight, known)))
    written = [line.removeprefix("  ") for line in text]
    assert f"rotate([{', '.join(f'{a:g}' for a in turn)}]) {{" in text
    assert [line for line in other if "translate" in line] == [line for line in written if "translate" in line]


@pytest.mark.parametrize("turn", TURNS)
def test_an_edit_does_what_it_does_to_the_part_as_it_was_drawn(turn: tuple[float, float, float]) -> None:
    aslant = turned(clamp(), turn)
    for name in parametrise(clamp(), (), clamp()).values:
        value = 1.1 * parametrise(clamp(), (), clamp()).values[name]
        wanted = turned(edit(clamp(), name, value), turn)
        assert volume_iou(to_manifold(edit(aslant, name, value)), to_manifold(wanted)) == pytest.approx(1, abs=1e-6), name


def test_loops_step_along_the_own_directions() -> None:
    aslant = turned(clamp(), TURNS[0])
    folding = fold_repeats(aslant)
    assert folding is not None
    named = parametrise(folding.program, (), folding.program, folding.folded)
    text = texts_of(folding.program, named, folding.folded, 48)["program.loops.scad"]
    assert "translate([hole_spacing*i, 0, 0])" in text.replace("hole2_spacing", "hole_spacing")
    step = named.loops[0].steps[0]
    (spacing,) = {term.name for e in step for term in e.terms}
    along = [sum(float(t.coefficient) for t in e.terms) for e in step]
    assert along == pytest.approx([math.cos(math.radians(27)), math.sin(math.radians(27)), 0])
    assert named.values[spacing] == pytest.approx(6.0)


def test_a_part_with_something_aslant_on_it_has_the_directions_of_the_world() -> None:
    body = union(box(40.0, 30.0, 4.0), box(6.0, 12.0, 20.0, (0.0, 0.0, 10.0), (0.0, 0.0, 27.0)))
    assert find_own_directions(body) is None
    assert find_own_directions(box(40.0, 30.0, 4.0)) is None
    own = find_own_directions(turned(clamp(), TURNS[0]))
    assert own is not None
    assert np.array(own.turn) == pytest.approx(matrix_from_euler(TURNS[0]))
