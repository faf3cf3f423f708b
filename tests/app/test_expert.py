"""Targets that the system finds for clouds without programs: what becomes one, what does not, and that a stopped run goes on."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from imdim.app import expert
from imdim.app.expert import ExpertConfig, draw_cloud, find_target, find_targets, main, to_sample
from imdim.data.npz import read_sample, write_sample
from imdim.data.solids import EXTRUDE, from_sequences, to_signed
from imdim.data.synthesize import SynthesisConfig
from imdim.geometry.solid import to_manifold, to_trimesh, volume_iou
from imdim.program.outline import Outline, rectangle
from imdim.program.sequence import Step, to_program
from imdim.program.tree import Combine, Primitive
from imdim.reconstruction.config import Settings
from imdim.target.target import sample_surface, target_from

SLOT = Outline((((-0.2, -0.1, 0.0), (0.2, -0.1, 1.0), (0.2, 0.1, 0.0), (-0.2, 0.1, 1.0)),))
SLOTTED = to_program(
    (
        Step("union", Primitive("box", (0.9, 0.5, 0.2))),
        Step("difference", Primitive("extrude", (0.6,), (0.1, 0.0, 0.0), (0.0, 0.0, 0.0), SLOT)),
    )
)
SMALL = SynthesisConfig(gt_points=256, cur_points=16, volume_samples=256, n_max=2)


def cloud_of(program, seed=0):
    mesh = to_trimesh(to_manifold(program))
    return sample_surface(np.asarray(mesh.vertices), np.asarray(mesh.faces), 1000, np.random.default_rng(seed))[0]


def test_a_program_with_an_outline_is_a_target_that_comes_back_from_its_file(tmp_path):
    cloud = cloud_of(SLOTTED)
    sample = to_sample(SLOTTED, cloud)
    assert sample is not None
    write_sample(tmp_path / "a.npz", sample)
    read = read_sample(tmp_path / "a.npz")
    solids = from_sequences(torch.as_tensor(read["gt_tokens"])[None], torch.as_tensor(read["gt_params"])[None])
    assert EXTRUDE in solids.kinds[0].tolist()
    again = to_program(to_signed(solids)[0])
    assert volume_iou(to_manifold(again), to_manifold(SLOTTED)) > 0.9999
    assert np.allclose(read["gt_points"], cloud, atol=1e-6)


def test_what_no_sequence_says_is_no_target():
    bent = Outline((((0.0, 0.0, 0.0), (0.5, 0.0, 0.3), (0.4, 0.4, 0.0), (0.1, 0.3, 0.0)),))
    cloud = cloud_of(SLOTTED)
    assert to_sample(Primitive("extrude", (0.3,), outline=bent), cloud) is None
    ball = Primitive("sphere", (0.3,))
    assert to_sample(Combine("intersection", Combine("union", ball, ball), ball), cloud) is None
    many = to_program(tuple(Step("union", Primitive("sphere", (0.1,), (0.1 * i, 0.0, 0.0))) for i in range(13)))
    assert to_sample(many, cloud) is None
    # a rectangle that is extruded is a box
    found = to_sample(Primitive("extrude", (0.3,), outline=rectangle(0.4, 0.2)), cloud)
    assert found is not None
    assert found["gt_tokens"].tolist() == [0, 4]


def test_a_program_that_leaves_much_of_its_cloud_is_no_target(monkeypatch):
    cloud = cloud_of(SLOTTED)
    monkeypatch.setattr(expert, "reconstruct", lambda target, settings, seed: SimpleNamespace(program=SLOTTED))
    assert find_target(cloud, Settings(), 0) is not None
    monkeypatch.setattr(expert, "reconstruct", lambda target, settings, seed: SimpleNamespace(program=Primitive("box", (0.9, 0.5, 0.3))))
    assert find_target(cloud, Settings(), 0) is None


def test_a_run_that_was_stopped_goes_on_with_the_clouds_that_are_left(tmp_path, monkeypatch):
    asked = []

    def find(cloud, settings, seed):
        asked.append(cloud)
        return None if len(asked) == 1 else to_sample(Primitive("box", (0.5, 0.5, 0.5)), cloud)

    monkeypatch.setattr(expert, "find_target", find)
    config = ExpertConfig(out=str(tmp_path), n=2, synthesis=SMALL)
    assert len(list(find_targets(config))) == 2
    assert len(list(find_targets(ExpertConfig(out=str(tmp_path), n=3, synthesis=SMALL)))) == 1
    assert len(asked) == 3
    assert sorted(p.name for p in tmp_path.glob("*.npz")) == ["found_000001.npz", "found_000002.npz"]
    assert np.array_equal(asked[2], draw_cloud(config, 2))
    assert not np.array_equal(asked[0], asked[1])
    assert target_from(asked[0]).mesh is None


@pytest.mark.parametrize("bad", ["n=0", "first=-1", "budget_s=0", "nn=3"])
def test_bad_settings_are_one_line(bad, tmp_path, capsys):
    assert main([f"out={tmp_path}", bad], print) == 2
    said = capsys.readouterr().err
    assert said.startswith("make_expert_targets: ")
    assert said.count("\n") == 1
    assert not list(Path(tmp_path).iterdir())
