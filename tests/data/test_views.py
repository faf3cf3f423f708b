"""What scanners see of solids, against what can be counted by hand."""

import pytest
import torch

from imdim.data.solids import from_sequences
from imdim.data.surfaces import surface_clouds
from imdim.data.views import fit_frame, hide_unseen
from imdim.program.state import ADD_BOX, END


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def boxes(*rows: tuple[float, ...]):
    """One row of boxes (centre, edges, sign) and its cloud, both in the frame of the cloud."""
    params = torch.zeros(1, len(rows) + 1, 10)
    for i, row in enumerate(rows):
        params[0, i, :6], params[0, i, 9] = torch.tensor(row[:6]), row[6]
    solids = from_sequences(torch.tensor([[ADD_BOX] * len(rows) + [END]]), params)
    return fit_frame(solids, surface_clouds(solids, 3000, generator())[0])


@pytest.mark.parametrize("seed", range(6))
def test_one_scanner_sees_at_most_three_sides_of_a_cube(seed):
    solids, points = boxes((0, 0, 0, 1, 1, 1, 1))
    seen = hide_unseen(solids, points, 1.0, 1, generator(seed))
    most = points[0].amax(0)
    # a few points of other sides are at the rims of those that are seen
    faces = [int(((seen[0, :, axis] - sign * most[axis]).abs() < 1e-4).sum()) > 30 for axis in range(3) for sign in (-1, 1)]
    assert 1 <= sum(faces) <= 3
    assert not any(faces[2 * axis] and faces[2 * axis + 1] for axis in range(3))
    # what is seen is of the cloud
    assert float(torch.cdist(seen[0], points[0]).amin(1).max()) < 1e-3


def test_what_stands_between_two_plates_is_seen_less_than_what_stands_outside():
    solids, points = boxes((0, 0, 0, 2, 2, 0.3, 1), (0, 0, 0.8, 2, 2, 0.3, 1), (0.9, 0, 0.4, 0.2, 2, 1.1, 1))
    many_solids = solids[torch.zeros(40, dtype=torch.long)]
    clouds = points.expand(40, -1, -1)
    seen = hide_unseen(many_solids, clouds, 1.0, 1, generator(3))
    scale = 2 / (points[0, :, 0].amax() - points[0, :, 0].amin())
    low = points[0].amin(0)
    height = (seen[..., 2] - low[2]) * scale
    within = (height - 0.3).abs() < 0.02
    outside = (height < 0.02) | (height > 1.08)
    # both are equally large
    assert 0 < int(within.sum()) < 0.35 * int(outside.sum())


def test_all_around_nothing_is_lost():
    solids, points = boxes((0, 0, 0, 1, 2, 3, 1))
    assert torch.equal(hide_unseen(solids, points, 0.0, 6, generator()), points)
