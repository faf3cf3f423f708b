"""Both designs: what may depend on what, what is masked, legal moves, and that they can learn a program by heart."""

import math

import pytest
import torch

from imdim.data.canonical import canonical_primitives
from imdim.data.dice import Dice
from imdim.data.families import FAMILIES
from imdim.data.solids import PAD, from_sequences, to_sequences
from imdim.data.synthesize import SynthesisConfig, sampled_iou, synthesize
from imdim.learn.base import BaseConfig, BasePolicy
from imdim.learn.codes import BINS, SLOTS, decode, encode, from_bins, to_bins, used
from imdim.learn.decode import DecodeConfig, applied, beam_search, costs_of, empty
from imdim.learn.decode import decode as write
from imdim.learn.patches import farthest, gaps
from imdim.learn.policy import VOCAB, Move, drawn, legal, supervised
from imdim.learn.seed import ModelComponents, SeedConfig, SeedPolicy, build_cad_model, forward_params_only, seed_losses
from imdim.program.state import ADD_BOX, ADD_SPHERE, END, UNDO_LAST, ShapeState

SMALL = BaseConfig(
    d_model=32, encoder_layers=1, decoder_layers=1, heads=2, gt_points=128, cur_points=64, gt_patches=8, cur_patches=4, neighbours=8
)
TINY = SeedConfig(d_model=32, layers=1, heads=2, hidden=32)
DATA = SynthesisConfig(gt_points=128, cur_points=64, n_max=4, volume_samples=512)


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


@pytest.fixture(autouse=True)
def _one_thread():
    torch.set_num_threads(1)
    torch.manual_seed(0)


@pytest.fixture(scope="module")
def batch():
    return synthesize(8, DATA, generator())


def policies():
    torch.manual_seed(0)
    return [SeedPolicy(TINY, 7), BasePolicy(SMALL, 7)]


def test_forward_params_only_has_the_shapes_of_the_design(batch):
    components = build_cad_model(TINY, 7)
    assert isinstance(components, ModelComponents)
    params, hidden, logits = forward_params_only(components, batch.gt_points, batch.cur_points, batch.gt_tokens)
    steps = batch.gt_tokens.shape[1]
    assert (params.shape, hidden.shape, logits.shape) == ((8, steps, 10), (8, steps, 32), (8, steps, VOCAB))
    with pytest.raises(ValueError, match="8 steps, the model has 7"):
        forward_params_only(components, batch.gt_points, batch.cur_points, torch.zeros(8, 8, dtype=torch.long))


def test_a_token_cannot_be_read_off_the_input(batch):
    """Logits at t must not change with token t or later ones, parameters at t must change with token t."""
    components = build_cad_model(TINY, 7)
    tokens = torch.zeros(8, 5, dtype=torch.long)
    other = tokens.clone()
    other[:, 2:] = 1
    (p0, h0, l0), (p1, h1, l1) = (forward_params_only(components, batch.gt_points, batch.cur_points, t) for t in (tokens, other))
    assert torch.allclose(l0[:, :3], l1[:, :3])
    assert torch.allclose(h0[:, :3], h1[:, :3])
    assert torch.allclose(p0[:, :2], p1[:, :2])
    assert not torch.allclose(p0[:, 2], p1[:, 2])
    assert not torch.allclose(l0[:, 3], l1[:, 3])


def test_an_empty_state_is_the_same_as_no_points(batch):
    components = build_cad_model(TINY, 7)
    zeros, none = torch.zeros(8, 64, 3), torch.zeros(8, 0, 3)
    for a, b in zip(*(forward_params_only(components, batch.gt_points, c, batch.gt_tokens) for c in (zeros, none)), strict=True):
        assert torch.allclose(a, b)


def test_seed_losses_are_the_designs_and_padding_is_masked():
    """Worked by hand: one box whose every number is off by 2, uniform logits, a sign logit of 0; the second row is END and padding."""
    tokens = torch.tensor([[int(ADD_BOX), int(END), PAD], [int(END), PAD, PAD]])
    targets = torch.zeros(2, 3, 10)
    targets[0, 0, 9] = 1.0
    params = torch.full((2, 3, 10), 2.0)
    params[..., 9] = 0.0
    params[1], params[0, 1:] = math.nan, math.nan  # must not be looked at
    logits = torch.zeros(2, 3, VOCAB)
    logits[0, 2], logits[1, 1:] = math.nan, math.nan
    losses = seed_losses(params, logits, tokens, targets)
    assert float(losses["params"]) == pytest.approx(4.0)
    assert float(losses["sign"]) == pytest.approx(math.log(2))
    assert float(losses["token"]) == pytest.approx(math.log(VOCAB))
    assert float(losses["loss"]) == pytest.approx(4 + math.log(2) + math.log(VOCAB))


def test_steps_that_are_taken_back_are_not_learned():
    tokens = torch.tensor([[int(ADD_BOX), int(ADD_SPHERE), int(UNDO_LAST), int(END), PAD]])
    assert supervised(tokens).tolist() == [[True, False, True, True, False]]


def test_base_ignores_what_comes_after_the_prefix(batch):
    policy = BasePolicy(SMALL, 7)
    column = torch.arange(batch.gt_tokens.shape[1])
    later = column > batch.steps[:, None]
    changed = batch._replace(
        gt_params=torch.where(later[..., None], 0.3, batch.gt_params), gt_tokens=torch.where(later, PAD, batch.gt_tokens)
    )
    for name, value in policy.losses(batch).items():
        assert torch.allclose(value, policy.losses(changed)[name])


def test_base_slots_see_only_the_slots_before(batch):
    policy = BasePolicy(SMALL, 7)
    memory = policy._memory(batch.gt_points, batch.cur_points, empty(8, 3))
    index = torch.zeros(8, SLOTS, dtype=torch.long)
    other = index.clone()
    other[:, 5:] = 7
    zero = index[:, 0]
    a, b = (policy._slots(memory, zero, zero, i) for i in (index, other))
    assert torch.allclose(a[:, :8], b[:, :8])  # token, sign, six numbers: slot 5's own value is not seen by slot 5
    assert not torch.allclose(a[:, 8], b[:, 8])
    assert torch.allclose(policy._slots(memory, zero, zero, index, 4), a[:, :4], atol=1e-5)


def test_codes_return_the_primitive():
    solids = canonical_primitives(FAMILIES["free"](Dice(generator(), 100)))
    numbers = encode(solids)
    index, offset = to_bins(numbers)
    mask = used(solids.kinds)
    within = mask & (offset.abs() <= 0.5 + 1e-4)
    assert within.sum() > 0.7 * mask.sum()
    for slot in range(SLOTS):
        back = from_bins(index[..., slot], offset[..., slot], slot)
        assert torch.allclose(back, numbers[..., slot], atol=1e-4)
    again = decode(solids.kinds, solids.positive, torch.where(mask, numbers, 0.37))  # unused slots must not matter
    for got, meant in zip(to_sequences(again), to_sequences(solids), strict=True):
        assert torch.allclose(got.float(), meant.float(), atol=5e-3)


def test_axes_of_aligned_parts_are_centres_of_bins():
    assert BINS % 2 == 1
    _, offset = to_bins(torch.tensor([0.0, 1, -1, 0, 0, 1, 0, 0, 0, 0, 0, 0]))
    assert offset[:6].abs().max() < 1e-5


def test_masks_are_those_of_the_state_machine():
    for length in range(3):
        state = ShapeState()
        for _ in range(length):
            state.apply_action(ADD_BOX, (0, 0, 0, 1, 1, 1, 0, 0, 0, 1))
        assert tuple(legal(torch.tensor([length]), 12)[0].tolist()) == state.action_mask(vocabulary=VOCAB)
    assert legal(torch.tensor([1]), 12, torch.tensor([False]))[0].tolist() == [True, True, True, False, True]
    assert legal(torch.tensor([12]), 12)[0].tolist() == [False, False, False, True, True]


def test_draws_follow_their_distribution():
    p = torch.tensor([0.5, 0.3, 0.2, 0.0])
    index, log_p = drawn(p.log().expand(20_000, 4), generator())
    share = torch.bincount(index, minlength=4) / 20_000
    assert torch.allclose(share, p, atol=4 * 0.5 / math.sqrt(20_000))
    assert torch.allclose(log_p.exp(), p[index])
    assert int(drawn(p.log()[None], None)[0]) == 0


def test_undo_and_end_move_the_batch_as_the_state_machine_does():
    solids, done = empty(3, 4), torch.zeros(3, dtype=torch.bool)
    for tokens in ((0, 0, 0), (1, 3, 4), (3, 0, 0)):
        move = Move(torch.tensor(tokens), from_sequences(torch.tensor(tokens).clamp_max(2)[:, None], torch.ones(3, 1, 10)), torch.zeros(3))
        solids = applied(solids, move, done)
        done = done | (move.tokens == 4)
    assert solids.lengths.tolist() == [1, 1, 1]
    assert solids.kinds[:, 0].tolist() == [0, 0, 0]


def test_farthest_points_spread_and_gaps_measure():
    line = torch.linspace(0, 1, 101)[None, :, None] * torch.tensor([1.0, 0, 0])
    assert sorted(farthest(line, 3)[0].tolist()) == [0, 50, 100]
    near, far = gaps(line, line[:, :51], torch.tensor([True]))
    assert float(near[0, 100]) == pytest.approx(math.tanh(5.0))
    assert float(far.max()) < 0.02


@pytest.mark.parametrize("index", [0, 1])
def test_decoded_programs_are_legal(batch, index):
    policy = policies()[index].eval()
    config = DecodeConfig(beam=2, expand=2, points=64, cur_points=64, max_primitives=4)
    for chance in (None, generator(1)):
        solids = write(policy, batch.gt_points, config, generator(), chance)
        assert ((solids.lengths >= 1) & (solids.lengths <= 4)).all()
        assert solids.positive[:, 0].all()
    found, costs = beam_search(policy, batch.gt_points, config, generator(), generator(1))
    assert found.kinds.shape[0] == 16
    assert (costs[:, 0] <= costs[:, 1]).all()


def test_costs_prefer_the_true_program(batch):
    config = DecodeConfig(points=128)
    truth = from_sequences(batch.gt_tokens, batch.gt_params)
    right, wrong = (costs_of(s, batch.gt_points, config, generator()) for s in (truth, truth[torch.arange(8).roll(1)]))
    assert (right < wrong).float().mean() > 0.8


def test_base_learns_a_few_programs_by_heart():
    """Plant two programs and demand them back from their clouds: greedy decoding after a short training on them alone."""
    config = SynthesisConfig(gt_points=128, cur_points=64, n_min=1, n_max=2, free_rotation=0.0, prefixes=12)
    policy = BasePolicy(SMALL, 4)
    optimizer = torch.optim.AdamW(policy.parameters(), 3e-3)
    data = synthesize(24, config, generator(0))
    for _ in range(150):
        optimizer.zero_grad()
        policy.losses(data)["loss"].backward()
        torch.nn.utils.clip_grad_norm_(policy.parameters(), 1.0)
        optimizer.step()
    policy.eval()
    truth = from_sequences(data.gt_tokens[:2], data.gt_params[:2])
    found = write(policy, data.gt_points[:2], DecodeConfig(cur_points=64, max_primitives=3), generator(5))
    assert (sampled_iou(found, truth, 4000, generator()) > 0.9).all()
