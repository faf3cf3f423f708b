"""Pictures of the live lab for the README: ``python scripts/lab_screenshots.py [part.stl] [-o docs]``.

Writes ``lab.png`` (a run in progress), ``lab-done.png`` (a primitive selected after it, with the distance map) and ``lab-small.png`` (a
window of 390 x 844). Needs a Chromium and the extras ``[lab,dev]``; everything stays on this machine.
"""

from __future__ import annotations

import argparse
import io
import shutil
import subprocess
import sys
from pathlib import Path

from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

WAIT_MS = 120_000
COLOURS = 192  # of the palette: a picture stays below 300 kB


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", nargs="?", default="dataset/examples/bracket.stl")
    parser.add_argument("-o", "--output", type=Path, default=Path("docs"))
    given = parser.parse_args()
    command = [sys.executable, "-m", "imdim.app.cli", "lab", given.part, "--no-browser", "--port", "0"]
    lab = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert lab.stdout is not None
    try:
        url = next(line.split()[-1] for line in lab.stdout if "Live Lab: http" in line)
        with sync_playwright() as playwright:
            chromium = shutil.which("chromium") or shutil.which("google-chrome")
            browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
            _large(browser, url, given.output)
            _small(browser, url, given.output)
            browser.close()
    finally:
        lab.terminate()
        lab.wait(30)


def _large(browser: Browser, url: str, folder: Path) -> None:
    page = _opened(browser, url, 1280, 720)
    page.get_by_role("tab", name="Curves", exact=True).click()
    _press(page, "Step")  # to the first program, and stand there
    page.wait_for_function("/statepaused.*IoU/.test(document.querySelector('.lab-status').textContent)")
    page.mouse.move(640, 650)  # off the button, which would show its hint
    page.wait_for_timeout(2500)
    _save(page, folder / "lab.png")
    _press(page, "Resume")
    _wait_for_end(page)
    page.get_by_role("tab", name="Front", exact=True).click()
    page.locator(".lab-primitive [role=treeitem]").first.click()
    page.get_by_role("tab", name="Edit", exact=True).click()
    page.wait_for_timeout(2500)
    _save(page, folder / "lab-done.png")
    page.close()


def _small(browser: Browser, url: str, folder: Path) -> None:
    page = _opened(browser, url, 390, 844)
    _press(page, "Start")
    page.mouse.move(195, 60)  # off the button, which would show its hint
    page.wait_for_function("/volume.*IoU/.test(document.querySelector('.lab-status').textContent)")
    page.wait_for_timeout(2500)
    _save(page, folder / "lab-small.png")
    page.close()


def _opened(browser: Browser, url: str, width: int, height: int) -> Page:
    page = browser.new_page(viewport={"width": width, "height": height})
    page.set_default_timeout(WAIT_MS)
    page.goto(url)
    page.wait_for_function("document.querySelector('.lab-status')?.textContent.includes('part')")
    page.wait_for_timeout(2500)
    for close in page.locator(".mantine-Notification-closeButton").all():  # says that WebGL runs in software here
        close.click()
    page.wait_for_timeout(500)
    return page


def _wait_for_end(page: Page) -> None:
    page.wait_for_function("/stateready.*fit: finished.*IoU/.test(document.querySelector('.lab-status').textContent)")


def _press(page: Page, name: str) -> None:
    page.get_by_role("button", name=name, exact=True).click()


def _save(page: Page, path: Path) -> None:
    picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
    picture.save(path, optimize=True)
    sys.stdout.write(f"{path}: {path.stat().st_size / 1000:.0f} kB\n")


if __name__ == "__main__":
    main()
