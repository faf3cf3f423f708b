"""Times of the live lab as a person meets them: ``python scripts/bench_lab.py [FOLDER] [--parts N]``.

A real Chromium, in software where there is no graphics card, asks a real server. FOLDER holds parts (``*.stl``) whose first program is
timed, N of them spread evenly; without it the example is used. Measured: page load to the first picture, start to the first program drawn,
edit to redraw (the volume on the page, and the picture), snapshots drawn a second beside 100,000 points, and memory for each client.
Each time is told twice: by the clock, and as the seconds of a core that server, its processes and the browser used meanwhile, an estimate
of what the clock would show on one core that nothing else runs on.
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
from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

WAIT_MS = 120_000
POINTS = 100_000
# counts what is drawn, and what is drawn of something new: cheaper to ask for than pictures, of which one at the end is proof
COUNT = """window.lab = { drawn: 0, sent: 0, anew: 0 };
const draw = () => { lab.drawn++; if (lab.sent) lab.anew++; };
const calls = ['drawElements', 'drawArrays', 'drawElementsInstanced', 'drawArraysInstanced'];
const sends = ['bufferData', 'bufferSubData'].map((name) => [name, () => lab.sent++]);
for (const [call, does] of [...sends, ...calls.map((name) => [name, draw])]) {
  const plain = WebGL2RenderingContext.prototype[call];
  WebGL2RenderingContext.prototype[call] = function (...given) { does(); return plain.apply(this, given); };
}"""
SHOT = {"x": 320, "y": 180, "width": 620, "height": 520}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path)
    parser.add_argument("--parts", type=int, default=10)
    given = parser.parse_args()
    cores, load = len(os.sched_getaffinity(0)), os.getloadavg()[0]
    print(f"cores {cores}, load average at the start {load:.1f}")
    command = [sys.executable, "-m", "imdim.app.cli", "lab", "--no-browser", "--port", "0"]
    lab = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert lab.stdout is not None
    try:
        url = next(line.split()[-1] for line in lab.stdout if "Live Lab: http" in line)
        time.sleep(8)  # a process is made ready meanwhile
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(
                executable_path=shutil.which("chromium") or shutil.which("google-chrome"), args=["--no-sandbox"]
            )
            _measure(browser, url, lab.pid, _parts(given.folder, given.parts))
            browser.close()
    finally:
        lab.terminate()
        lab.wait(30)
    print(f"load average at the end {os.getloadavg()[0]:.1f}")


def _parts(folder: Path | None, count: int) -> list[Path]:
    found = sorted(folder.glob("*.stl")) if folder else []
    return [found[i] for i in np.linspace(0, len(found) - 1, min(count, len(found))).astype(int)]


def _measure(browser: Browser, url: str, server: int, parts: list[Path]) -> None:
    loads, edits, first = [], [], {}
    _settle(server)
    for _ in range(3):
        page, took = _loaded(browser, url)
        loads.append(took)
        page.close()
    _say("page load to first picture", loads)
    before = _memory(server)
    page, _ = _loaded(browser, url)
    print(f"memory of the server {before:.0f} MB; one more client {_memory(server) - before:+.0f} MB")
    first["example Bracket"] = _first_program(page)
    _until(page, lambda: "finished" in _status(page))
    print(f"  after a run {_memory(server) - before:+.0f} MB; the working process {_memory_of_workers(server):.0f} MB")
    edits = _edits(page)
    _say("edit to volume on the page", [e[0] for e in edits])
    _say("edit to new picture", [e[1] for e in edits])
    for part in parts:
        _upload(page, part)
        first[part.name] = _first_program(page)
        page.get_by_role("button", name="Stop", exact=True).click()
        time.sleep(6)  # a process is made ready for the next one
        _settle(server)
    _say("start to first program drawn", list(first.values()))
    print("  " + ", ".join(f"{name} {took.clock:.1f} ({took.core:.1f})" for name, took in first.items()))
    _rate(page)
    page.close()


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


def _say(what: str, times: list[Took]) -> None:
    clock, core = zip(*times, strict=True)
    print(
        f"{what}: median {statistics.median(clock):.2f} s, from {min(clock):.2f} to {max(clock):.2f} ({len(times)} times); "
        f"of a core median {statistics.median(core):.2f} s, to {max(core):.2f}"
    )


def _loaded(browser: Browser, url: str) -> tuple[Page, Took]:
    page = browser.new_page(viewport={"width": 1280, "height": 720})
    page.set_default_timeout(WAIT_MS)
    page.add_init_script(COUNT)
    watch = Watch()
    page.goto(url)
    page.wait_for_function("window.lab?.drawn > 0")
    took = watch()
    assert _inked(page) > 2000, "what was drawn is no picture"
    return page, took


def _first_program(page: Page) -> Took:
    watch = Watch()
    page.get_by_role("button", name="Start", exact=True).click()
    page.wait_for_function("document.querySelector('.lab-status').textContent.includes('volume')")
    return watch()


def _edits(page: Page) -> list[tuple[Took, Took]]:
    """Seconds until the volume and until the picture have changed, for some radii of a hole."""
    page.locator(".lab-primitive [role=treeitem][data-n='3']").click()
    page.get_by_role("tab", name="Edit", exact=True).click()
    box, out = page.get_by_label("r mm", exact=True), []
    for radius in ("4", "5", "4.5", "5.5", "3"):
        time.sleep(2.0)
        volume, picture = _volume(page), _picture(page)
        page.evaluate("Object.assign(lab, { sent: 0, anew: 0 })")
        watch = Watch()
        box.fill(radius)
        page.wait_for_function(f"!document.querySelector('.lab-status').textContent.includes('{volume}')")
        told = watch()
        page.wait_for_function("lab.anew > 0")
        out.append((told, watch()))
        assert (np.abs(_picture(page) - picture).max(axis=2) > 40).sum() > 60, "what was drawn is the picture as it was"
    page.get_by_role("tab", name="Run", exact=True).click()
    return out


def _rate(page: Page) -> None:
    """An evolution beside a cloud of many points: programs drawn a second, and frames a second while the view turns."""
    rng = np.random.default_rng(0)
    side = rng.integers(0, 3, POINTS)
    points = rng.uniform(-1, 1, (POINTS, 3)) * [3.0, 2.0, 1.0]
    points[range(POINTS), side] = np.array([3.0, 2.0, 1.0])[side] * rng.choice([-1.0, 1.0], POINTS)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cloud.npy"
        np.save(path, points)
        _upload(page, path)
    _first_program(page)
    _until(page, lambda: "finished" in _status(page))
    page.get_by_text("Evolve from here").click()
    page.evaluate(
        "window.drawn = new Set(); const told = document.querySelector('.lab-status').closest('div').parentElement;"
        "new MutationObserver(() => window.drawn.add([...told.querySelectorAll('tr')].find(r => r.textContent.startsWith('stage'))"
        "?.textContent)).observe(told, {childList: true, subtree: true})"
    )
    page.get_by_role("button", name="Continue from this program", exact=True).click()
    _until(page, lambda: "evolve" in _status(page))
    begun, start = page.evaluate("window.drawn.size"), time.perf_counter()
    time.sleep(5.0)
    rate = (page.evaluate("window.drawn.size") - begun) / (time.perf_counter() - start)
    page.get_by_role("button", name="Stop", exact=True).click()
    print(f"snapshots drawn a second during an evolution beside {POINTS} points: {rate:.1f}")
    frames = """async () => { let n = 0, t = performance.now(); const end = t + 3000;
        while (performance.now() < end) { await new Promise(requestAnimationFrame); n++; } return n / 3; }"""
    page.mouse.move(640, 450)
    page.mouse.down()
    for i in range(20):
        page.mouse.move(640 + 5 * i, 450)
    print(f"frames a second with {POINTS} points, view turning: {page.evaluate(frames):.0f}")
    page.mouse.up()


def _upload(page: Page, part: Path) -> None:
    page.set_input_files("input[type=file]", part)
    page.wait_for_function("n => document.querySelector('.lab-status').textContent.includes('part' + n)", arg=part.name)
    page.wait_for_function("!document.querySelector('.lab-status').textContent.includes('volume')")


def _status(page: Page) -> str:
    return page.evaluate("document.querySelector('.lab-status')?.textContent ?? ''")


def _volume(page: Page) -> str:
    rows = "[...document.querySelectorAll('.lab-status tr')]"
    return page.evaluate(f"{rows}.find(r => r.cells[0].textContent === 'volume').cells[1].textContent")


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
    listed = subprocess.run(["ps", "-eo", "pid,ppid,args"], capture_output=True, text=True, check=True).stdout.splitlines()
    mine = [int(line.split()[0]) for line in listed[1:] if int(line.split()[1]) == server and "spawn_main" in line]
    return max((_memory(pid) for pid in mine), default=0.0)


if __name__ == "__main__":
    main()
