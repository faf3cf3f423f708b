"""Named parameters in the texts: the same solid as before, and after an edit all that follows has moved. OpenSCAD itself is the judge."""

import math
import re
import shutil
import subprocess
from itertools import pairwise
from pathlib import Path

import pytest
import trimesh
from tests.drawn import BORED
from tests.planted import PARTS, box, cut, cylinder, union

from imdim.delivery.deliver import finish_flat
from imdim.export.openscad import to_openscad
from imdim.export.openscad_reader import read_openscad
from imdim.export.parameters import Parameters, parametrise
from imdim.export.script import to_script
from imdim.geometry.solid import mesh_to_manifold, to_manifold, volume_iou
from imdim.program.constraints import Constraint, Ref
from imdim.program.outline import Outline
from imdim.program.tree import Primitive, Program, leaves
from imdim.relations.discover import exact_relations

# A plate on the ground with a boss, four holes in the corners, a bore through the boss; cutters end where the plate and the boss end.
MOUNT = cut(
    union(box(80, 50, 6, (0, 0, 3)), cylinder(12, 14, (0, 0, 13))),
    *(cylinder(3, 6, (x, y, 3.0)) for x in (-30.0, 30.0) for y in (-15.0, 15.0)),
    cylinder(5, 20, (0, 0, 10)),
)
ROW = cut(box(90, 20, 8), *(cylinder(2, 8, (x, 3.0, 0.0)) for x in (-30.0, -10.0, 10.0, 30.0)))
FLANGE = cut(cylinder(40, 8), *(cylinder(3, 12, (30 * math.cos(a), 30 * math.sin(a), 0.0)) for a in [i * math.pi / 3 for i in range(6)]))


def parametrised(program: Program) -> tuple[Program, Parameters]:
    """As `deliver` has it: relations of the program, then overshoot and rounding."""
    found = exact_relations(program)
    delivered = finish_flat(found.program)
    return delivered, parametrise(found.program, found.constraints, delivered)


def mount(thickness: float = 6.0, hole: float = 3.0, boss: float = 14.0) -> Program:
    """MOUNT as a person would have edited it."""
    top = thickness + boss
    return cut(
        union(box(80, 50, thickness, (0, 0, thickness / 2)), cylinder(12, boss, (0, 0, thickness + boss / 2))),
        *(cylinder(hole, 2 * thickness, (x, y, thickness / 2)) for x in (-30.0, 30.0) for y in (-15.0, 15.0)),
        cylinder(5, 2 * top, (0, 0, top / 2)),
    )


@pytest.mark.parametrize("program", [*PARTS.values(), MOUNT, ROW, FLANGE], ids=[*PARTS, "mount", "row", "flange"])
def test_the_text_reads_back_as_the_delivered_numbers(program):
    delivered, parameters = parametrised(program)
    read = read_openscad(to_openscad(delivered, 48, parameters))
    largest = max(max(p.size) for p in leaves(delivered))
    for ours, theirs in zip(leaves(delivered), leaves(read), strict=True):
        assert (ours.kind, ours.rotation) == (theirs.kind, theirs.rotation)
        assert theirs.size == pytest.approx(ours.size, abs=2e-9 * largest)
        assert theirs.center == pytest.approx(ours.center, abs=2e-9 * largest)


def uses(parameters: Parameters, name: str) -> int:
    """How many numbers follow a name."""
    rows = (*parameters.sizes, *parameters.centers)
    return sum(any(term.name == name for term in expression.terms) for row in rows for expression in row)


def test_names_say_what_they_are():
    delivered, parameters = parametrised(MOUNT)
    assert parameters.values["plate_thickness"] == 6
    assert parameters.values["hole_diameter"] == 6
    assert uses(parameters, "hole_diameter") == 4
    text = to_openscad(delivered, 48, parameters)
    assert "hole_diameter = 6; // [3:0.1:12]" in text.splitlines()
    assert text.count("r = hole_diameter/2") == 4
    assert parametrised(ROW)[1].values["hole_spacing"] == 20
    assert parametrised(FLANGE)[1].values["bolt_circle"] == pytest.approx(60)


@pytest.mark.parametrize("edit", [{"plate_thickness": 9.0}, {"hole_diameter": 8.0}, {"plate_thickness": 20.0, "hole_diameter": 4.0}])
def test_an_edit_moves_all_that_follows(edit):
    delivered, parameters = parametrised(MOUNT)
    read = read_openscad(to_openscad(delivered, 64, parameters), edit)
    meant = mount(edit.get("plate_thickness", 6.0), edit.get("hole_diameter", 6.0) / 2)
    assert volume_iou(to_manifold(read, 64), to_manifold(meant, 64)) == pytest.approx(1, abs=1e-6)


def test_a_row_and_a_circle_stretch():
    delivered, parameters = parametrised(ROW)
    read = list(leaves(read_openscad(to_openscad(delivered, 48, parameters), {"hole_spacing": 22.0})))
    steps = [b.center[0] - a.center[0] for a, b in pairwise(read[1:])]
    assert steps == pytest.approx([22.0] * 3)
    delivered, parameters = parametrised(FLANGE)
    text = to_openscad(delivered, 48, parameters)
    assert "translate([bolt_circle/4, bolt_circle/2*cos(30), 0])" in text
    read = list(leaves(read_openscad(text, {"bolt_circle": 66.0})))
    assert [math.hypot(*p.center[:2]) for p in read[1:]] == pytest.approx([33.0] * 6)


def test_a_circle_is_placed_by_its_centre_even_where_that_is_a_later_hole():
    """On a plate whose middle is elsewhere: no hole is measured from another one on the circle."""
    angles = [math.radians(60 * i + 15) for i in range(6)]
    around = [cylinder(2.25, 8, (22 * math.cos(a), 22 * math.sin(a), 0.0)) for a in angles]
    delivered, parameters = parametrised(cut(box(95, 76, 8, (2.0, 3.0, 0.0)), *around, cylinder(12, 8)))
    text = to_openscad(delivered, 48, parameters)
    assert "bolt_circle*" not in text
    assert text.count("bolt_circle/2*cos(") == 12
    read = list(leaves(read_openscad(text, {"bolt_circle": 50.0})))
    assert [math.hypot(*p.center[:2]) for p in read[1:7]] == pytest.approx([25.0] * 6)
    assert read[7].center[:2] == (0.0, 0.0)


def test_a_name_that_is_not_there_is_refused():
    delivered, parameters = parametrised(MOUNT)
    with pytest.raises(ValueError, match="no parameter 'holes'; it has plate_length"):
        read_openscad(to_openscad(delivered, 48, parameters), {"holes": 1.0})


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("a = b;\nsphere(r = a);", "line 1: 'b' is no number of ours"),
        ("a = 0;\nsphere(r = 1/a);", "line 2 divides by zero"),
        ("a = -1;\nsphere(r = a);", "line 2: sphere needs positive r, got -1"),
        ("a = __import__('os');\nsphere(r = 1);", "line 1: .* is no number of ours"),
    ],
)
def test_other_expressions_are_refused(line, message):
    with pytest.raises(ValueError, match=message):
        read_openscad(line)


def test_without_constraints_every_size_has_a_name_and_cuts_go_through_what_they_enter():
    delivered = finish_flat(MOUNT)
    parameters = parametrise(MOUNT, [], delivered)
    holes = {"bore_diameter", *(f"hole{n}_diameter" for n in ("", 2, 3, 4))}
    edges = {"hole": ("left", "front"), "hole2": ("left", "back"), "hole3": ("right", "front"), "hole4": ("right", "back")}
    places = {f"{hole}_from_{edge}" for hole, both in edges.items() for edge in both}
    sizes = {"plate_length", "plate_width", "plate_thickness", "boss_diameter", "boss_height"}
    assert set(parameters.values) == sizes | holes | places
    assert parameters.values["hole_from_left"] == parameters.values["hole4_from_right"] == 10, "the nearest edge"
    assert list(leaves(read_openscad(to_openscad(delivered, 48, parameters)))) == list(leaves(delivered))


def hub(height: float) -> Program:
    """A turned part on a plate, with a bore through both that widens at the top."""
    half = height / 2
    ring = ((0.0, -half, 0.0), (24.0, -half, 0.0), (18.0, 12.0 - half, 0.0), (18.0, half, 0.0), (0.0, half, 0.0))
    turned = Primitive("revolve", (360.0,), (0.0, 0.0, 8.0 + half), outline=Outline((ring,)))
    mouth = Primitive("cone", (10.0, 13.5, 7.0), (0.0, 0.0, height + 4.5))
    return cut(union(box(80, 50, 8, (0.0, 0.0, 4.0)), turned), cylinder(10.0, height + 8.0, (0.0, 0.0, height / 2 + 4.0)), mouth)


def test_what_enters_a_turned_part_follows_its_end():
    delivered = finish_flat(hub(28.0))
    text = to_openscad(delivered, 64, parametrise(hub(28.0), [], delivered))
    read = read_openscad(text, {"turned_part_height": 40.0})
    assert volume_iou(to_manifold(read, 64), to_manifold(hub(40.0), 64)) == pytest.approx(1, abs=1e-6)


def test_a_relation_of_hidden_depths_names_them_too():
    program = cut(box(30, 30, 10), cylinder(3, 6, (-8, 0, 4)), cylinder(4, 6, (8, 0, 4)))
    equal = Constraint("equal", (Ref(1, "h"), Ref(2, "h")), name="hole_depth")
    parameters = parametrise(program, [equal], finish_flat(program))
    assert parameters.values["hole_depth"] == 4, "what is seen: the two above the plate are how it is cut"
    assert uses(parameters, "hole_depth") >= 2


def rendered(text: str, folder: Path, *define: str) -> trimesh.Trimesh:
    tool = shutil.which("openscad")
    if tool is None:
        pytest.skip("openscad is not installed")
    (folder / "program.scad").write_text(text)
    options = [f"-D{d}" for d in define]
    command = [tool, "-o", str(folder / "program.stl"), *options, str(folder / "program.scad")]
    report = subprocess.run(command, check=True, capture_output=True, timeout=120, text=True).stderr
    assert re.search(r"Simple: +yes", report), report
    assert "WARNING" not in report
    return trimesh.load_mesh(folder / "program.stl")


@pytest.mark.tool
@pytest.mark.parametrize("program", [MOUNT, FLANGE, PARTS["L bracket"]], ids=["mount", "flange", "bracket"])
def test_openscad_renders_the_same_solid_with_names(program, tmp_path):
    delivered, parameters = parametrised(program)
    named = mesh_to_manifold(rendered(to_openscad(delivered, 48, parameters), tmp_path))
    plain = mesh_to_manifold(rendered(to_openscad(delivered, 48), tmp_path))
    assert volume_iou(named, plain) == pytest.approx(1, abs=1e-6)


@pytest.mark.tool
def test_openscad_moves_all_followers(tmp_path):
    """Four holes grow together; a thicker plate lifts the boss, and cutters still go through."""
    delivered, parameters = parametrised(MOUNT)
    text = to_openscad(delivered, 64, parameters)
    wide = mesh_to_manifold(rendered(text, tmp_path, "hole_diameter=8"))
    assert volume_iou(wide, to_manifold(mount(hole=4.0), 64)) == pytest.approx(1, abs=1e-5)
    thick = mesh_to_manifold(rendered(text, tmp_path, "plate_thickness=15"))
    assert volume_iou(thick, to_manifold(mount(thickness=15.0), 64)) == pytest.approx(1, abs=1e-5)
    # five holes through: no cutter ends inside
    assert thick.genus() == 5


@pytest.mark.parametrize("program", [MOUNT, FLANGE], ids=["mount", "flange"])
def test_the_script_has_the_same_names_and_numbers(program):
    """Evaluated by Python itself, statement by statement, with stand-ins that record sizes and places."""
    delivered, parameters = parametrised(program)
    text = to_script(delivered, parameters)
    seen: list[tuple[float, ...]] = []

    class Part:
        def __mul__(self, other):
            return self

        __add__ = __sub__ = __rmul__ = __mul__

    class Hole:
        def __init__(self, radius: float, depth: float) -> None:
            self.radius, self.depth = radius, depth

    class Place:
        def __init__(self, x: float, y: float, z: float) -> None:
            self.at = x, y, z
            seen.append(self.at)

        def __mul__(self, other):
            if isinstance(other, Hole):
                holes.append((other.radius, *self.at[:2], self.at[2] - other.depth))
            return Part()

    def recorded(*numbers: float) -> Part:
        seen.append(numbers)
        return Part()

    holes: list[tuple[float, ...]] = []
    scope = {"__name__": "program", "Box": recorded, "Cylinder": recorded, "Pos": Place, "Hole": Hole}
    code = "\n".join(line for line in text.splitlines() if not line.startswith("from build123d"))
    exec(compile(code, "program.py", "exec"), scope)

    def is_hole(p: Primitive) -> bool:
        bottom = (p.size[0], *p.center[:2], p.center[2] - p.size[-1] / 2)
        return p.kind == "cylinder" and any(hole == pytest.approx(bottom, abs=1e-7) for hole in holes)

    rest = [p for p in leaves(delivered) if not is_hole(p)]
    assert len(rest) == len(list(leaves(delivered))) - len(holes) < len(list(leaves(delivered)))
    for numbers in (*(p.size for p in rest), *(p.center for p in rest if any(p.center))):
        assert any(len(s) == len(numbers) and s == pytest.approx(numbers, abs=1e-7) for s in seen)
    assert all(scope[name] == pytest.approx(value) for name, value in parameters.values.items())


def test_coordinates_of_outlines_that_no_name_moves_are_free():
    bored, slotted = Parameters.none(BORED), Parameters.none(cut(BORED, box(1.0, 1.0, 1.0)))
    assert bored.free_numbers(40.0) == slotted.free_numbers(40.0) == [24]  # of eight corners and two holes, which are two arcs each
    assert parametrise(BORED, (), BORED).free_numbers(40.0) == [0]
    assert Parameters.none(box(1.0, 1.0, 1.0)).free_numbers(40.0) == []


def test_the_point_of_a_cone_has_no_name():
    sunk = cut(box(40, 40, 10), Primitive("cone", (0.0, 8.0, 8.0), (0.0, 0.0, 4.0)))
    delivered, parameters = parametrised(sunk)
    assert all(parameters.values.values())
    assert read_openscad(to_openscad(delivered, 48, parameters)) == delivered


def test_cuts_that_end_at_one_level_have_a_depth():
    """And not a height that says how far they stand out."""
    program = cut(box(80, 40, 30, (0, 0, 15)), *(box(14, 14, 20, (x, 0, 21)) for x in (-20.0, 20.0)))
    level = Constraint("coplanar", (Ref(1, "-z"), Ref(2, "-z")), name="level")
    assert parametrise(program, (level,), program).values["pocket_depth"] == 19.0


def test_no_word_is_said_twice() -> None:
    plate = Primitive("box", (60.0, 60.0, 6.0), (0.0, 0.0, 3.0))
    rim = Primitive("torus", (20.0, 4.0), (0.0, 0.0, 6.0))
    program = union(plate, rim)
    values = parametrise(program, (), program).values
    assert {"ring_radius": 20.0, "ring_tube_radius": 4.0}.items() <= values.items()
