"""Text is found wherever it stands on a flat face; what a part is for never is."""

import math

import numpy as np
import pytest
from manifold3d import CrossSection, Manifold, OpType
from tests.lettered import box, draw_text, raise_on, sink_into

from imdim.detection.facets import facets_of
from imdim.detection.lettering import Lettering, find_lettering
from imdim.geometry.solid import to_trimesh

PLATE = box(100, 60, 0, 10)


def find(solid: Manifold) -> list[Lettering]:
    mesh = to_trimesh(solid)
    return list(find_lettering(mesh, facets_of(mesh)))


def unite(*sections: CrossSection) -> CrossSection:
    return CrossSection.batch_boolean([*sections], OpType.Add)


def rect(wide: float, high: float, x: float = 0.0, y: float = 0.0) -> CrossSection:
    return CrossSection.square((wide, high), True).translate((x, y))


def circle(radius: float, x: float = 0.0, y: float = 0.0) -> CrossSection:
    return CrossSection.circle(radius, 32).translate((x, y))


@pytest.mark.parametrize(("make", "sign"), [(raise_on, 1), (sink_into, -1)])
@pytest.mark.parametrize("turn", [(0, 0, 0), (90, 0, 37), (20, 35, 50)])
@pytest.mark.parametrize("slant", [0, 12, 90])
def test_a_row_of_letters_is_text(make, sign, turn, slant):
    (text,) = find(make(PLATE, draw_text("LEFT HOLE", 6).rotate(slant), 10, 0.8).rotate(turn))
    assert text.depth == pytest.approx(0.8 * sign, abs=1e-6)
    assert (text.letters, text.rows, len(text.pieces)) == (8, 1, 8)
    frame = to_trimesh(box(2, 2, 10, 11).rotate(turn)).vertices
    assert text.normal @ (frame.mean(0) / np.linalg.norm(frame.mean(0))) == pytest.approx(1, abs=1e-6)
    assert np.linalg.norm(text.point - frame.mean(0) / 10.5 * 10) < 0.1


def test_dots_hyphens_and_short_lines_belong_to_text():
    section = unite(draw_text("PiECE-L.", 7).translate((0, 8)), draw_text("UP", 7).translate((-20, -4)))
    (text,) = find(raise_on(PLATE, section, 10, 1.0))
    assert len(text.pieces) == 11
    assert text.letters == 10


def test_rows_and_faces():
    section = unite(draw_text("HELP").translate((0, 10)), draw_text("LEFT", 7).translate((10, -10)))
    both = sink_into(raise_on(PLATE, section, 10, 1.0).rotate((180, 0, 0)).translate((0, 0, 10)), draw_text("TOP FLUTE", 8), 10, 0.5)
    below, above = sorted(find(both), key=lambda text: text.normal[2])
    assert (below.rows, below.letters, above.rows, above.letters) == (2, 8, 1, 8)


def test_a_frame_and_a_line_stay():
    frame = rect(90, 30) - rect(86, 26)
    (text,) = find(raise_on(PLATE, unite(frame, draw_text("HELP"), rect(60, 1, 0, -9)), 10, 1.0))
    assert len(text.pieces) == 4


def standoff(ribs: int, long: float = 8.0) -> CrossSection:
    arms = [rect(long, 1.5, long / 2).rotate(90 * k) for k in range(ribs)]
    return unite(circle(3.5), *arms) - circle(1.6)


def corners(*sections: CrossSection) -> CrossSection:
    places = ((-38, -20), (38, -20), (38, 20), (-38, 20))
    return unite(*(section.translate(place) for section, place in zip(sections, places, strict=False)))


ANGLE = unite(rect(8, 1.5, 4, 0.75), rect(1.5, 8, 0.75, 4))
FEATURES = {
    "unequal bosses": corners(circle(3), circle(4), circle(5), circle(6)),
    "unequal pads": corners(rect(6, 8), rect(9, 5), rect(4, 12), rect(12, 12)),
    "standoffs with ribs": corners(*(standoff(2).rotate(90 * k) for k in range(4))),
    "unequal standoffs": corners(standoff(1), standoff(2), standoff(3), standoff(4)),
    "a row of standoffs": unite(*(standoff(2).translate((x, 0)) for x in (-36, -12, 12, 36))),
    "rings": unite(*(circle(r, x) - circle(r - 1.5, x) for x, r in ((-30, 5), (-15, 6), (2, 7), (20, 8)))),
    "slots": unite(*(unite(rect(3, 4 * k, 10 * k), circle(1.5, 10 * k, 2 * k), circle(1.5, 10 * k, -2 * k)) for k in range(-4, 5) if k)),
    "fins": unite(*(rect(2, 40, x) for x in range(-40, 41, 6))),
    "uneven fins": unite(*(rect(2, 20 + abs(x) / 2, x) for x in range(-40, 41, 6))),
    "pockets": unite(*(rect(18, 24, -40 + 20 * i, -14 + 28 * j) for i in range(5) for j in range(2))),
    "pockets about holes": unite(*(rect(18, 48, -40 + 20 * i) for i in range(5))) - unite(circle(9, -30, 5), circle(8, 12, -8)),
    "a pattern of holes": unite(*(circle(1 + 0.1 * i, 5 * i - 45, 4 * j) for i in range(18) for j in range(-3, 4))),
    "hooks": unite(*((ANGLE if k % 2 else ANGLE.mirror((1, 0))).translate((12 * k - 40, 0)) for k in range(8))),
    "ribs": corners(ANGLE, unite(ANGLE, rect(8, 1.5, -4, 0.75)), unite(ANGLE, rect(1.5, 8, 7.25, 4)), rect(20, 1.5)),
    "a frame": rect(90, 50) - rect(86, 46),
    "stars": unite(*(unite(rect(9, 1.5), rect(1.5, 9)).rotate(15 * k).translate((12 * k - 40, 0)) for k in range(7))),
    "teeth": CrossSection([[(a * math.cos(b), a * math.sin(b)) for k in range(30) for a, b in ((20, k / 4.7746), (24, k / 4.7746 + 0.1))]]),
}


@pytest.mark.parametrize("name", FEATURES)
@pytest.mark.parametrize("make", [raise_on, sink_into])
@pytest.mark.parametrize("depth", [0.5, 2.0])
def test_features_are_no_text(name, make, depth):
    assert not find(make(PLATE, FEATURES[name] ^ rect(98, 58), 10, depth))


def test_tall_letters_and_those_that_go_through_are_features():
    assert not find(raise_on(PLATE, draw_text("HELP"), 10, 8.0))
    assert not find(PLATE - draw_text("HELP").extrude(30).translate((0, 0, -10)))


def test_copies_and_two_letters_are_too_little_to_tell():
    assert not find(raise_on(PLATE, draw_text("EEEE"), 10, 1.0))
    assert not find(raise_on(PLATE, draw_text("UP"), 10, 1.0))
    assert not find(PLATE)


def test_letters_scattered_over_a_face_are_no_text():
    places = np.random.default_rng(1).permutation([(x, y) for x in (-40, -20, 0, 20, 40) for y in (-20, 0, 20)])
    letters = [draw_text(c).rotate(90 * k).translate(tuple(at)) for k, (c, at) in enumerate(zip("HELPFOUT", places, strict=False))]
    assert not find(raise_on(PLATE, unite(*letters), 10, 1.0))
