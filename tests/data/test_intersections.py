"""What is common to several primitives, in batches, against closed forms and the exact program."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from imdim.data.canonical import canonical_order, canonical_primitives
from imdim.data.dice import Dice
from imdim.data.families import FAMILIES
from imdim.data.solids import BOX, CYLINDER, SPHERE, Solids, empty, from_sequences, from_signed, holds, inside, to_sequences, to_signed
from imdim.data.surfaces import surface_clouds
from imdim.data.synthesize import SynthesisConfig, contributions, draw_programs, estimate_iou, without_idle_steps
from imdim.data.views import hide_unseen
from imdim.geometry import kernels
from imdim.geometry.solid import to_manifold, volume_iou
from imdim.learn.measure import exact_structure
from imdim.learn.profile import fold_levels
from imdim.program.sequence import Step, to_program
from imdim.program.tree import Primitive

CONFIG = SynthesisConfig(gt_points=256, cur_points=64, volume_samples=2048)
CUBE, BALL = Primitive("box", (1.0, 1.0, 1.0)), Primitive("sphere", (0.6,))
BAR, PEG = Primitive("box", (3.0, 0.2, 0.2)), Primitive("cylinder", (0.2, 2.0))
CAP = math.pi * 0.1**2 * (3 * 0.6 - 0.1) / 3  # of the ball, beyond a face of the cube


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def of(*steps):
    """One row of (operation, primitive) in single precision."""
    solids = from_signed([tuple(Step(*s) for s in steps)])
    return replace(solids, **{n: getattr(solids, n).float() for n in ("centers", "sizes", "rotations", "shares")})


ROUNDED_CUBE = ("union", CUBE), ("intersection", BALL)
SEQUENCES = {
    "a bar added later is whole": (*ROUNDED_CUBE, ("union", BAR)),
    "a bar added before is cut": (("union", CUBE), ("union", BAR), ("intersection", BALL)),
    "a bore of what is common": (*ROUNDED_CUBE, ("difference", PEG)),
    "the bore before it": (("union", CUBE), ("difference", PEG), ("intersection", BALL)),
    "two in a row": (*ROUNDED_CUBE, ("intersection", PEG)),
    "what was cut is not given back": (("union", CUBE), ("difference", BALL), ("intersection", BALL), ("union", PEG)),
}


@pytest.fixture(scope="module", params=["profile", "ring", "common"])
def drawn(request):
    """Programs of a family with outlines or intersections."""
    return draw_programs(12, replace(CONFIG, families=(request.param,)), generator())


@pytest.mark.parametrize("name", SEQUENCES)
def test_what_is_common_is_that_of_the_program_tree(name):
    """Membership, the level that policies see, and the sequence there and back."""
    solids = of(*SEQUENCES[name])
    program = to_program(tuple(Step(*s) for s in SEQUENCES[name]))
    points = torch.rand(1, 6000, 3, generator=generator()) * 2.4 - 1.2
    exact = kernels.program_sdf(program, points[0].double().numpy())
    mine = inside(solids, holds(solids, points))[0].numpy()
    assert (mine == (exact < 0))[np.abs(exact) > 1e-5].all()
    assert ((fold_levels(solids, points)[0].numpy() < 0) == mine)[np.abs(exact) > 1e-5].all()
    assert [step.op for step in to_signed(solids)[0]] == [op for op, _ in SEQUENCES[name]]
    assert [step.term.kind for step in to_signed(solids)[0]] == [p.kind for _, p in SEQUENCES[name]]
    again = from_sequences(*to_sequences(solids, 6))
    assert torch.equal(again.common, solids.common)
    assert torch.equal(again.positive, solids.positive)
    assert not (solids.common & solids.positive).any()
    sorted_ones = canonical_order(solids)
    assert torch.equal(inside(sorted_ones, holds(sorted_ones, points))[0], torch.tensor(mine))


def test_rows_without_an_intersection_are_not_cut_by_those_with_one():
    """Nothing that is absent holds anything, and an intersection of nothing is nothing."""
    nothing = replace(empty(1, 3), common=torch.ones(1, 3, dtype=torch.bool))
    points = torch.rand(1, 100, 3, generator=generator())
    assert not holds(nothing, points).any()
    alone = from_sequences(torch.tensor([[SPHERE]]), torch.tensor([[[0.0, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]]]))
    assert alone.common.all()
    assert not inside(alone, holds(alone, points)).any()
    assert to_signed(alone) == [()]
    padded = Solids(*(torch.cat([a, b], 1) for a, b in zip(vars(of(*ROUNDED_CUBE)).values(), vars(nothing).values(), strict=True)))
    assert torch.equal(inside(padded, holds(padded, points)), inside(of(*ROUNDED_CUBE), holds(of(*ROUNDED_CUBE), points)))
    assert torch.equal(fold_levels(padded, points), fold_levels(of(*ROUNDED_CUBE), points))


def test_the_cloud_of_a_rounded_cube_is_spread_over_ball_and_faces():
    """The cube keeps six discs of radius sqrt(0.11), the ball what six caps of height 0.1 leave."""
    solids = of(*ROUNDED_CUBE)
    points, normals, count = surface_clouds(solids, 20_000, generator())
    assert int(count) == 20_000
    radius = torch.linalg.vector_norm(points[0], dim=-1)
    discs, sphere = 6 * math.pi * 0.11, 4 * math.pi * 0.6**2 - 6 * 2 * math.pi * 0.6 * 0.1
    on_ball = (radius - 0.6).abs() < 1e-5
    share = sphere / (sphere + discs)
    assert float(on_ball.float().mean()) == pytest.approx(share, abs=4 * math.sqrt(share * (1 - share) / 20_000))
    assert (points[0, ~on_ball].abs().amax(1) - 0.5).abs().max() < 1e-5
    assert radius.max() < 0.6 + 5e-4  # the step by which both sides are looked at
    # out of the solid on both
    assert (torch.linalg.vecdot(points[0], normals[0]) > 0).float().mean() > 0.999


def test_what_an_intersection_changes_is_counted_by_hand():
    """A ball about the cube changes nothing; one that touches its edges takes six caps less than itself away."""
    around = of(("union", CUBE), ("intersection", Primitive("sphere", (2.0,))), ("difference", PEG))
    inner = of(*ROUNDED_CUBE)
    common = 4 / 3 * math.pi * 0.6**3 - 6 * CAP
    shares = contributions(inner, 200_000, generator())[0]
    assert float(shares[1]) == pytest.approx((1 - common) / common, rel=0.05)
    assert float(contributions(around, 40_000, generator())[0, 1]) == 0
    config = replace(CONFIG, volume_samples=20_000)
    kept, valid = without_idle_steps(around, config, generator())
    assert valid.all()
    assert kept.kinds.tolist() == [[BOX, CYLINDER]]
    assert not kept.common.any()
    kept, valid = without_idle_steps(inner, config, generator())
    assert valid.all()
    assert kept.common.tolist() == [[False, True]]
    far = of(("union", CUBE), ("intersection", Primitive("sphere", (0.3,), (4.0, 0.0, 0.0))))
    assert not without_idle_steps(far, config, generator())[1].any()


def test_sampled_iou_of_what_is_common_is_that_of_exact_booleans():
    ones = [of(*steps) for steps in (SEQUENCES["a bore of what is common"], ROUNDED_CUBE)]
    a, b = (to_manifold(to_program(to_signed(s)[0])) for s in ones)
    assert float(estimate_iou(ones[0], ones[1], 40_000, generator())) == pytest.approx(volume_iou(a, b), abs=0.02)
    cube = of(("union", CUBE))
    known = 4 / 3 * math.pi * 0.6**3 - 6 * CAP
    assert float(estimate_iou(ones[1], cube, 40_000, generator())) == pytest.approx(known, abs=0.01)


def test_an_intersection_is_no_cut_of_the_same_ball():
    common, cut, drawn = of(*ROUNDED_CUBE), of(("union", CUBE), ("difference", BALL)), of(("union", CUBE), ("union", BALL))
    assert exact_structure(common, common).all()
    assert not exact_structure(common, cut).any()
    assert not exact_structure(common, drawn).any()


def test_a_scanner_sees_into_what_an_intersection_took_away():
    """Of a plate that is all but a disc of itself: rays pass where the corners were."""
    disc = of(("union", Primitive("box", (0.9, 0.9, 0.1))), ("intersection", Primitive("cylinder", (0.3, 1.0))))
    twin = of(("union", Primitive("cylinder", (0.3, 0.1))))
    points = surface_clouds(twin, 800, generator())[0]
    seen, known = (hide_unseen(s, points, 1.0, 2, generator(1)) for s in (disc, twin))
    assert torch.equal(seen, known)


def test_membership_of_drawn_programs_is_that_of_the_program_tree(drawn):
    solids, clouds = drawn
    points = torch.rand(12, 300, 3, generator=generator(1)) * 1.1 - 0.55
    mine = inside(solids, holds(solids, points))
    for row, sequence in enumerate(to_signed(solids)):
        assert len(sequence) == int(solids.lengths[row])
        program = to_program(sequence)
        values = kernels.program_sdf(program, points[row].double().numpy())
        assert (mine[row].numpy() == (values < 0))[np.abs(values) > 1e-5].all()
        assert np.abs(kernels.program_sdf(program, clouds[row].double().numpy())).max() < 1e-4


def test_every_step_of_a_drawn_program_changes_the_exact_solid(drawn):
    """As the state machine cannot say them, each is left out of the sequence."""
    for sequence in to_signed(drawn[0])[:6]:
        whole = to_manifold(to_program(sequence))
        for left_out in range(1, len(sequence)):
            rest = to_program(sequence[:left_out] + sequence[left_out + 1 :])
            assert volume_iou(to_manifold(rest), whole) < 0.9995


@pytest.mark.parametrize("family", ["profile", "ring", "common"])
def test_canonical_numbers_keep_what_families_draw(family):
    raw = FAMILIES[family](Dice(generator(3), 40))
    again = canonical_order(canonical_primitives(raw))
    points = torch.rand(40, 800, 3, generator=generator(2)) * 2.4 - 1.2
    a, b = (inside(s, holds(s, points)) for s in (raw, again))
    assert (a == b).float().mean() > 0.9999
    assert a.any()
    for one, other in zip(to_sequences(again.compact()), to_sequences(canonical_order(canonical_primitives(again)).compact()), strict=True):
        assert torch.allclose(one.float(), other.float(), atol=1e-3)
