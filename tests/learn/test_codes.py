"""Extruded and turned parts and intersections as choices among places, and back."""

from dataclasses import fields, replace

import numpy as np
import pytest
import torch

from imdim.data.canonical import canonical_primitives, shortest_from_z
from imdim.data.dice import Dice
from imdim.data.outlines import FORMS, NO_FORM, SIDES, Family, family_of, form_of, mask_shares
from imdim.data.solids import BOX, CONE, CYLINDER, EXTRUDE, NAMES, REVOLVE, Solids, holds, to_signed
from imdim.data.synthesize import estimate_iou
from imdim.geometry import kernels
from imdim.geometry.sdf import rotation_matrices
from imdim.learn.codes import (
    BINS,
    COMMON,
    ENDS,
    FREE,
    NUMBERS,
    PLACES,
    SIGNS,
    TAPER,
    TURNS,
    Choices,
    decode,
    encode,
    encode_signs,
    numbers_of,
)
from imdim.learn.rotations import ROTATION_CODES
from imdim.program.outline import check_crossings
from imdim.program.sequence import to_program
from imdim.program.tree import Primitive

SHARES = {Family.ROUNDED: (0.37, 0.0), Family.ELL: (0.22, 0.41), Family.TEE: (0.31, 0.18), Family.CHANNEL: (0.13, 0.29)}
EXTRUDED = [(EXTRUDE, family, quarter) for family in Family for quarter in (0, 1, 2, 3)]
TURNED = [(REVOLVE, family, quarter) for family in SHARES for quarter in (0, 1, 2, 3)]
LOW, EDGES = torch.tensor([-0.4, -0.5, -0.3]), torch.tensor([0.8, 1.0, 0.6])


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def parts(rotations):
    """Each extruded and turned outline in each of the rotations [n, 3, 3], canonical, one to a row, none in the middle of its ruler."""
    given = EXTRUDED + TURNED
    n = len(rotations)
    kinds = torch.tensor([kind for kind, _, _ in given])
    family, quarter = (torch.tensor([int(g[i]) for g in given]) for i in (1, 2))
    sizes = torch.tensor([(0.3, 0.3 if f in SIDES else 0.21, 0.17) if k == EXTRUDE else (0.24, 0.31, 0.0) for k, f, _ in given])
    shares = torch.tensor([(*SHARES.get(f, (0.0, 0.0)), 0.35 if k == REVOLVE else 0.0) for k, f, _ in given])
    count = len(given)
    rows = torch.arange(count).repeat_interleave(n)
    centers = torch.tensor([0.06, -0.11, 0.04]).expand(count * n, 1, 3)
    plain = Solids.plain(
        kinds[rows, None], torch.ones(count * n, 1, dtype=torch.bool), centers, sizes[rows, None], rotations.repeat(count, 1, 1)[:, None]
    )
    return canonical_primitives(replace(plain, forms=form_of(family, quarter)[rows, None], shares=shares[rows, None]))


def ruler(part):
    return LOW.expand(len(part.kinds), 3), EDGES.expand(len(part.kinds), 3)


def back(part, code="columns"):
    return decode(part.kinds[:, 0], encode_signs(part), encode(part, *ruler(part), code), *ruler(part), code)


def test_aligned_outlines_come_back_number_by_number():
    part = parts(shortest_from_z(torch.eye(3)))
    choices = encode(part, *ruler(part))
    assert (choices.turn == torch.arange(3).repeat(len(part.kinds) // 3)).all()
    assert torch.equal(choices.form, part.forms[:, 0])
    again = canonical_primitives(back(part))
    assert torch.equal(again.forms, part.forms)
    assert torch.equal(again.kinds, part.kinds)
    for name in ("centers", "sizes", "shares", "rotations"):
        assert torch.allclose(getattr(again, name), getattr(part, name), atol=1e-5), name
    assert (estimate_iou(again, part, 2000, generator()) == 1.0).float().mean() > 0.95


@pytest.mark.parametrize("code", sorted(ROTATION_CODES))
def test_outlines_in_any_pose_come_back(code):
    part = parts(Dice(generator(1), 4).rotations())
    choices = encode(part, *ruler(part), code)
    assert (choices.turn == FREE).all()
    again = canonical_primitives(back(part, code))
    assert torch.equal(again.forms, part.forms)
    iou = estimate_iou(again, part, 4000, generator())
    assert float(iou.median()) > 0.985
    assert float(iou.min()) > 0.94


def test_an_outline_spun_about_its_axis_is_turned_freely():
    """Where a quarter turn is not what is left: 30 degrees about z are free, one is as good as none; what is turned has no spin."""
    for degrees, expected in ((30.0, FREE), (1.0, 2)):
        part = parts(rotation_matrices(torch.tensor([[0.0, 0.0, degrees]])))
        turn = encode(part, *ruler(part)).turn
        assert (turn[part.kinds[:, 0] == EXTRUDE] == expected).all()
        assert (turn[part.kinds[:, 0] == REVOLVE] == 2).all()


def test_a_step_is_cut_united_or_intersected_with():
    part = parts(torch.eye(3)[None])[torch.arange(3)]
    part = replace(part, positive=torch.tensor([[False], [True], [False]]), common=torch.tensor([[False], [False], [True]]))
    assert encode_signs(part).tolist() == [0, 1, COMMON]
    assert SIGNS == 3
    again = back(part)
    assert torch.equal(again.positive, part.positive)
    assert torch.equal(again.common, part.common)


def test_the_unseen_ends_of_a_pocket_are_one_choice_and_its_sides_are_not():
    """An outline cut through along z: both ends beyond; across it the ends stay where they are, and come back though they are outside."""
    part = parts(torch.eye(3)[None])[:1]
    long = replace(part, sizes=torch.tensor([[[0.3, 1.3, 4.0]]]), positive=torch.tensor([[False]]))
    choices = encode(long, *ruler(long))
    assert choices.places[0, 4:].tolist() == [0, PLACES - 1]
    assert ((choices.places[0, :4] > 0) & (choices.places[0, :4] < PLACES - 1)).all()
    again = back(long)
    assert torch.allclose(again.sizes[0, 0], torch.tensor([0.3, 1.3, 0.6 + 2 * 1.0]), atol=1e-5)
    united = encode(replace(long, sizes=torch.tensor([[[0.3, 1.3, 0.8]]]), positive=torch.tensor([[True]])), *ruler(long))
    assert ((united.places > 0) & (united.places < PLACES - 1)).all()


def test_only_numbers_that_mean_something_are_asked_for():
    """Along the axes: a cone's taper, the shares of an outline. Turned freely: two columns of a box and of what is extruded, one of what is
    turned, and sizes."""
    kinds = torch.tensor([BOX, CYLINDER, CONE, *[EXTRUDE] * 3, *[REVOLVE] * 3])
    form = torch.tensor(
        [NO_FORM, 5, NO_FORM, *(int(form_of(torch.tensor(int(f)), torch.tensor(0))) for f in (0, Family.HEXAGON, Family.ELL) * 2)]
    )
    zeros = torch.zeros(9, NUMBERS, dtype=torch.long)

    def used(turn):
        choices = Choices(torch.full((9,), turn), form, zeros[:, :ENDS], zeros, torch.zeros(9, ENDS + NUMBERS))
        return choices.mask_used_bins(kinds)

    straight, free = used(0), used(FREE)
    shares = [[False] * 3, [False] * 3, [False] * 3, [True, False, False], [False] * 3, [True, True, False]]
    shares += [[True, False, True], [False, False, True], [True, True, True]]
    assert straight[:, TAPER + 1 :].tolist() == free[:, TAPER + 1 :].tolist() == shares
    assert straight[:, TAPER].tolist() == free[:, TAPER].tolist() == [k == CONE for k in kinds.tolist()]
    assert not straight[:, :TAPER].any()
    boxy = (kinds == BOX) | (kinds == EXTRUDE)
    assert free[:, :3].all()
    assert torch.equal(free[:, 3:6], boxy[:, None].expand(-1, 3))
    assert free[:, 6:8].all()
    assert torch.equal(free[:, 8], boxy)


def drawn_at_random(n):
    """Outlines of any form and numbers, as a policy that knows nothing may draw them."""
    dice = Dice(generator(5), n)
    kinds = torch.where(dice.coin(0.5), EXTRUDE, REVOLVE)
    bins = torch.where(dice.coin(0.2, NUMBERS), torch.where(dice.coin(0.5, NUMBERS), 0, BINS - 1), dice.integers(0, BINS - 1, NUMBERS))
    places = dice.integers(0, PLACES - 1, ENDS)
    choices = Choices(dice.integers(0, TURNS - 1), dice.integers(1, FORMS - 1), places, bins, dice.uniform(-0.5, 0.5, ENDS + NUMBERS))
    low, edges = LOW.expand(n, 3), EDGES.expand(n, 3)
    return kinds, choices, low, edges


def test_whatever_is_drawn_is_a_part_that_a_program_can_say():
    """The same solid for points and for the program, whatever its form, turn and numbers."""
    kinds, choices, low, edges = drawn_at_random(400)
    part = decode(kinds, torch.ones_like(kinds), choices, low, edges)
    assert ((part.sizes[..., 0] > 0) & (part.sizes[..., 1] > 0)).all()
    family, form = family_of(part.forms[:, 0]), part.forms[:, 0]
    polygon = torch.isin(family, torch.tensor([int(f) for f in SIDES]))
    assert (part.shares[:, 0][~mask_shares(form, kinds == REVOLVE)] == 0).all()
    assert torch.equal(part.sizes[polygon & (kinds == EXTRUDE), 0, 0], part.sizes[polygon & (kinds == EXTRUDE), 0, 1])
    exact = replace(part, **{n: getattr(part, n).double() for n in ("centers", "sizes", "rotations", "shares")})
    reach = torch.linalg.vector_norm(exact.sizes, dim=-1)
    points = exact.centers + (torch.rand(400, 300, 3, generator=generator(), dtype=torch.float64) - 0.5) * 1.5 * reach[..., None]
    mine, failed = holds(exact, points)[:, 0], []
    for row in range(400):
        numbers = f"sizes {part.sizes[row, 0].tolist()} shares {part.shares[row, 0].tolist()}"
        name = f"{NAMES[int(kinds[row])]} {Family(int(family[row])).name} form {int(form[row])} {numbers}"
        try:
            program = to_program(to_signed(exact[row : row + 1])[0])
            assert isinstance(program, Primitive)
            assert program.outline is not None
            check_crossings(program.outline)
        except ValueError as error:
            failed.append(f"{name}: {error}")
            continue
        values = kernels.program_sdf(program, points[row].numpy())
        if not (mine[row].numpy() == (values < 0))[np.abs(values) > 1e-6 * float(reach[row])].all():
            failed.append(f"{name}: another solid")
    assert not failed, "\n".join([f"{len(failed)} of 400", *failed[:8]])


def test_what_a_network_reads_of_a_program_is_what_it_chooses():
    """Each primitive of a row as if it stood alone, and zeros where there is none."""
    part = parts(shortest_from_z(torch.eye(3)))
    pair = Solids(*(torch.cat([getattr(part, f.name), getattr(part, f.name).roll(5, 0)], 1) for f in fields(Solids)))
    low, edges = ruler(part)
    numbers = numbers_of(pair, low, edges)
    assert numbers.shape == (len(part.kinds), 2, ENDS + NUMBERS + TURNS)
    assert torch.equal(numbers[:, 0], numbers_of(part, low, edges)[:, 0])
    assert torch.equal(numbers[:, 1], numbers[:, 0].roll(5, 0))
    assert torch.allclose(numbers[:, 0, ENDS + TAPER + 1 : ENDS + NUMBERS], part.shares[:, 0], atol=1e-6)
    assert not numbers_of(replace(pair, kinds=torch.full_like(pair.kinds, -1)), low, edges).any()
