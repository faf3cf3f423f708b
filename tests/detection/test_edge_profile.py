"""Points along a known corner, arc or bevel, blurred by known noise, against what is read off them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from imdim.detection.edge_profile import Crossing, Profile, SeenEdge, Wedge, see_edge
from imdim.program.edges import EDGE_KINDS

REACH, SIGMA = 6.0, 0.2


def wedge_of(degrees: float) -> Wedge:
    """Two faces under an angle, the first along x."""
    angle = math.radians(degrees)
    along = np.array([[1.0, 0.0], [math.cos(angle), math.sin(angle)]])
    return Wedge(np.array([[0.0, 1.0], [math.sin(angle), -math.cos(angle)]]), along)


def seen(profile: Profile | None, wedge: Wedge, rng: np.random.Generator, sigma: float = SIGMA, count: int = 1500) -> SeenEdge:
    """Points at equal densities along both faces and the blend."""
    one, two = (0.0, 0.0) if profile is None else profile.starts(wedge)
    blend = np.empty((0, 2)) if profile is None else blended(profile, wedge, one, two)
    walls = [wedge.along[k] * np.linspace(start, REACH + 2, 4000)[:, None] for k, start in ((0, one), (1, two))]
    curve = np.concatenate([walls[0][::-1], blend, walls[1]])
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    at = rng.uniform(0, length[-1], count)
    points = np.column_stack([np.interp(at, length, curve[:, k]) for k in (0, 1)])
    return see_edge(points + rng.normal(0, sigma, points.shape), wedge, REACH, sigma, (0.0, 0.0))


def blended(profile: Profile, wedge: Wedge, one: float, two: float) -> np.ndarray:
    start, end = wedge.along[0] * one, wedge.along[1] * two
    if profile.kind == "chamfer":
        return start + (end - start) * np.linspace(0, 1, 200)[:, None]
    middle = start + wedge.inward[0] * profile.sizes[0]
    assert middle == pytest.approx(end + wedge.inward[1] * profile.sizes[0])
    ways = np.outer(np.linspace(1, 0, 400), start - middle) + np.outer(np.linspace(0, 1, 400), end - middle)
    return middle + profile.sizes[0] * ways / np.linalg.norm(ways, axis=1, keepdims=True)


@pytest.mark.parametrize("degrees", [60.0, 90.0, 130.0])
@pytest.mark.parametrize("kind", EDGE_KINDS)
def test_sizes_come_back(kind, degrees):
    wedge, true = wedge_of(degrees), Profile(kind, (1.5,))
    view = seen(true, wedge, np.random.default_rng(1), 0.01)
    found, cost = view.likeliest(kind)
    assert found.sizes[0] == pytest.approx(1.5, abs=3 * view.deviation(found))
    assert view.deviation(found) < 0.02
    other = view.likeliest("chamfer" if kind == "fillet" else "fillet")
    assert cost + 100 < view.sharp
    assert other is None or cost + 30 < other[1]


def test_a_sharp_corner_is_no_blend():
    """The noise makes one by no more than a few nats."""
    for number in range(8):
        view = seen(None, wedge_of(90.0), np.random.default_rng(number))
        gains = [view.sharp - found[1] for kind in EDGE_KINDS if (found := view.likeliest(kind)) is not None]
        assert max(gains, default=0.0) < 6


def test_intervals_hold():
    """95 % of them, of which 40 draws show 34 at least all but once in 500 times."""
    wedge, true, held = wedge_of(90.0), Profile("fillet", (1.5,)), 0
    for number in range(40):
        view = seen(true, wedge, np.random.default_rng(number), count=600)
        found = view.likeliest("fillet")
        assert found is not None
        held += abs(found[0].sizes[0] - 1.5) < 1.96 * view.deviation(found[0])
    assert held >= 34


@pytest.mark.parametrize(("kind", "times"), [("fillet", 1 + 1 / math.sqrt(2)), ("chamfer", 1.0)])
def test_a_face_that_is_off_makes_a_size_wrong_by_what_is_told(kind, times):
    """Between faces at right angles an arc of the same points grows by 1.7 times as much as a face is nearer, a bevel by as much."""
    wedge, off = wedge_of(90.0), 0.02
    view = seen(Profile(kind, (1.5,)), wedge, np.random.default_rng(3), 0.05)
    found, _ = view.likeliest(kind)
    moved = see_edge(view.points, wedge, REACH, view.sigma, (-off, 0.0)).likeliest(kind)[0]
    told = replace(view, faces=(off, 0.0)).deviation_by_faces(found)
    assert told == pytest.approx(abs(moved.sizes[0] - found.sizes[0]), rel=0.25)
    assert told == pytest.approx(times * off, rel=0.35)
    assert replace(view, faces=(off, off)).deviation_by_faces(found) == pytest.approx(math.sqrt(2) * told, rel=0.1)
    assert view.deviation_by_faces(found) == 0.0


def test_intervals_hold_where_faces_are_known_about():
    """As `test_intervals_hold`, with faces that are off by a third of the noise; without what that does, fewer than 34 hold."""
    wedge, true, doubt = wedge_of(90.0), Profile("fillet", (1.5,)), SIGMA / 3
    held, alone = 0, 0
    for number in range(40):
        rng = np.random.default_rng(number)
        view = seen(true, wedge, rng, count=600)
        view = see_edge(view.points, wedge, REACH, SIGMA, tuple(rng.normal(0, doubt, 2)), (doubt, doubt))
        best = view.likeliest("fillet")[0]
        off = abs(best.sizes[0] - 1.5)
        held += off < 1.96 * math.hypot(view.deviation(best), view.deviation_by_faces(best))
        alone += off < 1.96 * view.deviation(best)
    assert held >= 34 > alone


def test_two_distances_are_told():
    view = seen(Profile("chamfer", (1.0, 2.0)), wedge_of(90.0), np.random.default_rng(2), 0.05)
    equal, cost = view.likeliest("chamfer")
    found, better = view.unequal(equal)
    assert found.sizes == pytest.approx((1.0, 2.0), rel=0.03)
    assert better + 50 < cost


@pytest.mark.parametrize("profile", [Profile("fillet", (2.0,)), Profile("chamfer", (1.0, 1.5))])
def test_places_along_a_blend(profile):
    wedge = wedge_of(75.0)
    curve = blended(profile, wedge, *profile.starts(wedge))
    crossing = Crossing.of(curve, profile, wedge)
    assert np.abs(crossing.inside).max() < 1e-9
    assert crossing.share[[0, -1]] == pytest.approx([0.0, 1.0], abs=1e-9)
    assert (np.diff(crossing.share) > 0).all()
    middle = curve[len(curve) // 2][None]
    assert Crossing.of(1.05 * middle, profile, wedge).inside[0] > 0  # away from the edge, into the wedge
