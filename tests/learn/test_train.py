"""Training runs: resuming, stopping, files; checkpoints that refuse what they are not."""

import json
import math
import resource
from dataclasses import replace
from functools import cache, partial

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import save_file
from tests.data.folders import make_folder

from imdim.data.families import PLAIN
from imdim.data.folder import FolderConfig
from imdim.data.npz import SampleError
from imdim.data.solids import adds_primitive, from_sequences
from imdim.data.synthesize import APPEND, SynthesisConfig, synthesize
from imdim.learn.batches import Batches
from imdim.learn.checkpoint import CheckpointError, load_policy, load_state, save_net, save_state
from imdim.learn.distributed import Processes
from imdim.learn.optimise import NotFinite, Optimiser
from imdim.learn.policy import Move, Policy
from imdim.learn.policy_net import BaseConfig
from imdim.learn.schedule import Plan, learning_rate, plan_steps, shorten_plan
from imdim.learn.seed_policy import SeedConfig
from imdim.learn.settings import TrainConfig, build, fill_defaults
from imdim.learn.train import train
from imdim.learn.validation import Validation

BASE = BaseConfig(d_model=16, encoder_layers=1, decoder_layers=1, heads=2, gt_points=64, cur_points=32)
SEED = SeedConfig(d_model=16, layers=1, heads=2, hidden=16)
DATA = SynthesisConfig(gt_points=64, cur_points=32, n_max=3, volume_samples=256, p_undo=0.2, families=PLAIN)


def small(out, experiment="base", **changes) -> TrainConfig:
    config = TrainConfig(experiment, out=str(out), epochs=2, samples_per_epoch=12, n_val=8, batch_size=4, max_seq_len=6, synthesis=DATA)
    return replace(config, base=BASE, seed_design=SEED, warmup=2, **{"n_measure": 4, **changes})


def weights(path):
    with safe_open(path, framework="pt") as file:
        return {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """The folder and the reports of an undisturbed run of a design, with which tests compare theirs; they leave the folder as it is."""

    @cache
    def run(experiment):
        out = tmp_path_factory.mktemp(experiment)
        return out, list(train(small(out, experiment)))

    return run


@pytest.mark.parametrize("experiment", ["base", "seed"])
def test_a_run_that_was_killed_ends_with_the_same_weights(tmp_path, experiment, finished):
    out, whole = finished(experiment)
    assert [r.step for r in whole] == [3, 6]
    assert whole[-1].stop == "finished"
    killed = train(small(tmp_path, experiment, save_every=2))
    next(killed)
    killed.close()
    resumed = list(train(small(tmp_path, experiment, save_every=2, resume=True)))
    assert [r.step for r in resumed] == [6]
    assert [r.val for r in resumed] == [r.val for r in whole[1:]]
    a, b = (load_state(folder / "state.pt") for folder in (out, tmp_path))
    assert all(torch.equal(a[part][key], b[part][key]) for part in ("policy", "average") for key in a[part])
    one, other = (weights(folder / "best.safetensors") for folder in (out, tmp_path))
    assert all(torch.equal(one[key], other[key]) for key in one)


@pytest.mark.parametrize("experiment", ["base", "seed"])
def test_a_run_begins_with_the_weights_of_a_checkpoint(tmp_path, experiment, finished):
    given = finished(experiment)[0] / "best.safetensors"
    # a rate of nothing leaves what the run began with
    anew = small(tmp_path / "second", experiment, lr=0.0, ema=0.0, seed=1, weights=str(given))
    list(train(replace(anew, epochs=1, samples_per_epoch=4)))
    first, second = (weights(path) for path in (given, tmp_path / "second" / "best.safetensors"))
    assert all(torch.equal(first[key], second[key]) for key in first)
    wider = replace(
        small(tmp_path / "other", experiment, weights=str(given)), base=replace(BASE, d_model=32), seed_design=replace(SEED, hidden=32)
    )
    with pytest.raises(CheckpointError, match=r"weights of other settings: (d_model|hidden) 16"):
        next(train(wider))
    with pytest.raises(FileNotFoundError, match="no checkpoint at"):
        next(train(small(tmp_path / "none", experiment, weights=str(tmp_path / "nothing"))))


def test_resuming_another_run_or_none_says_so(tmp_path):
    with pytest.raises(FileNotFoundError, match="nothing to resume"):
        next(train(small(tmp_path, resume=True)))
    next(train(small(tmp_path)))
    with pytest.raises(ValueError, match="another lr"):
        next(train(small(tmp_path, resume=True, lr=0.1)))


def test_training_reads_npz_and_lowers_the_loss(tmp_path):
    list(make_folder(FolderConfig(str(tmp_path / "data"), 12, 8, 0, replace(DATA, p_undo=0.0))))
    roots = {"data_root": str(tmp_path / "data" / "train"), "val_root": str(tmp_path / "data" / "val")}
    reports = list(train(replace(small(tmp_path / "run", lr=5e-3, **roots), epochs=15)))
    assert len(reports) == 15
    assert reports[-1].train["loss"] < 0.8 * reports[0].train["loss"]
    assert reports[0].best
    assert reports[-1].lr < 0.1 * 5e-3 < reports[2].lr


class Clock:
    """A second passes whenever it is looked at."""

    def __init__(self, seconds=1.0):
        self.now, self.seconds = 0.0, seconds

    def __call__(self):
        self.now += self.seconds
        return self.now


def test_a_time_limit_makes_the_rate_fall_in_time(tmp_path):
    """3 looks at the clock a step: 30 s are 10 steps, of which a fifth falls; the run says why it stopped and has a whole state."""
    clock = Clock()
    config = small(tmp_path, "seed", max_minutes=0.5)
    reports = list(train(replace(config, epochs=30, cooldown=0.2), clock=clock))
    assert reports[-1].stop == "max_minutes"
    assert [r.stop for r in reports[:-1]] == [None] * (len(reports) - 1)
    assert 25 <= clock.now <= 45
    state = load_state(tmp_path / "state.pt")
    start, end = state["plan"]
    assert end == state["step"] == reports[-1].step < 15
    assert start < end
    assert reports[-1].lr < config.lr


def test_a_fall_that_was_killed_ends_as_the_one_that_was_not(tmp_path):
    """The clock of the resumed run stands still: when to end was settled before."""
    limit = {"max_minutes": 0.5, "save_every": 1}
    configs = [replace(small(tmp_path / name, "seed", **limit), epochs=30, cooldown=0.5) for name in ("whole", "killed")]
    whole = list(train(configs[0], clock=Clock()))[-1]
    killed = train(configs[1], clock=Clock())
    while True:
        next(killed)
        state = load_state(tmp_path / "killed" / "state.pt")
        if state["step"] >= state["plan"][0]:
            break
    killed.close()
    assert state["step"] < whole.step
    resumed = list(train(replace(configs[1], resume=True), clock=Clock(0.0)))[-1]
    assert (resumed.step, resumed.val) == (whole.step, whole.val)


@pytest.mark.parametrize("cooldown", [0.0, 0.4])
def test_a_run_that_is_over_goes_on_as_if_it_had_been_meant_to_be_longer(tmp_path, cooldown):
    long, short = (replace(small(tmp_path / name, "seed"), cooldown=cooldown) for name in ("long", "short"))
    list(train(replace(long, epochs=2)))
    list(train(replace(short, epochs=1)))
    with pytest.raises(ValueError, match="is of a run that is over, 3 steps long; give it more epochs"):
        next(train(replace(short, epochs=1, resume=True)))
    list(train(replace(short, epochs=2, resume=True)))
    a, b = (load_state(tmp_path / name / "state.pt") for name in ("long", "short"))
    assert all(torch.equal(a[part][key], b[part][key]) for part in ("policy", "average") for key in a[part])


def test_the_rate_warms_up_stays_and_falls_like_one_minus_root():
    plan = plan_steps(100, 0.2)
    assert plan == Plan(80, 100)
    rates = [learning_rate(2.0, 10, plan, step) for step in range(100)]
    assert rates[:10] == pytest.approx([0.2 * (i + 1) for i in range(10)])
    assert set(rates[10:80]) == {2.0}
    assert rates[80:] == pytest.approx([2.0 * (1 - math.sqrt(i / 21)) for i in range(1, 21)])
    assert learning_rate(2.0, 0, Plan(5, 5), 4) == 2.0
    with pytest.raises(ValueError, match=r"0 to 1, got 1.5"):
        plan_steps(100, 1.5)


def test_a_fall_is_brought_forward_once_it_has_to_begin():
    plan = Plan(800, 1000)
    assert shorten_plan(plan, 80, 80, 79.9, 100.0, 0.2) == plan
    assert shorten_plan(plan, 80, 80, 80.0, 100.0, 0.2) == Plan(80, 100)
    assert shorten_plan(plan, 580, 80, 80.0, 100.0, 0.2) == Plan(580, 600)  # a resumed run counts its own steps
    assert shorten_plan(Plan(80, 100), 90, 90, 99.0, 100.0, 0.2) == Plan(80, 100)  # under way
    assert shorten_plan(plan, 0, 0, 1.0, 1e-9, 0.2) == Plan(0, 1)


def test_the_average_is_the_moving_one(tmp_path):
    """Against the closed form of its first two steps; without a decay it is the weights themselves."""
    for ema in (0.999, 0.0):
        optimiser = Optimiser(build(small(tmp_path)), ema, 1.0)
        seen = [[p.detach().clone() for p in optimiser.policy.parameters()]]
        for step in range(2):
            batch = synthesize(4, DATA, torch.Generator().manual_seed(step))
            optimiser.step([partial(optimiser.policy.losses, batch)], 1, 1e-2, step)
            seen.append([p.detach().clone() for p in optimiser.policy.parameters()])
        keep = [min(ema, 1 / 10), min(ema, 2 / 11)]
        for mean, zero, one, two in zip(optimiser.average.parameters(), *seen, strict=True):
            expected = keep[1] * (keep[0] * zero + (1 - keep[0]) * one) + (1 - keep[1]) * two
            assert torch.allclose(mean, expected, atol=1e-6)


def test_what_is_validated_and_saved_is_the_average(finished):
    out, _ = finished("base")
    state, best = load_state(out / "state.pt"), weights(out / "best.safetensors")
    assert all(torch.equal(best[key], state["average"][key]) for key in best)
    assert not all(torch.equal(best[key], state["policy"][key]) for key in best)


def test_programs_and_errors_are_measured_every_few_epochs_and_at_the_end(tmp_path):
    reports = list(train(replace(small(tmp_path, measure_every=2, n_measure=4), epochs=3, samples_per_epoch=4)))
    assert [bool(r.measured) for r in reports] == [False, True, True]
    last = reports[-1]
    assert last.shown is not None
    assert last.shown.iou.shape == (4,)
    assert {"iou_median", "iou_mean", "iou_share_090", "exact_structure"} <= last.measured.keys()
    assert last.measured["iou_mean"] == pytest.approx(float(last.shown.iou.mean()))


def test_measured_iou_is_that_of_the_true_program_when_the_policy_knows_it(tmp_path):
    """A policy that writes the truth step by step has IoU 1 and every structure right."""
    validation = Validation(small(tmp_path, n_measure=6))
    values, shown = validation.programs(Oracle(validation.targets, 6))
    assert values["iou_mean"] == 1.0
    assert values["iou_share_090"] == 1.0
    assert values["exact_structure"] == 1.0
    assert torch.equal(shown.found.compact().kinds, shown.truth.kinds)


@pytest.mark.parametrize("changes", [{"workers": 1}, {"shards": 2}, {"precision": "bfloat16"}])
def test_what_may_not_change_the_run_does_not(tmp_path, changes, finished):
    """Workers make the same samples; a run in parts or in half precision learns nearly the same and resumes like any other."""
    _, plain = finished("seed")
    killed = train(small(tmp_path, "seed", **changes))
    next(killed)
    killed.close()
    other = list(train(small(tmp_path, "seed", resume=True, **changes)))
    assert other[-1].step == plain[-1].step
    if "workers" in changes:
        assert other[-1].val == plain[-1].val
    else:
        assert other[-1].val != plain[-1].val
        assert other[-1].val["loss"] == pytest.approx(plain[-1].val["loss"], rel=0.3)


@pytest.mark.parametrize("experiment", ["base", "seed"])
def test_losses_in_half_precision_are_close(tmp_path, experiment):
    policy = build(small(tmp_path, experiment))
    batch = synthesize(8, DATA, torch.Generator().manual_seed(0))
    exact = policy.losses(batch)
    with torch.autocast("cpu", torch.bfloat16):
        half = policy.losses(batch)
    for name, value in exact.items():
        assert half[name].item() == pytest.approx(value.item(), rel=0.03, abs=0.03), name


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"precision": "half"}, "unknown precision 'half'; known are auto, float32, bfloat16"),
        ({"shards": 3}, "3 shards .* cannot share a batch of 4 among 1 process"),
        ({"cooldown": 2.0}, "cooldown is a share"),
        ({"experiment": "third"}, "unknown experiment 'third'"),
    ],
)
def test_settings_that_cannot_be_say_so(tmp_path, changes, message):
    with pytest.raises(ValueError, match=message):
        next(train(small(tmp_path, **changes)))


def test_a_sample_that_cannot_be_read_is_named_even_by_a_worker(tmp_path):
    list(make_folder(FolderConfig(str(tmp_path), 4, 4, 0, replace(DATA, p_undo=0.0))))
    (tmp_path / "train" / "sample_00002.npz").write_bytes(b"no archive")
    roots = {"data_root": str(tmp_path / "train"), "val_root": str(tmp_path / "val")}
    with pytest.raises(SampleError, match=r"^[^\n]*sample_00002.npz: not an npz archive[^\n]*$"):
        list(train(small(tmp_path / "run", "seed", workers=1, **roots)))


class Oracle(Policy):
    def __init__(self, batch, max_seq_len):
        super().__init__()
        self.batch, self.max_seq_len = batch, max_seq_len

    def losses(self, batch):
        raise NotImplementedError

    def propose(self, seen, generator=None, ways=1):
        known = (seen.gt_points[:, None, 0] == self.batch.gt_points[None, :, 0]).all(-1).int().argmax(1)
        at = known, seen.written.lengths
        tokens = self.batch.gt_tokens[at].clamp_min(0)
        part = from_sequences(torch.where(adds_primitive(tokens), tokens, 0)[:, None], self.batch.gt_params[at][:, None])
        return Move(tokens, part, torch.zeros(len(tokens)), torch.full_like(tokens, APPEND))


def test_a_loss_that_is_not_finite_stops_with_step_and_batch(tmp_path, monkeypatch):
    from imdim.learn.policy_net import BasePolicy

    honest = BasePolicy.losses
    calls = []

    def poisoned(self, batch):
        calls.append(batch)
        losses = honest(self, batch)
        return {**losses, "loss": losses["loss"] * math.nan} if len(calls) == 2 else losses

    monkeypatch.setattr(BasePolicy, "losses", poisoned)
    with pytest.raises(NotFinite, match=r"loss nan.*at step 1; its batch is in .*not_finite_1.pt"):
        list(train(small(tmp_path)))
    saved = load_state(tmp_path / "not_finite_1.pt")
    assert saved["step"] == 1
    assert torch.equal(saved["parts"][0]["gt_points"], calls[1].gt_points)


def test_a_checkpoint_comes_back_as_it_was(tmp_path):
    policy = build(small(tmp_path))
    save_net(tmp_path / "a.safetensors", policy, {"commit": "abc"})
    back, header = load_policy(tmp_path / "a.safetensors")
    assert header["commit"] == "abc"
    assert not back.training
    assert all(torch.equal(value, back.state_dict()[key]) for key, value in policy.state_dict().items())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"version": "0"}, "checkpoint version 0, this program reads version 1"),
        ({"vocabulary": json.dumps(["ADD_BOX"])}, "vocabulary ADD_BOX, this program's is ADD_BOX ADD_SPHERE"),
        ({"design": "third"}, "design 'third', known are seed, base"),
        ({"format": "other"}, "not a checkpoint of imdim-policy, its format is other"),
        ({"max_seq_len": "9"}, "the weights do not fit the design base"),
    ],
)
def test_foreign_checkpoints_say_what_they_are(tmp_path, change, message):
    path = tmp_path / "a.safetensors"
    save_net(path, build(small(tmp_path)), {})
    header = {**load_policy(path)[1], **change}
    save_file(weights(path), path, header)
    with pytest.raises(CheckpointError, match=message):
        load_policy(path)


def test_broken_and_missing_checkpoints_are_named(tmp_path):
    (tmp_path / "bad.safetensors").write_bytes(b"no weights")
    with pytest.raises(CheckpointError, match=r"bad.safetensors: not a safetensors file"):
        load_policy(tmp_path / "bad.safetensors")
    with pytest.raises(FileNotFoundError, match="none"):
        load_policy(tmp_path / "none")


@pytest.fixture
def full_disk():
    """Files cannot grow beyond 2,000 bytes: what is written fails half-way, as on a disk that is full."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (2000, hard))
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("name", ["a.safetensors", "state.pt"])
def test_a_full_disk_leaves_the_last_checkpoint_whole(tmp_path, full_disk, name):
    def write(seed):
        policy = build(small(tmp_path, "seed", seed=seed))
        save_net(tmp_path / name, policy, {}) if name.endswith("s") else save_state(tmp_path / name, policy.state_dict())

    write(0)
    before = (tmp_path / name).read_bytes()
    full_disk()
    with pytest.raises(OSError, match=rf"too large.*{name}"):
        write(1)
    assert (tmp_path / name).read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize("content", [b"", b"no state", b"PK\x03\x04 cut off", "other"])
def test_states_that_are_none_are_named(tmp_path, content):
    path = tmp_path / "state.pt"
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        torch.save({"weights": torch.zeros(2)}, path)
    with pytest.raises(CheckpointError, match=r"state.pt: not (a training state|the state of a training run)"):
        next(train(small(tmp_path, resume=True)))


def test_samples_of_several_steps_are_made_at_once(tmp_path):
    """Each step has its own rows of one draw, the same in a run that is resumed between them."""
    config = fill_defaults(small(tmp_path, together=2, workers=0), 1)
    batches = Batches(config, Processes())
    parts = [batches.part(step, 0) for step in range(3)]
    assert all(len(part.steps) == config.batch_size for part in parts)
    assert not torch.equal(parts[0].gt_points, parts[1].gt_points)
    again = Batches(config, Processes()).part(1, 0)
    assert all(torch.equal(a, b) for a, b in zip(again, parts[1], strict=True))
