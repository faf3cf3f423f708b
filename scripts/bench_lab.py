"""Times of the live lab as a person meets them: ``python scripts/bench_lab.py [FOLDER] [--parts N]``.

A real Chromium, in software where there is no graphics card, asks a real server. FOLDER holds parts (``*.stl``) whose first program is
timed, N of them spread evenly; without it the example is used. Measured: page load to the first picture, start to the first program drawn,
edit to redraw (the volume on the page, and the picture), snapshots drawn and frames a second beside 100,000 points, and memory for each
client. A table at the end tells them beside their bars. Each time is told twice: by the clock, and as the seconds of a core that server,
its processes and the browser used meanwhile, an estimate of what the clock would show on one core that nothing else runs on.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh
from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

from imdim.app.lab.examples import example

WAIT_MS = 120_000
POINTS = 100_000
POLL_MS = 30
SHOWN_S = 5.0  # for which pictures are counted
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
# the distinct states of a run that the page tells (its seconds have one digit), and the frames that draw new data
TELL = """() => { lab.stages = new Set(); lab.fresh = 0; lab.sent = 0;
  lab.after = () => { if (lab.sent) { lab.fresh++; lab.sent = 0; } };
  const told = new MutationObserver(() => lab.stages.add(lab.status('stage')));
  told.observe(document.body, { childList: true, subtree: true, characterData: true }); }"""
CHANGED = 60  # pixels: less than one of the holes
SHOT = {"x": 320, "y": 180, "width": 620, "height": 520}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path)
    parser.add_argument("--parts", type=int, default=10)
    given = parser.parse_args()
    cores, load = len(os.sched_getaffinity(0)), os.getloadavg()[0]
    command = [sys.executable, "-m", "imdim.app.cli", "lab", "--no-browser", "--port", "0"]
    lab = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert lab.stdout is not None
    try:
        url = next(line.split()[-1] for line in lab.stdout if "Live Lab: http" in line)
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(
                executable_path=shutil.which("chromium") or shutil.which("google-chrome"), args=["--no-sandbox"]
            )
            rows = _measure(browser, url, lab.pid, _parts(given.folder, given.parts))
            browser.close()
    finally:
        lab.terminate()
        lab.wait(30)
    table = ["| what | bar | by the clock | of a core |", "| --- | --- | --- | --- |", *rows]
    load = f"load average {load:.1f} at the start, {os.getloadavg()[0]:.1f} at the end"
    sys.stdout.write("\n".join([f"cores {cores}; {load}", *table]) + "\n")


def _parts(folder: Path | None, count: int) -> list[Path]:
    found = sorted(folder.glob("*.stl")) if folder else []
    return [found[i] for i in np.linspace(0, len(found) - 1, min(count, len(found))).astype(int)]


def _measure(browser: Browser, url: str, server: int, parts: list[Path]) -> list[str]:
    _settle(server)  # a process is made ready meanwhile
    loads = []
    for _ in range(3):
        page, took = _loaded(browser, url)
        loads.append(took)
        page.close()
    before = _memory(server)
    page, _ = _loaded(browser, url)
    one_more = _memory(server) - before
    bracket = _first_program(page)
    _until(page, lambda: "finished" in _status(page))
    ran = _memory(server) - before
    edits = _edits(page)
    first = {part.name: _of_part(page, part, server) for part in parts}
    slowest = ", ".join(f"{name} {took.clock:.1f}" for name, took in sorted(first.items(), key=lambda item: -item[1].clock)[:3])
    memory = f"{before:.0f} MB, {one_more:+.0f} MB, {ran:+.0f} MB, {_memory_of_workers(server):.0f} MB"
    told, drawn, frames, frames_of_core = _rate(page)
    page.close()
    return [
        _row("page load to first picture", "2 s", loads),
        _row('start to first program drawn, the example "Bracket"', "3 s", [bracket]),
        *([_row(f"start to first program drawn, {len(first)} parts (slowest: {slowest})", "3 s", list(first.values()))] if first else []),
        _row("edit to the new volume", "0.5 s", [told for told, _ in edits]),
        _row("edit to the new picture", "0.5 s", [seen for _, seen in edits]),
        f"| programs told, and new pictures, a second: an evolution beside {POINTS:,} points | | {told:.1f}, {drawn:.1f} | |",
        f"| frames a second, {POINTS:,} points, the view turning | | {frames:.1f} | {frames_of_core:.1f} |",
        f"| memory: the server, one more client, after its run, its process | | {memory} | |",
    ]


def _of_part(page: Page, part: Path, server: int) -> Took:
    """Seconds to the first program of a part that was opened a moment ago."""
    _upload(page, part)
    time.sleep(2.0)
    took = _first_program(page)
    page.get_by_role("button", name="Stop", exact=True).click()
    time.sleep(6)  # a process is made ready for the next one
    _settle(server)
    return took


class Took(NamedTuple):
    """Seconds by the clock, and of a core."""

    clock: float
    core: float


class Watch:
    """Takes the time from when it is made."""

    def __init__(self) -> None:
        self._clock, self._core = time.perf_counter(), _core_seconds(os.getpid())

    def __call__(self) -> Took:
        return Took(time.perf_counter() - self._clock, _core_seconds(os.getpid()) - self._core)


def _core_seconds(pid: int) -> float:
    """Of a core, that a process and all that it started have used."""
    tables = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            fields = stat.read_text().rpartition(")")[2].split()
            tables[int(stat.parent.name)] = int(fields[1]), sum(map(int, fields[11:15]))
    mine = {pid}
    while grown := {p for p, (parent, _) in tables.items() if parent in mine} - mine:
        mine |= grown
    return sum(tables[p][1] for p in mine if p in tables) / os.sysconf("SC_CLK_TCK")


def _settle(server: int) -> None:
    """Until the server and its processes rest."""
    before = -1.0
    while (now := _core_seconds(server)) - before > 0.1:
        before = now
        time.sleep(2.0)


def _row(what: str, bar: str, times: list[Took]) -> str:
    clock, core = zip(*times, strict=True)
    return f"| {what} | {bar} | {_spread(clock)} | {_spread(core)} |"


def _spread(seconds: tuple[float, ...]) -> str:
    return f"{statistics.median(seconds):.2f} s" + (f", up to {max(seconds):.2f} s" if len(seconds) > 1 else "")


def _loaded(browser: Browser, url: str) -> tuple[Page, Took]:
    page = browser.new_page(viewport={"width": 1280, "height": 720})
    page.set_default_timeout(WAIT_MS)
    page.add_init_script(PROBE)
    watch = Watch()
    page.goto(url)
    page.wait_for_function("window.lab?.drawn > 0", polling=POLL_MS)
    took = watch()
    assert _inked(page) > 2000, "what was drawn is no picture"
    return page, took


def _first_program(page: Page) -> Took:
    page.evaluate("Object.assign(lab, { sent: 0, anew: 0 })")
    watch = Watch()
    page.get_by_role("button", name="Start", exact=True).click()
    page.wait_for_function("lab.anew > 0 && document.querySelector('.lab-status').textContent.includes('volume')", polling=POLL_MS)
    return watch()


def _edits(page: Page) -> list[tuple[Took, Took]]:
    """Seconds until the volume and until the picture have changed, for some radii of a hole."""
    page.locator(".lab-primitive [role=treeitem][data-n='3']").click()
    page.get_by_role("tab", name="Edit", exact=True).click()
    box, out = page.get_by_label("r mm", exact=True), []
    for radius in "45627":
        time.sleep(2.5)
        box.select_text()
        time.sleep(0.5)
        page.evaluate(f"lab.expect({CHANGED})")
        watch = Watch()
        page.keyboard.press(radius)
        told = Took(page.evaluate("lab.told") / 1000, watch().core)
        out.append((told, Took(page.evaluate("lab.seen") / 1000, watch().core)))
    page.get_by_role("tab", name="Run", exact=True).click()
    return out


def _rate(page: Page) -> tuple[float, float, float, float]:
    """Beside many points: programs told and new pictures a second during an evolution, and frames a second while the view turns."""
    mesh = example("Bracket").mesh
    assert mesh is not None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cloud.npy"
        np.save(path, trimesh.sample.sample_surface(mesh, POINTS, seed=0)[0])
        _upload(page, path)
    frames = _frames(page)
    page.get_by_role("tab", name="Edit", exact=True).click()
    page.get_by_role("button", name="Add", exact=True).click()  # a program to start from, far from the end
    page.wait_for_function("lab.status('volume')", polling=POLL_MS)
    page.get_by_role("tab", name="Run", exact=True).click()
    page.get_by_label("Seconds", exact=True).fill("600")
    page.get_by_text("Evolve from here").click()
    page.get_by_role("button", name="Continue from this program", exact=True).click()
    page.wait_for_function("lab.status('stage')?.includes('continue: evolve')", polling=POLL_MS)
    page.evaluate(TELL)
    start = time.perf_counter()
    # an evolution that is done sooner has its rate until then
    while time.perf_counter() < start + SHOWN_S and "continue: evolve" in page.evaluate("lab.status('stage')"):
        time.sleep(0.1)
    told, drawn = page.evaluate("[lab.stages.size, lab.fresh]")
    seconds = time.perf_counter() - start
    assert told, "the evolution told nothing"
    page.get_by_role("button", name="Stop", exact=True).click()
    return told / seconds, drawn / seconds, frames.clock, frames.core


def _frames(page: Page) -> Took:
    """Frames a second, by the clock and of a core, while a hand turns the view, each of which shows something else than the one before."""
    page.mouse.move(640, 450)
    page.mouse.down()
    page.mouse.move(660, 450)
    time.sleep(0.5)
    begun, watch = page.evaluate("lab.frames"), Watch()
    turned, end = 0, time.perf_counter() + SHOWN_S
    while time.perf_counter() < end:
        turned += 1
        page.mouse.move(640 + 4 * (turned % 60), 450)
        time.sleep(0.01)
    drawn, took = page.evaluate("lab.frames") - begun, watch()
    page.mouse.up()
    return Took(drawn / took.clock, drawn / took.core)


def _upload(page: Page, part: Path) -> None:
    page.set_input_files("input[type=file]", part)
    page.wait_for_function("n => document.querySelector('.lab-status').textContent.includes('part' + n)", arg=part.name)
    page.wait_for_function("!document.querySelector('.lab-status').textContent.includes('volume')")


def _status(page: Page) -> str:
    return page.evaluate("document.querySelector('.lab-status')?.textContent ?? ''")


def _picture(page: Page) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(page.screenshot(clip=SHOT))).convert("RGB"), np.int64)  # type: ignore[arg-type]


def _inked(page: Page) -> int:
    return int((_picture(page).min(axis=2) < 240).sum())


def _until(page: Page, good: Callable[[], bool], seconds: float = 120.0) -> None:
    end = time.perf_counter() + seconds
    while not good():
        if time.perf_counter() > end:
            raise TimeoutError("the page did not come to it")
        time.sleep(0.02)


def _memory(pid: int) -> float:
    """Resident memory of a process, in MB."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def _memory_of_workers(server: int) -> float:
    listed = subprocess.run(["ps", "-ww", "-eo", "pid,ppid,args"], capture_output=True, text=True, check=True).stdout.splitlines()
    mine = [int(line.split()[0]) for line in listed[1:] if int(line.split()[1]) == server and "spawn_main" in line]
    return max((_memory(pid) for pid in mine), default=0.0)


if __name__ == "__main__":
    main()
