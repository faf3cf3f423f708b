"""Untied names: one feature changes alone, the others stay as they were, in every text."""

import math
import re
from itertools import pairwise

import pytest
from tests.export.test_parameters import MOUNT, ROW
from tests.planted import box, cut, cylinder, union

from imdim.delivery.finish import finish
from imdim.export.delivered import Delivered, EditError, list_tied_sizes
from imdim.export.edit import change_values, open_delivered, solid_of
from imdim.export.untie import list_ties, new_names, untie
from imdim.program.codec import dumps, parse
from imdim.program.constraints import Constraint, Ref
from imdim.program.tree import Program, leaves
from imdim.relations.discover import exact_relations

# Two blocks between the same two planes.
BLOCKS = union(box(20, 20, 10, (0, 0, 5)), box(10, 10, 10, (20, 0, 5)), box(10, 12, 10, (-20, 0, 5)))
CIRCLE = cut(cylinder(40, 8), *(cylinder(3, 12, (30 * math.cos(a), 30 * math.sin(a), 0.0)) for a in [i * math.pi / 3 for i in range(6)]))


def delivered_of(program: Program) -> Delivered:
    """With its repeats and relations, as a fit delivers it."""
    found = exact_relations(program)
    done = finish(found.program, found.constraints)
    return open_delivered(parse(dumps(done.program, None, done.constraints, done.folded)), {})


def name_of(delivered: Delivered, feature: tuple[int, str]) -> str:
    return next(name for name, sizes in list_tied_sizes(delivered).items() if feature in sizes)


@pytest.mark.parametrize(("program", "holes"), [(MOUNT, 4), (ROW, 4), (CIRCLE, 6)], ids=["mount", "row", "circle"])
def test_each_hole_gets_a_diameter_of_its_own(program, holes):
    before = delivered_of(program)
    name = max(list_ties(before), key=lambda n: len(list_ties(before)[n]) * ("diameter" in n))
    members = [leaf for leaf, _ in list_tied_sizes(before)[name]]
    assert len(members) == holes
    after = untie(before, name)
    own = [name_of(after, (leaf, "r")) for leaf in members]
    assert len(set(own)) == holes
    assert [p.size for p in leaves(after.program)] == [p.size for p in leaves(before.program)]
    assert solid_of(after).volume() == pytest.approx(solid_of(before).volume(), rel=1e-12)
    wider = change_values(after, {own[1]: after.values[own[1]] * 1.5})
    changed = [i for i, (p, q) in enumerate(zip(leaves(wider.program), leaves(after.program), strict=True)) if p.size != q.size]
    assert changed == [members[1]]
    again = open_delivered(parse(dumps(after.program, after.meta, after.constraints, after.folded)), after.texts)
    assert again.values == after.values
    assert all(re.search(rf"^{own[1]} = ", text, re.MULTILINE) for text in after.texts.values())


def test_some_primitives_are_parted_from_the_others():
    before = delivered_of(MOUNT)
    name = next(n for n in list_ties(before) if n == "hole_diameter")
    members = [leaf for leaf, _ in list_tied_sizes(before)[name]]
    after = untie(before, name, members[2:])
    assert name_of(after, (members[0], "r")) == name_of(after, (members[1], "r"))
    assert name_of(after, (members[2], "r")) == name_of(after, (members[3], "r")) != name_of(after, (members[0], "r"))
    assert new_names(before, after)[name] == {
        name_of(after, (members[0], "r")): members[:2],
        name_of(after, (members[2], "r")): members[2:],
    }


def test_a_row_that_is_written_out_keeps_its_spacing():
    before = delivered_of(ROW)
    assert before.folded is not None
    after = untie(before, "hole_diameter")
    assert after.folded is None
    spacing = next(name for name in after.values if name.endswith("spacing"))
    moved = change_values(after, {spacing: 17.0})
    places = sorted(p.center[0] for p in list(leaves(moved.program))[1:])
    assert [b - a for a, b in pairwise(places)] == pytest.approx([17.0] * 3)


def test_heights_between_two_planes_are_untied():
    planes = [Constraint("coplanar", (Ref(0, side), Ref(leaf, side))) for leaf in (1, 2) for side in ("-z", "+z")]
    before = open_delivered(parse(dumps(BLOCKS, None, planes)), {})
    name = next(n for n, sizes in list_ties(before).items() if len([f for _, f in sizes if f == "sz"]) == 3)
    after = untie(before, name, [2])
    higher = change_values(after, {name_of(after, (2, "sz")): 15.0})
    assert [p.size[2] for p in leaves(higher.program)] == [10.0, 10.0, 15.0]
    assert [p.center[2] - p.size[2] / 2 for p in leaves(higher.program)] == [0.0, 0.0, 0.0], "all stand where they stood"


@pytest.mark.parametrize(
    ("name", "apart", "message"),
    [
        ("hole_diametr", None, "no parameter"),
        ("plate_thickness", None, "nothing to untie"),
        ("hole_diameter", [0], "is no size of #0; it is one of hole"),
        ("hole_diameter", "all", "tied as they were"),
    ],
)
def test_what_is_not_tied_is_refused(name, apart, message):
    before = delivered_of(MOUNT)
    everything = [leaf for leaf, _ in list_tied_sizes(before)["hole_diameter"]]
    with pytest.raises(EditError, match=message):
        untie(before, name, everything if apart == "all" else apart)
