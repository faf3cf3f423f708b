"""A person changes the program that was found: numbers, locks, relations, primitives; the solver finishes; all can be taken back."""

import math

from tests.app.lab.page.browser import EXACT, in_the_lab, red

from imdim.app.lab.panels.edit import LOCKED

pytestmark = in_the_lab
HOLE = math.pi * 9 * 8
WIDER = math.pi * (25 - 9) * 8  # what a hole of radius 5 takes more
SLIMMER = EXACT - math.pi * (14**2 - 13**2) * 16  # a boss of radius 13


def test_a_radius_is_edited_and_the_edit_undone_and_redone(done):
    done.select(3)
    before = done.picture()
    done.tab("Edit")
    done.box("r mm").fill("5")
    done.measures(EXACT - 4 * WIDER)  # the four holes have one radius
    assert done.status("proof") == "", "it was of another program"
    done.wait_for_picture(lambda picture: red(picture) > red(before) + 400)
    done.keys("Control+z")
    done.measures(EXACT)
    assert "minimal" in done.status("proof")
    done.keys("Control+y")
    done.measures(EXACT - 4 * WIDER)
    done.press("Undo")
    done.measures(EXACT)
    done.press("Redo")
    done.measures(EXACT - 4 * WIDER)
    done.box("Keep relations").uncheck()
    done.box("r mm").fill("3")
    done.measures(EXACT - 3 * WIDER)  # this one alone
    done.box("Keep relations").check()
    done.keys("Control+z", "Control+z", "Escape")
    done.measures(EXACT)


def test_a_constraint_is_added_and_the_solver_finishes_under_it(done):
    done.tab("Relations")
    rows = done.page.locator(".lab-constraint [data-n]").count()
    assert rows > 5
    done.relate("value", "1.r", "13")
    added = done.page.locator(f".lab-constraint [data-n='{rows}']")
    added.wait_for()
    assert "off by" not in added.inner_text()
    done.measures(SLIMMER)
    done.keys("l")  # let the solver finish
    done.measures(SLIMMER)
    done.notice("fitted: all relations hold")
    done.tab("Edit")
    done.select(3)
    done.box("r mm").fill("5")  # the next edit keeps it
    done.measures(SLIMMER - 4 * WIDER)
    assert "off by" not in added.inner_text()
    done.keys("Escape")
    done.undo(3)
    done.measures(EXACT)


def test_a_constraint_is_removed_and_found_again(done):
    done.tab("Relations")
    every, radii = done.page.locator(".lab-constraint [data-n]"), done.page.locator(".lab-constraint [data-n]", has_text="equal diameter")
    assert done.page.get_by_role("button", name="Remove the relation", exact=True).is_disabled(), "none is chosen"
    rows = every.count()
    radii.click()
    done.page.wait_for_selector(".lab-constraint [aria-pressed=true]")
    assert "hole #2 to #5 have equal diameter" in done.page.locator(".lab-constraint [aria-pressed=true]").inner_text()
    done.press("Remove the relation")
    radii.wait_for(state="detached")
    assert every.count() == rows - 1
    done.tab("Edit")
    done.select(3)
    done.box("r mm").fill("5")
    done.measures(EXACT - WIDER)  # the other holes are free now
    done.undo()
    done.measures(EXACT)
    done.tab("Relations")
    done.press("Look for relations")
    done.notice("relations found")
    radii.wait_for()
    assert every.count() > rows / 2
    done.tab("Edit")
    done.keys("Escape")
    done.undo(2)


def test_a_press_counts_though_the_tree_is_drawn_anew_before_the_release(done):
    mouse, row = done.page.mouse, done.page.locator(".lab-primitive [role=treeitem][data-n='4']")
    done.select(0)
    row.hover()
    mouse.down()
    done.keys("k")
    done.page.wait_for_selector(".lab-primitive [data-n='6'][aria-selected=true]")
    mouse.up()
    done.page.wait_for_selector(".lab-primitive [data-n='4'][aria-selected=true]")
    row.hover()
    mouse.down()
    mouse.move(640, 400)  # thought better of it
    mouse.up()
    done.keys("Escape")


def test_a_click_counts_though_what_it_is_on_was_clicked_before_and_answers_are_on_their_way(done):
    for leaf in (2, 3, 2):
        for _ in range(4):
            done.page.locator(f".lab-primitive [role=treeitem][data-n='{leaf}']").click()
            done.page.keyboard.press("Escape")
        done.select(leaf)
    done.keys("Escape")


def test_a_row_of_the_tree_is_chosen_by_key(done):
    done.page.locator(".lab-primitive [role=treeitem][data-n='2']").press("Enter")
    done.page.wait_for_selector(".lab-primitive [data-n='2'][aria-selected=true]")
    done.keys("Escape")


def test_a_locked_number_stays_where_the_solver_moves_the_others_back(done):
    done.select(1)
    done.box("r mm").fill("13")
    done.measures(SLIMMER)
    done.press("r")
    done.page.get_by_role("button", name=LOCKED + "r", exact=True).wait_for()
    done.select(3)
    done.box("r mm").fill("5")
    done.measures(SLIMMER - 4 * WIDER)
    done.press("Fit the numbers to the part")
    done.measures(SLIMMER)
    done.notice("fitted: all relations hold")
    done.keys("Escape")
    done.undo(4)
    done.measures(EXACT)


def test_a_primitive_is_added(done):
    before = done.picture()
    done.press("Add")  # a cylinder in the middle, which fits into the bore
    length = 0.15 * math.sqrt(80**2 + 50**2 + 24**2)
    done.measures(EXACT + math.pi * (length / 2) ** 2 * 2 * length)
    assert done.status("primitives") == "8"
    done.page.wait_for_selector(".lab-primitive [data-n='7'][aria-selected=true]")
    done.wait_for_picture(lambda picture: red(picture) > red(before) + 400)
    done.keys("Control+z", "Escape")
    done.measures(EXACT)


def test_a_primitive_is_removed_by_button_and_key_or_does_something_else(done):
    done.select(3)
    done.press("Remove the selected")
    done.measures(EXACT + HOLE)
    assert done.status("primitives") == "6"
    done.undo()
    done.measures(EXACT)
    done.select(3)
    done.keys("Delete")
    done.measures(EXACT + HOLE)
    done.undo()
    done.measures(EXACT)
    done.select(3)
    done.choose("Operation", "union")
    done.wait_for_volume(EXACT + 0.99 * HOLE, EXACT + 4 * HOLE)  # filled, and what overshot stands out
    done.undo()
    done.measures(EXACT)
    done.keys("Escape")
    done.tab("Run")
