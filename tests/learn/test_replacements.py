"""Policies that mend what is written: one primitive in the place of another, outlines among them, and solids known without a program."""

import dataclasses
from dataclasses import replace

import pytest
import torch

from imdim.data.outlines import NO_FORM
from imdim.data.solids import BOX, CYLINDER, EXTRUDE, REVOLVE, adds_primitive, empty, from_sequences, to_sequences
from imdim.data.surfaces import surface_clouds
from imdim.data.synthesize import APPEND, SynthesisConfig, TrainingSamples, synthesize
from imdim.learn.beam import beam_search
from imdim.learn.decode import DecodeConfig, apply_move, steps, takes_back
from imdim.learn.draft import Draft
from imdim.learn.policy import VOCAB, Move, Policy, Sight
from imdim.learn.policy_net import HEAD, SLOTS, BaseConfig, BasePolicy
from imdim.learn.profile import fold_levels
from imdim.learn.rollouts import RewardConfig, branches
from imdim.learn.seed_policy import SeedConfig, SeedPolicy
from imdim.program.state import END, UNDO_LAST

SMALL = BaseConfig(d_model=32, encoder_layers=1, decoder_layers=1, heads=2, gt_points=128, cur_points=64, point_width=16)
DATA = SynthesisConfig(gt_points=128, cur_points=64, n_min=2, n_max=4, volume_samples=512)
WIDE = replace(DATA, families=("profile", "ring", "common"))


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


@pytest.fixture(autouse=True)
def _one_thread():
    torch.set_num_threads(1)
    torch.manual_seed(0)


@pytest.fixture(scope="module")
def batch():
    """Prefixes of outlines and intersections, a half of them to be mended."""
    return synthesize(16, replace(WIDE, p_replace=0.5), generator())


def base(**changes):
    torch.manual_seed(0)
    return BasePolicy(replace(SMALL, **changes), 7).eval()


def sight(batch, may_undo=True):
    return Sight(batch.gt_points, batch.cur_points, batch.written, torch.full((len(batch.steps),), may_undo))


SWITCHES = [{}, {"distributions": False}, {"rotation": "euler"}, {"local": False}, {"canonical": False}]


@pytest.mark.parametrize("changes", SWITCHES, ids=str)
@pytest.mark.parametrize("may_undo", [True, False])
def test_log_p_of_a_draw_with_a_place_and_a_form_is_that_of_the_draw(batch, changes, may_undo):
    policy = base(**changes)
    seen = sight(batch, may_undo)
    with torch.no_grad():
        move = policy.propose(seen, generator(3), 12)
        again = policy.log_prob(seen, move)
    replaced = takes_back(move)
    if may_undo:
        assert (replaced & adds_primitive(move.tokens)).sum() > 20
    for kind in (EXTRUDE, REVOLVE):
        assert (move.tokens == kind).sum() > 5
    assert torch.allclose(again, move.log_p, atol=1e-3)
    assert torch.isfinite(move.log_p).all()


def test_log_p_of_a_draw_is_that_of_teacher_forcing(batch):
    """Where nothing was barred, what `propose` multiplies is what the loss sums over the primitive that it made."""
    policy, seen = base(), sight(batch)
    with torch.no_grad():
        move = policy.propose(seen, generator(3), 12)
        lengths = seen.written.lengths.repeat_interleave(12)
        assert move.draws is not None
        view = policy._view(*seen[:3]).repeat(12)
        log_p = sum(policy._log_p(view, Draft.of(move.tokens, move.draws))[0].values())
    free = (lengths > 0) & (move.at != 0) & adds_primitive(move.tokens)
    assert (move.at[free] > 0).any()
    assert (move.part.forms[free] > 0).any()
    assert isinstance(log_p, torch.Tensor)
    assert torch.allclose(log_p[free], move.log_p[free], atol=1e-3)


def test_moves_are_legal(batch):
    """A program opens with a union, whatever is put in its first place; where nothing may be taken back, nothing is replaced; and what has
    an outline has a form, nothing else."""
    policy = base()
    with torch.no_grad():
        free, bound = (policy.propose(sight(batch, may), generator(4), 40) for may in (True, False))
    lengths = batch.written.lengths.repeat_interleave(40)
    adds = adds_primitive(free.tokens)
    opens = adds & ((lengths == 0) | (free.at == 0))
    assert ((opens & (free.at == 0)).sum() > 20) & ((lengths == 0).any())
    assert free.part.positive[opens, 0].all()
    assert not free.part.common[opens, 0].any()
    others = adds & ~opens
    signs = free.part.positive[others, 0], free.part.common[others, 0], ~free.part.positive[others, 0] & ~free.part.common[others, 0]
    assert all(s.any() for s in signs)
    assert not (free.part.positive & free.part.common).any()
    assert ((free.at < lengths) & (free.at >= APPEND)).all()
    assert (free.at[~adds] == APPEND).all()
    assert (free.at[adds & (lengths > 1)].unique().tolist()) == list(range(APPEND, int(lengths.max())))
    assert (bound.at == APPEND).all()
    assert not (bound.tokens == int(UNDO_LAST)).any()
    drawn = free.tokens >= EXTRUDE
    assert torch.equal(free.part.forms[:, 0] > NO_FORM, drawn)
    assert drawn.any()


def test_a_replacement_leaves_the_others_where_they_are():
    tokens = torch.tensor([[BOX, CYLINDER, BOX]] * 4)
    params = torch.zeros(4, 3, 15)
    params[..., 3:6], params[..., 9], params[..., 0] = 0.5, 1.0, torch.arange(3.0)
    before = from_sequences(tokens, params)
    new = from_sequences(torch.full((4, 1), EXTRUDE), torch.tensor([7.0, 0, 0, 1, 1, 1, 0, 0, 0, -1, 5, 0.2, 0.3, 0, 1]).expand(4, 1, 15))
    move = Move(torch.tensor([EXTRUDE, EXTRUDE, EXTRUDE, int(UNDO_LAST)]), new, torch.zeros(4), torch.tensor([0, 2, 1, APPEND]))
    after = apply_move(before, move)
    assert takes_back(move).tolist() == [True] * 4
    assert after.lengths.tolist() == [3, 3, 3, 2]
    assert after.centers[..., 0].tolist() == [[7, 1, 2], [0, 1, 7], [0, 7, 2], [0, 1, 2]]
    assert after.kinds.tolist() == [[EXTRUDE, CYLINDER, BOX], [BOX, CYLINDER, EXTRUDE], [BOX, EXTRUDE, BOX], [BOX, CYLINDER, -1]]
    assert after.forms.tolist() == [[5, 0, 0], [0, 0, 5], [0, 5, 0], [0, 0, 0]]
    assert after.common.tolist() == [[True, False, False], [False, False, True], [False, True, False], [False] * 3]
    # behind the last one there is no room
    full = apply_move(before, Move(torch.tensor([EXTRUDE] * 4), new, torch.zeros(4), torch.full((4,), APPEND)))
    assert torch.equal(full.kinds, before.kinds)
    assert takes_back(Move(torch.tensor([BOX, int(END)]), new[:2], torch.zeros(2), torch.full((2,), APPEND))).tolist() == [False, False]


class Restless(Policy):
    """Writes the box of its cloud and puts another one in its place for as long as it may; then it ends."""

    max_seq_len = 5

    def __init__(self) -> None:
        super().__init__()
        self.asked: list[torch.Tensor] = []

    def losses(self, batch):
        raise NotImplementedError

    def log_prob(self, seen, move):
        raise NotImplementedError

    def propose(self, seen, generator=None, ways=1):
        self.asked.append(seen.may_undo)
        lengths, may = (v.repeat_interleave(ways) for v in (seen.written.lengths, seen.may_undo))
        tokens = torch.where((lengths == 0) | may, BOX, int(END))
        numbers = torch.zeros(len(tokens), 1, 15)
        # each box is a little larger, so that a beam does not take it for the last one
        numbers[:, 0, 3:6] = 0.3 + 0.02 * len(self.asked) + 0.001 * torch.arange(len(tokens))[:, None]
        numbers[:, 0, 9] = 1.0
        at = torch.where((tokens == BOX) & (lengths > 0), 0, APPEND)
        return Move(tokens, from_sequences(torch.full((len(tokens), 1), BOX), numbers), torch.zeros(len(tokens)), at)


@pytest.mark.parametrize("limit", [0, 3])
def test_replacements_are_counted_as_steps_taken_back(batch, limit):
    config = DecodeConfig(beam=2, expand=2, points=64, cur_points=32, max_primitives=4, undo_limit=limit)
    policy = Restless()
    made = list(steps(policy, batch.gt_points[:3], config, generator()))
    assert [int(s.move.tokens[0]) for s in made] == [BOX] * (1 + limit) + [int(END)]
    assert [bool(may.all()) for may in policy.asked] == [True] * (limit > 0) + [True] * limit + [False] * (1 + (limit == 0))
    assert made[-1].after.lengths.tolist() == [1, 1, 1]
    policy = Restless()
    beam_search(policy, batch.gt_points[:3], config, generator(), generator(1))
    barred = [i for i, may in enumerate(policy.asked) if not may.any()]
    assert barred
    assert all(may.all() for may in policy.asked[: barred[0]])
    assert barred[0] <= limit + 1
    assert len(policy.asked) <= limit + 2
    truth, reward = batch._replace(steps=torch.zeros_like(batch.steps)), RewardConfig(2, 0.0, 64)
    few = TrainingSamples(*(v[:3] for v in truth))
    written, facts = branches(Restless(), few, reward, config, generator())
    assert facts["moves"] == limit + 2
    assert written.ways == 2


def rewritten(first, second):
    """Two samples of one solid: a box and a peg, in this order or the other, the box with other numbers; a third box is to follow."""
    box = [0.1, 0.0, -0.1, 0.5, 0.3, 0.2, 0.0, 0.0, 0.0, 1.0, 0, 0, 0, 0, 0]
    turned = [0.1, 0.0, -0.1, 0.3, 0.5, 0.2, 0.0, 0.0, 90.0, 1.0, 0, 0, 0, 0, 0]
    peg = [0.1, 0.0, 0.0, 0.1, 0.4, 0.0, 0.0, 0.0, 0.0, 1.0, 0, 0, 0, 0, 0]
    more = [-0.2, 0.0, -0.1, 0.2, 0.2, 0.2, 0.0, 0.0, 0.0, 1.0, 0, 0, 0, 0, 0]
    known = {"box": (BOX, box), "turned": (BOX, turned), "peg": (CYLINDER, peg), "small": (BOX, [*box[:3], 0.4, *box[4:]])}
    kinds = [known[first][0], known[second][0], BOX, int(END)]
    numbers = [known[first][1], known[second][1], more, [0.0] * 15]
    return torch.tensor([kinds]), torch.tensor([numbers])


def test_losses_of_hidden_prefixes_depend_on_the_solid_alone():
    """The same two clouds each time. Written otherwise, the solid is the same; another solid is not."""
    policy = base()
    given = [rewritten(*names) for names in (("box", "peg"), ("peg", "turned"), ("small", "peg"))]
    whole = from_sequences(*given[0])
    points, shown = (surface_clouds(s, n, generator())[0] for s, n in ((whole, 128), (whole.take(torch.tensor([[0, 1]])), 64)))

    def losses(index, hidden):
        tokens, params = given[index]
        steps, at = torch.tensor([2]), torch.tensor([APPEND])
        return policy.losses(TrainingSamples(points, shown, tokens, params, steps, at, torch.tensor([hidden])))

    known, same, other = (losses(i, True) for i in range(3))
    for name, value in known.items():
        assert torch.allclose(value, same[name], atol=1e-5), name
    assert not torch.allclose(known["loss"], other["loss"], atol=1e-4)
    assert not torch.allclose(losses(0, False)["loss"], losses(1, False)["loss"], atol=1e-4)
    assert not torch.allclose(losses(0, False)["loss"], known["loss"], atol=1e-4)


def test_what_is_hidden_in_training_is_what_a_search_shows(batch):
    """The view of a hidden prefix is that of an empty program with its solid beside; rows that are not hidden are as ever."""
    policy = base()
    some = torch.arange(len(batch.steps)) % 2 == 0
    mixed = batch._replace(hidden=some)
    view = policy._view(batch.gt_points, batch.cur_points, *policy._as_seen(mixed))
    asked = policy._view(batch.gt_points, batch.cur_points, empty(16, 1), fold_levels(batch.written, batch.gt_points))
    plain = policy._view(batch.gt_points, batch.cur_points, batch.written)
    for mine, search, whole in zip(view.slabs, asked.slabs, plain.slabs, strict=True):
        assert torch.allclose(mine[some], search[some], atol=1e-5)
        assert torch.allclose(mine[~some], whole[~some], atol=1e-5)
        assert not torch.allclose(mine[some], whole[some], atol=1e-3)


def test_a_search_that_shows_the_solid_alone_is_offered_cuts_and_intersections(batch):
    """As it learns from hidden prefixes: only what has nothing at all before it has to be a union."""
    policy = base()
    outside = fold_levels(batch.written, batch.gt_points)
    some = batch.steps > 0
    seen = Sight(batch.gt_points, batch.cur_points, empty(16, 1), torch.ones(16, dtype=torch.bool), outside, must_add=True).of(
        some.nonzero()[:, 0]
    )
    with torch.no_grad():
        move = policy.propose(seen, generator(5), 20)
    assert adds_primitive(move.tokens).all()
    assert (move.at == APPEND).all()
    assert move.part.common.any()
    assert (~move.part.positive & ~move.part.common).any()


@pytest.mark.parametrize(("choice", "first"), [("tokens", 1), ("at", 2), ("sign", 3), ("turn", 4), ("form", 5)])
def test_each_head_is_seen_by_the_slots_behind_it_alone(batch, choice, first):
    policy = base()
    view = policy._view(batch.gt_points, batch.cur_points, batch.written)
    move = policy.propose(sight(batch), generator(3))
    assert move.draws is not None
    one, two = (Draft.of(move.tokens.clone(), move.draws.clone()) for _ in range(2))
    if choice in ("turn", "form"):
        two.choices = dataclasses.replace(two.choices, **{choice: getattr(two.choices, choice) * 0 + 3})
        one.choices = dataclasses.replace(one.choices, **{choice: getattr(one.choices, choice) * 0 + 1})
    elif choice == "at":
        one.at, two.at = torch.full_like(one.at, APPEND), torch.zeros_like(two.at)
    else:
        setattr(one, choice, torch.ones_like(one.tokens))
        setattr(two, choice, torch.zeros_like(two.tokens))
    a, b = (policy._encode_slots(view, d, SLOTS) for d in (one, two))
    rows = batch.steps > 0
    assert torch.allclose(a[:, :first], b[:, :first], atol=1e-5)
    assert not torch.allclose(a[rows][:, first], b[rows][:, first], atol=1e-3)
    assert first <= HEAD


def test_the_base_policy_reads_the_forms_shares_and_intersections_of_its_program(batch):
    """With the same clouds before it; not those of what comes after the prefix."""
    policy = base()
    tokens, params = batch.gt_tokens, batch.gt_params
    column = torch.arange(tokens.shape[1])
    before = (column < batch.steps[:, None])[..., None]
    loss = policy.losses(batch)["loss"]
    for place, value in (
        (10, torch.where(params[..., 10:11] > 0, 21.0, 0.0)),
        (11, 0.9 - params[..., 11:12]),
        (14, 1 - params[..., 14:15]),
    ):
        changed = params.clone()
        changed[..., place : place + 1] = torch.where(before, value, changed[..., place : place + 1])
        written = replace(batch.written)
        other = batch._replace(gt_params=changed)
        assert torch.equal(other.written.centers, written.centers)
        assert not torch.allclose(policy.losses(other)["loss"], loss, atol=1e-5)
        later = params.clone()
        behind = (column > batch.steps[:, None])[..., None]
        later[..., place : place + 1] = torch.where(behind, value, later[..., place : place + 1])
        assert torch.allclose(policy.losses(batch._replace(gt_params=later))["loss"], loss)


def test_base_learns_by_heart_which_primitive_is_wrong():
    """After a short training on a few prefixes it points at the one that is wrong, or at none."""
    torch.manual_seed(0)
    data = synthesize(8, replace(WIDE, p_replace=1.0, n_min=3, n_max=3, gt_points=64, cur_points=32), generator(2))
    policy = BasePolicy(replace(SMALL, gt_points=64, cur_points=32), 6)
    optimizer = torch.optim.AdamW(policy.parameters(), 5e-3)
    for _ in range(30):
        optimizer.zero_grad()
        policy.losses(data)["loss"].backward()
        torch.nn.utils.clip_grad_norm_(policy.parameters(), 1.0)
        optimizer.step()
    policy.eval()
    with torch.no_grad():
        move = policy.propose(sight(data))
    adds = adds_primitive(move.tokens) & adds_primitive(data.following[0])
    assert len(data.at[adds].unique()) == 3
    assert (move.at[adds] == data.at[adds]).float().mean() > 0.85


def test_the_first_design_replaces_nothing_and_refuses_outlines(batch):
    policy = SeedPolicy(SeedConfig(d_model=32, layers=1, heads=2, hidden=32), 7).eval()
    with pytest.raises(ValueError, match="a sample has an outline"):
        policy.losses(batch)
    plain = synthesize(8, replace(DATA, families=("plate", "turned")), generator())
    with torch.no_grad():
        move = policy.propose(sight(plain), generator(1), 20)
    assert (move.at == APPEND).all()
    assert int(move.tokens.max()) < 7 < VOCAB
    assert not move.part.common.any()


def test_written_programs_may_have_outlines_and_intersections(batch):
    """Whole programs of a policy that knows nothing: their sequences come back, and a program starts with a union."""
    config = DecodeConfig(beam=2, expand=2, points=64, cur_points=32, max_primitives=4, undo_limit=2)
    made = list(steps(base(), batch.gt_points, config, generator(), generator(1)))
    after = made[-1].after
    assert after.positive[:, 0].all()
    assert not after.common[:, 0].any()
    assert any((takes_back(s.move) & adds_primitive(s.move.tokens)).any() for s in made)
    back = from_sequences(*to_sequences(after.compact()))
    assert torch.equal(back.kinds, after.compact().kinds)
    assert torch.equal(back.forms[back.present], after.compact().forms[back.present])
    assert after.drawn.any()
    found, costs = beam_search(base(), batch.gt_points[:4], config, generator(), generator(1))
    assert (costs[:, 0] <= costs[:, 1]).all()
    assert found.positive[:, 0].all()
