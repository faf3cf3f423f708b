"""Signed sequences in batches, against the state machine, the exact solids and the numpy SDF."""

from dataclasses import replace

import numpy as np
import pytest
import torch
import trimesh

from imdim.data.canonical import canonical
from imdim.data.dice import Dice
from imdim.data.families import FAMILIES, PLAIN
from imdim.data.solids import (
    PAD,
    adds_primitive,
    euler_from_matrices,
    from_sequences,
    from_signed,
    inside,
    levels,
    to_sequences,
    to_signed,
    to_states,
)
from imdim.data.surfaces import surface_areas, surface_clouds, volumes
from imdim.data.synthesize import SynthesisConfig, contributions, draw_programs, estimate_iou, synthesize
from imdim.geometry import kernels
from imdim.geometry.sdf import rotation_matrices
from imdim.geometry.solid import to_manifold, to_trimesh, volume_iou
from imdim.geometry.surface_map import surface_area
from imdim.program.sequence import Step, to_program
from imdim.program.state import ADD_BOX, ADD_CYLINDER, ADD_SPHERE, END, UNDO_LAST
from imdim.program.tree import Primitive

CONFIG = SynthesisConfig(gt_points=256, cur_points=64, volume_samples=2048, families=PLAIN)


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


@pytest.fixture(scope="module")
def drawn():
    return draw_programs(24, CONFIG, generator())


def programs(solids):
    return [state.to_program() for state in to_states(*to_sequences(solids))]


def test_membership_is_that_of_the_program_tree(drawn):
    solids, _ = drawn
    points = torch.rand(24, 200, 3, generator=generator(1)) * 1.1 - 0.55
    mine = inside(solids, levels(solids, points) < 0)
    for row, program in enumerate(programs(solids)):
        values = kernels.program_sdf(program, points[row].double().numpy())
        clear = np.abs(values) > 1e-5
        assert (mine[row].numpy() == (values < 0))[clear].all()


def test_sequences_and_rows_are_the_same(drawn):
    solids, _ = drawn
    sequences = to_signed(solids)
    assert [to_program(s) for s in sequences] == programs(solids)
    again, there = from_signed(sequences), solids.present
    assert torch.equal(again.kinds, solids.kinds)
    for name in ("positive", "centers", "sizes", "rotations"):
        assert torch.allclose(getattr(again, name)[there].double(), getattr(solids, name)[there].double(), atol=1e-5)
    nothing = replace(solids[:1], positive=torch.zeros_like(solids.positive[:1]))
    assert to_signed(nothing) == [()]


SIX = [
    *(Primitive("box", (1.0, 2.0, 0.5)), Primitive("sphere", (0.7,)), Primitive("cylinder", (0.4, 1.2))),
    *(Primitive("cone", (0.6, 0.2, 1.0)), Primitive("torus", (0.8, 0.3)), Primitive("ellipsoid", (0.5, 1.0, 0.3))),
]


@pytest.mark.parametrize("primitive", SIX, ids=lambda p: p.kind)
def test_rows_are_all_six_kinds_of_primitives(primitive):
    """Membership, cloud, normals and evenness of each, turned and moved, against the exact primitive."""
    moved = Primitive(primitive.kind, primitive.size, (0.2, -0.1, 0.3), (25.0, 40.0, -70.0))
    solids = from_signed([(Step("union", moved),)])
    assert to_signed(solids)[0][0].term.kind == primitive.kind
    single = replace(solids, **{name: getattr(solids, name).float() for name in ("centers", "sizes", "rotations")})
    points = torch.rand(1, 4000, 3, generator=generator(3)) * 3 - 1.5
    exact = kernels.program_sdf(moved, points[0].double().numpy())
    found = (levels(single, points) < 0)[0, 0].numpy()
    assert (found == (exact < 0))[np.abs(exact) > 1e-4].all()
    cloud, normals, count = surface_clouds(single, 6000, generator())
    assert int(count) == 6000
    on = cloud[0].double().numpy()
    assert np.abs(kernels.program_sdf(moved, on)).max() < 1e-4
    step = 1e-3 * normals[0].double().numpy()
    risen = kernels.program_sdf(moved, on + step) - kernels.program_sdf(moved, on - step)
    assert np.quantile(risen, 0.01) > 1.8e-3
    # as many points on each side of the middle, along each axis, as on evenly sampled triangles
    mesh = to_trimesh(to_manifold(moved))
    even = trimesh.sample.sample_surface(mesh, 40_000, seed=1)[0]
    for axis in range(3):
        for quantile in (0.1, 0.3, 0.5, 0.7, 0.9):
            assert (on[:, axis] < np.quantile(even[:, axis], quantile)).mean() == pytest.approx(quantile, abs=0.03)


def test_clouds_lie_on_the_boundary_and_in_their_frame(drawn):
    solids, clouds = drawn
    for program, cloud in zip(programs(solids), clouds.double().numpy(), strict=True):
        values = kernels.program_sdf(program, cloud)
        assert np.abs(values).max() < 1e-5
    extent = clouds.amax(1) - clouds.amin(1)
    assert torch.allclose(torch.linalg.vector_norm(extent, dim=-1), torch.ones(24), atol=1e-5)
    assert torch.allclose(clouds.amax(1), -clouds.amin(1), atol=1e-5)


def test_clouds_are_area_weighted_and_cover_the_walls_of_cuts():
    """A unit cube with a bore of radius 0.3: the wall is 2 pi r h of the exact total, which counts the two drilled faces once."""
    params = torch.zeros(1, 3, 10)
    params[0, 0] = torch.tensor([0.0, 0, 0, 1, 1, 1, 0, 0, 0, 1])
    params[0, 1] = torch.tensor([0.0, 0, 0, 0.3, 1.0, 0, 0, 0, 0, -1])  # flush with both faces
    solids = from_sequences(torch.tensor([[ADD_BOX, ADD_CYLINDER, END]]), params)
    points, normals, count = surface_clouds(solids, 20_000, generator())
    wall = torch.linalg.vector_norm(points[0, :, :2], dim=-1) < 0.3 + 1e-4
    area = 2 * np.pi * 0.3
    share = area / (area + 6 - 2 * np.pi * 0.09)
    assert int(count) == 20_000
    assert float(wall.float().mean()) == pytest.approx(share, abs=4 * np.sqrt(share / 20_000))
    # out of the solid, into the bore; the few points at the rim of a face look up
    assert (torch.linalg.vecdot(points[0, wall, :2], normals[0, wall, :2]) < 0).float().mean() > 0.99


def test_touching_faces_are_no_boundary():
    params = torch.zeros(1, 3, 10)
    params[0, 0] = torch.tensor([0.0, 0, 0, 1, 1, 1, 0, 0, 0, 1])
    params[0, 1] = torch.tensor([0.0, 0, 1, 1, 1, 1, 0, 0, 0, 1])
    solids = from_sequences(torch.tensor([[ADD_BOX, ADD_BOX, END]]), params)
    points = surface_clouds(solids, 5000, generator())[0][0]
    hidden = ((points[:, 2] - 0.5).abs() < 1e-4) & (points[:, :2].abs().amax(1) < 0.499)
    assert not hidden.any()
    assert float((points[:, 2] > 0.5).float().mean()) == pytest.approx(0.5, abs=0.03)


def test_areas_and_volumes_are_those_of_the_exact_primitives(drawn):
    solids, _ = drawn
    areas, bulk = surface_areas(solids), volumes(solids)
    for row, state in enumerate(to_states(*to_sequences(solids))):
        for column, primitive in enumerate(state.to_primitives()):
            solid = primitive.solid(state.ellipsoids)
            known = 0.012 if solid.kind == "ellipsoid" else 1e-4
            assert float(areas[row, column]) == pytest.approx(surface_area(solid.kind, solid.size), rel=known)
            assert float(bulk[row, column]) == pytest.approx(to_manifold(solid).volume(), rel=0.01)


def test_every_step_changes_the_exact_solid(drawn):
    """Leave one primitive out and compare exact volumes; the sampled rule must have refused every step that does nothing."""
    solids, _ = drawn
    for state in to_states(*to_sequences(solids))[:10]:
        whole = to_manifold(state.to_program())
        for left_out in range(len(state.primitives)):
            rest = state.copy()
            del rest.primitives[left_out]
            program = rest.to_program()
            if program is not None:
                assert volume_iou(to_manifold(program), whole) < 0.9995


def test_idle_hidden_and_undone_steps_contribute_nothing():
    params = torch.zeros(1, 5, 10)
    rows = [
        (0, 0, 0, 1, 1, 1, 0, 0, 0, 1),
        (0, 0, 0, 0.2, 0, 0, 0, 0, 0, 1),  # inside of the box
        (3, 0, 0, 0.2, 0, 0, 0, 0, 0, -1),  # cuts nothing
        (0.5, 0, 0, 0.3, 0, 0, 0, 0, 0, 1),
        (0.5, 0, 0, 0.31, 0, 0, 0, 0, 0, -1),  # takes all of the one before away again
    ]
    params[0] = torch.tensor(rows)
    tokens = torch.tensor([[ADD_BOX, ADD_SPHERE, ADD_SPHERE, ADD_SPHERE, ADD_SPHERE]])
    share = contributions(from_sequences(tokens, params), 50_000, generator())[0]
    assert share[1:4].tolist() == [0, 0, 0]
    # without the last cut, half of its ball in the cube and the other half of the ball before would be there
    cut, back = 2 / 3 * np.pi * 0.31**3, 2 / 3 * np.pi * 0.3**3
    assert float(share[4]) == pytest.approx((cut + back) / (1 - cut), rel=0.1)


def test_canonical_keeps_the_solid_and_forgets_how_it_was_written(drawn):
    solids, _ = drawn
    again = canonical(solids)
    points = torch.rand(24, 500, 3, generator=generator(2)) * 1.1 - 0.55
    a, b = (inside(s, levels(s, points) < 0) for s in (solids, again))
    assert (a == b).float().mean() > 0.9999
    raw = FAMILIES["free"](Dice(generator(3), 50))
    spun = rotation_matrices(torch.tensor([0.0, 0.0, 90.0]))
    swapped = torch.where((raw.kinds == 0)[..., None], raw.sizes[..., [1, 0, 2]], raw.sizes)
    turned = replace(raw, sizes=swapped, rotations=raw.rotations @ spun)
    for one, other in zip(to_sequences(canonical(raw)), to_sequences(canonical(turned)), strict=True):
        assert torch.allclose(one.float(), other.float(), atol=1e-3)


def test_programs_may_stay_as_they_were_drawn(drawn):
    """The same solids, in orders and with rotations that `canonical` would not have chosen."""
    solids, _ = drawn
    raw, _ = draw_programs(24, replace(CONFIG, canonical_numbers=False, canonical_order=False), generator())
    points = torch.rand(24, 500, 3, generator=generator(2)) * 1.1 - 0.55
    a, b = (inside(s, levels(s, points) < 0) for s in (solids, raw))
    assert (a == b).float().mean() > 0.9999
    ordered, _ = draw_programs(24, replace(CONFIG, canonical_numbers=False), generator())
    same = ((raw.centers == ordered.centers).all(-1) | ~raw.present).all(1)
    assert 0 < int(same.sum()) < 24
    boxes = raw.kinds == 0
    assert (raw.rotations.diagonal(dim1=-2, dim2=-1).sum(-1)[boxes] < 2.0).any()
    assert torch.equal(torch.sort(ordered.kinds, 1).values, torch.sort(raw.kinds, 1).values)


def test_sequences_round_trip_through_the_state_machine(drawn):
    tokens, params = to_sequences(drawn[0], 14)
    assert tokens.shape == (24, 14)
    assert ((tokens == END).sum(1) == 1).all()
    assert (params[tokens == PAD] == 0).all()
    back = from_sequences(tokens, params)
    assert torch.equal(back.kinds, drawn[0].kinds)
    assert torch.allclose(back.rotations[back.present], drawn[0].rotations[back.present], atol=1e-4)


def test_undo_is_executed_and_unknown_tokens_are_refused():
    tokens = torch.tensor([[UNDO_LAST, ADD_BOX, ADD_SPHERE, UNDO_LAST, ADD_CYLINDER, END]])
    assert from_sequences(tokens, torch.ones(1, 6, 10)).kinds.tolist() == [[ADD_BOX, ADD_CYLINDER]]
    with pytest.raises(ValueError, match="unknown token 9; known are 0 to 8"):
        from_sequences(torch.tensor([[9]]), torch.ones(1, 1, 10))


def test_euler_angles_return_the_matrix_even_at_the_lock():
    rotations = torch.cat([Dice(generator(), 500).rotations(), rotation_matrices(torch.tensor([[30.0, 90, 20], [0, -90, 70]]))])
    assert torch.allclose(rotation_matrices(euler_from_matrices(rotations)), rotations, atol=2e-3)
    assert torch.allclose(rotation_matrices(euler_from_matrices(rotations[:500])), rotations[:500], atol=1e-4)


def test_sampled_iou_agrees_with_exact_booleans(drawn):
    solids, _ = drawn
    a, b = solids[:6], solids[6:12]
    estimate = estimate_iou(a, b, 20_000, generator())
    for value, one, other in zip(estimate.tolist(), programs(a), programs(b), strict=True):
        assert value == pytest.approx(volume_iou(to_manifold(one), to_manifold(other)), abs=0.03)


def test_prefix_clouds_show_the_prefix():
    samples = synthesize(12, CONFIG, generator(5))
    for row in range(12):
        steps = int(samples.steps[row])
        if steps == 0:
            assert not samples.cur_points[row].any()
            continue
        program = to_states(samples.gt_tokens[row, None, :steps], samples.gt_params[row, None, :steps])[0].to_program()
        assert program is not None
        assert np.abs(kernels.program_sdf(program, samples.cur_points[row].double().numpy())).max() < 1e-4
        assert to_trimesh(to_manifold(program)).area > 0


def test_counts_stay_within_their_bounds_and_impossible_ones_are_refused():
    samples = synthesize(16, SynthesisConfig(n_min=7, n_max=9, gt_points=64, cur_points=16), generator())
    count = adds_primitive(samples.gt_tokens).sum(1)
    assert 7 <= int(count.min()) <= int(count.max()) <= 9
    with pytest.raises(ValueError, match="n_min=5, n_max=3"):
        synthesize(1, SynthesisConfig(n_min=5, n_max=3), generator())
    with pytest.raises(ValueError, match="gears"):
        synthesize(1, SynthesisConfig(families=("gears",)), generator())
