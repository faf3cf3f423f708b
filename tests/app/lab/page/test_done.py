"""What a person sees when a run is done, in pixels and in numbers, and how they find their way in it."""

import re

import numpy as np
import pytest
from tests.app.lab.page.browser import EXACT, blue, changed, green, hot, in_the_lab, inked, red

pytestmark = in_the_lab
PLATE = 80 * 50 * 8
CURVES = {"error": (194, 37, 92), "primitives": (24, 100, 171), "relations off by": (43, 138, 62)}


def test_the_solid_appears_with_its_cutters(done):
    done.wait_for_picture(lambda picture: blue(picture) > 20_000 and red(picture) > 800)
    done.measures(EXACT)
    done.says("of the volume")
    assert done.status("primitives") == "7"
    assert float(done.status("error").split("%")[0]) < 0.1
    assert "minimal" in done.status("proof")


def test_the_curves_tell_how_the_run_went(done):
    done.tab("Curves")
    said = [done.page.locator(f"[data-curve='{name}'] text").first.text_content() for name in CURVES]
    assert float(said[0].removeprefix("error: ")) < 0.01
    assert said[1:] == ["primitives: 7", "relations off by: none"]
    seen = done.picture_of("svg[aria-label='curves of the run']")
    for name, ink in CURVES.items():
        _, columns = (abs(seen - ink).max(axis=2) < 40).nonzero()
        assert len(columns), f"{name} is not drawn"
        assert columns.max() - columns.min() > 0.2 * seen.shape[1], "from its first program to its last"
    done.tab("Alternatives")


@pytest.mark.parametrize("place", ["svg [role=button][data-n='1'] circle >> nth=-1", ".lab-choice button[data-n='1'] img"])
def test_a_program_of_the_front_is_clicked_in_the_plot_or_among_the_small_solids(done, place):
    done.page.wait_for_function("document.querySelectorAll('.lab-choice button img').length === 7")
    assert done.page.locator(".lab-choice button img").evaluate_all("all => all.every((one) => one.naturalWidth > 30)")
    done.page.locator(place).click()
    done.measures(PLATE)  # alone
    done.wait_for_picture(lambda picture: red(picture) < 300)
    assert done.page.locator(".lab-primitive [role=treeitem]").count() == 1
    done.keys("Control+z")
    done.measures(EXACT)


def test_a_click_in_the_picture_selects_in_tree_and_code(done):
    page, before = done.page, done.picture()
    left, top, width, height = done.view()
    page.mouse.click(left + width // 2, top + height * 0.53)
    page.wait_for_selector(".lab-primitive [role=treeitem][aria-selected=true]")
    row = page.locator(".lab-primitive [aria-selected=true]")
    leaf = row.get_attribute("data-n")
    assert "boss" in row.inner_text()
    done.tab("Code")
    assert "r = boss_diameter/2" in page.locator(".lab-primitive [aria-pressed=true]").inner_text()
    done.tab("Edit")
    page.get_by_text(f"{leaf} boss, cylinder").wait_for()
    done.tab("Run")
    done.wait_for_picture(lambda picture: red(picture) > red(before) + 2000)  # amber
    done.tab("Program")
    done.keys("Escape")
    page.wait_for_function("!document.querySelector('.lab-primitive [aria-selected=true]')")


def test_holes_are_listed_as_a_drawing_says_them(done):
    done.tab("Program")
    said = done.page.locator(".lab-hole")
    said.first.wait_for()
    assert any(text.startswith("4 x ") and "diameter 6, through" in text for text in said.all_inner_texts())
    said.filter(has_text="4 x ").click()
    done.page.wait_for_selector(".lab-primitive [data-n='2'][aria-selected=true]")
    done.keys("Escape")


def test_a_click_in_the_code_selects_in_tree_and_picture(done):
    done.wait_for_picture(lambda picture: red(picture) < 6000)
    before = red(done.picture())
    done.tab("Code")
    done.page.locator(".lab-primitive button", has_text="r = boss_diameter/2").click()
    done.tab("Program")
    done.page.wait_for_selector(".lab-primitive [role=treeitem][aria-selected=true] >> text=boss")
    done.wait_for_picture(lambda picture: red(picture) > before + 2000)
    done.keys("Escape")
    done.wait_for_picture(lambda picture: red(picture) < before + 500)


def test_layers_are_shown_and_hidden(done):
    done.tab("View")
    done.box("Solid").uncheck()
    done.box("Cutters").uncheck()
    done.wait_for_picture(lambda picture: blue(picture) == 0 and red(picture) == 0)
    done.keys("o")  # control points and constraints
    done.wait_for_picture(lambda picture: green(picture) > 50)
    done.box("Relations").uncheck()
    done.box("Points").uncheck()
    done.wait_for_picture(lambda picture: inked(picture) < 1000)
    done.keys("m")  # the distance map
    done.wait_for_picture(lambda picture: inked(picture) > 3000 and hot(picture) == 0)
    done.page.get_by_text("from the result").wait_for()  # its scale
    done.select(1)
    done.tab("Edit")
    done.box("r mm").fill("17")
    done.wait_for_picture(lambda picture: hot(picture) > 500)  # 3 mm off
    done.keys("Control+z", "Escape")
    done.wait_for_picture(lambda picture: hot(picture) == 0)
    done.tab("View")
    done.box("Distance map").uncheck()
    done.box("Points").check()
    done.box("Solid").check()
    done.keys("c")  # the cutters
    done.wait_for_picture(lambda picture: blue(picture) > 20_000 and red(picture) > 800 and green(picture) == 0)
    done.tab("Run")


def test_the_original_is_seen_beside_the_solid(done):
    done.tab("View")
    done.box("Solid").uncheck()
    done.box("Cutters").uncheck()
    done.wait_for_picture(lambda picture: inked(picture) < 1000)
    done.keys("t")
    done.wait_for_picture(lambda picture: inked(picture) > 10_000 and blue(picture) == 0)  # grey
    done.keys("t")
    done.wait_for_picture(lambda picture: inked(picture) < 1000)
    done.box("Solid").check()
    done.box("Cutters").check()
    done.tab("Run")


def test_the_part_stands_on_a_grid_with_axes(done):
    bare = done.picture()
    done.keys("g")
    done.wait_for_picture(lambda picture: changed(picture, bare) > 500)
    done.tab("View")
    done.page.get_by_text("The lines of the grid are 5 mm apart.").wait_for()
    done.box("Grid and axes").uncheck()
    done.wait_for_picture(lambda picture: changed(picture, bare) < 200)
    done.tab("Run")


@pytest.mark.parametrize(
    ("name", "key", "across", "down", "slack"), [("Front", "1", 80, 24, 0.22), ("Top", "2", 80, 50, 0.08), ("Right", "3", 50, 24, 0.22)]
)
def test_it_is_looked_at_from_the_standard_sides(done, name, key, across, down, slack):
    """Of the bracket, 80 x 50 mm with its boss 24 mm high, each side shows two lengths, the nearer one larger."""
    done.tab("View")

    def is_seen(picture):
        return abs(seen_ratio(picture) * down / across - 1) < slack

    done.press(name)
    done.wait_for_picture(is_seen)
    done.keys("0")
    done.wait_for_picture(lambda picture: not is_seen(picture))
    done.keys(key)
    done.wait_for_picture(is_seen)
    done.press("Corner")
    done.wait_for_picture(lambda picture: not is_seen(picture))
    done.tab("Run")


def seen_ratio(picture):
    """Width over height of what is seen."""
    rows, columns = (picture.min(axis=2) < 235).nonzero()
    return (np.ptp(columns) + 1) / (np.ptp(rows) + 1) if len(rows) else 0.0


def test_the_view_is_turned_by_hand_and_by_itself_and_found_again(done):
    before, (left, top, width, height) = done.picture(), done.view()
    done.page.mouse.move(left + width // 2, top + height - 30)
    done.page.mouse.down()
    done.page.mouse.move(left + width // 2 + 120, top + height - 30, steps=3)
    done.page.mouse.up()
    done.wait_for_picture(lambda picture: changed(picture, before) > 10_000)
    done.keys("f")  # the whole part
    done.wait_for_picture(lambda picture: changed(picture, before) < 1500)
    done.tab("View")
    done.box("Turn slowly").check()
    done.wait_for_picture(lambda picture: changed(picture, before) > 10_000)
    done.box("Turn slowly").uncheck()
    done.press("Show the whole part")
    done.wait_for_picture(lambda picture: changed(picture, before) < 1500)
    done.tab("Run")


def test_selecting_and_loading_by_keyboard(done):
    page = done.page
    done.keys("j")
    page.wait_for_selector(".lab-primitive [data-n='0'][aria-selected=true]")
    done.keys("k")
    page.wait_for_selector(".lab-primitive [data-n='6'][aria-selected=true]")
    page.locator(".lab-primitive [role=treeitem][data-n='2']").focus()
    page.keyboard.press("Enter")
    page.wait_for_selector(".lab-primitive [data-n='2'][aria-selected=true]")
    page.locator("svg [data-n='1']").focus()
    page.keyboard.press("Enter")
    done.measures(PLATE)
    done.keys("Control+z", "Escape")
    done.measures(EXACT)
    done.keys("Control+k")  # lists all keys
    page.get_by_text("Select the next primitive").wait_for()
    page.keyboard.press("Escape")
    page.get_by_text("Select the next primitive").wait_for(state="hidden")


CONTRAST = """() => {
  const light = (c) => { const [r, g, b] = c.map((v) => v / 255).map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
  const read = (text) => { const n = text.match(/[\\d.]+/g).map(Number); return { rgb: n.slice(0, 3), alpha: n.length > 3 ? n[3] : 1 }; };
  const behind = (e) => {
    for (; e; e = e.parentElement) { const c = read(getComputedStyle(e).backgroundColor); if (c.alpha > 0.9) return c.rgb; }
    return [255, 255, 255]; };
  const poor = [];
  const walker = document.createTreeWalker(document.getElementById('root'), NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const e = walker.currentNode.parentElement;
    if (!walker.currentNode.textContent.trim() || ['STYLE', 'SCRIPT'].includes(e.tagName) || !e.getClientRects().length) continue;
    const style = getComputedStyle(e), svg = e.ownerSVGElement;
    const [a, b] = [light(read(svg ? style.fill : style.color).rgb), light(behind(e))].sort((x, y) => y - x);
    if ((a + 0.05) / (b + 0.05) < 4.5) poor.push(walker.currentNode.textContent.slice(0, 40) + ' ' + ((a + 0.05) / (b + 0.05)).toFixed(1));
  }
  return poor; }"""


PRIVATE = ("lambda", "iou", "elitism", "mutation", "constraint", "theory", "lock:", "take")


def test_all_text_is_readable_and_in_words_that_users_know(done):
    """WCAG 2.2, 1.4.3: a contrast of at least 4.5."""
    for name in ("Edit", "Relations", "View", "Download", "Code", "Curves", "Parameters", "Program", "Alternatives", "Run"):
        done.tab(name)
        assert done.page.evaluate(CONTRAST) == [], name
        words = set(re.findall(r"[a-z:]+", done.page.locator("body").inner_text().lower()))
        assert words.isdisjoint(PRIVATE), (name, words.intersection(PRIVATE))


def test_the_tab_is_called_by_the_part(done):
    assert done.page.title() == "Bracket - IMDIM lab"


def test_buttons_can_be_pressed_where_they_do_something(done):
    def can(name):
        return done.page.get_by_role("button", name=name, exact=True).is_enabled()

    done.tab("Run")
    assert done.page.get_by_role("button", name="Step", exact=True).count() == 1
    assert done.page.get_by_role("button", name="Pause", exact=True).count() == 0, "nothing runs"
    done.tab("Edit")
    assert can("Fit the numbers to the part")
    assert not can("Remove the selected")
    done.select(1)
    done.page.locator("button:enabled", has_text="Remove the selected").wait_for()
    done.keys("Escape")
    done.tab("Relations")
    assert not can("Remove the relation")
    assert can("Look for relations")
    done.tab("Run")


def test_a_large_and_a_narrow_window_show_part_and_controls(done):
    for width, height in ((390, 844), (1280, 720)):
        done.page.set_viewport_size({"width": width, "height": height})
        done.wait_for_picture(lambda picture: blue(picture) > 8_000 and red(picture) > 300)
        left, top, across, down = done.view()
        assert across >= 0.5 * width
        assert down >= 0.4 * height
        assert left >= 0
        assert left + across <= width
        assert done.page.evaluate("document.documentElement.scrollWidth") <= width
        start = done.page.get_by_role("button", name="Start", exact=True).bounding_box()
        assert start
        assert start["y"] >= top + down or start["x"] >= left + across, "the controls lie beside or below the picture"
        assert start["y"] + start["height"] <= height
