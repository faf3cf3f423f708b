"""Pictures of the live lab for the README: ``python scripts/lab/screenshots.py [part.stl] [-o docs]``.

Writes ``lab.png`` (a run in progress), ``lab-done.png`` (a dimension chosen after it) and ``lab-small.png`` (a
window of 390 x 844). Needs a Chromium and the extras ``[lab,dev]``; everything stays on this machine.
"""

from __future__ import annotations

import argparse
import io
import sys
from pathlib import Path

from page import chromium, press, says, server, tab, window
from PIL import Image
from playwright.sync_api import Browser, Page

COLOURS = 192  # of the palette: a picture stays below 300 kB


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", nargs="?", default="dataset/examples/bracket.stl")
    parser.add_argument("-o", "--output", type=Path, default=Path("docs"))
    given = parser.parse_args()
    with server(given.part) as (url, _), chromium() as browser:
        _large(browser, url, given.output)
        _small(browser, url, given.output)


def _large(browser: Browser, url: str, folder: Path) -> None:
    page = _opened(browser, url, 1280, 720)
    tab(page, "Curves")
    press(page, "Step")  # to the first program, and stand there
    says(page, "statepaused.*of the volume")
    page.mouse.move(640, 650)  # off the button, which would show its hint
    page.wait_for_timeout(2500)
    _save(page, folder / "lab.png")
    press(page, "Resume")
    says(page, "stateready.*fit: finished.*of the volume")
    tab(page, "Alternatives")
    page.locator(".lab-row .lab-name").nth(3).click()
    page.wait_for_timeout(2500)
    _save(page, folder / "lab-done.png")
    page.close()


def _small(browser: Browser, url: str, folder: Path) -> None:
    page = _opened(browser, url, 390, 844)
    press(page, "Start")
    page.mouse.move(195, 60)  # off the button, which would show its hint
    says(page, "volume.*of the volume")
    page.wait_for_timeout(2500)
    _save(page, folder / "lab-small.png")
    page.close()


def _opened(browser: Browser, url: str, width: int, height: int) -> Page:
    page = window(browser, (width, height))
    page.goto(url)
    says(page, "part")
    page.wait_for_timeout(2500)
    for close in page.locator(".mantine-Notification-closeButton").all():  # says that WebGL runs in software here
        close.click()
    page.wait_for_timeout(500)
    return page


def _save(page: Page, path: Path) -> None:
    picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
    picture.save(path, optimize=True)
    sys.stdout.write(f"{path}: {path.stat().st_size / 1000:.0f} kB\n")


if __name__ == "__main__":
    main()
