"""Reinforcement: its arithmetic by hand, log p against what was drawn, reward that rises, runs that resume."""

import math
from dataclasses import replace

import pytest
import torch

from imdim.app.reinforce import main
from imdim.data.folder import chunk_generator
from imdim.data.solids import from_sequences
from imdim.data.synthesize import SynthesisConfig, estimate_iou, synthesize
from imdim.learn.checkpoint import load_policy, load_state, save_net
from imdim.learn.decode import DecodeConfig, apply_move, steps
from imdim.learn.policy_net import BaseConfig, BasePolicy
from imdim.learn.reinforce import TARGETS, ReinforceConfig, clip_objective, reinforce
from imdim.learn.rollouts import CREDIT, RewardConfig, advantages, branches, whole_programs
from imdim.learn.seed_policy import SeedConfig, SeedPolicy
from imdim.program.state import ADD_BOX, ADD_CYLINDER, ADD_SPHERE

DATA = SynthesisConfig(
    gt_points=64, cur_points=32, n_max=3, volume_samples=256, families=("plate", "turned"), free_rotation=0.0, smallest_change=0.05
)
BASE = BaseConfig(d_model=16, encoder_layers=1, decoder_layers=1, heads=2, gt_points=64, cur_points=32)
TINY = SeedConfig(d_model=16, layers=1, heads=2, hidden=32)
CONFIG = ReinforceConfig(
    steps=6, targets=2, group=4, rows=8, anchor_batch=4, iou_samples=128, n_val=4, validate_every=2, synthesis=DATA, reuse=2
)


@pytest.fixture(autouse=True)
def _one_thread():
    torch.set_num_threads(1)
    torch.manual_seed(0)


def test_advantages_compare_siblings_alone():
    reward = torch.tensor([1.0, 3.0, 10.0, 10.0, 0.0, 0.0])
    found = advantages(reward, 2)
    assert found.tolist() == pytest.approx([-1 / math.sqrt(2), 1 / math.sqrt(2), 0, 0, 0, 0])


def test_the_objective_is_clipped_where_a_step_would_go_too_far():
    ratio = torch.tensor([1.0, 1.5, 0.5, 1.5, 0.5])
    gain = torch.tensor([2.0, 2.0, 2.0, -2.0, -2.0])
    assert clip_objective(ratio.log(), gain, 0.2).tolist() == pytest.approx([-2.0, -2.4, -1.0, 3.0, 1.6])


@pytest.mark.parametrize("policy", [SeedPolicy(TINY, 7), BasePolicy(BASE, 7)], ids=["seed", "base"])
def test_log_p_is_that_of_the_draw(policy):
    """Over whole sampled episodes, bars on UNDO_LAST included."""
    policy.eval()
    batch = synthesize(16, DATA, torch.Generator().manual_seed(0))
    chance = torch.Generator().manual_seed(1)
    config = DecodeConfig(cur_points=32, max_primitives=3, undo_limit=1)
    made = list(steps(policy, batch.gt_points, config, chance, chance))
    assert len(made) > 3
    for step in made:
        log_p = policy.log_prob(step.seen, step.move)
        assert torch.allclose(log_p, step.move.log_p, atol=1e-4)
        assert log_p.requires_grad


def of_one_size(*size: float) -> SeedPolicy:
    """A fresh policy whose primitives have this size, are upright, positive and in the middle, whatever the cloud; its tokens are free."""
    policy = SeedPolicy(TINY, 5)
    last = policy.components.param_head.mlp[-1]
    torch.nn.init.zeros_(last.weight)
    last.bias.data = torch.tensor([0, 0, 0, *size, 0, 0, 0, 1.0])
    return policy


def test_the_reward_rises_to_what_is_best(tmp_path):
    """Targets are upright plates. The mean reward of sampled programs must rise by far more than its standard error (below 0.01: 512
    programs), and greedy programs must be worth what the best of all single primitives that this policy can write is worth."""
    data = replace(DATA, families=("plate",))
    config = replace(CONFIG, out=str(tmp_path), steps=12, targets=8, group=8, rows=512, lr=5e-3, anchor=0.0, price=0.02, synthesis=data)
    policy, targets = of_one_size(0.5, 0.5, 0.4), synthesize(64, data, torch.Generator().manual_seed(5))

    def sampled() -> float:
        decoding, chance = DecodeConfig(cur_points=32, max_primitives=3), torch.Generator().manual_seed(6)
        return whole_programs(policy, targets, RewardConfig(8, config.price, 512), decoding, chance)[1]["reward"]

    before = sampled()
    last = list(reinforce(policy, replace(config, n_val=64, iou_samples=1024, validate_every=12)))[-1]
    assert sampled() > before + 0.1
    assert last.val["moves"] == 2.0
    validation = synthesize(64, replace(data, prefixes=1), chunk_generator(0, TARGETS, 0))
    truth = from_sequences(validation.gt_tokens, validation.gt_params)
    worth = []
    for kind in (ADD_BOX, ADD_SPHERE, ADD_CYLINDER):
        one = torch.tensor([0, 0, 0, 0.5, 0.5, 0.4, 0, 0, 0, 1.0]).expand(64, 1, 10)
        found = from_sequences(torch.full((64, 1), int(kind)), one)
        worth.append(float(estimate_iou(found, truth, 2048, torch.Generator().manual_seed(0)).mean()) - 2 * config.price)
    assert last.val["reward"] == pytest.approx(max(worth), abs=0.02)


@pytest.mark.parametrize("make", [lambda: SeedPolicy(TINY, 7), lambda: BasePolicy(BASE, 7)], ids=["seed", "base"])
def test_moves_from_one_state_are_worth_the_solids_they_lead_to(make):
    """Executed one by one and measured with other points: the best of a group has the best solid, up to their error where a solid is a
    sliver of its box, and log p is that of the draw."""
    policy = make().eval()
    targets = synthesize(6, replace(DATA, prefixes=1), torch.Generator().manual_seed(2))
    chance = torch.Generator().manual_seed(3)
    made, facts = branches(
        policy, targets, RewardConfig(4, 0.0, 40_000), DecodeConfig(cur_points=32, max_primitives=3, undo_limit=1), chance
    )
    assert made.ways == 4
    assert made.advantage.view(-1, 4).sum(1).abs().max() < 1e-3
    log_p = policy.log_prob(made.seen, made.move)
    assert torch.allclose(log_p, made.move.log_p, atol=1e-4)
    some = made.of(torch.tensor([made.states - 1]))
    assert torch.equal(some.move.log_p, made.move.log_p[-4:])
    truth = from_sequences(targets.gt_tokens, targets.gt_params)
    for state in range(made.states):
        here = made.of(torch.tensor([state]))
        row = int((targets.gt_points[:, 0] == here.seen.gt_points[:, 0]).all(1).nonzero()[0])
        worth = []
        for way in range(4):
            after = apply_move(here.seen.written, here.move.of(torch.tensor([way])))
            worth.append(float(estimate_iou(after, truth[row : row + 1], 40_000, torch.Generator().manual_seed(way))))
        best = worth[int(here.advantage.argmax())]
        assert best == pytest.approx(max(worth), abs=0.05)
    assert 0 <= facts["reward"] <= 1


def test_siblings_share_their_points():
    """Equal solids have equal estimates, where each alone is off by more."""
    params = torch.zeros(1, 2, 10)
    params[0, 0] = torch.tensor([0, 0, 0, 0.4, 0.4, 0.4, 0, 0, 0, 1.0])
    ball = from_sequences(torch.tensor([[int(ADD_SPHERE), -1]]), params)[torch.zeros(8, dtype=torch.long)]
    box = from_sequences(torch.tensor([[int(ADD_BOX), -1]]), params)[torch.zeros(8, dtype=torch.long)]
    alike, alone = (estimate_iou(ball, box, 500, torch.Generator().manual_seed(0), n) for n in (4, 1))
    assert torch.equal(alike[:4], alike[:1].expand(4))
    assert alike[0] != alike[4]
    assert len(alone.unique()) > 4
    assert torch.allclose(alike.mean(), alone.mean(), atol=0.05)


def test_learning_move_by_move_raises_the_reward_too(tmp_path):
    """As above, with several moves from each state."""
    data = replace(DATA, families=("plate",))
    changes = {"targets": 16, "group": 8, "rows": 512, "lr": 5e-3, "anchor": 0.0, "price": 0.02, "reuse": 1, "credit": "move"}
    config = replace(CONFIG, out=str(tmp_path), steps=16, n_val=64, iou_samples=1024, validate_every=16, synthesis=data, **changes)
    first, last = reinforce(of_one_size(0.5, 0.5, 0.4), config)
    assert last.val["reward"] >= first.val["reward"]
    assert last.val["moves"] == 2.0
    assert last.train["reward"] > 0


@pytest.mark.parametrize(
    ("changes", "message"),
    [({"credit": "luck"}, "unknown credit 'luck'; known are program, move"), ({"precision": "half"}, "unknown precision 'half'")],
)
def test_settings_that_cannot_be_say_so(tmp_path, changes, message):
    with pytest.raises(ValueError, match=message):
        next(reinforce(SeedPolicy(TINY, 5), replace(CONFIG, out=str(tmp_path), **changes)))


@pytest.mark.parametrize("credit", sorted(CREDIT))
def test_a_run_that_was_killed_ends_with_the_same_weights(tmp_path, credit):
    def run(name, **changes):
        torch.manual_seed(0)
        return reinforce(SeedPolicy(TINY, 5), replace(config, out=str(tmp_path / name), **changes))

    config = replace(CONFIG, steps=4, credit=credit)
    whole = list(run("whole"))
    assert [p.step for p in whole] == [0, 2, 4]
    assert whole[-1].stop == "finished"
    killed = run("killed")
    next(killed), next(killed)
    killed.close()
    torch.manual_seed(1)
    resumed = list(reinforce(SeedPolicy(TINY, 5), replace(config, out=str(tmp_path / "killed"), resume=True)))
    assert [p.val for p in resumed] == [p.val for p in whole[2:]]
    a, b = (load_state(tmp_path / name / "state.pt") for name in ("whole", "killed"))
    assert all(torch.equal(a[part][key], b[part][key]) for part in ("policy", "average") for key in a[part])
    for changes, message in (({"lr": 1.0}, "another lr"), ({}, "is of a run that is over, 4 steps")):
        with pytest.raises(ValueError, match=message):
            next(run("whole", resume=True, **changes))
    with pytest.raises(FileNotFoundError, match="nothing to resume"):
        next(run("none", resume=True))


def test_the_command_writes_a_checkpoint_and_refuses_what_is_none(tmp_path, capsys):
    from pathlib import Path

    save_net(tmp_path / "a.safetensors", SeedPolicy(TINY, 5), {"commit": "abc"})
    configs, said = Path(__file__).parents[2] / "configs", []
    small = ["steps=2", "targets=2", "group=2", "n_val=4", "validate_every=1", "iou_samples=64", "anchor_batch=4"]
    small += [
        "synthesis.gt_points=64",
        "synthesis.cur_points=32",
        "synthesis.n_max=3",
        "synthesis.volume_samples=256",
        "synthesis.p_undo=0",
        "synthesis.families=[plate,bracket,turned]",
    ]
    assert main([f"checkpoint={tmp_path / 'a.safetensors'}", f"out={tmp_path / 'run'}", *small], configs, said.append) == 0
    assert [s.split(":")[0] for s in said] == ["step 0", "step 1", "step 2"]
    _, header = load_policy(tmp_path / "run" / "best.safetensors")
    assert header["commit"] == "abc"
    assert "reinforced_by" in header
    assert any(p.name.startswith("events.") for p in (tmp_path / "run").iterdir())
    (tmp_path / "b.safetensors").write_bytes(b"none")
    for wrong, message in (("checkpoint=" + str(tmp_path / "b.safetensors"), "not a safetensors file"), ("stepz=1", "did you mean steps")):
        assert main([wrong], configs, said.append) == 2
        error = capsys.readouterr().err
        assert message in error
        assert error.count("\n") == 1
