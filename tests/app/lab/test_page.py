"""The lab in a real browser: from an example to the files, with what a person sees checked in pixels."""

import json
import math
import os
import re
import signal
import subprocess
from pathlib import Path

import pytest
import trimesh
from tests.app.lab.browser import LabPage, blue, chromium, inked, lab, needs_chromium, red

from imdim.geometry.solid import volume
from imdim.program import codec

pytestmark = [needs_chromium, pytest.mark.browser]
EXACT = 80 * 50 * 8 + math.pi * 14**2 * 16 - 4 * math.pi * 9 * 8 - math.pi * 64 * 24


@pytest.fixture(scope="module")
def url():
    with lab() as address:
        yield address


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


@pytest.fixture(scope="module")
def done(browser, url):
    """A client whose part is reconstructed; tests leave it as they found it."""
    page = LabPage(browser, url)
    page.wait_for_picture(lambda picture: inked(picture) > 3000)
    assert red(page.picture()) == 0
    page.run()
    yield page
    page.close()


def test_the_solid_appears_with_its_cutters(done):
    done.wait_for_picture(lambda picture: blue(picture) > 20_000 and red(picture) > 800)
    assert done.volume() == pytest.approx(EXACT, rel=2e-3)
    assert done.status("primitives") == "7"
    assert float(done.status("error").split("%")[0]) < 0.1


def test_a_click_selects_in_picture_tree_and_code(done):
    page = done.page
    before = done.picture()
    page.mouse.click(630, 400)
    page.wait_for_selector(".lab-primitive [role=treeitem][aria-selected=true]")
    leaf = page.locator(".lab-primitive [aria-selected=true]").get_attribute("data-n")
    assert "boss" in page.locator(".lab-primitive [aria-selected=true]").inner_text()
    done.tab("Code")
    assert "r = 14" in page.locator(".lab-primitive [aria-pressed=true]").inner_text()
    done.tab("Edit")
    assert done.box("Primitive").input_value() == leaf
    done.wait_for_picture(lambda picture: red(picture) > red(before) + 5000)
    page.keyboard.press("Escape")
    page.mouse.move(640, 650)
    done.tab("Program")
    page.keyboard.press("j")
    page.wait_for_selector(".lab-primitive [data-n='0'][aria-selected=true]")
    page.keyboard.press("Escape")
    page.wait_for_function("!document.querySelector('.lab-primitive [aria-selected=true]')")


def test_a_radius_is_edited_and_the_edit_undone(done):
    done.tab("Program")
    done.select(3)
    before = done.picture()
    done.tab("Edit")
    done.box("r mm").fill("5")
    done.tab("Run")
    larger = EXACT - 4 * math.pi * (25 - 9) * 8  # the four holes have one radius
    done.wait_for_volume(0.998 * larger, 1.002 * larger)
    done.wait_for_picture(lambda picture: red(picture) > red(before) + 400)
    done.page.locator("body").press("Control+z")
    done.wait_for_volume(0.998 * EXACT, 1.002 * EXACT)
    done.page.locator("body").press("Control+y")
    done.wait_for_volume(0.998 * larger, 1.002 * larger)
    done.page.locator("body").press("Control+z")
    done.wait_for_volume(0.998 * EXACT, 1.002 * EXACT)


def test_a_constraint_is_added_and_the_solver_finishes_under_it(done):
    done.tab("Relate")
    rows = done.page.locator(".lab-constraint [data-n]").count()
    assert rows > 5
    done.box("Relation").fill("value")
    done.page.get_by_role("option", name="value", exact=True).click()
    for label, text in (("Of", "1.r"), ("Value", "13")):
        box = done.page.locator("label", has_text=re.compile(f"^{label}$")).locator("xpath=../../..").locator("input")
        box.fill(text)
    done.press("Add the constraint")
    done.page.wait_for_selector(f".lab-constraint [data-n='{rows}']")
    assert "off by" in done.page.locator(f".lab-constraint [data-n='{rows}']").inner_text()
    done.tab("Edit")
    done.press("Let the solver finish")
    done.tab("Run")
    smaller = EXACT - math.pi * (14**2 - 13**2) * 16
    done.wait_for_volume(0.998 * smaller, 1.002 * smaller)
    done.tab("Edit")
    for _ in range(2):
        done.press("Undo")
    done.tab("Run")
    done.wait_for_volume(0.998 * EXACT, 1.002 * EXACT)


def test_a_point_of_the_front_is_clicked(done):
    done.page.locator("svg [role=button][data-n='1']").click()
    done.wait_for_volume(31_000, 33_000)  # the plate alone
    done.page.locator("body").press("Control+z")
    done.wait_for_volume(0.998 * EXACT, 1.002 * EXACT)


def test_every_format_is_downloaded(done, browser, tmp_path):
    done.tab("Take")
    begins = {
        "JSON": b"{",
        "OpenSCAD": b"$fn = 96;",
        "STEP": b"ISO-10303-21;",
        "build123d": b"",
        "STL": b"IMDIM",
        "GLB": b"glTF",
        "3MF": b"PK",
        "PNG": b"\x89PNG",
        "HTML report": b"<!",
    }
    files = {}
    for label, start in begins.items():
        with done.page.expect_download() as waiting:
            done.press(f"Download {label}")
        files[label] = tmp_path / waiting.value.suggested_filename
        waiting.value.save_as(files[label])
        assert files[label].read_bytes().startswith(start), label
    assert codec.parse(files["JSON"].read_bytes())["units"] == "millimeter"  # type: ignore[index]
    assert volume(codec.loads(files["JSON"].read_text()), 512) == pytest.approx(EXACT, rel=1e-4)
    _opens_anywhere(browser, files["HTML report"])
    done.tab("Run")


def _opens_anywhere(browser, report: Path):
    page, asked = browser.new_page(), []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(report.as_uri())
    page.wait_for_selector("canvas")
    page.close()
    assert all(address.startswith(("file:", "data:", "blob:")) for address in asked)


def test_junk_is_refused_in_one_line_and_the_lab_goes_on(browser, url, tmp_path):
    page = LabPage(browser, url)
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
    for name, text in says.items():
        page.page.set_input_files("input[type=file]", tmp_path / name)
        page.page.wait_for_function("t => document.querySelector('.lab-notice')?.textContent.includes(t)", arg=f"{name}: ")
        assert text in page.page.locator(".lab-notice").inner_text()
        assert page.status("part") == "Bracket"
    page.page.set_input_files("input[type=file]", tmp_path / "cube.stl")
    page.says("cube.stl")
    page.run()
    assert page.volume() == pytest.approx(6.0, rel=1e-3)
    page.close()


def test_two_clients_work_on_their_own_and_survive_a_killed_run(browser, url):
    one, two = LabPage(browser, url), LabPage(browser, url)
    two.box("Example").click()
    two.page.get_by_role("option", name="Knob", exact=True).click()
    two.says("Knob")
    one.press("Start")
    two.press("Start")
    one.says("(finished)")
    two.says("volume")
    assert (one.status("part"), two.status("part")) == ("Bracket", "Knob")
    two.press("Stop")
    one.box("Example").click()
    one.page.get_by_role("option", name="Bracket, scanned", exact=True).click()
    one.says("scanned")
    one.press("Start")
    one.says("running")
    _kill_a_worker()
    one.page.wait_for_function("document.querySelector('.lab-notice')?.textContent.includes('SIGKILL')")
    one.close()
    two.run()
    two.close()


def _kill_a_worker():
    """The process that works hardest: that of the run."""
    listed = subprocess.run(["ps", "-eo", "pid,ppid,pcpu,args", "--sort=-pcpu"], capture_output=True, text=True, check=True).stdout
    lab_pid = next(line.split()[0] for line in listed.splitlines() if "imdim.app.cli lab" in line)
    workers = [int(line.split()[0]) for line in listed.splitlines() if line.split()[1] == lab_pid and "spawn_main" in line]
    for pid in workers:
        os.kill(pid, signal.SIGKILL)


@pytest.mark.parametrize(("width", "height"), [(1280, 720), (390, 844)])
def test_both_windows_show_part_and_buttons(browser, url, width, height):
    page = LabPage(browser, url, width, height)
    assert page.page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.page.get_by_role("button", name="Start", exact=True).is_visible()
    page.press("Start")
    page.says("(finished)")
    shown = page.page.evaluate("JSON.stringify([...document.querySelectorAll('canvas')].map(c => c.getBoundingClientRect()))")
    assert max(c["width"] for c in json.loads(shown)) >= min(width, 390)
    page.close()
