"""What the lab gives away, read again by the tools that it is for."""

import ast
import io
import math
import shutil
import subprocess
import time

import pytest
import trimesh
from PIL import Image

from imdim.app.lab import wire, work
from imdim.app.lab.examples import PROGRAMS, example
from imdim.app.lab.panels.take import FORMATS, in_units
from imdim.app.lab.wire import Message
from imdim.export.openscad_reader import read_openscad
from imdim.fitting import relations_of
from imdim.geometry.solid import volume
from imdim.program import codec
from imdim.program.front import Choice

EXACT = 80 * 50 * 8 + math.pi * 14**2 * 16 - 4 * math.pi * 9 * 8 - math.pi * 64 * 24


@pytest.fixture(scope="module")
def files():
    program, constraints = relations_of(PROGRAMS["Bracket"]())
    target = wire.target_message(example("Bracket"))
    front = wire.front_values([Choice(program, 0.0)])
    values = {**target.values, "document": wire.document(program, constraints), "front": front, "stop": "edited", "settings": {}}
    told = list(work.perform(Message("files", values, target.arrays), time.perf_counter))
    assert [m.kind for m in told] == ["files", "done"]
    return {name: data.tobytes() for name, data in told[0].arrays.items()}


def test_all_formats_are_there(files):
    assert set(FORMATS.values()) <= set(files)


def test_programs_read_again_are_the_part(files):
    document = codec.parse(in_units(files["program.json"], "millimeter"))
    assert codec.meta_of(document).units == "millimeter"
    assert len(codec.constraints_of(document)) > 5
    for program in (codec.from_json(document), read_openscad(files["program.scad"].decode())):
        assert volume(program, 512) == pytest.approx(EXACT, rel=1e-4)
    ast.parse(files["program.py"].decode())


@pytest.mark.parametrize("name", ["mesh.stl", "mesh.glb", "mesh.3mf"])
def test_meshes_read_again_are_the_part(files, name):
    mesh = trimesh.load(io.BytesIO(files[name]), file_type=name.rsplit(".", 1)[1], force="mesh")
    mesh.merge_vertices()
    assert mesh.volume == pytest.approx(EXACT, rel=2e-3)


def test_the_picture_and_the_report_are_whole(files):
    assert Image.open(io.BytesIO(files["preview.png"])).size == (1500, 590)
    page = files["report.html"].decode()
    assert page.rstrip().endswith("</html>")
    assert "http-equiv" in page


@pytest.mark.tool
@pytest.mark.skipif(shutil.which("openscad") is None, reason="OpenSCAD is not installed")
def test_openscad_renders_it(files, tmp_path):
    source, stl = tmp_path / "part.scad", tmp_path / "part.stl"
    source.write_bytes(files["program.scad"])
    subprocess.run(["openscad", "-o", str(stl), str(source)], check=True, capture_output=True, timeout=240)
    assert trimesh.load_mesh(stl).volume == pytest.approx(EXACT, rel=2e-3)


def test_opencascade_reads_it(files, tmp_path):
    pytest.importorskip("OCP")
    from imdim.export.step import step_volume

    path = tmp_path / "part.step"
    path.write_bytes(files["program.step"])
    assert step_volume(path) == pytest.approx(EXACT, rel=1e-6)
