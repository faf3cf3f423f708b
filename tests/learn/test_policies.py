"""Both designs: what may depend on what, what is masked, legal moves, and that they can learn a program by heart."""

import dataclasses
import math

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from imdim.data.canonical import canonical_primitives
from imdim.data.families import FAMILIES, PLAIN
from imdim.data.solids import PAD, Solids, empty, from_sequences
from imdim.data.surfaces import surface_clouds
from imdim.data.synthesize import APPEND, SynthesisConfig, estimate_iou, synthesize
from imdim.learn.beam import beam_search, costs_of
from imdim.learn.codes import ENDS, FIRST, FREE, NUMBERS, PLACES, STEPS, TAPER, Choices, decode, encode, encode_signs, ruler, to_bins
from imdim.learn.decode import DecodeConfig, apply_move
from imdim.learn.decode import decode as write
from imdim.learn.draft import Draft
from imdim.learn.policy import Move, Sight, draw_index, legal, mask_supervised
from imdim.learn.policy_net import HEAD, SLOTS, BaseConfig, BasePolicy
from imdim.learn.profile import fold_levels, histograms, look, voxel_moments, voxel_of
from imdim.learn.rotations import ROTATION_CODES
from imdim.learn.seed_policy import VOCAB, ModelComponents, SeedConfig, SeedPolicy, build_cad_model, forward_params_only, seed_losses
from imdim.program.state import ADD_BOX, ADD_SPHERE, END, UNDO_LAST, ShapeState

SMALL = BaseConfig(d_model=32, encoder_layers=1, decoder_layers=1, heads=2, gt_points=128, cur_points=64, point_width=16)
TINY = SeedConfig(d_model=32, layers=1, heads=2, hidden=32)
DATA = SynthesisConfig(gt_points=128, cur_points=64, n_max=4, volume_samples=512, families=PLAIN)


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
    assert mask_supervised(tokens).tolist() == [[True, False, True, True, False]]


def test_base_ignores_what_comes_after_the_prefix(batch):
    policy = BasePolicy(SMALL, 7)
    column = torch.arange(batch.gt_tokens.shape[1])
    later = column > batch.steps[:, None]
    changed = batch._replace(
        gt_params=torch.where(later[..., None], 0.3, batch.gt_params), gt_tokens=torch.where(later, PAD, batch.gt_tokens)
    )
    for name, value in policy.losses(batch).items():
        assert torch.allclose(value, policy.losses(changed)[name])


def sight(batch):
    return Sight(batch.gt_points, batch.cur_points, written(batch), torch.ones(len(batch.steps), dtype=torch.bool))


def written(batch, rows=slice(None)):
    """The solids that the prefixes of a batch show."""
    column = torch.arange(batch.gt_tokens.shape[1])
    return from_sequences(torch.where(column < batch.steps[:, None], batch.gt_tokens, PAD), batch.gt_params)[rows]


def blank(count):
    zeros = torch.zeros(count, ENDS, dtype=torch.long)
    bins, offsets = torch.zeros(count, NUMBERS, dtype=torch.long), torch.zeros(count, ENDS + NUMBERS)
    return Draft(zeros[:, 0], torch.full((count,), APPEND), zeros[:, 0], Choices(zeros[:, 0], zeros[:, 0], zeros, bins, offsets), [])


def test_base_slots_see_only_the_slots_before(batch):
    policy = BasePolicy(SMALL, 7)
    view = policy._view(batch.gt_points, batch.cur_points, written(batch))
    a, b = blank(8), blank(8)
    b.choices.places[:, 4:] = FIRST + 7  # z low and z high
    before, after = policy._encode_slots(view, a, SLOTS), policy._encode_slots(view, b, SLOTS)
    # the heads, x and y ends, z low: it does not see itself
    assert torch.allclose(before[:, : HEAD + 5], after[:, : HEAD + 5])
    assert not torch.allclose(before[:, HEAD + 5], after[:, HEAD + 5])
    assert torch.allclose(policy._encode_slots(view, a, HEAD + 2), before[:, : HEAD + 2], atol=1e-5)


def test_log_p_of_a_draw_is_that_of_teacher_forcing(batch):
    """What `propose` multiplies slot by slot is what the loss sums over a whole draft."""
    policy = BasePolicy(SMALL, 7).eval()
    drafts = []
    inner = policy._draw_end

    def spy(view, draft, end, chance):
        drafts.append((view, draft))
        return inner(view, draft, end, chance)

    policy._draw_end = spy
    move = policy.propose(sight(batch), generator(3))
    view, draft = drafts[-1]
    log_p, _, _ = policy._log_p(view, Draft(draft.tokens, draft.at, draft.sign, draft.choices, []))
    free_to_choose = (batch.steps > 0) & (move.tokens <= 2) & (draft.at != 0)  # else masks take part
    total = sum(log_p.values())
    assert free_to_choose.any()
    assert torch.allclose(total[free_to_choose], move.log_p[free_to_choose], atol=1e-3)
    again = policy.log_prob(sight(batch), move)
    assert torch.allclose(again, move.log_p, atol=1e-3)
    again.sum().backward()
    assert policy.to_token.weight.grad is not None


@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_choices_return_the_solid(family):
    """Every program rewritten by its choices is the same solid: hidden ends of cutters may move, nothing else."""
    config = SynthesisConfig(gt_points=512, cur_points=16, n_max=5, families=(family,))
    data = synthesize(24, config, generator(4))
    truth = from_sequences(data.gt_tokens, data.gt_params)
    low, edges = ruler(data.gt_points)
    parts = []
    for step in range(truth.kinds.shape[1]):
        one = truth.take(torch.full((24, 1), step))
        parts.append(decode(one.kinds[:, 0].clamp_min(0), encode_signs(one), encode(one, low, edges), low, edges))
    again = type(truth)(*(torch.cat([getattr(p, f) for p in parts], 1) for f in type(truth).__dataclass_fields__))
    again = dataclasses.replace(again, kinds=torch.where(truth.present, again.kinds, -1))
    iou = estimate_iou(again, truth, 8000, generator())
    assert float(iou.median()) > 0.999
    assert float((iou > 0.97).float().mean()) > 0.9, iou


def test_aligned_ends_are_marks_and_free_turns_are_told_apart():
    low, edges = torch.zeros(2, 3), torch.tensor([[1.0, 2.0, 4.0]]).expand(2, 3)
    params = torch.tensor([[[0.5, 1.0, 3.0, 1.0, 1.0, 2.0, 0, 0, 0, 1.0]], [[0.5, 1.0, 3.0, 1.0, 1.0, 2.0, 20, 0, 0, 1.0]]])
    choices = encode(canonical_primitives(from_sequences(torch.zeros(2, 1, dtype=torch.long), params)), low, edges)
    assert choices.turn.tolist() == [0, FREE]
    assert (choices.places[0] - FIRST).tolist() == [0, STEPS, STEPS // 4, 3 * STEPS // 4, STEPS // 2, STEPS]
    assert choices.offsets[0, :ENDS].abs().max() < 1e-5


def test_the_unseen_end_of_a_cut_is_one_choice():
    low, edges = torch.zeros(2, 3), torch.ones(2, 3)
    params = torch.tensor([[[0.5, 0.5, 0.5, 0.2, h, 0.0, 0, 0, 0, -1.0]] for h in (1.5, 7.0)])
    part = canonical_primitives(from_sequences(torch.full((2, 1), 2), params))
    choices = encode(part, low, edges)
    assert choices.places[:, 4:].tolist() == [[0, PLACES - 1]] * 2
    back = decode(part.kinds[:, 0], part.positive[:, 0], choices, low, edges)
    assert torch.allclose(back.sizes[:, 0, :2], torch.tensor([0.2, 3.0]), atol=1e-5)


def test_a_look_tells_what_is_explained_from_what_is_not():
    """A plate with a peg; the plate is written. Counted by hand: points on the plate are on, points of the peg beyond."""
    tokens, params = torch.tensor([[0, 2, int(END)]]), torch.zeros(1, 3, 10)
    params[0, 0] = torch.tensor([0.0, 0, -0.1, 0.6, 0.6, 0.2, 0, 0, 0, 1])
    params[0, 1] = torch.tensor([0.0, 0, 0.2, 0.1, 0.4, 0, 0, 0, 0, 1])
    whole = from_sequences(tokens, params)
    points = surface_clouds(whole, 512, generator())[0]
    plate = whole.take(torch.tensor([[0]]))
    shown = surface_clouds(plate, 64, generator(1))[0]
    low, edges = ruler(points)
    clouds = look(points, shown, plate, low, edges)
    peg = points[0, :, 2] > 0.013
    assert torch.equal(clouds.kinds[0, :512, 1].bool(), peg)
    assert torch.equal(clouds.kinds[0, :512, 3].bool(), ~peg)
    profile = histograms(clouds, 2)
    assert profile.shape == (1, STEPS + 1, 7)
    assert float(profile[0, -1, 0]) > float(profile[0, -2, 0])  # the peg's top is fuller than its side
    # the peg's foot is near the plate
    near = torch.zeros(int((~peg).sum()))
    assert torch.allclose(fold_levels(plate, points)[0, ~peg], near, atol=0.013)


def test_voxel_moments_are_those_of_numpy():
    points = torch.rand(1, 4000, 3, generator=generator()) - 0.5
    table, at = voxel_moments(points), voxel_of(points)[0]
    fullest = int(torch.bincount(at).argmax())
    here = points[0, at == fullest].double().numpy()
    covariance = np.cov(here.T, bias=True)
    assert int(table[0, fullest, 0]) == len(here)
    assert np.allclose(table[0, fullest, 1:4], here.mean(0), atol=1e-6)
    assert np.allclose(table[0, fullest, 4:], (covariance / np.trace(covariance))[np.triu_indices(3)], atol=1e-2)


SWITCHES = [{name: False} for name in ("feedback", "pointing", "within", "local", "distributions", "canonical")]
SWITCHES += [{"rotation": "euler"}, {"rotation": "euler", "distributions": False, "local": False}]


def switched(changes):
    torch.manual_seed(0)
    return BasePolicy(dataclasses.replace(SMALL, **changes), 7)


@pytest.mark.parametrize("changes", SWITCHES, ids=str)
def test_design_changes_can_be_taken_back(batch, changes):
    """The loss falls, and what is drawn has the log p of teacher forcing and a finite solid."""
    policy = switched(changes)
    optimizer = torch.optim.AdamW(policy.parameters(), 3e-3)
    losses = []
    for _ in range(12):
        optimizer.zero_grad()
        losses.append(policy.losses(batch)["loss"])
        losses[-1].backward()
        optimizer.step()
    assert losses[-1] < 0.9 * losses[0]
    policy.eval()
    with torch.no_grad():
        move = policy.propose(sight(batch), generator(3))
        again = policy.log_prob(sight(batch), move)
    assert torch.allclose(again, move.log_p, atol=1e-3)
    assert all(torch.isfinite(v).all() for v in (move.part.centers, move.part.sizes, move.part.rotations))


def test_one_vector_knows_no_places(batch):
    """Without local tokens the order of the points is all the same, and the whole cloud is as many tokens as there are vectors."""
    policy = switched({"local": False}).eval()
    view = policy._view(batch.gt_points, batch.cur_points, written(batch))
    assert view.there.shape[-1] == 3 + written(batch).kinds.shape[1]
    mixed = batch.gt_points[:, torch.randperm(128, generator=generator(1))]
    other = policy._view(mixed, batch.cur_points, written(batch))
    assert torch.allclose(view.reads[0][0], other.reads[0][0], atol=1e-4)


def test_regression_minimises_the_squared_error_of_what_it_writes(batch):
    """The value written is the value of the loss: an error of 0 writes the truth, up to what a mark's reach cuts off."""
    policy = switched({"distributions": False}).eval()
    part = from_sequences(torch.tensor([[int(ADD_BOX)]]), torch.tensor([[[0.1, 0, 0, 0.3, 0.4, 0.5, 20, 30, 40, 1.0]]]))
    low, edges = torch.full((1, 3), -0.5), torch.ones(1, 3)
    truth = encode(canonical_primitives(part), low, edges)
    head = policy.regression.requires_grad_(False)
    torch.nn.init.zeros_(head.weight)
    head.bias.data = truth.values()[0]
    hidden, used = torch.zeros(1, ENDS + NUMBERS, 32), truth.mask_used_bins(torch.tensor([0]))
    assert used[:, :TAPER].all()
    assert float(head.errors(hidden, truth, used)) == pytest.approx(0.0, abs=1e-9)
    ends = torch.stack([torch.stack(head.place(hidden[:, 0], i)).float()[:, 0] for i in range(ENDS)], 1)
    assert torch.equal(ends[0].long(), truth.places[0])
    assert torch.allclose(ends[1], truth.offsets[0, :ENDS], atol=1e-4)
    head.bias.data = truth.values()[0] + 0.1
    assert float(head.errors(hidden, truth, used)) == pytest.approx(5.0 * 15 * 0.01, rel=1e-3)


@pytest.mark.parametrize("code", sorted(ROTATION_CODES))
def test_rotation_codes_come_back(code):
    """Boxes and cylinders in any pose, against scipy's rotations."""
    matrices = Rotation.random(200, rng=np.random.default_rng(0)).as_matrix()
    kinds = torch.arange(200) % 2 * 2  # boxes and cylinders
    zeros, sizes = torch.zeros(200, 1, 3), torch.tensor([0.2, 0.4, 0.3]).expand(200, 1, 3)
    turned = torch.tensor(matrices, dtype=torch.float32)[:, None]
    part = canonical_primitives(Solids.plain(kinds[:, None], torch.ones(200, 1, dtype=torch.bool), zeros, sizes, turned))
    low, edges = torch.full((200, 3), -0.5), torch.ones(200, 3)
    choices = encode(part, low, edges, code)
    used = choices.mask_used_bins(kinds, code)
    bins = torch.where(used, choices.bins, 0)
    if code == "columns":
        implied = to_bins(ROTATION_CODES[code].implied(choices.values()[:, ENDS : ENDS + 3]))[0]
        bins[:, 3:6] = torch.where(used[:, 3:6], bins[:, 3:6], implied)
    again = canonical_primitives(decode(kinds, torch.ones(200), dataclasses.replace(choices, bins=bins), low, edges, code))
    free = choices.turn == FREE
    assert free.sum() > 150
    z, x = (torch.linalg.vecdot(part.rotations[:, 0, :, i], again.rotations[:, 0, :, i]) for i in (2, 0))
    assert (z[free] > 0.999).all()
    assert (x[free & (kinds == 0)] > 0.999).all()


def test_an_unknown_rotation_code_says_what_is_known():
    with pytest.raises(ValueError, match="unknown rotation code 'quaternion'; known are columns, euler"):
        switched({"rotation": "quaternion"})


def test_masks_are_those_of_the_state_machine():
    for length in range(3):
        state = ShapeState()
        for _ in range(length):
            state.apply_action(ADD_BOX, (0, 0, 0, 1, 1, 1, 0, 0, 0, 1))
        assert tuple(legal(torch.tensor([length]), 12, vocab=VOCAB)[0].tolist()) == state.action_mask(vocabulary=VOCAB)
        assert legal(torch.tensor([length]), 12)[0].tolist() == [*state.action_mask(vocabulary=VOCAB), True, True]  # outlines
    assert legal(torch.tensor([1]), 12, torch.tensor([False]))[0].tolist() == [True, True, True, False, True, True, True, True, True]
    assert legal(torch.tensor([12]), 12)[0].tolist() == [False, False, False, True, True, False, False, False, False]


def test_draws_follow_their_distribution():
    p = torch.tensor([0.5, 0.3, 0.2, 0.0])
    index, log_p = draw_index(p.log().expand(20_000, 4), generator())
    share = torch.bincount(index, minlength=4) / 20_000
    assert torch.allclose(share, p, atol=4 * 0.5 / math.sqrt(20_000))
    assert torch.allclose(log_p.exp(), p[index])
    assert int(draw_index(p.log()[None], None)[0]) == 0


def test_undo_and_end_move_the_batch_as_the_state_machine_does():
    solids = empty(3, 4)
    for tokens in ((0, 0, 0), (1, 3, 4), (3, 0, 4)):
        part = from_sequences(torch.tensor(tokens).clamp_max(2)[:, None], torch.ones(3, 1, 10))
        move = Move(torch.tensor(tokens), part, torch.zeros(3), torch.full((3,), APPEND))
        solids = apply_move(solids, move)
    assert solids.lengths.tolist() == [1, 1, 1]
    assert solids.kinds[:, 0].tolist() == [0, 0, 0]


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


@pytest.mark.parametrize("index", [0, 1])
def test_several_ways_are_the_same_moves(batch, index):
    policy = policies()[index].eval()
    one, three = (policy.propose(sight(batch), ways=w) for w in (1, 3))
    for value, wide in ((one.tokens, three.tokens), (one.part.sizes, three.part.sizes), (one.log_p, three.log_p)):
        assert torch.allclose(value.repeat_interleave(3, 0), wide, atol=1e-4)


def test_costs_prefer_the_true_program(batch):
    config = DecodeConfig(points=128)
    truth = from_sequences(batch.gt_tokens, batch.gt_params)
    both = (truth, truth[torch.arange(8).roll(1)])
    right, wrong = (costs_of(s, batch.gt_points, surface_clouds(s, 64, generator())[0], config) for s in both)
    assert (right < wrong).float().mean() > 0.8


def test_base_learns_a_few_programs_by_heart():
    """Plant two programs and demand them back from their clouds: greedy decoding after a short training on them alone."""
    config = SynthesisConfig(gt_points=128, cur_points=64, n_min=1, n_max=2, free_rotation=0.0, prefixes=12, families=PLAIN)
    policy = BasePolicy(SMALL, 4)
    optimizer = torch.optim.AdamW(policy.parameters(), 3e-3)
    data = synthesize(24, config, generator(0))
    for _ in range(80):
        optimizer.zero_grad()
        policy.losses(data)["loss"].backward()
        torch.nn.utils.clip_grad_norm_(policy.parameters(), 1.0)
        optimizer.step()
    policy.eval()
    truth = from_sequences(data.gt_tokens[:2], data.gt_params[:2])
    found = write(policy, data.gt_points[:2], DecodeConfig(cur_points=64, max_primitives=3), generator(5))
    assert (estimate_iou(found, truth, 4000, generator()) > 0.9).all()
