"""Numbers that a hair keeps from a round one."""

import re

import pytest

from imdim.delivery.finish import finish
from imdim.export.residues import settle_number
from imdim.geometry.solid import to_manifold
from imdim.program.tree import Primitive, combine_all, leaves
from imdim.reconstruction.fitting import relations_of


@pytest.mark.parametrize(
    ("value", "settled"),
    [(142.700016, 142.7), (25.49999, 25.5), (-4.0000006, -4.0), (4e-06, 0.0), (14.262001, 14.262), (8.660255, 8.660255), (6.355, 6.355)],
)
def test_a_number_comes_to_its_grid_over_the_last_bits_of_a_mesh(value: float, settled: float) -> None:
    assert settle_number(value, 100.0) == settled


def test_what_is_off_by_more_is_another_number() -> None:
    assert settle_number(142.7001, 100.0) == 142.7001
    assert settle_number(0.00142, 1.0) == 0.00142


def test_spacings_and_depths_are_round_where_a_file_of_single_precision_had_them() -> None:
    plate = Primitive("box", (180.0, 60.0, 10.0), (0.0, 0.0, 5.0))
    slots = [Primitive("box", (20.0, 12.0, 4.000004), (x, 3.0, 8.499998)) for x in (-71.350008, 71.350008)]
    program = combine_all("difference", [plate, *slots])
    found = finish(*relations_of(program))
    assert all(round(value, 3) == value for value in found.parameters.values.values()), found.parameters.values
    constants = {e.constant for row in (*found.parameters.sizes, *found.parameters.centers) for e in row}
    assert not [c for c in constants if round(c, 3) != c]
    digits = [n for leaf in leaves(found.program) for n in (*leaf.size, *leaf.center) if not re.fullmatch(r"-?\d+(\.\d{1,4})?", f"{n:.9g}")]
    assert not digits
    assert to_manifold(found.program).volume() == pytest.approx(to_manifold(program).volume(), rel=1e-6)


def test_copies_stay_alike() -> None:
    plate = Primitive("box", (100.0, 20.0, 5.0))
    holes = [Primitive("cylinder", (2.0, 9.0), (24.000007 * k - 36.0000105, 0.0, 0.0)) for k in range(4)]
    found = finish(*relations_of(combine_all("difference", [plate, *holes])))
    assert found.folded is not None
    assert 24.0 in found.parameters.values.values()
    assert sorted(round(leaf.center[0], 9) for leaf in list(leaves(found.program))[1:]) == [-36.0, -12.0, 12.0, 36.0]


def test_a_size_never_vanishes() -> None:
    thin = Primitive("box", (100.0, 20.0, 5e-06))
    assert min(min(leaf.size) for leaf in leaves(finish(thin).program)) > 0
