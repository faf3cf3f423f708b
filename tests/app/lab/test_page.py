"""The lab in a real browser: from an example to the files, with what a person sees checked in pixels.

One server, one browser and two clients serve all tests: `done`, whose part is reconstructed, is left as each test found it.
"""

import ast
import math
import os
import shutil
import signal
import subprocess
import time

import pytest
import trimesh
from PIL import Image
from tests.app.lab.browser import WAIT_MS, LabPage, blue, chromium, green, inked, lab, needs_chromium, red

from imdim.app.lab.panels.edit import LOCKED
from imdim.geometry.solid import volume
from imdim.program import codec

pytestmark = [needs_chromium, pytest.mark.xdist_group("lab")]  # one server for all of them
EXACT = 80 * 50 * 8 + math.pi * 14**2 * 16 - 4 * math.pi * 9 * 8 - math.pi * 64 * 24
NEAR = (0.998, 1.002)  # facets


@pytest.fixture(scope="module")
def server():
    with lab() as running:
        yield running


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


@pytest.fixture(scope="module")
def done(browser, server):
    """A client whose example is reconstructed."""
    page = LabPage(browser, server.url)
    page.wait_for_picture(lambda picture: inked(picture) > 3000)
    assert red(page.picture()) == 0
    page.run()
    yield page
    page.close()


@pytest.fixture(scope="module")
def other(browser, server):
    """A second client."""
    page = LabPage(browser, server.url)
    yield page
    page.close()


def measures(page, exact):
    page.wait_for_volume(*(exact * share for share in NEAR))


def test_the_solid_appears_with_its_cutters(done):
    done.wait_for_picture(lambda picture: blue(picture) > 20_000 and red(picture) > 800)
    measures(done, EXACT)
    done.says("IoU")
    assert done.status("primitives") == "7"
    assert float(done.status("error").split("%")[0]) < 0.1
    assert "minimal" in done.status("proof")


def test_a_click_selects_in_picture_tree_and_code(done):
    page, before = done.page, done.picture()
    left, top, width, height = done.view()
    page.mouse.click(left + width // 2, top + height * 0.53)
    page.wait_for_selector(".lab-primitive [role=treeitem][aria-selected=true]")
    row = page.locator(".lab-primitive [aria-selected=true]")
    leaf = row.get_attribute("data-n")
    assert "boss" in row.inner_text()
    done.tab("Code")
    assert "r = 14" in page.locator(".lab-primitive [aria-pressed=true]").inner_text()
    assert done.box("Primitive").input_value() == leaf
    done.wait_for_picture(lambda picture: red(picture) > red(before) + 2000)
    done.tab("Program")
    done.keys("Escape")
    page.wait_for_function("!document.querySelector('.lab-primitive [aria-selected=true]')")


def test_a_radius_is_edited_and_the_edit_undone(done):
    done.select(3)
    before = done.picture()
    done.tab("Edit")
    done.box("r mm").fill("5")
    larger = EXACT - 4 * math.pi * (25 - 9) * 8  # the four holes have one radius
    measures(done, larger)
    done.wait_for_picture(lambda picture: red(picture) > red(before) + 400)
    done.keys("Control+z")
    measures(done, EXACT)
    done.keys("Control+y")
    measures(done, larger)
    done.keys("Control+z", "Escape")
    measures(done, EXACT)
    done.tab("Run")


def test_a_constraint_is_added_and_the_solver_finishes_under_it(done):
    done.tab("Relate")
    rows = done.page.locator(".lab-constraint [data-n]").count()
    assert rows > 5
    done.choose("Relation", "value")
    done.field("Of").fill("1.r")
    done.field("Value").fill("13")
    done.press("Add the constraint")
    added = done.page.locator(f".lab-constraint [data-n='{rows}']")
    added.wait_for()
    assert "off by" in added.inner_text()
    done.tab("Edit")
    done.press("Let the solver finish")
    smaller = EXACT - math.pi * (14**2 - 13**2) * 16
    measures(done, smaller)
    done.notice("solved: all constraints and locks hold")
    done.select(3)
    done.box("r mm").fill("5")  # the next edit keeps it
    measures(done, smaller - 4 * math.pi * (25 - 9) * 8)
    assert "off by" not in added.inner_text()
    done.keys("Escape")
    for _ in range(3):
        done.press("Undo")
    measures(done, EXACT)
    done.tab("Run")


def test_a_locked_number_stays_where_the_solver_moves_the_others_back(done):
    done.tab("Edit")
    done.select(1)
    done.box("r mm").fill("13")
    smaller = EXACT - math.pi * (14**2 - 13**2) * 16
    measures(done, smaller)
    done.press("r")
    done.page.get_by_role("button", name=LOCKED + "r", exact=True).wait_for()
    done.select(3)
    done.box("r mm").fill("5")
    measures(done, smaller - 4 * math.pi * (25 - 9) * 8)
    done.press("Let the solver finish")
    measures(done, smaller)
    done.notice("solved: all constraints and locks hold")
    done.keys("Escape")
    for _ in range(4):
        done.press("Undo")
    measures(done, EXACT)
    done.tab("Run")


def test_a_primitive_is_added(done):
    before = done.picture()
    done.tab("Edit")
    done.press("Add")  # a cylinder in the middle, which fits into the bore
    length = 0.15 * math.sqrt(80**2 + 50**2 + 24**2)
    measures(done, EXACT + math.pi * (length / 2) ** 2 * 2 * length)
    assert done.status("primitives") == "8"
    done.page.wait_for_selector(".lab-primitive [data-n='7'][aria-selected=true]")
    done.wait_for_picture(lambda picture: red(picture) > red(before) + 400)
    done.keys("Control+z", "Escape")
    measures(done, EXACT)
    done.tab("Run")


def test_a_point_of_the_front_is_clicked(done):
    done.page.locator("svg [role=button][data-n='1'] circle").last.click()
    done.wait_for_volume(31_000, 33_000)  # the plate alone
    done.wait_for_picture(lambda picture: red(picture) < 300)
    done.keys("Control+z")
    measures(done, EXACT)


def test_layers_are_shown_and_hidden(done):
    done.tab("View")
    done.box("Solid").uncheck()
    done.box("Cutters").uncheck()
    done.wait_for_picture(lambda picture: blue(picture) == 0 and red(picture) == 0)
    done.box("Constraints").check()
    done.wait_for_picture(lambda picture: green(picture) > 50)
    done.box("Constraints").uncheck()
    done.box("Points").uncheck()
    done.wait_for_picture(lambda picture: inked(picture) < 1000)
    done.box("Distance map").check()
    done.wait_for_picture(lambda picture: inked(picture) > 3000)
    done.page.get_by_text("from the result").wait_for()  # its scale
    done.box("Distance map").uncheck()
    done.box("Points").check()
    done.box("Solid").check()
    done.keys("c")  # the cutters
    done.wait_for_picture(lambda picture: blue(picture) > 20_000 and red(picture) > 800 and green(picture) == 0)
    done.tab("Run")


def test_all_of_it_by_keyboard(done):
    page = done.page
    done.keys("j")
    page.wait_for_selector(".lab-primitive [data-n='0'][aria-selected=true]")
    done.keys("k")
    page.wait_for_selector(".lab-primitive [data-n='6'][aria-selected=true]")
    page.locator(".lab-primitive [role=treeitem][data-n='2']").focus()
    page.keyboard.press("Enter")
    page.wait_for_selector(".lab-primitive [data-n='2'][aria-selected=true]")
    page.locator("svg [data-n='1']").focus()
    page.keyboard.press("Enter")
    done.wait_for_volume(31_000, 33_000)
    done.keys("Control+z", "Escape")
    measures(done, EXACT)


CONTRAST = """() => {
  const light = (c) => { const [r, g, b] = c.map((v) => v / 255).map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
  const read = (text) => { const n = text.match(/[\\d.]+/g).map(Number); return { rgb: n.slice(0, 3), alpha: n.length > 3 ? n[3] : 1 }; };
  const behind = (e) => {
    for (; e; e = e.parentElement) { const c = read(getComputedStyle(e).backgroundColor); if (c.alpha > 0.9) return c.rgb; }
    return [255, 255, 255]; };
  const poor = [];
  const walker = document.createTreeWalker(document.getElementById('root'), NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const e = walker.currentNode.parentElement;
    if (!walker.currentNode.textContent.trim() || ['STYLE', 'SCRIPT'].includes(e.tagName) || !e.getClientRects().length) continue;
    const style = getComputedStyle(e), svg = e.ownerSVGElement;
    const [a, b] = [light(read(svg ? style.fill : style.color).rgb), light(behind(e))].sort((x, y) => y - x);
    if ((a + 0.05) / (b + 0.05) < 4.5) poor.push(walker.currentNode.textContent.slice(0, 40) + ' ' + ((a + 0.05) / (b + 0.05)).toFixed(1));
  }
  return poor; }"""


def test_all_text_is_readable(done):
    """WCAG 2.2, 1.4.3: a contrast of at least 4.5."""
    for name in ("Edit", "Relate", "View", "Take", "Code", "Program", "Run"):
        done.tab(name)
        assert done.page.evaluate(CONTRAST) == [], name


@pytest.fixture(scope="module")
def files(done, tmp_path_factory):
    """Every format, downloaded through its button."""
    folder, found = tmp_path_factory.mktemp("taken"), {}
    done.tab("Take")
    for label in ("JSON", "OpenSCAD", "STEP", "build123d", "STL", "GLB", "3MF", "PNG", "HTML report"):
        with done.page.expect_download() as waiting:
            done.press(f"Download {label}")
        found[label] = folder / waiting.value.suggested_filename
        waiting.value.save_as(found[label])
    done.tab("Run")
    return found


def test_programs_and_meshes_that_were_downloaded_are_the_part(files):
    assert codec.parse(files["JSON"].read_bytes())["units"] == "millimeter"  # type: ignore[index]
    assert volume(codec.loads(files["JSON"].read_text()), 512) == pytest.approx(EXACT, rel=1e-4)
    for label in ("STL", "GLB", "3MF"):
        mesh = trimesh.load(files[label], force="mesh")
        mesh.merge_vertices()
        assert mesh.is_watertight, label
        assert mesh.volume == pytest.approx(EXACT, rel=2e-3), label
    assert "build123d" in files["build123d"].read_text()
    ast.parse(files["build123d"].read_text())
    with Image.open(files["PNG"]) as picture:
        assert picture.size == (1500, 590)


@pytest.mark.tool
@pytest.mark.skipif(shutil.which("openscad") is None, reason="OpenSCAD is not installed")
def test_openscad_renders_what_was_downloaded(files, tmp_path):
    stl = tmp_path / "part.stl"
    subprocess.run(["openscad", "-o", str(stl), str(files["OpenSCAD"])], check=True, capture_output=True, timeout=300)
    assert trimesh.load_mesh(stl).volume == pytest.approx(EXACT, rel=2e-3)


def test_opencascade_reads_what_was_downloaded(files):
    pytest.importorskip("OCP")
    from imdim.export.step import step_volume

    assert step_volume(files["STEP"]) == pytest.approx(EXACT, rel=1e-6)


def test_the_report_that_was_downloaded_opens_anywhere(files, browser):
    page, asked = browser.new_page(), []
    page.set_default_timeout(WAIT_MS)
    page.on("request", lambda request: asked.append(request.url))
    page.goto(files["HTML report"].as_uri())
    page.wait_for_selector("html[data-drawn]", state="attached")
    page.close()
    assert all(address.startswith(("file:", "data:", "blob:")) for address in asked)


WATCH = """() => { window.said = []; const look = () => {
    for (const e of document.querySelectorAll('.mantine-Notification-root')) {
      if (e.getClientRects().length) said.push(e.textContent); } };
  new MutationObserver(look).observe(document.body, {childList: true, subtree: true, characterData: true}); }"""


def test_junk_is_refused_in_one_line_and_the_lab_goes_on(other, tmp_path):
    (tmp_path / "picture.stl").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 20)
    (tmp_path / "empty.stl").write_bytes(b"")
    (tmp_path / "nan.xyz").write_text("nan nan nan\n" * 100)
    with (tmp_path / "huge.stl").open("wb") as file:
        file.truncate(200 * 2**20)
    (tmp_path / "cube.stl").write_bytes(trimesh.creation.box((3, 2, 1)).export(file_type="stl"))
    says = {
        "picture.stl": "not a readable STL file",
        "empty.stl": "empty (0 bytes)",
        "nan.xyz": "not finite",
        "huge.stl": "200 MB are too large, at most 64 MB can be uploaded",
    }
    other.page.evaluate(WATCH)
    for name, text in says.items():
        other.page.set_input_files("input[type=file]", tmp_path / name)
        assert other.notice(text).startswith(f"{name}: ")
        assert other.status("part") == "Bracket"
    other.page.wait_for_function("t => said.some((s) => s.includes(t))", arg=says["huge.stl"])
    assert not other.page.evaluate("said.some((s) => s.includes('success'))"), "nothing that was refused is said to be taken"
    other.page.set_input_files("input[type=file]", tmp_path / "cube.stl")
    other.says("cube.stl")
    other.run()
    assert other.volume() == pytest.approx(6.0, rel=1e-3)


DROP = """() => {
  const carried = new DataTransfer();
  const lines = Array.from({ length: 500 }, (_, i) => `${Math.sin(i)} ${Math.cos(i)} ${i / 99}`);
  carried.items.add(new File([lines.join('\\n')], 'dropped.xyz'));
  document.querySelector('canvas').dispatchEvent(new DragEvent('drop', { dataTransfer: carried, bubbles: true, cancelable: true }));
}"""


def test_a_file_is_dropped_onto_the_picture(other):
    other.page.evaluate(DROP)
    other.says("dropped.xyz")


def test_a_run_is_stepped_paused_and_stopped(other):
    other.choose("Example", "Knob")
    other.says("Knob")
    other.press("Step")  # to the first program
    other.says("paused")
    other.says("volume")
    other.choose("Example", "Bracket, scanned")  # which takes its time
    other.says("scanned")
    other.press("Start")
    other.says("running")
    other.press("Pause")
    other.says("paused")
    other.press("Resume")
    other.says("running")
    other.press("Stop")
    other.says("ready")


def test_two_clients_work_on_their_own_and_survive_a_killed_run(done, other, server):
    other.choose("Example", "Bracket, scanned")
    other.says("scanned")
    assert done.status("part") == "Bracket"
    other.press("Start")
    other.says("running")
    told = other.page.locator(".lab-notice", has_text="SIGKILL")
    for _ in range(60):  # again where a process was only starting and did not look like one yet
        if told.count():
            break
        _kill_workers(server.pid)
        other.page.wait_for_timeout(500)
    assert told.count(), (other.page.locator(".lab-notice").all_inner_texts(), other.page.locator(".lab-status").all_inner_texts())
    assert "the lab goes on" in told.first.inner_text()
    assert done.page.locator(".lab-notice", has_text="SIGKILL").count() == 0
    done.select(3)
    done.keys("Delete")
    measures(done, EXACT + math.pi * 9 * 8)
    done.keys("Control+z", "Escape")
    measures(done, EXACT)
    other.choose("Example", "Knob")
    other.says("Knob")
    other.press("Start")
    other.says("volume")
    other.page.get_by_text("Evolve from here").click()
    other.press("Continue from this program")
    other.says("continue: evolve")
    other.press("Stop")
    other.says("ready")


def _workers(server):
    """All processes that work for a server, those that wait too."""
    listed = subprocess.run(["ps", "-ww", "--ppid", str(server), "-o", "pid=,args="], capture_output=True, text=True, check=True).stdout
    return {int(line.split()[0]) for line in listed.splitlines() if "spawn_main" in line}


def _kill_workers(server):
    for pid in _workers(server):
        os.kill(pid, signal.SIGKILL)


def test_a_large_and_a_narrow_window_show_part_and_controls(done):
    for width, height in ((390, 844), (1280, 720)):
        done.page.set_viewport_size({"width": width, "height": height})
        done.wait_for_picture(lambda picture: blue(picture) > 8_000 and red(picture) > 300)
        left, top, across, down = done.view()
        assert across >= 0.5 * width
        assert down >= 0.4 * height
        assert left >= 0
        assert left + across <= width
        assert done.page.evaluate("document.documentElement.scrollWidth") <= width
        start = done.page.get_by_role("button", name="Start", exact=True).bounding_box()
        assert start
        assert start["y"] >= top + down or start["x"] >= left + across, "the controls lie beside or below the picture"
        assert start["y"] + start["height"] <= height


@pytest.fixture
def narrow(browser, server):
    """A third client, in a window of a telephone's size."""
    page = LabPage(browser, server.url, 390, 844)
    yield page
    if not page.page.is_closed():
        page.close()


def test_a_narrow_window_is_usable_from_the_first(narrow, tmp_path):
    """Clicks are those of a hand: scrolled to, and refused where something lies above."""
    page = narrow.page
    narrow.wait_for_picture(lambda picture: inked(picture) > 3000)
    left, top, across, down = narrow.view()
    assert across == 390
    assert down >= 0.4 * 844
    narrow.choose("Example", "Knob")
    narrow.says("Knob")
    (tmp_path / "cube.stl").write_bytes(trimesh.creation.box((30, 20, 10)).export(file_type="stl"))
    with page.expect_file_chooser() as chooser:
        narrow.press("Open a file")
    chooser.value.set_files(tmp_path / "cube.stl")
    narrow.says("cube.stl")
    narrow.run()
    narrow.wait_for_picture(lambda picture: blue(picture) > 8_000)
    page.mouse.click(left + across / 2, top + down * 0.53)
    page.get_by_role("button", name="Expand panel Program").click()
    page.wait_for_selector(".lab-primitive [aria-selected=true]")
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    page.get_by_role("button", name="Collapse panel Program").click()
    narrow.tab("Edit")
    narrow.box("sx mm").fill("15")
    narrow.wait_for_volume(2999, 3001)
    narrow.press("sx")
    page.get_by_role("button", name=LOCKED + "sx", exact=True).wait_for()
    narrow.tab("Relate")
    rows = page.locator(".lab-constraint [data-n]").count()
    narrow.choose("Relation", "value")
    narrow.field("Of").fill("0.sy")
    narrow.field("Value").fill("20")
    narrow.press("Add the constraint")
    page.locator(f".lab-constraint [data-n='{rows}']").wait_for()
    narrow.tab("Take")
    with page.expect_download() as waiting:
        narrow.press("Download JSON")
    assert volume(codec.loads(waiting.value.path().read_text())) == pytest.approx(3000)


def test_a_closed_page_frees_its_work(browser, server):
    page = LabPage(browser, server.url)
    page.choose("Example", "Bracket, scanned")
    page.says("scanned")
    page.press("Start")
    page.says("running")
    working = _workers(server.pid)
    assert working
    page.close()
    end = time.monotonic() + WAIT_MS / 1000
    while working <= _workers(server.pid):
        assert time.monotonic() < end, "the page is gone and its process works on"
        time.sleep(0.1)
