"""A run measures the noise of its target once, and what is delivered is judged by that."""

import numpy as np
import pytest
from tests.planted import box, cut, cylinder, mesh_of

import imdim
from imdim.delivery import surface_elements
from imdim.detection.noise import measure_noise
from imdim.geometry.sampling import subsample
from imdim.reconstruction import observation
from imdim.target.target import target_from

PART = cut(box(40, 30, 10), cylinder(6, 12))


def shaken(share: float) -> np.ndarray:
    """Points [n, 3] of the part, off it by a share of its diagonal."""
    points = subsample(np.arange(20_000), 6_000)
    target, rng = target_from(mesh_of(PART)), np.random.default_rng(5)
    return target.points[points] + share * np.linalg.norm((40, 30, 10)) * rng.standard_normal((len(points), 3))


@pytest.mark.usefixtures("without_step")
@pytest.mark.parametrize(
    ("part", "of_points", "of_mesh", "budget_s"),
    # a calm cloud's search ends by itself, a noisy one's by the clock
    [(mesh_of(PART), 0, 1, 30.0), (shaken(0.0), 1, 0, 30.0), (shaken(3e-3), 1, 0, 4.0)],
    ids=["mesh", "cloud", "noisy cloud"],
)
def test_noise_is_measured_once_in_a_whole_fit(part, of_points, of_mesh, budget_s, tmp_path, monkeypatch):
    calls = {"points": 0, "mesh": 0}

    def count(name, measure):
        def counted(*args):
            calls[name] += 1
            return measure(*args)

        return counted

    monkeypatch.setattr(observation, "measure_noise", count("points", measure_noise))
    monkeypatch.setattr(surface_elements, "measure_noise", count("points", measure_noise))
    monkeypatch.setattr(observation, "measure_mesh_noise", count("mesh", observation.measure_mesh_noise))
    result = imdim.reconstruct(part, imdim.Settings(budget_s=budget_s, evolution=False, checkpoint="none"), seed=0)
    report = result.save(tmp_path / "out")
    assert calls == {"points": of_points, "mesh": of_mesh}
    assert report["verdict"]


def test_what_was_measured_is_in_the_parts_units():
    points = 25 * shaken(3e-3)
    result = imdim.reconstruct(points, imdim.Settings(budget_s=4.0, evolution=False, checkpoint="none"), seed=0)
    assert result.noise is not None
    model, kept = measure_noise(points, np.random.default_rng(0))
    assert result.noise.model.sigma == pytest.approx(model.sigma, rel=0.1)
    assert result.noise.kept is not None
    assert len(result.noise.kept) == len(kept)
