"""Times of the live lab as a person meets them: ``python scripts/lab/times.py [FOLDER] [--parts N]``.

A real Chromium, in software where there is no graphics card, asks a real server. FOLDER holds parts (``*.stl``) whose first program is
timed, N of them spread evenly; without it the example is used. Measured: page load to the first picture, in a window that was open; start
to the first program drawn; edit to redraw (the volume on the page, and the picture); snapshots drawn and frames a second beside 100,000
points; memory for each client. A table at the end tells them beside their bars. Each time is told twice: by the clock, and as the seconds
of a core that server, its processes and the browser used meanwhile, an estimate of what the clock would show on one core that nothing else
runs on.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import trimesh
from page import POLL_MS, PROBE, chromium, inked, press, says, server, tab, upload, window
from playwright.sync_api import Browser, Page
from watch import Took, Watch, memory, memory_of_workers, settle

from imdim.app.lab.examples import example

POINTS = 100_000
LOADS = 7
SHOWN_S = 5.0  # for which pictures are counted
# the distinct states of a run that the page tells (its seconds have one digit), and the frames that draw new data
TELL = """() => { lab.stages = new Set(); lab.fresh = 0; lab.sent = 0;
  lab.after = () => { if (lab.sent) { lab.fresh++; lab.sent = 0; } };
  const told = new MutationObserver(() => lab.stages.add(lab.status('stage')));
  told.observe(document.body, { childList: true, subtree: true, characterData: true }); }"""
CHANGED = 60  # pixels: less than one of the holes


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path)
    parser.add_argument("--parts", type=int, default=10)
    given = parser.parse_args()
    cores, load = len(os.sched_getaffinity(0)), os.getloadavg()[0]
    with server() as (url, pid), chromium() as browser:
        rows = _measure(browser, url, pid, _parts(given.folder, given.parts))
    table = ["| what | bar | by the clock | of a core |", "| --- | --- | --- | --- |", *rows]
    loaded = f"load average {load:.1f} at the start, {os.getloadavg()[0]:.1f} at the end"
    sys.stdout.write("\n".join([f"cores {cores}; {loaded}", *table]) + "\n")


def _parts(folder: Path | None, count: int) -> list[Path]:
    found = sorted(folder.glob("*.stl")) if folder else []
    return [found[i] for i in np.linspace(0, len(found) - 1, min(count, len(found))).astype(int)]


def _measure(browser: Browser, url: str, lab: int, parts: list[Path]) -> list[str]:
    first_of_all, *loads = [_load(browser, url) for _ in range(1 + LOADS)]
    before = memory(lab)
    page, _ = _loaded(browser, url)
    one_more = memory(lab) - before
    bracket = _first_program(page)
    says(page, "finished")
    ran = memory(lab) - before
    edits = _edits(page)
    first = {part.name: _of_part(page, part, lab) for part in parts}
    slowest = ", ".join(f"{name} {took.clock:.1f}" for name, took in sorted(first.items(), key=lambda item: -item[1].clock)[:3])
    used = f"{before:.0f} MB, {one_more:+.0f} MB, {ran:+.0f} MB, {memory_of_workers(lab):.0f} MB"
    told, drawn, frames, frames_of_core = _rate(page)
    page.close()
    return [
        _row(f"page load to first picture, {LOADS} times", "2 s", loads),
        _row("the same, first page of server and browser", "", [first_of_all]),
        _row('start to first program drawn, the example "Bracket"', "3 s", [bracket]),
        *([_row(f"start to first program drawn, {len(first)} parts (slowest: {slowest})", "3 s", list(first.values()))] if first else []),
        _row("edit to the new volume", "0.3 s", [told for told, _ in edits]),
        _row("edit to the new picture", "0.3 s", [seen for _, seen in edits]),
        f"| programs told, and new pictures, a second: an evolution beside {POINTS:,} points | | {told:.1f}, {drawn:.1f} | |",
        f"| frames a second, {POINTS:,} points, the view turning | | {frames:.1f} | {frames_of_core:.1f} |",
        f"| memory: the server, one more client, after its run, its process | | {used} | |",
    ]


def _row(what: str, bar: str, times: list[Took]) -> str:
    clock, core = zip(*times, strict=True)
    return f"| {what} | {bar} | {_spread(clock)} | {_spread(core)} |"


def _spread(seconds: tuple[float, ...]) -> str:
    return f"{statistics.median(seconds):.2f} s" + (f", up to {max(seconds):.2f} s" if len(seconds) > 1 else "")


def _load(browser: Browser, url: str) -> Took:
    page, took = _loaded(browser, url)
    page.close()
    return took


def _loaded(browser: Browser, url: str) -> tuple[Page, Took]:
    """A page, and the time to its first picture. Its window is there before: Chromium fills each new one with pages of its own."""
    page = window(browser)
    page.add_init_script(PROBE)
    settle(os.getpid())
    watch = Watch()
    page.goto(url)
    page.wait_for_function("window.lab?.drawn > 0", polling=POLL_MS)
    took = watch()
    assert inked(page) > 2000, "what was drawn is no picture"
    return page, took


def _of_part(page: Page, part: Path, lab: int) -> Took:
    """Seconds to the first program of a part that was opened a moment ago."""
    upload(page, part)
    time.sleep(2.0)
    took = _first_program(page)
    press(page, "Stop")
    time.sleep(6)  # a process is made ready for the next one
    settle(lab)
    return took


def _first_program(page: Page) -> Took:
    page.evaluate("Object.assign(lab, { sent: 0, anew: 0 })")
    watch = Watch()
    press(page, "Start")
    page.wait_for_function("lab.anew > 0 && document.querySelector('.lab-status').textContent.includes('volume')", polling=POLL_MS)
    return watch()


def _edits(page: Page) -> list[tuple[Took, Took]]:
    """Seconds until the volume and until the picture have changed, for some diameters of the holes, in the parameter table."""
    box, out = page.get_by_label("hole_diameter", exact=True), []
    for diameter in ("8", "10", "12", "4", "14"):
        time.sleep(2.5)
        box.fill(diameter)
        time.sleep(0.5)
        page.evaluate(f"lab.expect({CHANGED})")
        watch = Watch()
        page.keyboard.press("Enter")
        told = Took(page.evaluate("lab.told") / 1000, watch().core)
        out.append((told, Took(page.evaluate("lab.seen") / 1000, watch().core)))
    return out


def _rate(page: Page) -> tuple[float, float, float, float]:
    """Beside many points: programs told and new pictures a second during an evolution, and frames a second while the view turns."""
    mesh = example("Bracket").mesh
    assert mesh is not None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cloud.npy"
        np.save(path, trimesh.sample.sample_surface(mesh, POINTS, seed=0)[0])
        upload(page, path)
    frames = _frames(page)
    tab(page, "Edit")
    press(page, "Add")  # a program to start from, far from the end
    page.wait_for_function("lab.status('volume')", polling=POLL_MS)
    tab(page, "Run")
    page.get_by_label("Seconds", exact=True).fill("600")
    page.get_by_text("Search on from here").click()
    press(page, "Search on from this program")
    page.wait_for_function("lab.status('stage')?.includes('continue: evolve')", polling=POLL_MS)
    page.evaluate(TELL)
    start = time.perf_counter()
    # an evolution that is done sooner has its rate until then
    while time.perf_counter() < start + SHOWN_S and "continue: evolve" in page.evaluate("lab.status('stage')"):
        time.sleep(0.1)
    told, drawn = page.evaluate("[lab.stages.size, lab.fresh]")
    seconds = time.perf_counter() - start
    assert told, "the evolution told nothing"
    press(page, "Stop")
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


if __name__ == "__main__":
    main()
