"""The parameter table: a person sets a dimension by its name, holds it, breaks a tie, and sees what it drives."""

import math

import pytest
import trimesh
from tests.app.lab.page.browser import EXACT, HAND_MS, in_the_lab, red

from imdim.app.lab.panels.edit import LOCKED
from imdim.app.lab.panels.parameters import STRICT

pytestmark = in_the_lab
THICKER = 80 * 50 * 10 + math.pi * 14**2 * 16 - 4 * math.pi * 9 * 10 - math.pi * 64 * 26
WIDER = math.pi * (25 - 9) * 8  # what a hole of diameter 10 takes more


@pytest.fixture
def table(done):
    done.tab("Parameters")
    yield done
    done.tab("Program")


def test_a_dimension_is_set_and_all_that_stands_on_it_follows(table):
    table.set_parameter("plate_thickness", "10")
    table.measures(THICKER)
    said = table.notice("plate_thickness = 10")
    assert "size 80 x 50 x 24 -> 80 x 50 x 26" in said
    assert "in kind as before: 1 body, 5 through-holes" in said
    focus = table.page.evaluate("document.activeElement.dataset.name")
    assert focus == "plate_thickness", "the next number is typed at once"
    table.keys("Control+z")
    table.measures(EXACT)
    table.page.wait_for_function("document.querySelector('[data-name=plate_thickness]').value === '8'")
    assert table.parameters()["boss_height"] == 16, "as it is seen, not with what is hidden in the plate"


@pytest.mark.parametrize("leave", ["Enter", "Tab"])
def test_what_is_typed_while_the_table_is_drawn_anew_is_set(table, leave):
    """A run that goes on and names that come draw it under a person's hands."""
    table.box("plate_thickness").fill("10")
    table.page.evaluate("""() => {
        const drawn = document.querySelector('.lab-parameter');
        drawn.innerHTML = drawn.innerHTML;  // as the toolkit does it
    }""")
    table.page.wait_for_function("document.activeElement.dataset.name === 'plate_thickness'")
    assert table.box("plate_thickness").input_value() == "10"
    table.page.wait_for_timeout(HAND_MS)
    table.measures(EXACT)  # nobody has ended typing
    table.page.keyboard.press(leave)
    table.measures(THICKER)
    table.keys("Control+z")
    table.measures(EXACT)


def test_an_edit_has_a_picture_of_before_and_after(table):
    table.set_parameter("boss_height", "30")
    table.notice("boss_height = 30")
    picture = table.page.get_by_alt_text("the part before and after boss_height = 30")
    picture.wait_for()
    assert picture.evaluate("image => [image.naturalWidth, image.naturalHeight]") == [280, 140]
    box = picture.bounding_box()
    panel = table.page.locator(".lab-row").first.bounding_box()
    assert box["width"] <= panel["width"] + 24, "it fits the panel"
    table.keys("Control+z")
    picture.wait_for(state="detached")
    table.measures(EXACT)


def test_what_cannot_be_is_refused_in_one_line_and_the_value_comes_back(table):
    for value, says in (("-3", "needs a positive number"), ("wide", "'wide' is no number"), ("1e9", "boss_diameter")):
        table.set_parameter("boss_diameter", value)
        if value == "1e9":
            table.notice("boss_diameter = 1e+09")  # nonsense, and a solid
            table.keys("Control+z")
        else:
            assert "\n" not in table.notice(says)
        table.page.wait_for_function("document.querySelector('[data-name=boss_diameter]').value === '28'")
    table.measures(EXACT)


def test_what_changes_in_kind_is_told_or_refused(table):
    table.set_parameter("bore_diameter", "52")  # wider than the plate
    assert "changed in kind: 1 body became 2" in table.notice("bore_diameter = 52")
    table.keys("Control+z")
    table.measures(EXACT)
    table.box(STRICT).check()
    table.set_parameter("bore_diameter", "52")
    table.notice("1 body became 2")
    table.page.wait_for_function("document.querySelector('[data-name=bore_diameter]').value === '16'")
    table.measures(EXACT)
    table.box(STRICT).uncheck()


def test_a_row_shows_in_the_picture_what_it_drives(table):
    table.page.mouse.move(640, 30)
    table.wait_for_picture(lambda picture: red(picture) < 6000)
    before = red(table.picture())
    table.page.locator(".lab-row", has_text="plate_width").locator(".lab-drives").hover()
    table.wait_for_picture(lambda picture: red(picture) > before + 8000)
    table.page.mouse.move(640, 30)
    table.wait_for_picture(lambda picture: red(picture) < before + 500)
    table.page.locator(".lab-row", has_text="boss_diameter").locator(".lab-name").click()
    table.page.mouse.move(640, 30)
    table.wait_for_picture(lambda picture: red(picture) > before + 2000)
    table.page.mouse.click(640, 30)
    table.wait_for_picture(lambda picture: red(picture) < before + 500)


def test_a_dimension_is_held_for_the_solver(table):
    held = table.page.get_by_role("button", name="Keep boss_diameter fixed for the solver")
    held.click()
    let = table.page.get_by_role("button", name="Let the solver change boss_diameter")
    let.wait_for()
    table.tab("Edit")
    table.keys("j", "j")
    table.page.get_by_role("button", name=LOCKED + "r", exact=True).wait_for()
    table.tab("Run")
    let.click()
    held.wait_for()
    table.keys("Escape")
    table.undo(2)


def test_a_tie_is_broken_from_its_row(table):
    assert "hole2_diameter" not in table.parameters()
    table.page.get_by_role("button", name="Untie hole_diameter").click()
    table.notice("hole_diameter is untied")
    table.box("hole3_diameter").wait_for()
    table.set_parameter("hole2_diameter", "10")
    table.measures(EXACT - WIDER)
    table.notice("hole2_diameter = 10")
    table.keys("Control+z", "Control+z")
    table.measures(EXACT)
    table.box("hole3_diameter").wait_for(state="detached")


def test_it_is_set_in_a_narrow_window_too(phone, tmp_path):
    (tmp_path / "tile.stl").write_bytes(trimesh.creation.box((30, 20, 4)).export(file_type="stl"))
    phone.page.set_input_files("input[type=file]", tmp_path / "tile.stl")
    phone.says("tile.stl")
    phone.run()
    phone.page.get_by_role("button", name="Expand panel Parameters").click()
    phone.tab("Parameters")
    box = phone.page.locator(".lab-row").first.bounding_box()
    assert box["x"] >= 0
    assert box["x"] + box["width"] <= 390
    phone.set_parameter("plate_thickness", "5,5")
    phone.notice("plate_thickness = 5.5")
    phone.measures(30 * 20 * 5.5)
    phone.keys("Control+z")
    phone.measures(30 * 20 * 4)
    phone.page.get_by_role("button", name="Collapse panel Parameters").click()


def test_the_unit_is_said_and_set(phone):
    assert phone.status("volume").endswith("mm³")
    phone.choose("Example", "Flange")
    phone.says("Flange")
    phone.choose("Units", "cm")
    phone.notice("Lengths are read as centimetres: each becomes 10 millimetres.")
    assert phone.status("volume") == "", "a run starts anew"
    phone.choose("Units", "auto")
    phone.says("Flange")
