"""The results page of a batch in a real browser: sorted, coloured, linked, and used on a telephone."""

from pathlib import Path

import pytest
from tests.app.lab.page.browser import CHROMIUM, chromium

from imdim.app.batch.folder import PARTS, Outcome, Part
from imdim.app.batch.table import html_text

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")
OUTCOMES = [
    Outcome("plate", "plate.stl", "0", "", 3, 0.9998, 1e-5, "finished", 4.2, 310.0, 12, 1.0, 0.0),
    Outcome("knob", "knob.stl", "1", "", 23, 0.971, 1e-3, "budget_spent", 60.1, 512.0, None, 0.8, 0.1),
    Outcome(
        "pulley_with_a_very_long_name_" * 3, "pulley_with_a_very_long_name_" * 3 + ".stl", "2", "", 104, 0.823, 2e-2, "finished", 9.0, 90.0
    ),
    Outcome("junk", "junk.stl", "3", "junk.stl: 0 points"),
]
WAITING = Part("later", Path("later.stl"), "4")


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    out = tmp_path_factory.mktemp("batch")
    for outcome in OUTCOMES[:3]:
        folder = out / PARTS / outcome.part
        folder.mkdir(parents=True)
        for name in ("report.html", "preview.png", "program.scad", "program.step", "program.FCMacro", "mesh.stl", "report.json"):
            (folder / name).write_bytes(b"")
    parts = [*(Part(o.part, Path(o.input), o.digest) for o in OUTCOMES), WAITING]
    (out / "results.html").write_text(html_text(out, parts, {o.part: o for o in OUTCOMES}, "4 of 5 parts done, 1 failed", False))
    return (out / "results.html").as_uri()


def names(tab):
    return [name[:6] for name in tab.locator("tbody td:nth-child(2)").all_inner_texts()]


def test_a_column_that_is_pressed_sorts(browser, page):
    tab = browser.new_page(viewport={"width": 1280, "height": 720})
    tab.goto(page)
    assert names(tab) == ["plate.", "knob.s", "pulley", "junk.s", "later."]
    head = tab.get_by_role("button", name="volume IoU")
    head.click()
    assert names(tab)[:3] == ["pulley", "knob.s", "plate."], "worst first; what has no figure stays last"
    head.click()
    assert names(tab)[:3] == ["plate.", "knob.s", "pulley"]
    tab.get_by_role("button", name="features").click()
    assert names(tab)[:3] == ["plate.", "knob.s", "pulley"], "by number: 3, 23, 104"
    tab.reload()
    assert names(tab)[:3] == ["plate.", "knob.s", "pulley"]
    assert tab.locator("th[aria-sort=ascending]").inner_text() == "features"
    tab.get_by_role("button", name="part").click()
    assert names(tab) == ["junk.s", "knob.s", "later.", "plate.", "pulley"]
    tab.close()


def test_poor_fits_are_red_and_pictures_lead_to_the_report(browser, page):
    tab = browser.new_page(viewport={"width": 1280, "height": 720})
    tab.goto(page)
    tints = tab.locator("td.good, td.fair, td.poor").evaluate_all(
        "all => all.map((e) => [e.textContent, getComputedStyle(e).backgroundColor])"
    )
    assert [text for text, _ in tints] == ["0.9998", "0.9710", "0.8230"]
    (r, g, _), _, (red, green, _) = ([int(v) for v in tint[4:-1].split(",")] for _, tint in tints)
    assert g > r
    assert red > green
    assert tab.locator("tbody tr").first.locator("a").first.get_attribute("href").endswith("/report.html")
    assert tab.get_by_text("budget spent").count() == 1
    assert tab.evaluate("document.documentElement.scrollWidth") <= 1280
    tab.close()


def test_it_fits_a_telephone(browser, page):
    tab = browser.new_page(viewport={"width": 390, "height": 844}, is_mobile=True, has_touch=True)
    tab.goto(page)
    assert tab.evaluate("document.documentElement.scrollWidth") <= 390
    inside = "all => all.every((e) => { const b = e.getBoundingClientRect(); return b.width === 0 || (b.left >= 0 && b.right <= 390); })"
    assert tab.locator("td, th, a").evaluate_all(inside)
    assert "volume IoU: " in tab.locator("td.poor").evaluate("e => getComputedStyle(e, '::before').content").replace('"', "")
    tab.get_by_role("button", name="volume IoU").tap()
    assert names(tab)[0] == "pulley"
    tab.close()
