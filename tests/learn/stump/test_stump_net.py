"""CSG-Stump Net: gradients, training runs, checkpoints; fits of one shape and their binary matrices."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from tests.data.folders import make_folder
from tests.deadlines import PASSED

from imdim.app.pretrain import main
from imdim.data.folder import FolderConfig
from imdim.data.solids import inside, levels
from imdim.data.synthesize import SynthesisConfig, draw_programs
from imdim.geometry import kernels
from imdim.geometry.lowering import pack
from imdim.learn.batches import Batches
from imdim.learn.checkpoint import CheckpointError, load_policy, load_state, load_stump, save_net
from imdim.learn.distributed import Processes
from imdim.learn.settings import TrainConfig
from imdim.learn.stump.binary import LabelledPoints, Matrices, find_used, improve, to_stump
from imdim.learn.stump.decoded import start, to_primitives
from imdim.learn.stump.fit import FitConfig, columns, fit, random_start
from imdim.learn.stump.net import StumpNet, losses
from imdim.learn.stump.samples import draw_samples, label_solids
from imdim.learn.stump.settings import StumpConfig
from imdim.learn.train import train
from imdim.program.stump import to_program
from imdim.program.tree import Combine, Primitive, combine_all, leaves

CONFIGS = Path(__file__).parents[3] / "configs"
SMALL = StumpConfig(primitives=8, intersections=4, width=16, neighbours=4, cloud=48, points=64)
DATA = SynthesisConfig(gt_points=48, n_max=3, volume_samples=256)
PART = Combine("difference", Primitive("box", (0.7, 0.5, 0.4)), Primitive("cylinder", (0.14, 0.6)))


def chance(seed):
    return torch.Generator().manual_seed(seed)


def small(out, **changes) -> TrainConfig:
    config = TrainConfig("stump", out=str(out), epochs=3, samples_per_epoch=12, n_val=8, batch_size=4, n_measure=4, measure_every=1)
    return replace(config, warmup=2, synthesis=DATA, stump=SMALL, **changes)


def labels_of(program, n, seed) -> LabelledPoints:
    points = np.random.default_rng(seed).uniform(-0.5, 0.5, (n, 3))
    held = kernels.inside(program, points).astype(float)
    return LabelledPoints(points, held, 1 - held)


def iou(program, labels) -> float:
    found, truth = kernels.inside(program, labels.points), labels.w_in > 0
    return float((found & truth).sum() / (found | truth).sum())


@pytest.mark.parametrize("encoder", ["dgcnn", "pointnet"])
def test_every_weight_learns(encoder):
    net = StumpNet(replace(SMALL, encoder=encoder)).train()
    batch = draw_samples(6, DATA, SMALL, chance(0))
    found = net.losses(batch)
    found["loss"].backward()
    values = {name: float(value.detach()) for name, value in found.items()}
    assert values["loss"] == pytest.approx(values["recon"] + 0.001 * values["primitive"], rel=1e-6)
    idle = [name for name, weight in net.named_parameters() if weight.grad is None or not weight.grad.abs().sum() > 0]
    assert not idle


def test_the_primitive_loss_is_the_mean_of_least_squared_distances():
    shape = start(8, 4, chance(0))
    points = torch.rand(1, 30, 3, generator=chance(1)) - 0.5
    found = losses(shape, points, torch.zeros(1, 30), 50.0, 0.001)
    table = np.abs(kernels.leaf_table(*packed(shape), points[0].double().numpy()))
    assert float(found["primitive"]) == pytest.approx(float((table.min(1) ** 2).mean()), rel=1e-4)


def packed(shape):
    return pack(combine_all("union", list(to_primitives(shape))))


def test_labels_are_those_of_the_program():
    """Against the last-holder rule at the same points; half of the points lie beside the surface."""
    solids, clouds = draw_programs(3, DATA, chance(2))
    batch = label_solids(solids, clouds, DATA, replace(SMALL, points=200, near=0.5, spread=0.01), chance(3))
    assert torch.equal(batch.inside > 0.5, inside(solids, levels(solids, batch.points) < 0))
    off = torch.cdist(batch.points[:, 100:], clouds).amin(-1)
    assert float(off.max()) < 0.07
    assert float(torch.cdist(batch.points[:, :100], clouds).amin(-1).max()) > 0.07


@pytest.mark.parametrize("seed", range(3))
def test_a_binary_program_is_its_matrices(seed):
    """The matrices over columns, against the tree that they become, at other points."""
    rng = np.random.default_rng(seed)
    shape = start(16, 4, chance(seed))
    shape.numbers[..., 7:] *= 2
    connection = (rng.random((4, 16)) < 0.2) & (np.arange(16) % 2 == 1)
    connection[:, ::2] |= np.eye(8, dtype=bool)[rng.integers(0, 8, 4)]
    matrices = Matrices(np.arange(16) % 2 == 1, connection, np.array([True, False, True, True]))
    points = rng.uniform(-0.5, 0.5, (5000, 3))
    program = to_program(to_stump(to_primitives(shape), matrices))
    assert np.array_equal(kernels.inside(program, points), matrices.contains(columns(shape, points)))
    assert matrices.contains(columns(shape, points)).any()


def test_improved_matrices_are_never_dearer_and_drop_what_is_idle():
    """Error + price by counting, before and after; a primitive beyond the part goes, a missing one comes."""
    labels = labels_of(PART, 6000, 0)
    held = np.stack([kernels.inside(p, labels.points) for p in (*leaves(PART), Primitive("box", (0.1, 0.1, 0.1), (0.5, 0.5, 0.5)))])
    complement = np.array([False, True, False])
    first = Matrices(complement, np.array([[True, False, False], [False, False, True]]), np.array([True, True]))
    after = improve(first, held, labels, 1e-3)
    assert np.array_equal(find_used(after)[0], [0, 1])
    assert np.array_equal(after.contains(held), labels.w_in > 0)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        cells = rng.random((6, 300)) < 0.5
        target = (cells[0] & ~cells[4]) | (cells[1] & cells[2])
        given = LabelledPoints(np.zeros((300, 3)), target.astype(float), 1.0 - target)
        any_matrices = Matrices(np.arange(6) > 3, rng.random((3, 6)) < 0.4, np.ones(3, bool))
        any_matrices.connection[:, 0] = True
        better = improve(any_matrices, cells, given, 0.01)
        assert price(better, cells, given) <= price(any_matrices, cells, given) + 1e-6


def price(matrices, cells, labels) -> float:
    found = matrices.contains(cells)
    wrong = np.where(found, labels.w_out, labels.w_in).sum() / labels.w_in.sum()
    return float(wrong) + 0.01 * int(matrices.connection[matrices.union].sum())


def test_one_shape_is_fitted():
    labels, others = labels_of(PART, 12_000, 0), labels_of(PART, 12_000, 1)
    config = FitConfig(soft=150, hard=40, rounds=3, last=60, points=384, last_points=1024)
    assert iou(to_program(fit(random_start(labels, 32, 8, 0), labels, config)), others) > 0.9


def test_a_fit_is_the_same_again():
    labels = labels_of(PART, 3000, 0)
    config = FitConfig(soft=10, hard=5, rounds=2, last=5, points=64, last_points=64)
    one, other = (fit(random_start(labels, 16, 4, 0), labels, config) for _ in range(2))
    assert one == other


def test_a_shape_of_complements_alone_is_still_a_solid():
    shape = start(16, 4, chance(0))
    shape.complement.abs_()
    labels = labels_of(PART, 2000, 0)
    assert iou(to_program(fit(shape, labels, FitConfig(), deadline=PASSED)), labels) > 0.0


def test_a_fit_that_is_out_of_time_still_answers():
    labels = labels_of(PART, 3000, 0)
    assert iou(to_program(fit(random_start(labels, 16, 4, 0), labels, FitConfig(), deadline=PASSED)), labels) > 0.0


def test_a_run_that_was_killed_ends_with_the_same_weights(tmp_path):
    whole = list(train(small(tmp_path / "whole")))
    assert whole[-1].stop == "finished"
    assert {"iou_mean", "intersections"} <= whole[-1].measured.keys()
    killed = train(small(tmp_path / "killed", save_every=2))
    next(killed)
    killed.close()
    resumed = list(train(small(tmp_path / "killed", save_every=2, resume=True)))
    assert [r.val for r in resumed] == [r.val for r in whole[1:]]
    a, b = (load_state(tmp_path / name / "state.pt") for name in ("whole", "killed"))
    assert all(torch.equal(a[part][key], b[part][key]) for part in ("policy", "average") for key in a[part])


@pytest.mark.parametrize("precision", ["float32", "bfloat16"])
def test_training_reads_npz_in_either_precision(tmp_path, precision):
    list(make_folder(FolderConfig(str(tmp_path / "data"), 8, 4, 0, replace(DATA, cur_points=16))))
    roots = {"data_root": str(tmp_path / "data" / "train"), "val_root": str(tmp_path / "data" / "val")}
    reports = list(train(small(tmp_path / "run", precision=precision, **roots)))
    assert len(reports) == 3
    assert all(np.isfinite(r.train["loss"]) for r in reports)


def test_parts_of_a_batch_are_functions_of_the_step(tmp_path):
    one, other = (Batches(small(tmp_path, shards=2), Processes()) for _ in range(2))
    assert all(torch.equal(a, b) for a, b in zip(one.part(3, 1), other.part(3, 1), strict=True))
    assert not torch.equal(one.part(3, 1)[1], one.part(3, 0)[1])


def test_a_checkpoint_is_the_net_that_was_saved(tmp_path):
    torch.manual_seed(0)
    net, cloud = StumpNet(SMALL).eval(), torch.rand(1, 48, 3) - 0.5
    save_net(tmp_path / "net.safetensors", net, {"command": "test"})
    loaded, header = load_stump(tmp_path / "net.safetensors")
    assert header["command"] == "test"
    assert json.loads(header["config"])["primitives"] == 8
    assert all(torch.equal(a, b) for a, b in zip(net(cloud).tensors, loaded(cloud).tensors, strict=True))
    with pytest.raises(CheckpointError, match="not a checkpoint of imdim-policy"):
        load_policy(tmp_path / "net.safetensors")
    (tmp_path / "bad.safetensors").write_bytes(b"nothing")
    with pytest.raises(CheckpointError, match=r"bad\.safetensors: not a safetensors file"):
        load_stump(tmp_path / "bad.safetensors")


@pytest.mark.parametrize(
    ("argument", "message"),
    [
        ("stump.encoder=resnet", "unknown encoder 'resnet'; known are dgcnn, pointnet"),
        ("stump.primitives=10", "stump.primitives must be a multiple of 8, got 10"),
        ("stump.neighbours=0", "stump.neighbours must lie in 1..cloud"),
        ("stump.primitve=8", "did you mean stump.primitives"),
    ],
)
def test_what_cannot_be_is_one_line_and_status_2(tmp_path, capsys, argument, message):
    assert main(["experiment=stump", f"out={tmp_path / 'run'}", argument], CONFIGS, print) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "run").exists()
