"""The pictures of docs/: ``python scripts/make_docs_pictures.py [only ...]`` draws them with the page of report.html in Chromium.

Needs Playwright and Chromium (`pip install -e '.[dev]'`, `apt-get install chromium`). Each picture stays below 200 kB.
"""

from __future__ import annotations

import io
import shutil
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from imdim.delivery.deliver import RunRecord, deliver
from imdim.export.html import content, page
from imdim.program.codec import to_json
from imdim.program.front import Choice, loads
from imdim.program.tree import Combine, Primitive, Program, leaves
from imdim.reconstruction.fitting import relations_of
from imdim.target.target import load_target

ROOT = Path(__file__).parents[1]
PICTURES = ROOT / "docs" / "pictures"
PANEL = (420, 330)
MOST_BYTES = 190_000
INK = (38, 46, 58)


class Browser:
    """Chromium, which draws pages of programs."""

    def __init__(self) -> None:
        from playwright.sync_api import sync_playwright

        self._tools = sync_playwright().start()
        self._browser = self._tools.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])

    def close(self) -> None:
        self._browser.close()
        self._tools.stop()

    def window(self, path: Path, width: int, height: int, act: Callable[[object], None] | None = None) -> Image.Image:
        """A whole window with a page; `act` may click in it first."""
        tab = self._browser.new_page(viewport={"width": width, "height": height}, device_scale_factor=1)
        tab.goto(path.as_uri())
        tab.wait_for_selector("html[data-drawn]", state="attached")
        if act:
            act(tab)
        tab.wait_for_timeout(300)
        image = Image.open(io.BytesIO(tab.screenshot())).convert("RGB")
        tab.close()
        return image

    def solid(self, program: Program, cutters: bool = False, leaf: int | None = None) -> Image.Image:
        """One program from the usual side, with its cutters shining through or one leaf selected."""

        def act(tab) -> None:
            if cutters:
                tab.get_by_role("button", name="Cutters").click()
            if leaf is not None:
                tab.locator(".sizes").nth(leaf).click()

        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "page.html"
            path.write_text(page(content(to_json(program))), encoding="utf-8")
            shot = self.window(path, 1200, 640, act)
        return shot.crop((40, 130, 760, 590)).resize(PANEL, Image.Resampling.LANCZOS)


def operations(browser: Browser) -> Image.Image:
    box, rod = Primitive("box", (40.0, 26.0, 16.0)), Primitive("cylinder", (9.0, 30.0), center=(6.0, 0.0, 0.0))
    return row([(op, browser.solid(Combine(op, box, rod), op == "difference")) for op in ("union", "difference", "intersection")])


def front(browser: Browser) -> Image.Image:
    choices = _front()
    shown = [choices[i] for i in (0, 1, 3, 5)]
    return row([(f"{counted(c.program)}, {100 * (c.error or 0):.2g} % off", browser.solid(c.program)) for c in shown])


def steps(browser: Browser) -> Image.Image:
    """The bracket as it grows, in the order of its program."""
    prefixes = _prefixes(_front()[5].program)
    shown = [prefixes[i] for i in (0, 3, 5, 7, 10, len(prefixes) - 1)]
    panels = [(counted(p), browser.solid(p, cutters=True)) for p in shown]
    return stacked([row(panels[:3]), row(panels[3:])])


def report(browser: Browser) -> Image.Image:
    choices = _front()
    program, constraints = relations_of(choices[5].program)
    choices = [*choices[:5], Choice(program, choices[5].error), *choices[6:]]
    target = load_target(ROOT / "dataset/examples/bracket.stl")
    record = RunRecord("dataset/examples/bracket.stl", {"search": 13.5}, "finished", 0, {}, "proved minimal over these candidates")
    with tempfile.TemporaryDirectory() as folder:
        deliver(program, target, Path(folder) / "bracket", record, step_limit_s=0.0, constraints=constraints, front=choices)
        path = Path(folder) / "bracket" / "report.html"
        return browser.window(path, 1280, 720, lambda tab: tab.locator(".row", has_text="cone").first.click())


def cells(_: Browser) -> Image.Image:
    """A plate with a bump and a hole, in the plane: two lines and two circles, and the pieces into which they cut a square."""
    size, big = 520, 1560
    y, x = np.mgrid[0:big, 0:big] / big
    kept, bump, hole = (y < 0.75) & (y > 0.45), np.hypot(x - 0.62, y - 0.45) < 0.2, np.hypot(x - 0.27, y - 0.6) < 0.09
    inside = (kept | (bump & (y < 0.75))) & ~hole
    piece = (y > 0.45) + 2.0 * (y > 0.75) + 4 * bump + 8 * hole
    shade = np.array([9, 0, -18, 26, -24, 30, -9, 18, 6, -24, 15, -15, 27, -27, 9, -6])[piece.astype(int) % 16]
    pixels = np.where(inside[..., None], np.array([104, 146, 196]), np.array([236, 240, 244])) + shade[..., None]
    image = Image.fromarray(np.clip(pixels, 0, 255).astype(np.uint8))
    draw = ImageDraw.Draw(image)
    for level in (0.45, 0.75):
        draw.line([(0, level * big), (big, level * big)], fill=INK, width=6)
    for cx, cy, r in ((0.62, 0.45, 0.2), (0.27, 0.6, 0.09)):
        draw.ellipse([(cx - r) * big, (cy - r) * big, (cx + r) * big, (cy + r) * big], outline=INK, width=6)
    return image.resize((size, size), Image.Resampling.LANCZOS).crop((0, 80, size, 440))


DRAWN: Mapping[str, Callable[[Browser], Image.Image]] = {
    "operations": operations,
    "front": front,
    "steps": steps,
    "report": report,
    "cells": cells,
}


def counted(program: Program) -> str:
    count = len(list(leaves(program)))
    return f"{count} primitive{'' if count == 1 else 's'}"


def row(panels: list[tuple[str, Image.Image]]) -> Image.Image:
    """Pictures beside each other, with a line of text below each."""
    width, height = PANEL
    sheet = Image.new("RGB", (width * len(panels), height + 34), (246, 248, 250))
    draw = ImageDraw.Draw(sheet)
    for i, (text, panel) in enumerate(panels):
        sheet.paste(panel, (i * width, 0))
        draw.text((i * width + width / 2, height + 4), text, font=ImageFont.load_default(22), fill=INK, anchor="ma")
    return sheet


def stacked(rows: list[Image.Image]) -> Image.Image:
    sheet = Image.new("RGB", (rows[0].width, sum(r.height for r in rows)))
    top = 0
    for image in rows:
        sheet.paste(image, (0, top))
        top += image.height
    return sheet


def _front() -> list[Choice]:
    return list(loads((ROOT / "examples/bracket_front.json").read_bytes())[0])


def _prefixes(program: Program) -> list[Program]:
    """The programs of the first one, two, three ... leaves."""
    total = len(list(leaves(program)))
    return [found for n in range(1, total + 1) if (found := _first(program, n)[0]) is not None]


def _first(program: Program, n: int) -> tuple[Program | None, int]:
    """What the first `n` leaves make, and how many of the `n` are left over."""
    if isinstance(program, Primitive):
        return (program, n - 1) if n > 0 else (None, 0)
    left, rest = _first(program.left, n)
    right, rest = _first(program.right, rest)
    return (left if left is None or right is None else Combine(program.op, left, right)), rest


def main(only: list[str]) -> None:
    PICTURES.mkdir(exist_ok=True)
    browser = Browser()
    for name, draw in DRAWN.items():
        if not only or name in only:
            path = PICTURES / f"{name}.png"
            image = draw(browser)
            image.save(path, optimize=True)
            if path.stat().st_size > MOST_BYTES:
                image.quantize(256, dither=Image.Dither.NONE).save(path, optimize=True)
            print(f"{path.relative_to(ROOT)}: {path.stat().st_size / 1000:.0f} kB")
    browser.close()


if __name__ == "__main__":
    main(sys.argv[1:])
