"""Outlined leaves in every text and in STEP, re-read by the tools themselves, against volumes in closed form."""

import json
import math
import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from importlib.util import find_spec

import numpy as np
import pytest
import trimesh
from tests.export.outlined import BEND, KNOB, OUTLINED_PARTS, PLATE, SLOT

from imdim.delivery.deliver import RunRecord, deliver
from imdim.delivery.finish import finish
from imdim.export.cadquery import to_cadquery
from imdim.export.delivered import EditError, meanings, texts_of
from imdim.export.edit import change_values, open_delivered
from imdim.export.html import content
from imdim.export.html_tree import outline_values
from imdim.export.numbers import round_program
from imdim.export.openscad import to_openscad
from imdim.export.openscad_reader import read_openscad
from imdim.export.script import to_script
from imdim.geometry.solid import mesh_to_manifold, to_manifold, to_trimesh, volume, volume_iou
from imdim.program.codec import dumps, parse, to_json
from imdim.program.outline import Outline, circle, rectangle
from imdim.program.tree import Combine, Primitive, leaves
from imdim.target.target import target_from

SEGMENTS = 32
EXACT = 1e-9


@pytest.mark.parametrize("name", OUTLINED_PARTS)
def test_openscad_text_reads_back(name):
    program, exact = OUTLINED_PARTS[name]
    read = read_openscad(to_openscad(program))
    assert round_program(read) == round_program(program)
    assert volume(read, 512) == pytest.approx(exact, rel=1e-4)


@pytest.mark.tool
@pytest.mark.parametrize("name", OUTLINED_PARTS)
def test_openscad_renders_the_same_solid(name, tmp_path):
    tool = shutil.which("openscad")
    if tool is None:
        pytest.skip("openscad is not installed")
    program = OUTLINED_PARTS[name][0]
    (tmp_path / "part.scad").write_text(to_openscad(program, SEGMENTS))
    command = [tool, "-o", tmp_path / "part.stl", tmp_path / "part.scad"]
    said = subprocess.run(command, check=True, capture_output=True, timeout=120, text=True).stderr
    assert "WARNING" not in said
    ours = to_manifold(program, SEGMENTS)
    solid = mesh_to_manifold(trimesh.load_mesh(tmp_path / "part.stl"))
    assert volume_iou(solid, ours) == pytest.approx(1, abs=1e-4)  # its STL has six digits


def test_a_changed_definition_of_outlines_is_not_ours():
    with pytest.raises(ValueError, match="line 15 is no primitive of ours"):
        read_openscad(to_openscad(PLATE).replace("rings = [for", "rings = [ for"))
    with pytest.raises(ValueError, match="is no loop or vertex of ours"):
        read_openscad("$fn = 96;\nlinear_extrude(height = 4, center = true) outline([[[1, 2, 3, 4], [0, 0], [0, 1]]]);")


def test_programs_without_outlines_have_no_definition_of_them():
    plain = Primitive("box", (1.0, 2.0, 3.0))
    for text in (to_openscad(plain), to_script(plain), to_cadquery(plain)):
        assert "outline" not in text
        assert "curves" not in text


def test_rounding_keeps_loops_closed_and_drops_what_is_too_short():
    third = 1 / 3
    short = ((0.0, 0.0, 0.0), (9 + third, 0.0, 0.0), (9 + third, 1e-12, 0.0), (9 + third, 5.0, 0.3), (0.0, 5.0, 0.0))
    leaf = next(leaves(round_program(Primitive("extrude", (1.0,), outline=Outline((short, circle(1e-12, 3, 3)))))))
    assert leaf.outline is not None
    assert leaf.outline.loops == (((0.0, 0.0, 0.0), (9.3333333, 0.0, 0.0), (9.3333333, 5.0, 0.3), (0.0, 5.0, 0.0)),)
    touching = Primitive("revolve", (360.0,), outline=Outline((circle(third, third),)))
    assert next(leaves(round_program(touching))).kind == "revolve"


def test_lengths_are_rounded_by_what_the_part_measures():
    """Neither the height of a thin sheet nor an angle says how many decimals a large part needs."""
    sheet = Primitive("extrude", (0.001 / 3,), outline=rectangle(2000.0 / 3, 1.0))
    assert "height = 0.000333, " in to_openscad(sheet)
    assert "[333.333333, -0.5]" in to_openscad(sheet)
    tiny = Primitive("revolve", (100 / 3,), outline=Outline((circle(1e-6, 3e-6),)))
    assert "rotate_extrude(angle = 33.333333333) outline([\n  ring(1e-06, 3e-06, 0)\n]);" in to_openscad(tiny)


# --- STEP


def step_text(program, folder) -> str:
    pytest.importorskip("OCP", reason="the extra [step] is not installed")
    from imdim.export.step import write_step

    write_step(program, folder / "part.step")
    return (folder / "part.step").read_text()


def surface_kinds(text: str) -> dict[str, int]:
    return dict(Counter(re.findall(r"= (PLANE|\w+_SURFACE\w*)\(", text)))


@pytest.mark.parametrize("name", OUTLINED_PARTS)
def test_opencascade_rereads_the_exact_volume(name, tmp_path):
    program, exact = OUTLINED_PARTS[name]
    step_text(program, tmp_path)
    from imdim.export.step import read_step, shape_volume

    assert shape_volume(read_step(tmp_path / "part.step"), 1e-11) == pytest.approx(exact, rel=EXACT)


def test_each_wall_is_one_analytic_face(tmp_path):
    assert surface_kinds(step_text(PLATE, tmp_path)) == {"PLANE": 6, "CYLINDRICAL_SURFACE": 6}
    # the slot's two flats and two round ends
    assert surface_kinds(step_text(Combine("difference", PLATE, SLOT), tmp_path)) == {"PLANE": 8, "CYLINDRICAL_SURFACE": 8}
    assert surface_kinds(step_text(KNOB, tmp_path)) == {"PLANE": 2, "CYLINDRICAL_SURFACE": 1, "TOROIDAL_SURFACE": 1}
    # two ends; the D's flat is a cylinder about the axis
    assert surface_kinds(step_text(BEND, tmp_path)) == {"PLANE": 2, "CYLINDRICAL_SURFACE": 1, "TOROIDAL_SURFACE": 2}


def test_step_is_one_solid(tmp_path):
    text = step_text(Combine("difference", PLATE, SLOT), tmp_path)
    assert text.count("MANIFOLD_SOLID_BREP(") == 1


# --- scripts, run by an interpreter that has the library


def interpreter(package: str) -> str:
    """This Python where it has the package, else the one that CADQUERY_PYTHON, say, names: their kernels exclude each other."""
    given = os.environ.get(f"{package.upper()}_PYTHON")
    if given is None and find_spec(package) is None:
        pytest.skip(f"{package} is not installed, and {package.upper()}_PYTHON names no Python that has it")
    return given or sys.executable


@pytest.mark.tool
@pytest.mark.parametrize(("package", "write"), [("build123d", to_script), ("cadquery", to_cadquery)])
@pytest.mark.parametrize("name", OUTLINED_PARTS)
def test_scripts_build_the_exact_solid(package, write, name, tmp_path):
    python = interpreter(package)
    pytest.importorskip("OCP", reason="the extra [step] is not installed")
    from imdim.export.step import read_step, shape_volume

    program, exact = OUTLINED_PARTS[name]
    (tmp_path / "program.py").write_text(write(program))
    subprocess.run([python, "program.py"], check=True, cwd=tmp_path, timeout=120, capture_output=True)
    shape = read_step(tmp_path / "part.step")
    assert shape_volume(shape, 1e-11) == pytest.approx(exact, rel=1e-7)  # scripts have nine digits of each number
    np.testing.assert_allclose(bounds(shape), manifold_bounds(program), atol=0.01)


def bounds(shape) -> np.ndarray:
    """Of the surface's triangles: what bounds its patches is loose."""
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib
    from OCP.BRepMesh import BRepMesh_IncrementalMesh

    BRepMesh_IncrementalMesh(shape, 1e-3)
    box = Bnd_Box()
    BRepBndLib.AddOptimal_s(shape, box, True, False)
    return np.array([box.CornerMin().Coord(), box.CornerMax().Coord()]).reshape(2, 3)


def manifold_bounds(program) -> np.ndarray:
    return np.array(to_manifold(program, 512).bounding_box()).reshape(2, 3)


# --- names, edits, delivery


def opened(program):
    """As `imdim export` and `imdim edit` see it."""
    found = finish(program)
    texts = texts_of(found.program, found.parameters, found.folded, SEGMENTS)
    return open_delivered(parse(dumps(found.program, None, found.constraints, found.folded)), texts)


@pytest.mark.parametrize("name", OUTLINED_PARTS)
def test_every_delivered_part_is_the_same_solid(name):
    program, exact = OUTLINED_PARTS[name]
    delivered = opened(program)
    assert set(delivered.texts) == {"program.scad", "program.py", "program.cq.py", "program.FCMacro"}
    assert volume(delivered.program, 512) == pytest.approx(exact, rel=1e-4)
    assert meanings(delivered)  # a full turn cannot be probed upwards


def test_an_edit_changes_the_height_of_an_extrusion_and_the_angle_of_a_turn():
    delivered = opened(PLATE)
    thick = change_values(delivered, {"plate_thickness": 12.0})
    assert volume(thick.program, 512) == pytest.approx(3 * OUTLINED_PARTS["plate"][1], rel=1e-4)
    assert "plate_thickness = 12;" in thick.texts["program.scad"]
    assert "extruded(plate_thickness, " in thick.texts["program.cq.py"]
    bend = opened(BEND)
    angle = next(name for name in bend.values if name.endswith("angle"))
    half = change_values(bend, {angle: 180.0})
    assert volume(half.program, 512) == pytest.approx(2 * OUTLINED_PARTS["bend"][1], rel=1e-4)
    with pytest.raises(EditError, match="at most 360"):
        change_values(bend, {angle: 361.0})
    assert meanings(bend)[angle] == f"degrees of the turn of {bend.labels[0]} #0"


def test_a_cut_through_a_thicker_plate_goes_along():
    upright = Combine(
        "difference",
        Primitive("extrude", (4.0,), (0.0, 0.0, 2.0), outline=PLATE.outline),
        Primitive("extrude", (6.0,), (0.0, 0.0, 2.0), outline=SLOT.outline),
    )
    delivered = opened(upright)
    thick = change_values(delivered, {"plate_thickness": 12.0})
    assert volume(thick.program, 512) == pytest.approx(3 * OUTLINED_PARTS["slotted"][1], rel=1e-4)


def test_an_outline_changed_by_hand_is_noticed():
    found = finish(PLATE)
    texts = texts_of(found.program, found.parameters, found.folded, SEGMENTS)
    ring = "ring(plate_hole_diameter/2, {}, 0)"
    changed = texts["program.scad"].replace(ring.format("-plate_hole_spacing_x/2"), ring.format("-16"))
    assert changed != texts["program.scad"]
    with pytest.raises(ValueError, match="describes another program"):
        open_delivered(parse(dumps(found.program)), {"program.scad": changed})


def test_a_delivery_writes_all_files_but_one_and_says_why(tmp_path):
    program = OUTLINED_PARTS["all"][0]
    run = RunRecord("part.stl", {"search": 1.0}, "finished", 0)
    report = deliver(program, target_from(to_trimesh(to_manifold(program))), tmp_path / "out", run, step_limit_s=60.0)
    assert report["files"]["program.ucad"] == "skipped: µcad has no polygons"
    assert report["files"]["program.cq.py"] == "written"
    assert not (tmp_path / "out" / "program.ucad").exists()
    assert report["scores"]["volume_iou"] > 0.9999
    assert report["result"]["kinds"] == {"extrude": 2, "revolve": 2}
    if find_spec("OCP"):
        assert report["volumes"]["program.step"] == pytest.approx(OUTLINED_PARTS["all"][1], rel=1e-6)
    page = (tmp_path / "out" / "report.html").read_text()
    data = json.loads(re.findall(r'<script type="application/json"[^>]*>(.*?)</script>', page, re.DOTALL)[0])
    assert [leaf["outline"]["curves"] for leaf in data["leaves"]] == [10, 4, 5, 3]


def test_the_page_draws_the_outline():
    """The path by itself, arcs by their ends, radius and flags: read back, it encloses the outline's area."""
    assert PLATE.outline is not None
    values = outline_values(PLATE.outline)
    assert values["radii"] == [5, 3]
    assert (values["low"], values["high"]) == ([-25, -15], [25, 15])
    steps = re.findall(r"([MLAZ])([^MLAZ]*)", values["path"])
    loops, x, y = [], 0.0, 0.0
    for letter, rest in steps:
        numbers = [float(n) for n in rest.split()]
        if letter == "M":
            loops.append([])
        elif letter == "L":
            loops[-1].append((x, y, 0.0))
        elif letter == "A":
            chord = math.hypot(numbers[5] - x, numbers[6] - y)
            quarter = math.asin(min(chord / 2 / numbers[0], 1.0)) / 2
            turn = math.pi / 2 - quarter if numbers[3] else quarter
            loops[-1].append((x, y, math.tan(turn) * (1 if numbers[4] else -1)))
        x, y = numbers[-2:] if numbers else (x, y)
    assert Outline(tuple(map(tuple, loops))).area == pytest.approx(PLATE.outline.area, rel=1e-6)


def test_the_page_shows_a_leaf_by_its_own_surface():
    (leaf,) = content(to_json(BEND))["leaves"]
    mesh = trimesh.Trimesh(leaf["surface"]["points"], np.reshape(leaf["surface"]["faces"], (-1, 3)), process=False)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(OUTLINED_PARTS["bend"][1], rel=0.01)
