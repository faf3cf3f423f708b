"""Relations are looked for once in a run: of a mesh, of a calm cloud and of a noisy one, delivery included."""

import numpy as np
import pytest
import trimesh
from tests.planted import box, cut, cylinder, mesh_of

from imdim.delivery.finish import finish
from imdim.reconstruction import mdl, pipeline
from imdim.reconstruction.config import Settings
from imdim.relations import discover as module
from imdim.target.target import Target, target_from

ROW = cut(box(40, 20, 6), *(cylinder(3, 6, (x, 0.0, 0.0)) for x in (-12.0, 0.0, 12.0)))


def target(noise: float | None) -> Target:
    if noise is None:
        return target_from(mesh_of(ROW))
    points, _ = trimesh.sample.sample_surface(mesh_of(ROW), 400, seed=0)
    return target_from(points + noise * float(np.linalg.norm(np.ptp(points, axis=0))) * np.random.default_rng(0).normal(size=points.shape))


@pytest.mark.parametrize("noise", [None, 1e-4, 6e-3], ids=["mesh", "calm cloud", "noisy cloud"])
def test_once(noise, monkeypatch):
    searches = []
    monkeypatch.setattr(mdl, "shorten", lambda *_, **__: iter(()))  # of programs: a noisy cloud's is most of the time
    choose = module._choose
    monkeypatch.setattr(module, "_choose", lambda *given: searches.append(given) or choose(*given))
    *_, last = pipeline.reconstruct(target(noise), Settings(budget_s=1e6), np.random.default_rng(0))
    delivered = finish(last.program, last.constraints)
    assert len(searches) == 1
    assert last.constraints
    assert delivered.parameters.values
