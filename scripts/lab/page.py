"""The live lab as scripts see it: a running server, a Chromium, and what its pages say and draw."""

from __future__ import annotations

import contextlib
import io
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

WAIT_MS = 120_000
POLL_MS = 30
WINDOW = 1280, 720
# Counts what is drawn, and what is drawn of something new. An edit is taken from the key to the first frame whose pixels have changed: they
# are read back in the frame itself, which waits until it is drawn; nothing polls and no pictures are taken meanwhile.
PROBE = """window.lab = { drawn: 0, sent: 0, anew: 0, frames: 0 };
const raf = window.requestAnimationFrame.bind(window);
window.requestAnimationFrame = (f) => raf((t) => {
  const before = lab.drawn;
  f(t);
  if (lab.drawn > before) { lab.frames++; lab.after?.(); } });
const draw = () => { lab.drawn++; if (lab.sent) lab.anew++; };
const calls = ['drawElements', 'drawArrays', 'drawElementsInstanced', 'drawArraysInstanced'];
const sends = ['bufferData', 'bufferSubData'].map((name) => [name, () => lab.sent++]);
for (const [call, does] of [...sends, ...calls.map((name) => [name, draw])]) {
  const plain = WebGL2RenderingContext.prototype[call];
  WebGL2RenderingContext.prototype[call] = function (...given) { does(); return plain.apply(this, given); };
}
lab.status = (name) => [...document.querySelectorAll('.lab-status tr')].find((r) => r.cells[0].textContent === name)?.cells[1].textContent;
lab.pixels = () => {
  const area = (c) => c.width * c.height, canvas = [...document.querySelectorAll('canvas')].sort((a, b) => area(b) - area(a))[0];
  const gl = canvas.getContext('webgl2'), [w, h] = [canvas.width >> 1, canvas.height >> 1], p = new Uint8Array(4 * w * h);
  gl.readPixels(w >> 1, h >> 1, w, h, gl.RGBA, gl.UNSIGNED_BYTE, p); // its middle
  return p; };
lab.differ = (a, b) => { let n = 0; for (let i = 0; i < a.length; i += 4)
  if (Math.abs(a[i] - b[i]) > 40 || Math.abs(a[i + 1] - b[i + 1]) > 40 || Math.abs(a[i + 2] - b[i + 2]) > 40) n++;
  return n; };
lab.expect = (least) => {
  const volume = lab.status('volume'), before = lab.pixels();
  let start;
  addEventListener('keydown', (e) => { start = e.timeStamp; }, { once: true, capture: true });
  lab.sent = 0;
  lab.told = new Promise((done) => {
    const seen = new MutationObserver(() => {
      if (lab.status('volume') !== volume) { seen.disconnect(); done(performance.now() - start); } });
    seen.observe(document.body, { childList: true, subtree: true, characterData: true }); });
  lab.seen = new Promise((done) => { lab.after = () => {
      if (lab.sent && lab.differ(lab.pixels(), before) > least) { lab.after = null; done(performance.now() - start); } }; });
};"""
SHOT = {"x": 320, "y": 180, "width": 620, "height": 520}


@contextlib.contextmanager
def server(*arguments: str) -> Iterator[tuple[str, int]]:
    """The address and the process of a running `imdim lab`."""
    command = [sys.executable, "-m", "imdim.app.cli", "lab", *arguments, "--no-browser", "--port", "0"]
    lab = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert lab.stdout is not None
    try:
        yield next(line.split()[-1] for line in lab.stdout if "Live Lab: http" in line), lab.pid
    finally:
        lab.terminate()
        lab.wait(30)


@contextlib.contextmanager
def chromium() -> Iterator[Browser]:
    """The browser. WebGL runs in software where there is no graphics card."""
    found = shutil.which("chromium") or shutil.which("google-chrome")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found, args=["--no-sandbox"])
        yield browser
        browser.close()


def window(browser: Browser, size: tuple[int, int] = WINDOW) -> Page:
    """An empty one."""
    page = browser.new_page(viewport={"width": size[0], "height": size[1]})
    page.set_default_timeout(WAIT_MS)
    return page


def press(page: Page, name: str) -> None:
    """A button."""
    page.get_by_role("button", name=name, exact=True).click()


def tab(page: Page, name: str) -> None:
    page.get_by_role("tab", name=name, exact=True).click()


def says(page: Page, pattern: str) -> None:
    """Wait until the status matches a JavaScript pattern."""
    page.wait_for_function("p => new RegExp(p).test(document.querySelector('.lab-status')?.textContent)", arg=pattern, polling=POLL_MS)


def upload(page: Page, part: Path) -> None:
    """Open a file, and wait until it is there."""
    page.set_input_files("input[type=file]", part)
    page.wait_for_function("n => document.querySelector('.lab-status').textContent.includes('part' + n)", arg=part.name)
    page.wait_for_function("!document.querySelector('.lab-status').textContent.includes('volume')")


def inked(page: Page) -> int:
    """Pixels of the 3D view that are not its paper."""
    picture = Image.open(io.BytesIO(page.screenshot(clip=SHOT))).convert("RGB")  # type: ignore[arg-type]
    return int((np.asarray(picture).min(axis=2) < 240).sum())
