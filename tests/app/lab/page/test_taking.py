"""Every format, downloaded through its button and read again by the tool that it is for."""

import ast
import shutil
import subprocess

import numpy as np
import pytest
import trimesh
from PIL import Image
from tests.app.lab.page.browser import EXACT, WAIT_MS, in_the_lab

from imdim.app.lab.panels.take import FORMATS
from imdim.export.delivered import read_values
from imdim.export.openscad_reader import read_openscad
from imdim.geometry.solid import volume
from imdim.program import codec

pytestmark = in_the_lab
needs_openscad = pytest.mark.skipif(shutil.which("openscad") is None, reason="OpenSCAD is not installed")
BUTTONS = ("JSON", "OpenSCAD", "STEP", "build123d", "CadQuery", "FreeCAD", "STL", "GLB", "3MF", "PNG", "HTML report")


@pytest.fixture(scope="module")
def files(done, tmp_path_factory):
    folder, found = tmp_path_factory.mktemp("taken"), {}
    done.tab("Download")
    for label in BUTTONS:
        with done.page.expect_download() as waiting:
            done.press(f"Download {label}")
        found[label] = folder / waiting.value.suggested_filename
        waiting.value.save_as(found[label])
    done.tab("Run")
    return found


def test_all_formats_have_a_button():
    assert set(FORMATS) == set(BUTTONS)


def test_files_are_called_by_the_part(files):
    endings = ["json", "scad", "step", "build123d.py", "cadquery.py", "FCMacro", "stl", "glb", "3mf", "png", "html"]
    assert [path.name for path in files.values()] == [f"Bracket.{ending}" for ending in endings]


def test_the_table_and_the_code_are_those_of_the_files(done, files):
    text = files["OpenSCAD"].read_text()
    done.tab("Parameters")
    named = read_values(text)
    assert len(named) >= 9
    table = done.parameters()
    assert {name: table[name] for name in named} == named
    assert set(table) - set(named) == {"hole_count_x", "hole_count_y"}, "of the texts with loops"
    done.tab("Code")
    assert done.page.locator(".lab-program").text_content() == text
    done.tab("Program")


def test_programs_are_the_part(files):
    document = codec.parse(files["JSON"].read_bytes())
    assert codec.meta_of(document).units == "unspecified", "nobody said what the lengths are"
    assert len(codec.constraints_of(document)) > 5
    for program in (codec.from_json(document), read_openscad(files["OpenSCAD"].read_text())):
        assert volume(program, 512) == pytest.approx(EXACT, rel=1e-4)
    assert "build123d" in files["build123d"].read_text()
    ast.parse(files["build123d"].read_text())
    assert "import cadquery" in files["CadQuery"].read_text()
    ast.parse(files["CadQuery"].read_text())
    ast.parse(files["FreeCAD"].read_text())


@pytest.mark.parametrize("label", ["STL", "GLB", "3MF"])
def test_meshes_are_the_part(files, label):
    mesh = trimesh.load(files[label], force="mesh")
    mesh.merge_vertices(merge_norm=True, merge_tex=True)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(EXACT, rel=2e-3)


def test_the_picture_shows_target_result_and_distances(files):
    with Image.open(files["PNG"]) as picture:
        assert picture.size == (2000, 590)
        seen = np.asarray(picture.convert("L"))
    for third in range(3):
        pane = seen[100:, 500 * third : 500 * (third + 1)]
        assert (pane < 200).mean() > 0.05


@pytest.mark.tool
@needs_openscad
@pytest.mark.parametrize("label", ["OpenSCAD", "STL", "3MF"])
def test_openscad_renders_it(files, label, tmp_path):
    source, stl = tmp_path / "part.scad", tmp_path / "part.stl"
    source.write_text(files[label].read_text() if label == "OpenSCAD" else f'import("{files[label]}");')
    subprocess.run(["openscad", "-o", str(stl), str(source)], check=True, capture_output=True, timeout=300)
    assert trimesh.load_mesh(stl).volume == pytest.approx(EXACT, rel=2e-3)


def test_opencascade_reads_it(files):
    pytest.importorskip("OCP")
    from imdim.export.step import step_volume

    assert step_volume(files["STEP"]) == pytest.approx(EXACT, rel=1e-6)


def test_build123d_runs_it(files, tmp_path, monkeypatch):
    pytest.importorskip("build123d")
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(compile(files["build123d"].read_text(), "program.py", "exec"), names)
    assert names["part"].volume == pytest.approx(EXACT, rel=1e-6)


def test_the_report_opens_anywhere(files, browser):
    context, asked = browser.new_context(offline=True), []
    page = context.new_page()
    page.set_default_timeout(WAIT_MS)
    page.on("request", lambda request: asked.append(request.url))
    page.goto(files["HTML report"].as_uri())
    page.wait_for_selector("html[data-drawn]", state="attached")
    assert page.locator("h1").inner_text() == "Bracket"
    context.close()
    assert all(address.startswith(("file:", "data:", "blob:")) for address in asked)


def test_it_is_taken_in_a_narrow_window_too(done, files):
    done.page.set_viewport_size({"width": 390, "height": 844})
    done.tab("Download")
    with done.page.expect_download() as waiting:
        done.press("Download JSON")
    assert waiting.value.path().read_bytes() == files["JSON"].read_bytes()
    done.page.set_viewport_size({"width": 1280, "height": 720})
    done.tab("Run")
