"""A real Chromium for the lab's tests, and what they read off its page."""

import io
import re
import shutil
import subprocess
import sys
from contextlib import contextmanager

import numpy as np
import pytest
from PIL import Image

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
WAIT_MS = 90_000  # for what takes a second on a machine that has nothing else to do
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")


@contextmanager
def lab(*arguments):
    """A running `imdim lab`, by its address."""
    command = [sys.executable, "-m", "imdim.app.cli", "lab", "--no-browser", "--port", "0", *arguments]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        line = next((text for text in process.stdout if "Live Lab: http" in text), None)
        assert line is not None, process.stderr.read()
        yield line.split()[-1]
    finally:
        process.terminate()
        try:
            process.communicate(timeout=30)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()


@contextmanager
def chromium():
    """The browser. WebGL runs in software where there is no graphics card."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


class LabPage:
    """One client. `foreign` lists requests that left this machine."""

    def __init__(self, browser, url, width=1280, height=720):
        self.foreign = []
        self.page = browser.new_page(viewport={"width": width, "height": height}, accept_downloads=True)
        self.page.set_default_timeout(WAIT_MS)
        self.page.on("request", lambda r: None if r.url.startswith((url, "data:", "blob:")) else self.foreign.append(r.url))
        self.page.goto(url)
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

    def press(self, name):
        self.page.get_by_role("button", name=name, exact=True).click()

    def tab(self, name):
        self.page.get_by_role("tab", name=name, exact=True).click()

    def box(self, label):
        return self.page.get_by_label(label, exact=True)

    def select(self, leaf):
        """By a click in the tree."""
        self.page.locator(f".lab-primitive [role=treeitem][data-n='{leaf}']").click()
        self.page.wait_for_selector(f".lab-primitive [data-n='{leaf}'][aria-selected=true]")

    def run(self):
        """Reconstruct what is open."""
        self.press("Start")
        self.says("(finished)")

    def picture(self):
        """The 3D view between the panels [h, w, 3]."""
        shot = Image.open(io.BytesIO(self.page.screenshot())).convert("RGB")
        return np.asarray(shot, np.int64)[180:700, 320:940]

    def wait_for_picture(self, good, tries=60):
        """Until the picture is as it should be."""
        for _ in range(tries):
            if good(self.picture()):
                return
            self.page.wait_for_timeout(300)
        raise AssertionError("the picture never came")

    def close(self):
        self.page.close()
        assert self.foreign == [], "requests left this machine"


def blue(picture):
    return int((picture[..., 2] - picture[..., 0] > 40).sum())


def red(picture):
    return int((picture[..., 0] - picture[..., 2] > 70).sum())


def inked(picture):
    return int((picture.min(axis=2) < 240).sum())
