"""The Python way in: paths, and a result that writes itself, against a plate with two equal holes whose volume is known."""

import html
import json
import math
import re
import subprocess
import sys
import webbrowser
from pathlib import Path

import pytest
import trimesh
from tests.planted import box, cut, cylinder

import imdim
from imdim.delivery import result as module
from imdim.export.openscad_reader import read_openscad
from imdim.export.step import StepError, step_volume
from imdim.geometry.solid import to_manifold, to_trimesh, volume_iou
from imdim.program.codec import from_json
from imdim.reconstruction.pipeline import Snapshot

PLATE = cut(box(80, 50, 6), cylinder(3, 8, (-20, 0, 0)), cylinder(3, 8, (20, 0, 0)))
VOLUME = 6 * (80 * 50 - 2 * math.pi * 9)


@pytest.fixture(scope="module")
def part(tmp_path_factory):
    path = tmp_path_factory.mktemp("parts") / "plate <1>.stl"
    to_trimesh(to_manifold(PLATE)).export(path)
    return path


@pytest.fixture(scope="module")
def found(part):
    return imdim.reconstruct(str(part), imdim.Settings(budget_s=60.0, language="csg"), seed=3)


def test_a_path_is_reconstructed(found, part):
    assert volume_iou(to_manifold(found.program), to_manifold(PLATE)) > 0.999
    assert (found.settings.input, found.seed, found.target.name) == (str(part), 3, part.name)
    assert repr(found).startswith(f"<{part.name}: 3 primitives, error ")
    assert len(repr(found)) < 100


@pytest.mark.usefixtures("without_step")
def test_the_results_folder_is_that_of_the_command(found, part, tmp_path):
    report = found.save(tmp_path / "out")
    assert report == json.loads((tmp_path / "out" / "report.json").read_text())
    assert (report["input"], report["seed"], report["scores"]["volume_iou"]) == (str(part), 3, pytest.approx(1.0, abs=1e-3))
    assert report["timing"]["stages_s"] == pytest.approx(dict(found.stages), abs=1e-3)
    for text, name in ((found.to_json(), "program.json"), (found.to_openscad(), "program.scad"), (found.to_build123d(), "program.py")):
        assert text == (tmp_path / "out" / name).read_text(), name
    assert found.to_cadquery() == (tmp_path / "out" / "program.cq.py").read_text()
    assert found.to_freecad() == (tmp_path / "out" / "program.FCMacro").read_text()


def test_texts_have_names_and_hold_the_solid(found):
    assert re.search(r"^hole_diameter = 6;", found.to_openscad(), re.MULTILINE)
    for program in (read_openscad(found.to_openscad()), from_json(json.loads(found.to_json()))):
        assert to_manifold(program, 360).volume() == pytest.approx(VOLUME, rel=1e-4)
    mesh = found.to_trimesh()
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(VOLUME, rel=1e-3)


def test_step_is_written_whole_or_not_at_all(found, tmp_path):
    pytest.importorskip("OCP")
    assert step_volume(found.to_step(tmp_path / "plate.step")) == pytest.approx(VOLUME, rel=1e-6)
    with pytest.raises(StepError, match="took more than 0 s"):
        found.to_step(tmp_path / "late.step", limit_s=0.0)
    assert [path.name for path in tmp_path.iterdir()] == ["plate.step"]


def test_the_page_is_shown_in_the_browser_and_in_a_notebook(found, monkeypatch):
    opened = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    path = found.show()
    assert opened == [path.as_uri()]
    assert "plate &lt;1&gt;.stl" in path.read_text()
    frame = found._repr_html_()
    assert html.unescape(re.search(r'srcdoc="([^"]*)"', frame)[1]) == path.read_text()
    assert 'sandbox="allow-scripts"' in frame
    path.unlink()
    path.parent.rmdir()


def test_what_cannot_be_reconstructed_is_told_by_its_name(tmp_path):
    with pytest.raises(imdim.InputError, match=r"none\.stl: no such file"):
        imdim.reconstruct(tmp_path / "none.stl")
    with pytest.raises(imdim.ConfigError, match="budget_s must be a finite number of at least 0, got -1"):
        imdim.reconstruct(trimesh.creation.box(), imdim.Settings(budget_s=-1.0))


def test_settings_bring_their_seed(monkeypatch):
    def box_found(target, settings, rng):
        yield Snapshot("finished", box(1, 1, 1), rng.bit_generator.seed_seq.entropy, 0.0)

    compiled = []
    monkeypatch.setattr(module.pipeline, "reconstruct", box_found)
    monkeypatch.setattr(module.first_run, "compile_kernels", lambda stream, cloud: compiled.append((stream, cloud)))
    mesh = trimesh.creation.box()
    assert imdim.reconstruct(mesh, imdim.Settings(seed=5)).error == 5
    assert imdim.reconstruct(mesh, imdim.Settings(seed=5), seed=6).error == 6
    assert imdim.reconstruct(mesh.sample(50), imdim.Settings(seed=5)).error == 5
    assert compiled == [(sys.stderr, False), (sys.stderr, False), (sys.stderr, True)]


@pytest.mark.usefixtures("without_step")
def test_what_somebody_has_changed_is_not_replaced(found, tmp_path):
    found.save(tmp_path / "out")
    text = tmp_path / "out" / "program.scad"
    text.write_text("mine")
    with pytest.raises(OSError, match=r"program\.scad changed since it was written"):
        found.save(tmp_path / "out")
    assert text.read_text() == "mine"
    found.save(tmp_path / "out", force=True)
    assert text.read_text() == found.to_openscad()


def test_the_package_shows_what_users_need_and_is_typed():
    assert dir(imdim) == sorted(imdim.__all__)
    assert all(getattr(imdim, name) is not None for name in imdim.__all__)
    assert re.match(r"\d+\.\d+", imdim.__version__)
    assert (Path(imdim.__file__).parent / "py.typed").is_file()
    with pytest.raises(AttributeError, match="no attribute 'reconstuct'"):
        imdim.reconstuct  # noqa: B018


def test_importing_takes_a_tenth_of_a_second():
    script = "import time; start = time.process_time(); import imdim; dir(imdim); print(time.process_time() - start)"
    took = [float(subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout) for _ in range(3)]
    assert min(took) < 0.1
