"""The target's points in the view, against a toolkit's server in place of a client."""

import time

import numpy as np
import pytest

from imdim.app.lab import points
from imdim.app.lab.points import MOVING, SIZES, STILL_S, Points

viser = pytest.importorskip("viser")
CLOUD = np.random.default_rng(0).normal(size=(4 * MOVING, 3)).astype(np.float32)


@pytest.fixture(scope="module")
def client():
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield server
    server.stop()


@pytest.fixture
def cloud(client, monkeypatch):
    monkeypatch.setattr(points, "STILL_S", 0.15)
    cloud = Points(client)
    yield cloud
    cloud.forget()


def drawn(cloud):
    """The points that are seen."""
    return [n.points for n in (cloud._few, cloud._rest) if n is not None and n.visible]


def settled(cloud):
    end = time.monotonic() + 10.0
    while len(drawn(cloud)) < 2:
        assert time.monotonic() < end, "the others never came back"
        time.sleep(0.02)


def test_while_something_moves_few_points_are_drawn_and_all_when_it_rests(cloud):
    cloud.draw(CLOUD)
    assert np.array_equal(np.sort(np.concatenate(drawn(cloud)), axis=0), np.sort(CLOUD, axis=0)), "each point once"
    cloud.stir()
    (few,) = drawn(cloud)
    assert len(few) == MOVING
    assert np.ptp(few, axis=0) == pytest.approx(np.ptp(CLOUD, axis=0), rel=0.2), "they come from everywhere"
    settled(cloud)


def test_motion_that_goes_on_keeps_the_others_away(cloud):
    cloud.draw(CLOUD)
    end = time.monotonic() + 3 * points.STILL_S
    while time.monotonic() < end:
        cloud.stir()
        assert len(drawn(cloud)) == 1
        time.sleep(0.01)
    settled(cloud)


def test_more_points_are_smaller_and_beside_a_solid_smaller_still(cloud):
    cloud.draw(CLOUD)
    many = cloud._few.point_size
    cloud.beside(True)
    assert cloud._few.point_size == pytest.approx(many * SIZES[1] / SIZES[0])
    cloud.beside(False)
    cloud.stir()
    assert cloud._few.point_size == SIZES[0] > many
    cloud.draw(CLOUD[:100])
    assert cloud._few.point_size == SIZES[0]
    assert len(drawn(cloud)) == 1, "so few move too"


def test_hidden_points_stay_hidden_when_the_view_rests(cloud):
    cloud.draw(CLOUD)
    cloud.show(False)
    assert drawn(cloud) == []
    cloud.stir()
    time.sleep(points.STILL_S + 0.1)
    assert drawn(cloud) == []
    cloud.show(True)
    settled(cloud)


def test_a_client_that_went_is_sent_nothing(client, cloud):
    cloud.draw(CLOUD)
    few = cloud._few
    cloud.stir()
    cloud.close()
    time.sleep(points.STILL_S + 0.1)
    assert cloud._few is None
    few.remove()
    assert STILL_S < 1.0, "a hand that rests is not kept waiting"
