"""report.html in a real browser, from a file, with every request to anything else an error."""

import io
import json
import shutil

import numpy as np
import pytest
from PIL import Image
from tests.export.coincident import MEANT
from tests.planted import box, cut, cylinder, mesh_of

from imdim.delivery.deliver import RunRecord, deliver
from imdim.delivery.finish import finish
from imdim.export.html import content, page
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.program.codec import to_json
from imdim.program.front import Choice
from imdim.program.tree import Combine, Primitive
from imdim.relations.discover import exact_relations
from imdim.target.scan import Condition, scan
from imdim.target.target import Target, target_from

CHROMIUM = shutil.which("chromium")
playwright = pytest.importorskip("playwright.sync_api")
pytestmark = [
    pytest.mark.tool,
    pytest.mark.skipif(CHROMIUM is None, reason="needs chromium"),
]

PROGRAM = MEANT["bracket"][0]
LACKING = Combine("union", PROGRAM, Primitive("box", (8.0, 8.0, 12.0), (-40.0, -20.0, 10.0)))
PAPER = (246, 248, 250)
TITLE, EDGE = 44, 6  # pixels of a pane that hold its title, and the ring of the focus
PATIENCE = 120_000  # milliseconds, on a busy machine
WINDOWS = {"desktop": (1280, 720), "phone": (390, 844)}


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as tools:
        running = tools.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield running
        running.close()


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """The report of a program that lacks a block of its target."""
    folder = tmp_path_factory.mktemp("results") / "bracket"
    run = RunRecord("parts/bracket.stl", {"search": 0.5}, "finished", 7, {}, "proved minimal over these candidates")
    front = [Choice(Primitive("box", (100.0, 60.0, 10.0)), 0.2), Choice(PROGRAM, 0.014)]
    deliver(PROGRAM, target_from(to_trimesh(to_manifold(LACKING)), "bracket.stl"), folder, run, step_limit_s=0.0, front=front)
    return folder / "report.html"


@pytest.fixture
def opened(browser):
    """Opens a file in a window and waits for its first frame; any request but for the file, and any error, fails the test."""
    pages, wrong = [], []

    def open_file(path, window="desktop", ready="html[data-drawn]", **context):
        width, height = WINDOWS[window]
        tab = browser.new_context(viewport={"width": width, "height": height}, **context).new_page()
        tab.set_default_timeout(PATIENCE)
        tab.on("request", lambda request: None if request.url == path.as_uri() else wrong.append(request.url))
        tab.on("pageerror", lambda error: wrong.append(str(error)))
        tab.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
        pages.append(tab)
        tab.goto(path.as_uri())
        if ready:
            tab.wait_for_selector(ready, state="attached")
        return tab

    yield open_file
    for tab in pages:
        tab.context.close()
    assert wrong == []


def pixels(tab, pane):
    """What is seen of a pane, [h, w, 3]: 0 is the target, 1 the result."""
    tab.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    image = Image.open(io.BytesIO(tab.screenshot(clip=tab.locator(".pane").nth(pane).bounding_box())))
    return np.asarray(image.convert("RGB"), np.int64)[TITLE:-EDGE, EDGE:-EDGE]


def drawn(seen):
    """The share of pixels that are not paper."""
    return (np.abs(seen - PAPER).max(axis=2) > 12).mean()


def changed(before, after):
    return (np.abs(before - after).max(axis=2) > 12).mean()


def like(seen, low, high):
    """The share of pixels within a box of colours."""
    return ((seen >= low) & (seen <= high)).all(axis=2).mean()


def amber(seen):
    """Which pixels have the colour of what is selected."""
    red, green, blue = np.moveaxis(seen, 2, 0)
    return (red > 140) & (green > 0.5 * red) & (green < 0.9 * red) & (blue < 0.4 * red)


RED = ((140, 20, 20), (235, 120, 120))


@pytest.mark.parametrize("window", WINDOWS)
def test_target_and_result_are_drawn(opened, report, window):
    tab = opened(report, window)
    for pane in (0, 1):
        seen = pixels(tab, pane)
        assert 0.08 < drawn(seen) < 0.8
        middle = seen[seen.shape[0] // 4 : -seen.shape[0] // 4]
        assert drawn(middle) > 0.1
    # the block that the program lacks is far off, dark red; nothing in the result is
    assert like(pixels(tab, 0), (50, 0, 10), (150, 50, 60)) > 0.002
    assert like(pixels(tab, 1), (50, 0, 10), (150, 50, 60)) == 0
    assert tab.evaluate("document.documentElement.scrollWidth") <= WINDOWS[window][0]


def test_dragging_and_keys_turn_both(opened, report):
    tab = opened(report)
    before = [pixels(tab, pane) for pane in (0, 1)]
    tab.mouse.move(300, 350)
    tab.mouse.down()
    tab.mouse.move(420, 380, steps=4)
    tab.mouse.up()
    turned = [pixels(tab, pane) for pane in (0, 1)]
    assert all(changed(a, b) > 0.05 for a, b in zip(before, turned, strict=True))
    tab.focus("#canvas")
    tab.keyboard.press("ArrowUp")
    assert changed(turned[1], pixels(tab, 1)) > 0.02
    small = drawn(pixels(tab, 1))
    for _ in range(4):
        tab.keyboard.press("+")
    assert drawn(pixels(tab, 1)) > 1.2 * small
    tab.keyboard.press("0")
    assert changed(before[1], pixels(tab, 1)) < 0.001
    for _ in range(3):
        tab.mouse.wheel(0, 240)
    assert drawn(pixels(tab, 1)) < 0.8 * small


@pytest.fixture(scope="module")
def scan_report(tmp_path_factory):
    """The report of a block of which one side was seen."""
    block = box(40, 30, 20)
    points = scan(mesh_of(block), Condition(noise=0.002, views=1), np.random.default_rng(0), 4000)[0]
    folder = tmp_path_factory.mktemp("results") / "block"
    deliver(block, target_from(points, "block.xyz"), folder, RunRecord("block.xyz", {}, "finished", 0, noisy=True), step_limit_s=0.0)
    return folder / "report.html"


def test_what_was_seen_of_a_result_is_coloured(opened, scan_report):
    tab = opened(scan_report)
    violet, plain = ((120, 100, 150), (215, 190, 240)), pixels(tab, 1)
    assert not tab.locator(".coverage").is_visible()
    tab.get_by_role("button", name="Seen").click()
    told = [item.strip() for item in tab.locator(".coverage li").all_inner_texts()]
    assert [item.split()[0] for item in told] == ["seen", "inferred", "unknown"]
    assert 40 < float(told[1].split()[1]) < 55
    assert like(pixels(tab, 1), *violet) > like(plain, *violet) + 0.03
    assert "Seen" in tab.locator("#sheets").inner_text()
    tab.get_by_role("button", name="Seen").click()
    assert not tab.locator(".coverage").is_visible()
    assert like(pixels(tab, 1), *violet) == pytest.approx(like(plain, *violet), abs=0.01)


def test_fingers_turn_and_zoom(opened, report):
    tab = opened(report, "phone", has_touch=True, is_mobile=True)
    session = tab.context.new_cdp_session(tab)

    def touch(kind, *points):
        session.send(
            "Input.dispatchTouchEvent", {"type": kind, "touchPoints": [{"x": x, "y": y, "id": i} for i, (x, y) in enumerate(points)]}
        )

    box = tab.locator(".pane").nth(1).bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    before = pixels(tab, 1)
    touch("touchStart", (x, y))
    for step in range(1, 5):
        touch("touchMove", (x + 20 * step, y))
    touch("touchEnd")
    turned = pixels(tab, 1)
    assert changed(before, turned) > 0.05
    touch("touchStart", (x - 20, y), (x + 20, y))
    for step in range(1, 5):
        touch("touchMove", (x - 20 - 15 * step, y), (x + 20 + 15 * step, y))
    touch("touchEnd")
    assert drawn(pixels(tab, 1)) > 1.3 * drawn(turned)
    tab.locator(".row").last.click()
    place = tab.locator(".pane").nth(1).bounding_box()
    assert 0 <= place["y"] <= 844 - place["height"]  # what is selected below is seen above


def test_selecting_in_the_tree_shows_it_in_3d(opened, report):
    tab = opened(report)
    before = pixels(tab, 1)
    assert amber(before).mean() < 0.001
    tab.locator(".row", has_text="cylinder").first.click()
    after = pixels(tab, 1)
    assert amber(after).mean() > 0.003
    assert changed(before, after) > 0.05
    selected = tab.locator("#selected").inner_text()
    assert "adds material" in selected
    assert tab.locator('[aria-selected="true"]').count() == 1
    tab.locator(".row", has_text="cylinder").first.click()
    assert changed(before, pixels(tab, 1)) < 0.001


def test_clicking_selects_and_measures(opened, report):
    tab = opened(report)
    target, result = (tab.locator(".pane").nth(i).bounding_box() for i in (0, 1))
    tab.get_by_role("button", name="Top", exact=True).click()
    tab.mouse.click(result["x"] + result["width"] / 2, result["y"] + result["height"] / 2)
    assert "box #0" in tab.locator("#selected").inner_text()
    tab.keyboard.press("Escape")
    assert "Select a part" in tab.locator("#selected").inner_text()
    far = pixels(tab, 0)
    rows, columns = np.nonzero(((far >= (50, 0, 10)) & (far <= (150, 50, 60))).all(axis=2))
    tab.mouse.click(target["x"] + EDGE + np.median(columns), target["y"] + TITLE + np.median(rows))
    assert float(tab.locator(".readout").inner_text().split()[-1]) == pytest.approx(11.0, rel=0.02)


def test_cutters_are_red_on_demand(opened, report):
    tab = opened(report)
    before = like(pixels(tab, 1), *RED)
    tab.get_by_role("button", name="Cutters").click()
    assert like(pixels(tab, 1), *RED) > before + 0.005
    tab.focus("#canvas")
    tab.keyboard.press("c")
    assert like(pixels(tab, 1), *RED) == pytest.approx(before, abs=1e-3)


def test_the_target_by_what_became_of_it(opened, report):
    """The block that the program lacks is crimson, and the legend says how much of the surface that is."""
    tab = opened(report)
    assert not tab.locator(".verdicts").is_visible()
    tab.get_by_role("button", name="Verdict").click()
    assert like(pixels(tab, 0), (90, 0, 20), (200, 50, 80)) > 0.002
    assert tab.locator(".verdicts li").nth(1).inner_text().strip() == "approximated 0.0 %"
    assert not tab.locator(".legend").is_visible()
    tab.get_by_role("button", name="Verdict").click()
    assert tab.locator(".legend").is_visible()


def test_the_tree_by_keyboard(opened, report):
    tab = opened(report)
    tab.focus('#tree [tabindex="0"]')
    tab.keyboard.press("ArrowDown")
    tab.keyboard.press("Enter")
    assert tab.locator('[aria-selected="true"]').count() == 1
    rows = tab.locator(".row:visible").count()
    tab.keyboard.press("Home")
    tab.keyboard.press("ArrowLeft")
    assert tab.locator(".row:visible").count() == 1 < rows


def test_the_tables_have_the_numbers(opened, report):
    tab = opened(report)
    said = json.loads((report.parent / "report.json").read_text())
    for closed in tab.locator("#sheets summary").all():
        closed.click()
    text = tab.locator("#sheets").inner_text()
    assert f"{said['scores']['volume_iou']:.6g}" in text
    for name in (*said["parameters"], *said["files"], "proved minimal"):
        assert name in text
    dots = tab.locator("svg circle")
    assert dots.count() == 2
    dots.nth(0).click()
    assert "--pick 1" in tab.locator("#sheets code").inner_text()


def test_the_program_leads_and_files_are_links(opened, report, tmp_path):
    tab = opened(report)
    heads = tab.locator("#sheets h2, #sheets summary").all_inner_texts()
    assert heads[:2] == ["Names", "Files"]
    assert heads[-4:] == ["Volumes", "Seconds", "Run", "Versions"]
    assert "written" not in tab.locator("#sheets details").first.inner_text()
    links = {link.inner_text(): link.get_attribute("href") for link in tab.locator("#sheets .sheet a").all()}
    files = json.loads((report.parent / "report.json").read_text())["files"]
    assert set(links) == {name for name, said in files.items() if said == "written"} - {"report.html"}
    assert [href for href in links.values() if not (report.parent / href).is_file()] == []
    alone = tmp_path / "bracket.html"  # as it is downloaded from the lab, beside no other file
    alone.write_bytes(report.read_bytes())
    tab = opened(alone)
    assert tab.locator("#sheets .sheet a").count() == 0
    assert "program.scad" in tab.locator("#sheets").inner_text()


def test_a_repeat_shows_all_its_copies(opened, tmp_path):
    part = cut(box(80, 30, 6), *(cylinder(3, 6, (x, 0.0, 0.0)) for x in (-30.0, -10.0, 10.0, 30.0)))
    found = finish(exact_relations(part).program)
    document = to_json(found.program, None, found.constraints, found.folded)
    path = tmp_path / "row.html"
    path.write_text(page(content(document, None, found.parameters, name="row")), encoding="utf-8")
    tab = opened(path)
    tab.get_by_role("button", name="Top", exact=True).click()
    tab.locator(".row", has_text="cylinder").click()
    seen = pixels(tab, 0)
    columns = np.flatnonzero(amber(seen).any(axis=0))
    assert np.count_nonzero(np.diff(columns) > 20) == 3  # gaps between four holes
    assert "4 copies" in tab.locator("#selected").inner_text()


def test_a_cloud_is_drawn(opened, tmp_path):
    points = target_from(to_trimesh(to_manifold(PROGRAM))).points
    path = tmp_path / "cloud.html"
    path.write_text(page(content(to_json(PROGRAM), target_from(points))), encoding="utf-8")
    assert drawn(pixels(opened(path), 0)) > 0.08


def test_a_hostile_name_is_shown_and_does_nothing(opened, report, tmp_path):
    name = "</script><img src=x onerror=\"document.title='owned'\"><script>document.title = 'owned'</script>.stl"
    target = target_from(to_trimesh(to_manifold(box(1, 1, 1))))
    named = Target(name, target.points, target.normals, target.mesh, True)
    said = json.loads((report.parent / "report.json").read_text())
    path = tmp_path / "report.html"
    path.write_text(
        page(content(to_json(box(1, 1, 1)), named), {**said, "input": name, "stop": name, "target": {"name": name, "notes": [name]}})
    )
    tab = opened(path)
    assert tab.title() == f"{name} - IMDIM report"
    assert tab.locator("h1").inner_text() == name
    assert tab.locator("img").count() == 0
    assert tab.locator("#sheets").evaluate("e => e.textContent").count(name) == 4


def test_without_webgl_the_numbers_are_there(opened, report, tmp_path):
    text = report.read_text(encoding="utf-8")
    path = tmp_path / "report.html"
    path.write_text(text.replace("<canvas", "<div").replace("></canvas>", "></div>"), encoding="utf-8")
    tab = opened(path, ready="#sheets .sheet")
    assert "draws no 3D" in tab.locator("#hint").inner_text()
    assert tab.locator(".row").count() > 5
