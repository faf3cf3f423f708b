import re
import shutil
import subprocess

import pytest
import trimesh
from tests.export.coincident import MEANT
from tests.known_programs import KNOWN

from imdim.export.numbers import plain, round_program
from imdim.export.openscad import to_openscad
from imdim.export.openscad_reader import read_openscad
from imdim.geometry.finish.overshoot import overshoot
from imdim.geometry.solid import mesh_to_manifold, to_manifold, volume
from imdim.program.tree import Combine, Primitive, leaves

SOLIDS = {name: known for name, known in KNOWN.items() if name != "nothing"}
ONE_LINE = (
    r"(  )*(translate\(\[[^\]]+\]\) )?(rotate\(\[[^\]]+\]\) )?(scale\(\[[^\]]+\]\) |rotate_extrude\(\) translate\(\[[^\]]+\]\) )?\w+\(.*\);"
)


@pytest.mark.parametrize("name", KNOWN)
def test_what_is_written_reads_back(name):
    program, exact = KNOWN[name]
    read = read_openscad(to_openscad(program))
    assert list(leaves(read)) == list(leaves(round_program(program)))
    assert volume(read, 256) == pytest.approx(exact, rel=1e-3, abs=1e-9)


@pytest.mark.parametrize("name", KNOWN)
def test_the_text_is_flat(name):
    program, _ = KNOWN[name]
    lines = to_openscad(program).splitlines()
    shapes = [line for line in lines[2:] if not re.fullmatch(r"(  )*((union|difference|intersection)\(\) {|})", line)]
    assert lines[:2] == ["$fn = 96;", ""]
    assert len(shapes) == sum(1 for _ in leaves(program))
    assert all(re.fullmatch(ONE_LINE, line) for line in shapes)


def test_chains_are_one_block():
    ball = Primitive("sphere", (1.0,))
    text = to_openscad(Combine("difference", Combine("difference", Combine("union", Combine("union", ball, ball), ball), ball), ball))
    assert [line for line in text.splitlines() if "{" in line] == ["difference() {", "  union() {"]


def test_numbers_are_trimmed_to_the_size_of_the_model():
    leaf = Primitive("box", (30.000000000000004, 0.1 + 0.2, 1e-3 / 3), (-1e-17, 1e6 + 1 / 3, 2.0), (89.99999999999999, 0.0, -1e-14))
    shape = "translate([0, 1000000.3333333, 2]) rotate([90, 0, 0]) cube([30, 0.3, 0.0003333], center = true);"
    assert to_openscad(leaf).splitlines()[2] == shape
    tiny = Primitive("sphere", (1.23456789123e-6,))
    assert to_openscad(tiny).splitlines()[2] == "sphere(r = 1.23456789e-06);"
    assert [plain(v) for v in (0.0, -0.0, 5.0, -2.5, 1e-7)] == ["0", "0", "5", "-2.5", "1e-07"]


def test_a_size_never_vanishes():
    sliver = Primitive("box", (1.0, 1.0, 1e-14))
    assert list(leaves(read_openscad(to_openscad(sliver)))) == [sliver]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("cube([1, 1, 1]);", "line 1 is no primitive of ours"),
        ("$fn = 96;\n\nhull() {\n", "line 3 is not flat OpenSCAD"),
        ("union() {\nsphere(r = 1);\n", "1 open blocks"),
        ("$fn = 96;\n", "0 solids"),
    ],
)
def test_other_openscad_is_refused(text, message):
    with pytest.raises(ValueError, match=message):
        read_openscad(text)


def drawn(text: str, folder) -> tuple[trimesh.Trimesh, str]:
    """What OpenSCAD makes of a text, and what it says."""
    tool = shutil.which("openscad")
    if tool is None:
        pytest.skip("openscad is not installed")
    (folder / "program.scad").write_text(text)
    command = [tool, "-o", folder / "program.stl", folder / "program.scad"]
    report = subprocess.run(command, check=True, capture_output=True, timeout=120, text=True).stderr
    return trimesh.load_mesh(folder / "program.stl"), report


def rendered(text: str, folder) -> trimesh.Trimesh:
    mesh, report = drawn(text, folder)
    # OpenSCAD's word for a closed solid whose parts do not only touch, which it has for what it had to unite or cut
    assert re.search(r"Simple: +yes", report), report
    return mesh


@pytest.mark.tool
@pytest.mark.parametrize("name", ["bracket", "two bores that meet", "core", "tilted"])
def test_openscad_renders_no_skin(name, tmp_path):
    program, exact, holes = MEANT[name]
    mesh = rendered(to_openscad(overshoot(program), 48), tmp_path)
    assert mesh.is_watertight
    assert mesh.euler_number == 2 * mesh.body_count - 2 * holes
    assert mesh.volume == pytest.approx(exact, rel=2e-3)


@pytest.mark.tool
def test_openscad_sees_every_primitive_as_we_do(tmp_path):
    """One at a time: together it takes OpenSCAD ten seconds to unite them."""
    shared = theirs = whole = 0.0
    for i, leaf in enumerate(_one_of_each()):
        apart = Primitive(leaf.kind, leaf.size, (2.0 * i, 0.3, -0.2), leaf.rotation)
        solid, ours = mesh_to_manifold(drawn(to_openscad(apart, 48), tmp_path)[0]), to_manifold(apart, 48)
        assert len(solid.decompose()) == 1
        shared, theirs, whole = shared + (solid ^ ours).volume(), theirs + solid.volume(), whole + ours.volume()
    # both inscribe, but place the vertices of a sphere differently
    assert shared == pytest.approx(whole, rel=6e-3)
    assert theirs == pytest.approx(whole, rel=2e-3)


def _one_of_each() -> list[Primitive]:
    known = ("box", "sphere", "cylinder", "frustum", "pointed cone", "torus", "ellipsoid")
    return [next(leaves(KNOWN[name][0])) for name in known]
