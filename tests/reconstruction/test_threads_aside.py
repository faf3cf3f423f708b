"""Threads are set aside before the search: the program has plain cylinders, and its notes say of which threads."""

import numpy as np
import pytest
import trimesh
from tests.threaded import MINOR, bolt, tapped_block

from imdim.program.tree import leaves
from imdim.reconstruction.config import Settings
from imdim.reconstruction.pipeline import reconstruct_best
from imdim.reconstruction.threads_aside import set_threads_aside
from imdim.target.target import target_from

TURN = np.array(trimesh.transformations.rotation_matrix(0.5, [1, 2, 3]), float)
TURN[:3, 3] = [30, -20, 50]


@pytest.mark.parametrize("place", [np.eye(4), TURN], ids=["as it is", "aslant"])
def test_a_bolt_is_two_cylinders(place: np.ndarray) -> None:
    found = reconstruct_best(target_from(bolt().apply_transform(place)), Settings(budget_s=40))
    parts = list(leaves(found.program))
    assert [part.kind for part in parts] == ["cylinder"] * 2
    assert sorted(part.size[0] for part in parts) == pytest.approx([4, 6.5])
    (note,) = found.notes
    assert note.startswith("thread M8 x 1.25, pitch 1.25, diameters 6.")
    assert note.endswith("set aside: the program has the cylinder of its major diameter")


def test_a_tapped_hole_is_as_wide_as_its_crests() -> None:
    found = reconstruct_best(target_from(tapped_block()), Settings(budget_s=40))
    hole = next(part for part in leaves(found.program) if part.kind == "cylinder")
    assert 2 * hole.size[0] == pytest.approx(MINOR[True], abs=0.01)
    assert found.notes[0].endswith("set aside: the program has the cylinder of its minor diameter")


def test_what_has_no_thread_stays_as_it_is() -> None:
    plain = target_from(trimesh.creation.box((3, 4, 5)))
    assert set_threads_aside(plain, 1.0).target is plain
    cloud = target_from(np.random.default_rng(0).normal(size=(200, 3)))
    assert set_threads_aside(cloud, 1.0).target is cloud
