"""A real Chromium for the lab's tests, and what they read off its page."""

import io
import math
import re
import shutil
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
import pytest
from PIL import Image

from imdim.app.lab.camera import AWAY, STANDARD_VIEWS
from imdim.app.lab.drawing import SPAN

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
WAIT_MS = 120_000  # for what takes a second on a machine that has nothing else to do
FOLDER_MS = 400  # for one that opens
DROPDOWN_MS = 5_000  # for a choice of an open dropdown
COARSE = "?fixedDpr=0.5"  # a quarter of the pixels: without a graphics card they are what takes the time
in_the_lab = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")
# Chromium fills the address bar of each window with pages of its own, half a second of a core
FIELD_OF_VIEW = math.radians(75.0)  # of the toolkit's camera
HAND_MS = 200  # a hand takes from one input to the next: the toolkit gathers messages for 50 ms and keeps the last of a kind
BARE = ("--no-sandbox", "--disable-features=WebUIOmniboxPopup,WebUIOmniboxAimPopup,WebUIOmniboxFullPopup")
EXACT = 80 * 50 * 8 + math.pi * 14**2 * 16 - 4 * math.pi * 9 * 8 - math.pi * 64 * 24  # the volume of the example "Bracket"
NEAR = (0.998, 1.002)  # facets


class Lab(NamedTuple):
    """A running server."""

    url: str
    pid: int


@contextmanager
def lab(*arguments):
    """A running `imdim lab`, which does not break where nobody sees it."""
    command = [sys.executable, "-m", "imdim.app.cli", "lab", "--no-browser", "--port", "0", *arguments]
    with tempfile.TemporaryFile("w+") as errors:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True)
        try:
            line = next((text for text in process.stdout if "Live Lab: http" in text), None)
            assert line is not None, _read(errors)
            yield Lab(line.split()[-1], process.pid)
        finally:
            process.terminate()
            try:
                process.communicate(timeout=30)
            except subprocess.TimeoutExpired:
                process.kill()
                process.communicate()
        assert "Traceback" not in _read(errors), _read(errors)


def _read(file):
    file.seek(0)
    return file.read()


@contextmanager
def chromium():
    """The browser. WebGL runs in software where there is no graphics card."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=BARE)
        yield browser
        browser.close()


class LabPage:
    """One client. `foreign` lists requests that left this machine, `said` what the browser complained of."""

    def __init__(self, browser, url, width=1280, height=720):
        self.foreign, self.said = [], []
        self.page = browser.new_page(viewport={"width": width, "height": height}, accept_downloads=True)
        self.page.set_default_timeout(WAIT_MS)
        self.page.on("request", lambda r: None if r.url.startswith((url, "data:", "blob:")) else self.foreign.append(r.url))
        self.page.on("console", lambda m: self.said.append(m.text) if m.type in ("error", "warning") else None)
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("crash", lambda _: self.said.append("the page crashed"))
        self.page.goto(url + COARSE)
        self.says("part")

    def says(self, text):
        """Wait until the status says it."""
        self.page.wait_for_function("t => document.querySelector('.lab-status')?.textContent.includes(t)", arg=text)

    def status(self, row):
        """The value of a row of the status, "" where it has none."""
        rows = "r => [...document.querySelectorAll('.lab-status tr')].find(e => e.cells[0].textContent === r)?.cells[1].textContent ?? ''"
        return self.page.evaluate(rows, row)

    def volume(self):
        return float(re.findall(r"[\d.e+]+", self.status("volume"))[0])

    def wait_for_volume(self, low, high):
        self.page.wait_for_function(
            """([a, b]) => {
                const row = [...document.querySelectorAll('.lab-status tr')].find(r => r.textContent.startsWith('volume'));
                const v = row ? parseFloat(row.textContent.slice(6)) : NaN;
                return a <= v && v <= b;
            }""",
            arg=[low, high],
        )

    def measures(self, exact):
        """Wait until the volume is that, but for facets."""
        self.wait_for_volume(*(exact * share for share in NEAR))

    def press(self, name):
        self.page.get_by_role("button", name=name, exact=True).click()

    def tab(self, name):
        self.page.get_by_role("tab", name=name, exact=True).click()

    def box(self, label):
        return self.page.get_by_label(label, exact=True)

    def field(self, label):
        """A text input, which the toolkit does not tie to its label."""
        return self.page.locator("label", has_text=re.compile(f"^{label}$")).locator("xpath=../../..").locator("input")

    def spot(self, frame, point):
        """The pixel at which a point of the part is seen from the corner that the view begins at."""
        left, top, width, height = self.view()
        away = AWAY * np.array(STANDARD_VIEWS["Corner"][0]) / np.linalg.norm(STANDARD_VIEWS["Corner"][0])
        back = away / np.linalg.norm(away)
        right = np.cross([0.0, 0.0, 1.0], back) / np.linalg.norm(np.cross([0.0, 0.0, 1.0], back))
        seen = np.stack([right, np.cross(back, right), back]) @ (frame.to_unit(np.array(point, float)) * SPAN - away)
        size = height / 2 / math.tan(FIELD_OF_VIEW / 2)
        return left + width / 2 - size * seen[0] / seen[2], top + height / 2 + size * seen[1] / seen[2]

    def click_spot(self, frame, point, key=None):
        """Click what is seen of a point of the part, with a key held; the toolkit's word on WebGL must not lie over it."""
        self.page.evaluate("document.querySelectorAll('.mantine-Notification-closeButton').forEach((e) => e.click())")
        self.page.wait_for_function("!document.querySelector('.mantine-Notification-root')")
        if key:
            self.page.keyboard.down(key)
        self.page.mouse.click(*self.spot(frame, point))
        if key:
            self.page.keyboard.up(key)

    def drag_spot(self, frame, start, end):
        """Drag what is seen of one point to another."""
        self.page.mouse.move(*self.spot(frame, start))
        self.page.mouse.down()
        self.page.mouse.move(*self.spot(frame, end), steps=8)
        self.page.wait_for_timeout(HAND_MS)
        self.page.mouse.up()

    def measured(self, text):
        """Wait until that is measured."""
        self.page.wait_for_function("t => document.querySelector('.lab-measured')?.textContent === t", arg=text)

    def select(self, leaf):
        """By a click in the tree."""
        self.tab("Program")
        self.page.locator(f".lab-primitive [role=treeitem][data-n='{leaf}']").click()
        self.page.wait_for_selector(f".lab-primitive [data-n='{leaf}'][aria-selected=true]")

    def parameters(self):
        """The values of the table by their names."""
        boxes = self.page.locator(".lab-row input").evaluate_all("all => all.map((e) => [e.dataset.name, e.value])")
        return {name: float(value) for name, value in boxes}

    def set_parameter(self, name, value):
        """By hand, in the table."""
        self.box(name).fill(value)
        self.box(name).press("Enter")

    def press_folder(self, name):
        """Open or close it, and wait as a hand does: what is pressed in a folder that still grows may not take it."""
        self.page.get_by_text(name).click()
        self.page.wait_for_timeout(FOLDER_MS)

    def relate(self, kind, of, value):
        """Add a constraint that has a value."""
        if not self.box("Relation").is_visible():
            self.press_folder("Write a relation")
        self.choose("Relation", kind)
        self.field("Of").fill(of)
        self.page.wait_for_timeout(HAND_MS)
        self.field("Value").fill(value)
        self.page.wait_for_timeout(HAND_MS)
        self.press("Add the relation")

    def undo(self, steps=1):
        for _ in range(steps):
            self.keys("Control+z")

    def run(self):
        """Reconstruct what is open."""
        self.press("Start")
        self.says("finished")

    def notice(self, text):
        """Wait until the last message says it, and give all of it."""
        self.page.wait_for_function("t => document.querySelector('.lab-notice')?.textContent.includes(t)", arg=text)
        return self.page.locator(".lab-notice").inner_text()

    def choose(self, label, value):
        """Of a dropdown, which the page closes when something moves it: then it is opened again."""
        from playwright.sync_api import TimeoutError as PlaywrightTimeout

        option, end = self.page.get_by_role("option", name=value, exact=True), time.monotonic() + WAIT_MS / 1000
        while True:
            if not option.is_visible():
                self.box(label).click()
            try:
                return option.click(timeout=DROPDOWN_MS)
            except PlaywrightTimeout:
                assert time.monotonic() < end, f"{value} of {label} never stood still"

    def keys(self, *names):
        """Pressed where no input has the focus. Escape takes what is selected away, and with it the inputs, in which nothing is to be typed
        until the answer is there."""
        self.page.evaluate("document.activeElement?.blur()")
        for name in names:
            self.page.keyboard.press(name)
        if "Escape" in names:
            self.page.wait_for_selector(".lab-primitive [aria-selected=true]", state="detached")

    def view(self):
        """Where the 3D view is seen: left, top, width, height."""
        boxes = [c.bounding_box() for c in self.page.locator("canvas").all()]
        largest = max((b for b in boxes if b), key=lambda b: b["width"] * b["height"])
        return tuple(round(largest[k]) for k in ("x", "y", "width", "height"))

    def picture(self):
        """What is seen of the 3D view [h, w, 3], without the messages that lie over its top."""
        x, y, width, height = self.view()
        top = min(210, height // 3)  # three or four lines, by the fonts that there are
        shot = self.page.screenshot(clip={"x": x, "y": y + top, "width": width, "height": height - top})
        return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB"), np.int64)

    def picture_of(self, selector):
        """What is seen of an element [h, w, 3]."""
        return np.asarray(Image.open(io.BytesIO(self.page.locator(selector).screenshot())).convert("RGB"), np.int64)

    def wait_for_picture(self, good):
        """Until the picture is as it should be."""
        end = time.monotonic() + WAIT_MS / 1000
        while not good(self.picture()):
            assert time.monotonic() < end, f"the picture never came; the browser said {self.said[-9:]}"
            self.page.wait_for_timeout(100)

    def close(self):
        self.page.close()
        assert self.foreign == [], "requests left this machine"


def blue(picture):
    return int((picture[..., 2] - picture[..., 0] > 40).sum())


def red(picture):
    return int((picture[..., 0] - picture[..., 2] > 70).sum())


def green(picture):
    return int((picture[..., 1] - picture[..., 0] > 60).sum())


def inked(picture):
    return int((picture.min(axis=2) < 240).sum())


def hot(picture):
    """Far off, in the colours of the distance map."""
    return int((picture[..., 0] - picture[..., 1] > 100).sum())


def purple(picture):
    """Faces that were clicked."""
    return int(((picture[..., 2] - picture[..., 1] > 60) & (picture[..., 0] - picture[..., 1] > 15)).sum())


def slate(picture):
    """Where the part is cut open: dark, and hardly blue."""
    return int(((picture.max(axis=2) < 125) & (picture[..., 2] - picture[..., 0] > 8) & (picture[..., 2] - picture[..., 0] < 45)).sum())


def changed(picture, before):
    return int((np.abs(picture - before).max(axis=2) > 40).sum())
