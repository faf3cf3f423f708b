"""A person clicks faces, measures, relates them in words; cuts the part open; and drags what is selected."""

import math

import pytest
from tests.app.lab.page.browser import EXACT, HAND_MS, in_the_lab, purple, slate

from imdim.app.lab.drawing import SPAN
from imdim.app.lab.examples import example
from imdim.app.lab.handle_view import ARROW, GAP
from imdim.target.target import Frame

pytestmark = in_the_lab
FRAME = Frame.of(example("Bracket"))
PLATE_TOP, RIM, WALL = (0.0, -21.0, 4.0), (11.0, 0.0, 20.0), (0.0, -14.0, 12.0)
RING = math.pi * (14**2 - 8**2)
STILL = 5  # looks at a number, a hand's time apart, that must not differ


@pytest.fixture
def faces(done):
    done.tab("Relations")
    yield done
    done.keys("Escape")
    done.tab("Run")


def test_a_face_is_measured_then_two(faces):
    before = purple(faces.picture())
    faces.click_spot(FRAME, PLATE_TOP)
    faces.measured("flat, at z = 4 mm")
    assert "1: the top face of plate" in faces.page.locator(".lab-picked").inner_text()
    faces.wait_for_picture(lambda picture: purple(picture) > before + 5000)
    faces.click_spot(FRAME, RIM, "Control")
    faces.measured("distance 16 mm, parallel")
    assert "2: the top face of boss" in faces.page.locator(".lab-picked").inner_text()
    faces.click_spot(FRAME, RIM, "Control")  # once more: it is none of them
    faces.measured("flat, at z = 4 mm")
    faces.keys("Escape")
    faces.page.locator(".lab-picked").wait_for(state="detached")
    faces.wait_for_picture(lambda picture: purple(picture) < before + 500)


def test_two_holes_are_measured_though_one_looks_through_them(faces):
    for key, place in ((None, (-30.0, -17.0, 4.0)), ("Control", (30.0, 17.0, 4.0))):
        faces.click_spot(FRAME, place, key)
    faces.measured("axes 68.964 mm apart")
    said = faces.page.locator(".lab-picked").inner_text()
    assert "x 60 mm, y 34 mm" in said
    assert "diameters 6 mm and 6 mm" in said
    assert faces.page.locator(".lab-fitting [data-n]", has_text="equal diameter").count() == 1


def test_what_fits_is_chosen_in_words_and_its_distance_set(faces):
    rows = faces.page.locator(".lab-constraint [data-n]").count()
    faces.click_spot(FRAME, PLATE_TOP)
    faces.measured("flat, at z = 4 mm")
    faces.click_spot(FRAME, RIM, "Control")
    faces.measured("distance 16 mm, parallel")
    assert faces.box("Distance or size").is_disabled(), "no relation is chosen"
    faces.page.locator(".lab-fitting [data-n]", has_text="the top face of plate and the top face of boss are 16 mm apart").click()
    chosen = faces.page.locator(".lab-constraint [aria-pressed=true]")
    chosen.wait_for()
    assert faces.page.locator(".lab-constraint [data-n]").count() == rows + 1
    assert chosen.inner_text() == "the top face of plate and the top face of boss are 16 mm apart"
    faces.box("Distance or size").fill("20")
    faces.measures(EXACT + 4 * RING)
    assert "20 mm apart" in chosen.inner_text()
    faces.undo(2)
    # the first of them brings the volume back already
    faces.page.wait_for_function("n => document.querySelectorAll('.lab-constraint [data-n]').length === n", arg=rows)
    faces.measures(EXACT)


def test_what_does_not_hold_is_made_to(faces):
    """A hole's diameter becomes that of another one, which is wider."""
    faces.click_spot(FRAME, WALL)
    faces.measured("diameter 28 mm")
    faces.click_spot(FRAME, (-30.0, -17.0, 4.0), "Control")
    offered = faces.page.locator(".lab-fitting [data-n]", has_text="at a right angle")
    offered.wait_for()
    assert "moves the part" in offered.inner_text()
    rows = faces.page.locator(".lab-constraint [data-n]").count()
    offered.click()
    faces.notice("cannot hold beside the other relations")  # both are parallel to the z axis
    assert faces.page.locator(".lab-constraint [data-n]").count() == rows
    faces.measures(EXACT)


def test_the_part_is_cut_open(done):
    whole = slate(done.picture())
    done.keys("i")
    done.wait_for_picture(lambda picture: slate(picture) > whole + 4000)
    done.tab("View")
    done.page.get_by_text("cut at y = 0 mm").wait_for()
    done.choose("Cut across", "x")
    done.page.get_by_text("cut at x = 0 mm").wait_for()
    done.field("At").last.fill("0.75")
    done.page.get_by_text("cut at x = 20 mm").wait_for()
    done.wait_for_picture(lambda picture: slate(picture) > whole + 1000)
    done.measures(EXACT)  # it is looked into, not changed
    done.keys("i")
    done.wait_for_picture(lambda picture: slate(picture) < whole + 300)
    done.tab("Run")


def settled_number(page, label, low, high):
    """The value of an input, once it is between these and stays: a drag takes it there in steps, slowly on a busy machine."""
    of = "l => [...document.querySelectorAll('input')].find((e) => e.labels?.[0]?.textContent === l).value"
    seen = []
    while len(seen) < STILL or len(set(seen[-STILL:])) > 1:
        page.page.wait_for_function(f"([l, a, b]) => {{ const v = ({of})(l); return a <= v && v <= b; }}", arg=[label, low, high])
        seen.append(page.box(label).input_value())
        page.page.wait_for_timeout(HAND_MS)
    return float(seen[-1])


def test_a_knob_resizes_and_an_arrow_moves(done):
    done.select(1)
    done.tab("Edit")
    done.drag_spot(FRAME, (14.0, 0.0, 20.0), (19.0, 0.0, 20.0))
    radius = settled_number(done, "r mm", 18.0, 20.0)
    assert radius == pytest.approx(round(radius, 1)), "in round steps"
    done.measures(EXACT + math.pi * (radius**2 - 14**2) * 16)
    done.undo()
    done.measures(EXACT)
    done.box("Keep relations").uncheck()
    gap = (GAP + ARROW / 3) / SPAN / FRAME.scale  # into the middle of the arrow
    done.drag_spot(FRAME, (14.0 + gap, 0.0, 20.0), (24.0 + gap, 0.0, 20.0))
    settled_number(done, "x mm", 9.0, 11.0)
    done.box("Keep relations").check()
    done.undo()
    done.measures(EXACT)
    done.keys("Escape")
    done.tab("Run")


def test_handles_can_be_put_away(done):
    done.select(1)
    done.tab("View")
    shown = done.picture()
    done.box("Handles").uncheck()
    done.wait_for_picture(lambda picture: (abs(picture - shown).max(axis=2) > 40).sum() > 30)
    done.box("Handles").check()
    done.keys("Escape")
    done.tab("Run")
