"""What scanners could not see, in the choice between programs: a hole through a block, of whose walls only the upper ends are seen."""

import numpy as np
from tests.planted import box, cut, cylinder, mesh_of

from imdim.geometry.shadows import Shadows
from imdim.numbers.likelihood import Noise
from imdim.search.mdl.description_length import description_length
from imdim.search.mdl.search import best_by_mdl, tables_of_subsample
from imdim.target.scan import Condition, place_scanners, scan

SIGMA = 0.15
BLOCK = box(40, 40, 30)
THROUGH = cut(BLOCK, cylinder(3, 50))
DENTED = cut(BLOCK, cylinder(3, 12, (0, 0, 15)), cylinder(3, 12, (0, 0, -15)))  # as deep as is seen


def seen(known: bool) -> tuple[np.ndarray, Noise]:
    mesh = mesh_of(THROUGH)
    points, _ = scan(mesh, Condition(noise=SIGMA / np.linalg.norm([40, 40, 30]), views=3), np.random.default_rng(0))
    return points, Noise(SIGMA, shadows=Shadows.of(points, place_scanners(mesh, 3), SIGMA) if known else None)


def test_a_hole_goes_through_where_its_walls_could_not_be_seen():
    points, noise = seen(known=True)
    assert description_length(THROUGH, points, noise) < description_length(DENTED, points, noise)
    draws = tables_of_subsample(points, noise.shadows)
    assert best_by_mdl([DENTED, THROUGH], draws, noise, 1) == [THROUGH]


def test_it_ends_where_points_do_if_nobody_says_from_where_they_were_seen():
    points, noise = seen(known=False)
    assert description_length(THROUGH, points, noise) > description_length(DENTED, points, noise)
