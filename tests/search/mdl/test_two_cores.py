"""A second core changes when a search ends, not what it finds."""

import mmap
import os
import signal
import sys

import numpy as np
import pytest
from tests.planted import box, cut, cylinder, mesh_of, union

from imdim import side_process
from imdim.deadline import NEVER, Deadline
from imdim.geometry.sampling import surface_points
from imdim.geometry.shadows import Shadows
from imdim.numbers.em import maximise_likelihood
from imdim.numbers.likelihood import Noise
from imdim.search.mdl import search
from imdim.target.scan import Condition, place_scanners, scan

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="copies of a process are for Linux")

PART = cut(union(box(40, 30, 6), cylinder(7, 16, (5.0, 2.0, 8.0))), cylinder(3, 40, (-12.0, 0.0, 0.0)))
SIGMA = 0.4


@pytest.fixture
def cloud():
    rng = np.random.default_rng(0)
    return surface_points(PART, 1500, rng)[0] + rng.normal(0, SIGMA, (1500, 3))


def shortened(points, shadows=None):
    """The programs and lengths that a search from a box comes to."""
    start = maximise_likelihood(box(40, 30, 6), points, Noise(SIGMA, shadows=shadows))
    return list(search.shorten(start, points, [cylinder(3, 40, (-12.0, 0.0, 0.0))], np.eye(3), NEVER))


def count_copies(monkeypatch):
    """Let copies be made, and tell of each."""
    made, fork = [], os.fork
    monkeypatch.setattr(side_process, "can_fork", lambda: not side_process._ALONE.get())
    monkeypatch.setattr(os, "fork", lambda: made.append(fork()) or made[-1])
    return made


def forbid_copies(monkeypatch):
    monkeypatch.setattr(side_process, "can_fork", lambda: False)


def test_a_search_finds_the_same_on_two_cores(monkeypatch, cloud):
    forbid_copies(monkeypatch)
    alone = shortened(cloud)
    made = count_copies(monkeypatch)
    assert shortened(cloud) == alone
    assert made


def test_where_every_copy_dies_the_search_finds_the_same(monkeypatch, cloud):
    forbid_copies(monkeypatch)
    alone, here, fit = shortened(cloud), os.getpid(), search.maximise_likelihood

    def dies_apart(*given):
        if os.getpid() != here:
            os.kill(os.getpid(), signal.SIGKILL)
        return fit(*given)

    monkeypatch.setattr(search, "maximise_likelihood", dies_apart)
    made = count_copies(monkeypatch)
    assert shortened(cloud) == alone
    for copy in made:
        with pytest.raises(ProcessLookupError):
            os.kill(copy, 0)


def test_programs_from_a_copy_know_the_shadows_of_this_process(monkeypatch):
    mesh = mesh_of(PART)
    points, _ = scan(mesh, Condition(noise=SIGMA / np.linalg.norm([40, 30, 19]), views=2), np.random.default_rng(0), 1500)
    shadows = Shadows.of(points, place_scanners(mesh, 2), SIGMA)
    made = count_copies(monkeypatch)
    found = shortened(points, shadows)
    assert made
    assert all(likely.noise.shadows is shadows for likely, _ in found)


def test_both_processes_end_with_the_time(monkeypatch, cloud):
    """Which only looks at the clock move, whoever looks."""
    looks, start = mmap.mmap(-1, 8), maximise_likelihood(box(40, 30, 6), cloud, Noise(SIGMA))

    def look():
        looks[:] = (int.from_bytes(looks[:], "big") + 1).to_bytes(8, "big")
        return int.from_bytes(looks[:], "big")

    made = count_copies(monkeypatch)
    list(search.shorten(start, cloud, [], np.eye(3), Deadline(40, look)))
    assert made
    assert 40 < look() < 40 + 2 * (1 + search.TRIED + search.STEPPED)  # one more for each that has to be fitted, and some in a fit
