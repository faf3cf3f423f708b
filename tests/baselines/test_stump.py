"""method=stump on planted parts, by exact booleans."""

import numpy as np
import pytest
from tests.planted import PARTS, mesh_of

from imdim.geometry.solid import to_manifold, volume_iou
from imdim.reconstruction.config import Settings
from imdim.reconstruction.pipeline import reconstruct
from imdim.target.target import target_from


def fitted(name: str, budget_s: float = 60.0):
    *_, last = reconstruct(target_from(mesh_of(PARTS[name])), Settings(method="stump", budget_s=budget_s), np.random.default_rng(0))
    return last


@pytest.mark.parametrize("name", ["L bracket", "open box"])
def test_a_part_is_explained(name: str):
    last = fitted(name)
    assert volume_iou(to_manifold(last.program), to_manifold(PARTS[name])) >= 0.99
    assert last.proof == ""


def test_no_time_still_gives_a_program():
    last = fitted("plate with four holes", 0.0)
    assert volume_iou(to_manifold(last.program), to_manifold(PARTS["plate with four holes"])) > 0.5
