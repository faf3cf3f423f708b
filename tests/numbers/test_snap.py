"""Round programs whose numbers were disturbed: the typed numbers are demanded back, and never at the price of the error."""

import numpy as np
import pytest
from tests.deadlines import PASSED

from imdim.geometry import kernels
from imdim.geometry.lowering import pack, unpack
from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.sampling import surface_points
from imdim.numbers.design_values import Values, clusters, find_parted_groups, grids, plainest_first, round_to_grid
from imdim.numbers.snap import SnapConfig, accept_changes, snap
from imdim.numbers.symmetry_normal_form import along_axis
from imdim.program.tree import Combine, Primitive, Program, combine_all, leaves

PLATE = Primitive("box", (80.0, 50.0, 6.0), (40.0, 25.0, 3.0))
HOLES = [Primitive("cylinder", (2.75, 8.0), (x, y, 3.0)) for x in (8.0, 72.0) for y in (8.0, 42.0)]
AXLE = Primitive("cylinder", (6.5, 30.0), (40.0, 25.0, 12.0), (0.0, 90.0, 0.0))
BRACE = Primitive("box", (10.0, 4.0, 12.0), (40.0, 10.0, 10.0), (0.0, 0.0, 30.0))
BRACKET = combine_all("difference", [Combine("union", Combine("union", PLATE, AXLE), BRACE), *HOLES])


class Distance:
    """Mean distance of a target's surface points to a candidate; counts its calls."""

    def __init__(self, target: Program) -> None:
        self.points, _ = surface_points(target, 1500, np.random.default_rng(0))
        self.calls = 0

    def __call__(self, program: Program) -> float:
        self.calls += 1
        return float(np.abs(kernels.program_sdf(program, self.points)).mean())


def disturbed(program: Program, length: float, degrees: float) -> Program:
    rng = np.random.default_rng(2)
    _, params = pack(program)
    noise = rng.uniform(-1, 1, params.shape)
    sizes = params[:, :3] + length * noise[:, :3] * (params[:, :3] > 0)
    return unpack(program, np.hstack([sizes, params[:, 3:6] + length * noise[:, 3:6], params[:, 6:] + degrees * noise[:, 6:]]))


def test_typed_numbers_come_back():
    error = Distance(BRACKET)
    config = SnapConfig(rel_tolerance=0.03)
    got = snap(disturbed(BRACKET, 0.02, 0.05), error, config=config)
    assert got == BRACKET
    assert error.calls < 120


def test_exact_numbers_cost_few_calls_and_stay():
    error = Distance(BRACKET)
    assert snap(BRACKET, error) == BRACKET
    assert error.calls < 60


def test_turned_leaves_become_canonical():
    turned = Primitive("box", (50.0, 6.0, 80.0), PLATE.center, (90.0, 0.0, 90.0))
    assert snap(turned, Distance(PLATE)) == PLATE


def test_the_error_never_grows_beyond_the_tolerance():
    odd = disturbed(BRACKET, 0.3, 4.0)
    error = Distance(odd)
    for rel, absolute in ((0.0, 0.0), (0.0, 1e-3), (0.5, 1e-2)):
        got = snap(odd, error, config=SnapConfig(rel_tolerance=rel, abs_tolerance=absolute))
        assert error(got) <= error(odd) * (1 + rel) + absolute + 1e-9


def single(program: Program) -> Program:
    """Numbers as a mesh in single precision has them."""
    _, params = pack(program)
    return unpack(program, np.hstack([params[:, :6].astype(np.float32), params[:, 6:]]))


def test_what_a_mesh_tells_to_its_last_bits_is_not_rounded_further():
    """A pocket of 10.5 in the middle of a long bar, whose walls are near rounder places; a wall on no grid is rounded."""
    bar = Primitive("box", (11.0, 47.65, 274.32), (5.5, 23.825, 137.16))
    pockets = [Primitive("box", (10.5, 10.5, 5.3), (5.5, 23.825, z)) for z in (10.65, 263.67)]
    odd = Primitive("box", (3.0, 5.012345, 3.0), (5.5, 2.5061725, 137.16))
    program = combine_all("difference", [bar, *pockets, odd])
    error = Distance(program)
    got, bold = (snap(single(program), error, config=SnapConfig(precision=bits, abs_tolerance=1e-3)) for bits in (2.8e-5, 0.0))
    assert list(leaves(got))[:3] == [bar, *pockets]
    assert list(leaves(got))[3].size[1] == pytest.approx(5.0, abs=1e-9)
    assert list(leaves(bold))[1] != pockets[0]


def test_what_is_near_a_typed_number_comes_to_that():
    parts = [Primitive("sphere", (r,), (0.0, 0.0, 0.0)) for r in (1.0, 1.003, 1.01, 5.0)]
    ((members, value),) = clusters(Values.of(parts), 0.05, {1.003})
    assert (members.tolist(), value) == ([0, 6, 12], 1.003)
    assert clusters(Values.of(parts), 0.05, {1.0, 1.003}) == []


def test_an_odd_radius_among_equal_ones_stays_odd():
    odd = combine_all("difference", [PLATE, *HOLES[:3], Primitive("cylinder", (2.87, 8.0), HOLES[3].center)])
    got = snap(disturbed(odd, 0.005, 0.0), Distance(odd), config=SnapConfig(rel_tolerance=0.05))
    radii = [p.size[0] for p in leaves(got)][1:]
    assert radii == pytest.approx([2.75, 2.75, 2.75, 2.87], abs=1e-2)
    assert len(set(radii)) == 2


def test_faces_are_made_round_rather_than_centres():
    box = Primitive("box", (7.0, 5.0, 3.0), (3.5, 2.5, 1.5))
    got = snap(disturbed(box, 0.004, 0.0), Distance(box))
    assert got == box


def test_hidden_numbers_take_the_coarsest_grid():
    drilled = Combine("difference", PLATE, Primitive("cylinder", (2.0, 20.1234), (10.0, 10.0, 2.98765)))
    got = list(leaves(snap(drilled, Distance(drilled), config=SnapConfig(max_move=0.01))))[1]
    assert (got.center[2] - got.size[1] / 2, got.center[2] + got.size[1] / 2) == pytest.approx((-7.0, 13.0))


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_round_means_round_at_any_scale(unit):
    small = unpack(BRACKET, pack(BRACKET)[1] * ([unit] * 6 + [1.0] * 3))
    got = snap(disturbed(small, 0.01 * unit, 0.0), Distance(small))
    np.testing.assert_allclose(pack(got)[1], pack(small)[1], rtol=1e-9, atol=1e-9 * unit)


def test_the_call_budget_is_kept():
    odd = disturbed(BRACKET, 0.3, 4.0)
    error = Distance(odd)
    snap(odd, error, config=SnapConfig(rel_tolerance=0.0, max_calls=20))
    assert error.calls <= 21


@pytest.mark.parametrize("bad", [{3}, {0, 9}, set(range(10)), set()])
def test_accepted_keeps_every_bearable_change(bad):
    got = accept_changes(frozenset(), list(range(10)), lambda s, c: s | {c}, lambda s: not (s & bad), tries=100)
    assert got == frozenset(range(10)) - bad


def test_clusters_join_close_values_of_one_class_only():
    parts = [
        Primitive("sphere", (1.0,), (1.0, 0.0, 0.0)),
        Primitive("sphere", (1.01,), (1.02, 5.0, 0.0)),
        Primitive("sphere", (1.5,), (9.0, 0.0, 0.0)),
    ]
    values = Values.of(parts)
    assert sorted((values.classes[i[0]], len(i), round(v, 3)) for i, v in clusters(values, 0.05)) == [(0, 2, 1.01), (3, 2, 1.005)]


def test_a_number_that_is_round_already_is_that_of_its_cluster():
    """Not the middle of it and of one that a mesh of single precision says."""
    parts = [Primitive("sphere", (r,), (0.0, 0.0, z)) for r, z in ((1.0, -645.820007324), (2.0, -645.82), (3.0, 7.0))]
    assert [value for _, value in clusters(Values.of(parts), 1e-3)] == [-645.82]


def test_values_that_were_equal_and_are_no_longer_are_told():
    before, after = (
        Values.of([Primitive("box", (size, 2.0, 2.0), (x, 0.0, 0.0)), Primitive("box", (4.0, 1.0, 5.0))])
        for size, x in ((4.0, 0.0), (4.002, -0.001))
    )
    (group,) = find_parted_groups(before, after, 1e-6)
    assert sorted(after.numbers[group]) == pytest.approx([-2.002, -2.0])
    assert plainest_first(after.numbers[group])[0] == -2.0


def test_values_read_back_exactly():
    parts = [*leaves(disturbed(BRACKET, 0.1, 3.0)), PLATE, AXLE]
    assert Values.of(parts).primitives() == parts


def test_grids_are_decimal():
    assert grids(30.0, 0.01) == pytest.approx([10.0, 5.0, 1.0, 0.5, 0.1, 0.05, 0.01])
    assert round_to_grid(0.30000000000000004, 0.1) == 0.3
    assert round_to_grid(12.3456, 0.05) == 12.35


def test_once_time_is_out_nothing_more_is_rounded():
    rough = Primitive("box", (39.98, 30.01, 6.003))
    assert next(leaves(snap(rough, lambda _: 0.0))).size == (40.0, 30.0, 6.0)
    assert next(leaves(snap(rough, lambda _: 0.0, deadline=PASSED))).size == rough.size


def test_what_is_square_to_a_tilted_plate_stays_so():
    tilted = (33.758972918, 32.969678687, 29.401243741)
    turn = matrix_from_euler(tilted)
    plate = Primitive("box", (80.0, 50.0, 6.0), rotation=tilted)
    holes = [along_axis(Primitive("cylinder", (2.0, 8.0), tuple(turn @ [x, 10.0, 0.0])), turn[:, 2]) for x in (-20.0, 20.0)]
    lone = along_axis(Primitive("cylinder", (2.0, 8.0)), turn[:, 0])
    cone = Primitive("cone", (2.0, 4.0, 2.0), rotation=along_axis(holes[0], turn[:, 2]).rotation)
    box, *rest = leaves(snap(combine_all("difference", [plate, *holes, cone, lone]), lambda _: 0.0))
    assert box.rotation != tilted
    along = [matrix_from_euler(box.rotation).T @ matrix_from_euler(leaf.rotation)[:, 2] for leaf in rest]
    assert np.allclose(np.abs(along), [[0, 0, 1], [0, 0, 1], [0, 0, 1], [1, 0, 0]], atol=1e-6)


def test_thirds_of_a_typed_length_are_as_exact_as_that() -> None:
    """Six balls spread evenly over a bar of 70: 11.667 would be off by more than a mesh's places are."""
    program = combine_all("union", [Primitive("box", (70.0, 8.0, 4.0), (35.0, 0.0, 2.0)), *thirds(70.0 + 4e-6)])
    config = SnapConfig(max_move=1e-3, abs_tolerance=1.0, precision=7e-6)
    found = [leaf.center[0] for leaf in leaves(snap(program, lambda trial: 0.0, config=config)) if leaf.kind == "sphere"]
    assert found == pytest.approx([70.0 * k / 6 for k in range(1, 6)], abs=1e-9)


def thirds(length: float) -> list[Primitive]:
    return [Primitive("sphere", (3.0,), (length * k / 6, 0.0, 4.0)) for k in range(1, 6)]
