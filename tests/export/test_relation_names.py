"""Relations have the names that sizes and features have in all files."""

from tests.planted import box, cut, cylinder, union

from imdim.delivery.finish import finish
from imdim.export.parameters import parametrise
from imdim.export.relation_names import name_relations
from imdim.program.constraints import Constraint, Ref
from imdim.program.tree import Primitive
from imdim.reconstruction.fitting import relations_of

PLATE = box(80, 50, 6, (0, 0, 3))
RIBS = [box(3, 20, 12, (x, y, 9)) for x, y in ((-30, 5), (20, -8))]
HOLES = [cylinder(1.7, 20, place) for place in ((-10, 12, 0), (7, -3, 0))]
PART = cut(union(PLATE, *RIBS), *HOLES)


def test_equal_sizes_have_the_name_of_the_size():
    found = finish(*relations_of(PART))
    names = {c.name for c in found.constraints if c.kind == "equal"}
    assert {"rib_thickness", "rib_length", "m3_hole_diameter"} <= names
    assert not any("block" in c.name or "radius" in c.name for c in found.constraints)


def test_other_relations_speak_of_the_labels_of_features():
    level = Constraint("coplanar", (Ref(1, "-z"), Ref(0, "-z")), value=0.0)
    named = parametrise(PART, [level], PART)
    assert [c.name for c in name_relations([level], PART, named)] == ["rib_plate_flush"]


def test_a_countersink_that_stands_out_has_the_name_of_its_diameter():
    sinks = [Primitive("cone", (1.7, 3.7, 2.0), place) for place in ((-10.0, 12.0, 5.0), (7.0, -3.0, 5.0))]
    found = finish(*relations_of(cut(PART, *sinks)))
    names = {c.name for c in found.constraints if c.kind == "equal" and "r_top" in str(c.of)}
    assert names == {"countersink_diameter"}
