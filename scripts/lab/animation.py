"""A fit in the live lab as an animation: ``python scripts/lab/animation.py [part.stl] [-o docs/lab.gif]``.

A real lab in a real Chromium: the part is opened, reconstructed, one dimension is changed, two faces are measured, and it is
cut open. Waiting is shortened to at most half a second a picture. Needs a Chromium and the extras ``[lab,dev]``; everything stays on this
machine.
"""

from __future__ import annotations

import argparse
import io
import sys
import time
from pathlib import Path

from page import chromium, press, says, server, tab, window
from PIL import Image
from playwright.sync_api import Page

SIZE = 960, 540
COLOURS = 224
MOST_BYTES = 3_000_000
LONGEST_MS, REST_MS, LAST_MS = 500, 1200, 2500  # that a picture stays: one of a run, one that a person would look at, and the last
FACES = (800, 520), (628, 322)  # clicked: pixels of a window of 1280 x 720 in which the bracket's plate and the ring on its boss are seen


class Film:
    """Pictures of a page, and how long each stays."""

    def __init__(self, page: Page) -> None:
        self._page, self._pictures, self._stay = page, list[Image.Image](), list[int]()
        self._taken = time.monotonic()

    def take(self, stay: int | None = None) -> None:
        """One picture; it stays for `stay` ms, or as long as it took until the next. One that shows nothing new is left out."""
        seen = Image.open(io.BytesIO(self._page.screenshot())).convert("RGB").resize(SIZE, Image.Resampling.LANCZOS)
        now = time.monotonic()
        passed, self._taken = int(1000 * (now - self._taken)), now
        if self._pictures and self._pictures[-1].tobytes() == seen.tobytes():
            self._stay[-1] = max(self._stay[-1], stay or 0)
            return
        self._pictures.append(seen)
        self._stay.append(stay or min(max(passed, 100), LONGEST_MS))

    def save(self, path: Path) -> None:
        """As a GIF of one palette, so that what stays the same costs nothing."""
        small = [picture.resize((SIZE[0] // 2, SIZE[1] // 2), Image.Resampling.NEAREST) for picture in self._pictures]
        sheet = Image.new("RGB", (small[0].width, small[0].height * len(small)))
        for i, picture in enumerate(small):
            sheet.paste(picture, (0, i * picture.height))
        palette = sheet.quantize(COLOURS, dither=Image.Dither.NONE)
        first, *others = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in self._pictures]
        first.save(path, save_all=True, append_images=others, duration=self._stay, loop=0, optimize=False)


def main() -> int:
    """The exit status: 1 where the animation is larger than it may be."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", nargs="?", default="dataset/examples/bracket.stl")
    parser.add_argument("-o", "--output", type=Path, default=Path("docs/lab.gif"))
    given = parser.parse_args()
    with server(given.part) as (url, _), chromium() as browser:
        page = window(browser)
        page.goto(url)
        says(page, "part")
        page.wait_for_timeout(2500)
        for close in page.locator(".mantine-Notification-closeButton").all():  # says that WebGL runs in software here
            close.click()
        page.wait_for_timeout(500)
        film = Film(page)
        film.take(REST_MS)
        _fit(page, film)
        _edit(page, film)
        _measure(page, film)
        _cut(page, film)
        film.save(given.output)
    size = given.output.stat().st_size
    sys.stdout.write(f"{given.output}: {size / 1e6:.2f} MB\n")
    return int(size > MOST_BYTES)


def _fit(page: Page, film: Film) -> None:
    press(page, "Start")
    page.mouse.move(640, 700)  # off the button, which would show its hint
    while "fit: finished" not in page.locator(".lab-status").inner_text().replace("\t", " "):
        film.take()
        page.wait_for_timeout(150)
    says(page, "stateready.*of the volume")
    page.locator(".lab-row input").first.wait_for()
    page.wait_for_timeout(1000)
    film.take(REST_MS)


def _edit(page: Page, film: Film) -> None:
    """The first dimension is made half as large again, and put back."""
    box = page.locator(".lab-row input").first
    box.click()
    film.take(LONGEST_MS)
    box.fill(f"{1.5 * float(box.input_value()):g}")
    film.take(LONGEST_MS)
    box.press("Enter")
    page.wait_for_timeout(1500)
    film.take(LAST_MS)
    page.evaluate("document.activeElement?.blur()")
    page.keyboard.press("Control+z")
    page.wait_for_timeout(1500)
    film.take(LONGEST_MS)


def _measure(page: Page, film: Film) -> None:
    tab(page, "Relations")
    for place, key in zip(FACES, (None, "Control"), strict=True):
        if key:
            page.keyboard.down(key)
        page.mouse.click(*place)
        if key:
            page.keyboard.up(key)
        page.mouse.move(640, 700)
        page.wait_for_timeout(1200)
        film.take(REST_MS)
    page.locator(".lab-measured").wait_for()
    film.take(LAST_MS)
    page.keyboard.press("Escape")


def _cut(page: Page, film: Film) -> None:
    tab(page, "View")
    page.keyboard.press("i")
    page.wait_for_timeout(1200)
    film.take(LAST_MS)


if __name__ == "__main__":
    sys.exit(main())
