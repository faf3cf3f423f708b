import json
import math

import pytest
from tests.planted import box, cut

from imdim.app.fit import summary
from imdim.delivery.deliver import RunRecord, deliver
from imdim.delivery.films import find_film
from imdim.geometry.solid import to_manifold, to_trimesh
from imdim.target.target import target_from

PLATE = box(60.0, 40.0, 8.0)
THICK = 0.02
OPEN = cut(PLATE, box(20.0, 20.0, 10.0))
CLOSED = cut(PLATE, box(20.0, 20.0, 8.0, (0.0, 0.0, THICK)))


def surface(program):
    return to_trimesh(to_manifold(program))


def test_a_film_is_found_where_the_target_is_open():
    film = find_film(surface(CLOSED), target_from(surface(OPEN)), math.inf)
    assert film is not None
    assert film.thickness == pytest.approx(THICK, rel=0.35)
    # both sides of what lies further than its edge from the walls of the opening
    assert film.share == pytest.approx(2 * 19.3**2 / surface(CLOSED).area, rel=0.1)
    assert film.low[:2] == pytest.approx((-10, -10), abs=0.7)
    assert film.high[2] == pytest.approx(-4 + THICK)
    assert "a film 0.02 thick" in str(film)


def test_a_film_of_the_target_is_none():
    assert find_film(surface(CLOSED), target_from(surface(CLOSED)), math.inf) is None
    assert find_film(surface(OPEN), target_from(surface(CLOSED)), math.inf) is None


def test_what_is_thick_is_no_film():
    assert find_film(surface(PLATE), target_from(surface(OPEN)), math.inf) is None


def test_the_summary_names_a_film(tmp_path):
    run = RunRecord("plate.stl", {"search": 1.0}, "finished", 0, {})
    deliver(CLOSED, target_from(surface(OPEN)), tmp_path / "closed", run)
    report = json.loads((tmp_path / "closed" / "report.json").read_text())
    assert [said for said in report["left_out"] if "film 0.02 thick where the target is open" in said]
    assert "film 0.02 thick" in summary(report, tmp_path)
