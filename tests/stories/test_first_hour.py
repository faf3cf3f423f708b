"""Six first hours, each from its first command to what its person came for; ``python -m pytest -s tests/stories`` prints their times.

All commands are real and run in processes of their own, in a new folder, as a shell would start them. The operator's batch has 5 parts
here; ``IMDIM_STORY_PARTS=200`` in the environment makes it 200.
"""

import json
import math
import os
import re
import shutil
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from tests.app.agent.test_server import talk
from tests.app.lab.page.browser import CHROMIUM, chromium
from tests.examples import test_notebook
from tests.export.test_freecad import measured
from tests.planted import box, cut, cylinder

from imdim.geometry.solid import to_manifold, to_trimesh

ROOT = Path(__file__).parents[2]
BRACKET = ROOT / "dataset/examples/bracket.stl"
PARTS = int(os.environ.get("IMDIM_STORY_PARTS", "5"))
PLATE = cut(box(60, 40, 6), cylinder(3, 10, (-20, 0, 0)), cylinder(3, 10, (20, 0, 0)))
HOLES = 2 * math.pi * 9 * 6


def imdim(*arguments, cwd, status=0):
    """What a command of the shell prints."""
    command = [sys.executable, "-m", "imdim", *map(str, arguments)]
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=1800, check=False)
    assert done.returncode == status, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.fixture
def story(request, capsys):
    """Tells how long a story took, whatever is captured."""
    begun = time.monotonic()
    yield
    with capsys.disabled():
        sys.stdout.write(f"\n{request.node.name.removeprefix('test_')}: {time.monotonic() - begun:.1f} s\n")


@contextmanager
def opened(page):
    """A page of a file in a real browser, without a network."""
    if CHROMIUM is None:
        pytest.skip("chromium is not installed")
    with chromium() as browser:
        tab = browser.new_page(viewport={"width": 1280, "height": 720})
        asked = []
        tab.on("request", lambda request: asked.append(request.url))
        tab.goto(page.as_uri())
        yield tab
        assert all(url.startswith(("file:", "data:", "blob:")) for url in asked)


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """A part of somebody's own, and its results."""
    folder = tmp_path_factory.mktemp("maker")
    to_trimesh(to_manifold(PLATE)).export(folder / "plate.stl")
    begun = time.monotonic()
    said = imdim("fit", "plate.stl", cwd=folder)
    return folder, said, time.monotonic() - begun


def test_a_visitor_fits_the_bundled_part_and_opens_its_report(story, tmp_path):
    shutil.copy(BRACKET, tmp_path)
    said = imdim("fit", "bracket.stl", cwd=tmp_path)
    assert "report" in said
    assert float(re.search(r"volume IoU (\d\.\d+)", said)[1]) > 0.999
    with opened(tmp_path / "bracket.imdim/report.html") as tab:
        tab.wait_for_selector("html[data-drawn]", state="attached")
        assert tab.locator("h1").inner_text() == "bracket.stl"
        assert tab.locator("#sheets a", has_text="program.scad").count() == 1
        names = tab.locator("#sheets .picks b").all_inner_texts()
        assert "plate_thickness" in names
    seen = np.asarray(Image.open(tmp_path / "bracket.imdim/preview.png").convert("L"))
    assert (seen < 200).mean() > 0.03, "the picture shows a part"


def test_a_maker_edits_their_own_part_and_prints_it(story, fitted):
    folder, _, _ = fitted
    listed = imdim("edit", "plate.imdim", "--list", cwd=folder)
    name = re.search(r"^(\w*hole_diameter)\b", listed, re.MULTILINE)[1]
    said = imdim("edit", "plate.imdim", "--set", f"{name}=8", "-o", "wider", cwd=folder)
    assert "in kind as before" in said
    printed = trimesh.load(folder / "wider/mesh.stl")
    assert printed.is_watertight
    assert printed.volume == pytest.approx(60 * 40 * 6 - 2 * math.pi * 16 * 6, rel=1e-3)
    assert (folder / "wider/edit.png").stat().st_size > 5000
    sliced = trimesh.load(folder / "wider/mesh.3mf", force="mesh")
    assert sliced.extents == pytest.approx([60, 40, 6])


def test_a_cad_user_opens_step_and_freecad(story, fitted, tmp_path):
    folder, _, _ = fitted
    pytest.importorskip("OCP", reason="the extra [step] is not installed")
    from imdim.export.step import step_volume

    exact = 60 * 40 * 6 - HOLES
    assert step_volume(folder / "plate.imdim/program.step") == pytest.approx(exact, rel=1e-5)
    text = (folder / "plate.imdim/program.FCMacro").read_text(encoding="utf-8")
    assert measured(text, tmp_path) == pytest.approx(exact, rel=1e-5)
    cell = re.search(r"\b(\w*hole_diameter)\b", text)[1]
    assert measured(text, tmp_path, **{cell: "8 mm"}) == pytest.approx(60 * 40 * 6 - 2 * math.pi * 16 * 6, rel=1e-5)


def test_a_python_user_runs_the_notebook(story, tmp_path, monkeypatch, capsys):
    test_notebook.test_its_cells_run_in_order(".", tmp_path, monkeypatch, capsys)


def test_an_operator_runs_a_folder_with_broken_files(story, tmp_path):
    """Half of the files are no parts; the others come out, and the page says which ones did not."""
    parts, rng = tmp_path / "parts", np.random.default_rng(0)
    parts.mkdir()
    broken = {f"part{i:03d}.stl" for i in range(0, PARTS, 2)}
    for i in range(PARTS):
        path = parts / f"part{i:03d}.stl"
        trimesh.creation.box(rng.uniform(5, 50, 3).round()).export(path)
        if path.name in broken:
            path.write_bytes((b"", b"solid nothing", path.read_bytes()[:200])[i // 2 % 3])
    imdim("batch", "parts", "-o", "out", "--budget", "10", "--jobs", "2", cwd=tmp_path, status=1)
    with opened(tmp_path / "out/results.html") as tab:
        rows = {row.locator("td").nth(1).inner_text(): row for row in tab.locator("tbody tr").all()}
        assert len(rows) == PARTS
        assert {name for name, row in rows.items() if "failed" in row.get_attribute("class")} == broken
        assert tab.locator("td.good").count() == PARTS - len(broken)
        tab.get_by_role("button", name="how it ended").click()
        assert tab.locator("tbody tr").last.get_attribute("class") == "failed" or "failed" in tab.locator("tbody tr").first.get_attribute(
            "class"
        )
    assert f"{PARTS} of {PARTS} parts done" in (tmp_path / "out/results.html").read_text()
    again = imdim("batch", "parts", "-o", "out", "--budget", "10", "--jobs", "2", cwd=tmp_path, status=1)
    assert len(re.findall("volume IoU|IoU 1", again)) == 0, "what is done is not done twice"


def test_an_agent_fits_and_edits_over_mcp(story, tmp_path):
    to_trimesh(to_manifold(PLATE)).export(tmp_path / "plate.stl")

    async def conversation(client):
        for name, arguments in (("open", {"path": "plate.stl"}), ("fit", {})):
            given = await client.call_tool(name, arguments)
            assert not given.isError, given.content[0].text
        listed = (await client.call_tool("parameters", {})).structuredContent
        name = next(word for word in re.findall(r"\w*hole_diameter", json.dumps(listed)))
        for tool, arguments in (("set", {"values": {name: 8}}), ("export", {"folder": "out"})):
            given = await client.call_tool(tool, arguments)
            assert not given.isError, given.content[0].text

    talk(tmp_path, conversation)
    assert trimesh.load(tmp_path / "out/mesh.stl").volume == pytest.approx(60 * 40 * 6 - 2 * math.pi * 16 * 6, rel=1e-3)
