"""Edge features in the scripts, run by build123d and CadQuery themselves, against volumes in closed form and edited programs."""

import math
import subprocess
from dataclasses import replace

import pytest
from scipy.integrate import quad
from tests.export.blended import BOX, CASES, PLATE, RIM, box_area, chamfer, fillet, rim
from tests.export.test_outlines import interpreter

from imdim.delivery.finish import FinishedProgram, finish
from imdim.export.blend_texts import FACES, WALLS
from imdim.export.cadquery import to_cadquery
from imdim.export.delivered import texts_of
from imdim.export.edit import change_values, open_delivered
from imdim.export.script import CURVES, RINGS, standard_imports, to_script
from imdim.geometry.edge_solids import solid_with_edges
from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.solid import to_manifold
from imdim.program.codec import to_json
from imdim.program.edges import EdgeFeature, Face, name_edges
from imdim.program.outline import Outline, arc_center, arc_middle, arc_radius, loop_curves
from imdim.program.tree import Combine, Primitive, leaves
from imdim.reconstruction.fitting import relations_of

WRITERS = {"build123d": to_script, "cadquery": to_cadquery}
MEASURE = {"build123d": "\nprint(part.volume)\n", "cadquery": "\nprint(sum(solid.Volume() for solid in part.solids().vals()))\n"}
PACKAGES = pytest.mark.parametrize("package", WRITERS)

# a plate with round corners, a boss with a hole through both
STAND = Combine(
    "difference",
    Combine(
        "union", Primitive("extrude", (5.0,), (0.0, 0.0, 2.5), outline=PLATE.outline), Primitive("cylinder", (4.0, 8.0), (0.0, 0.0, 9.0))
    ),
    Primitive("cylinder", (2.0, 15.0), (0.0, 0.0, 6.0)),
)
STAND_EDGES = [
    chamfer((0.5,), rim(8)),
    fillet(1.0, ((Face(0, "+z"), Face(1, "side")),)),
    chamfer((0.4, 0.8), ((Face(2, "side"), Face(1, "+z")),)),
]


def run(text: str, package: str, folder) -> tuple[float, str]:
    """The volume that the script says, and what else it says."""
    (folder / "program.py").write_text(text + MEASURE[package])
    command = [interpreter(package), "program.py"]
    *said, volume = subprocess.run(command, check=True, cwd=folder, timeout=120, capture_output=True, text=True).stdout.splitlines()
    return float(volume), "\n".join(said)


@pytest.mark.tool
@PACKAGES
@pytest.mark.parametrize("name", CASES)
def test_scripts_blend_the_edges(name, package, tmp_path):
    program, edges, exact, _ = CASES[name]
    if math.isnan(exact):
        pytest.skip("needs the features in another order")
    volume, said = run(WRITERS[package](program, edges=edges), package, tmp_path)
    assert not said
    assert volume == pytest.approx(exact, rel=1e-6)


def test_what_booleans_leave_is_mended_before_its_edges_are_picked():
    """CadQuery refuses each blend of a shape that is not valid to begin with; blends of its results are picked anew."""
    lines = to_cadquery(BOX, edges=[fillet(2.0, RIM[:1]), chamfer((1.0,), RIM[1:2])]).splitlines()
    mended = lines.index("part = cq.Workplane(part.val().fix())")
    assert [i > mended for i, line in enumerate(lines) if line.startswith("part = blended(")] == [True, True]
    assert "fix()" not in to_cadquery(BOX)


@pytest.mark.tool
@PACKAGES
def test_what_cannot_be_blended_stays_sharp_and_is_told(package, tmp_path):
    """The rest of its feature is blended one by one."""
    edges = [fillet(2.0, RIM[:1]), fillet(25.0, RIM[1:2])]
    volume, said = run(WRITERS[package](BOX, edges=edges), package, tmp_path)
    assert volume == pytest.approx(6000 - 20 * (4 - math.pi), rel=1e-9)
    assert said.startswith("fillet_edges leaves the edge at [-5.0, 0.0, 15.0] sharp: ")
    assert said.count("sharp") == 1


@pytest.mark.tool
@PACKAGES
def test_edges_that_others_shorten_are_still_found(package, tmp_path):
    """Where not all can be blended at once, each bevel moves the middles of the edges beside it."""
    knob = Combine("union", BOX, Primitive("box", (2.0, 2.0, 2.0), (0.0, 0.0, 16.0)))
    edges = [chamfer((2.5,), (*RIM, (Face(1, "+z"), Face(1, "+x"))))]
    volume, said = run(WRITERS[package](knob, edges=edges), package, tmp_path)
    assert volume == pytest.approx(27.5 * 200 + quad(lambda t: box_area(2.5 - t), 0, 2.5)[0] + 8, rel=1e-9)
    assert said.startswith("chamfer_edges leaves the edge at [1.0, 0.0, 17.0] sharp: ")
    assert said.count("sharp") == 1


@pytest.mark.tool
@PACKAGES
def test_one_wall_of_many_that_has_no_edge_is_told(package, tmp_path):
    """A part on the plate hides the edge of one of its eight walls."""
    bar = Primitive("box", (2.0, 30.0, 5.0), (10.0, 0.0, 2.5))
    volume, said = run(WRITERS[package](Combine("union", PLATE, bar), edges=[chamfer((0.5,), rim(8))]), package, tmp_path)
    assert said == "chamfer_edges finds no edge between 1 of 8 pairs of faces"
    assert volume < to_manifold(Combine("union", PLATE, bar)).volume() - 0.1


@pytest.fixture(scope="module")
def stand() -> FinishedProgram:
    return finish(*relations_of(STAND))


@pytest.mark.tool
@PACKAGES
@pytest.mark.parametrize(
    "values",
    [
        {},
        {"plate_thickness": 7.5},
        {"plate_corner_radius": 4.0, "plate_length": 26.0},
        {"boss_diameter": 11.0, "boss_height": 3.0},
        {"bore_diameter": 3.0},
    ],
)
def test_blends_follow_the_names(package, values, stand, tmp_path):
    text = WRITERS[package](stand.program, stand.parameters, stand.folded, STAND_EDGES)
    for name, value in values.items():
        line = f"\n{name} = {stand.parameters.values[name]:g}\n"
        assert line in text
        text = text.replace(line, f"\n{name} = {value:g}\n")
    document = to_json(stand.program, None, stand.constraints)
    delivered = open_delivered(document, texts_of(stand.program, stand.parameters, stand.folded, 64))
    edited = change_values(delivered, values).program if values else stand.program
    volume, said = run(text, package, tmp_path)
    assert not said
    sharp, blended = to_manifold(edited, 256).volume(), solid_with_edges(edited, STAND_EDGES, 256).volume()
    assert volume == pytest.approx(blended, rel=1e-3)
    alone, _ = run(text[: text.index("part = blended(")], package, tmp_path)
    assert volume - alone == pytest.approx(blended - sharp, rel=0.02)


@pytest.mark.tool
@PACKAGES
def test_sizes_are_changed_at_the_head(package, tmp_path):
    text = WRITERS[package](BOX, edges=[replace(fillet(2.0, RIM[:1]), name="edge")])
    volume, _ = run(text.replace("edge_radius = 2\n", "edge_radius = 3\n"), package, tmp_path)
    assert volume == pytest.approx(6000 - 20 * 9 * (1 - math.pi / 4), rel=1e-9)


# --- the texts themselves


@pytest.mark.tool
@PACKAGES
def test_faces_that_no_longer_meet_are_told(package, tmp_path):
    apart = EdgeFeature("chamfer", (1.0,), ((Face(0, "+z"), Face(0, "-z")), *RIM))
    _, said = run(WRITERS[package](BOX, edges=[apart]), package, tmp_path)
    assert "chamfer_edges finds no edge between 1 of" in said


@PACKAGES
def test_a_script_without_edges_says_nothing_of_them(package):
    assert WRITERS[package](PLATE, edges=[]) == WRITERS[package](PLATE)
    assert "blended" not in WRITERS[package](PLATE)


@PACKAGES
def test_a_script_with_edges_is_python(package):
    for program, edges, *_ in CASES.values():
        compile(WRITERS[package](program, edges=edges), "program.py", "exec")


def test_sizes_have_names_at_the_head():
    features = [fillet(2.0, RIM[:1]), chamfer((1.0, 3.0), RIM[1:2]), fillet(1.0, RIM[2:3])]
    head = "fillet_radius = 2\nchamfer_distance = 1\nchamfer_second = 3\nfillet2_radius = 1\n\n"
    text = to_script(BOX, edges=features)
    assert text.count(head) == 1
    # once, where they are among the others
    named = finish(*relations_of(BOX), edges=name_edges(features))
    text = to_script(named.program, named.parameters, named.folded, named.edges)
    assert text.count("fillet_radius = ") == text.count("chamfer_second = ") == 1


def test_faces_without_edges_are_left_out():
    ball = Combine("union", BOX, Primitive("sphere", (6.0,)))
    text = to_script(ball, edges=[fillet(1.0, (*RIM[:1], (Face(0, "+x"), Face(1, "side"))))])
    assert text.count("    (flat_face(") == 1


def scope(*texts: str) -> dict:
    out: dict = {}
    exec(standard_imports([RINGS, CURVES, FACES]) + RINGS + CURVES + "".join(texts), out)
    return out


def test_walls_are_far_from_what_lies_beyond_their_ends():
    loop = ((-2.0, 0.0, 0.0), (2.0, 0.0, 0.5), (0.0, 3.0, -0.4), (-3.0, 2.0, 0.0))
    wall = scope(FACES, WALLS)["wall_face"]
    written = [list(v) if v[2] else list(v[:2]) for v in loop]
    for k, curve in enumerate(loop_curves(loop)):
        far = wall((0, 0, 0), written, k, height=2)
        x, y = arc_middle(curve)
        assert far((x, y, 0.9)) == pytest.approx(0, abs=1e-9)
        assert far((x, y, 1.5)) == pytest.approx(0.5)
        assert far((*curve[:2], 0)) == pytest.approx(0, abs=1e-9)
        ends = [curve[:2], curve[2:4]]
        if curve[4]:
            # across the centre, where the circle goes on and the arc does not
            (cx, cy), radius = arc_center(curve), arc_radius(curve)
            across = (2 * cx - x, 2 * cy - y)
            assert far((*across, 0)) == pytest.approx(min(math.dist(across, end) for end in ends))
            assert far((cx + 1.25 * (x - cx), cy + 1.25 * (y - cy), 0)) == pytest.approx(radius / 4)
        else:
            beyond = [2 * e - m for e, m in zip(ends[1], (x, y), strict=True)]
            assert far((*beyond, 0)) == pytest.approx(math.dist(ends[0], ends[1]) / 2)


def test_faces_are_where_the_primitive_stands():
    turn, center = (20.0, -35.0, 50.0), (3.0, -2.0, 1.0)
    frame = matrix_from_euler(turn)

    def placed(*local):
        return tuple(float(c) for c in frame @ local + center)

    faces = scope(FACES)
    top = faces["flat_face"](center, "z", 5, reach=(1, 2, 5), turn=turn)
    assert top(placed(0.5, 1.5, 5.25)) == pytest.approx(0.25)
    assert top(placed(0.5, 2.5, 5.0)) == pytest.approx(0.5)
    assert faces["flat_face"](center, "x", -1, turn=turn)(placed(-1, 100, 100)) == pytest.approx(0)
    assert faces["round_face"](center, 4, turn=turn)(placed(0, 3, 77)) == pytest.approx(1)
    cone = faces["round_face"](center, 1, 3, 2, turn=turn)
    assert cone(placed(2, 0, 0)) == pytest.approx(0, abs=1e-12)
    assert cone(placed(0, 3, 1)) == pytest.approx(0, abs=1e-12)


def test_sides_of_a_regular_polygon_are_found_where_they_are_written():
    n, radius = 6, 10.0
    corners = [(radius * math.cos(a), radius * math.sin(a), 0.0) for a in (math.pi / 2 + 2 * math.pi * k / n for k in range(n))]
    for ring in (corners, corners[::-1], corners[2:] + corners[:2]):
        nut = finish(*relations_of(Primitive("extrude", (5.0,), outline=Outline((tuple(ring),)))))
        (leaf,) = leaves(nut.program)
        assert leaf.outline is not None
        for k in range(n):
            edges = [EdgeFeature("fillet", (1.0,), ((Face(0, "+z"), Face(0, f"wall[0][{k}]")),))]
            text = to_script(nut.program, nut.parameters, nut.folded, edges)
            call = text[text.index("wall_face((0", text.index("part = blended")) :]
            assert "ngon(" in call
            numbers = {name: int(value) if value == int(value) else value for name, value in nut.parameters.values.items()}
            names = {**scope(FACES, WALLS), **numbers}
            far = eval(call[: call.index("),\n])")], names)
            a, b = leaf.outline.loops[0][k], leaf.outline.loops[0][(k + 1) % n]
            assert far(((a[0] + b[0]) / 2, (a[1] + b[1]) / 2, 0.0)) == pytest.approx(0, abs=1e-6)
