"""A window of a telephone's size, from the first: clicks are those of a hand, scrolled to, and refused where something lies above."""

import trimesh
from tests.app.lab.page.browser import blue, in_the_lab, inked

from imdim.app.lab.panels.edit import LOCKED
from imdim.app.lab.panels.pick import KEEP
from imdim.target.target import Frame, target_from

pytestmark = in_the_lab


def test_a_file_is_opened_and_reconstructed(phone, tmp_path):
    page = phone.page
    phone.tab("Run")
    phone.wait_for_picture(lambda picture: inked(picture) > 3000)
    left, top, across, down = phone.view()
    assert across == 390
    assert down >= 0.4 * 844
    phone.choose("Example", "Knob")
    phone.says("Knob")
    (tmp_path / "cube.stl").write_bytes(trimesh.creation.box((30, 20, 10)).export(file_type="stl"))
    with page.expect_file_chooser() as chooser:
        phone.press("Open a file")
    chooser.value.set_files(tmp_path / "cube.stl")
    phone.says("cube.stl")
    assert phone.box("Example").input_value() == "none", "each example can be chosen again"
    phone.run()
    phone.wait_for_picture(lambda picture: blue(picture) > 8_000)
    page.mouse.click(left + across / 2, top + down * 0.53)
    page.get_by_role("button", name="Expand panel Parameters").click()
    phone.tab("Program")
    page.wait_for_selector(".lab-primitive [aria-selected=true]")
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    page.get_by_role("button", name="Collapse panel Parameters").click()


def test_faces_are_measured_and_the_part_is_cut_open_by_tapping(phone):
    frame = Frame.of(target_from(trimesh.creation.box((30, 20, 10)), "cube"))
    phone.keys("Escape")
    phone.tab("Relations")
    phone.box(KEEP).check()
    phone.click_spot(frame, (0.0, 0.0, 5.0))
    phone.measured("flat, at z = 5 mm")
    phone.click_spot(frame, (0.0, -10.0, 0.0))
    phone.measured("angle 90°")
    phone.page.locator(".lab-fitting").wait_for(state="detached")  # faces of one box: nothing to choose
    phone.keys("Escape")
    phone.box(KEEP).uncheck()
    phone.tab("View")
    whole = blue(phone.picture())
    phone.choose("Cut across", "x")
    phone.page.get_by_text("cut at x = 0 mm").wait_for()
    phone.wait_for_picture(lambda picture: blue(picture) < 0.8 * whole)
    phone.choose("Cut across", "nothing")
    phone.wait_for_picture(lambda picture: blue(picture) > 0.95 * whole)
    phone.tab("Run")
    assert phone.page.evaluate("document.documentElement.scrollWidth") <= 390


def test_it_is_edited_and_related(phone):
    page = phone.page
    phone.tab("Edit")
    phone.keys("j")
    phone.box("sx mm").fill("15")
    phone.wait_for_volume(2999, 3001)
    phone.press("sx")
    page.get_by_role("button", name=LOCKED + "sx", exact=True).wait_for()
    phone.tab("Relations")
    rows = page.locator(".lab-constraint [data-n]").count()
    phone.relate("value", "0.sy", "20")
    page.locator(f".lab-constraint [data-n='{rows}']").wait_for()
    phone.tab("Run")
