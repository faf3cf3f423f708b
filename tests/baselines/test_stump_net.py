"""method=stump-net: a program for a part in its own units and pose, from a network or a random start."""

from functools import partial

import numpy as np
import pytest
import torch

import imdim.baselines.stump_net as stump_net
from imdim.deadline import NEVER
from imdim.geometry import kernels
from imdim.geometry.rotations import matrix_from_euler
from imdim.geometry.solid import to_manifold, to_trimesh, volume_iou
from imdim.learn.checkpoint import save_net
from imdim.learn.stump import fit as fits
from imdim.learn.stump.net import StumpNet
from imdim.learn.stump.settings import StumpConfig
from imdim.program.tree import Combine, Primitive
from imdim.reconstruction.config import ConfigError, Settings
from imdim.reconstruction.observation import UnitBody, observe
from imdim.reconstruction.pipeline import reconstruct
from imdim.reconstruction.poses import Poses
from imdim.target.target import in_unit_frame, target_from

PLACE = (5.0, -20.0, 100.0)
PART = Combine("difference", Primitive("box", (70.0, 50.0, 40.0), PLACE), Primitive("cylinder", (14.0, 60.0), PLACE))
SHORT = partial(fits.FitConfig, soft=40, hard=20, rounds=2, last=20, points=256, last_points=512)


@pytest.fixture
def short(monkeypatch):
    monkeypatch.setattr(fits, "FitConfig", SHORT)


def iou(program) -> float:
    return volume_iou(to_manifold(program), to_manifold(PART))


def test_the_method_answers_in_the_part_s_units(short):
    target = target_from(to_trimesh(to_manifold(PART)))
    *_, last = reconstruct(target, Settings(method="stump-net", stump_checkpoint="none"), np.random.default_rng(0))
    assert iou(last.program) > 0.7
    assert last.stop == "finished"


def test_a_network_is_asked_for_the_cloud(tmp_path, short):
    """What it says is where the fit begins, so another network leads elsewhere."""
    found = []
    for seed in range(2):
        torch.manual_seed(seed)
        path = tmp_path / f"{seed}.safetensors"
        save_net(path, StumpNet(StumpConfig(primitives=16, intersections=8, width=16, cloud=64)), {})
        unit, frame = in_unit_frame(target_from(to_trimesh(to_manifold(PART))))
        rng = np.random.default_rng(0)
        seen = observe(UnitBody.of(unit, rng), 1e-3, rng)
        found.append(frame.undo(stump_net.propose_program(seen, stump_net.load(str(path)), 0, NEVER)))
    assert found[0] != found[1]
    assert min(iou(p) for p in found) > 0.5


def test_a_program_comes_back_from_the_network_s_frame():
    """Points of the world are inside where the same points, as the network sees them, are."""
    axes = matrix_from_euler((20.0, -35.0, 60.0))
    poses = Poses.of([np.random.default_rng(0).normal(size=(50, 3)) * 30 + 7], [axes])
    local = Primitive("cone", (0.2, 0.1, 0.3), (0.1, 0.2, -0.1), (10.0, 40.0, -70.0))
    back = stump_net._back(local, poses)
    points = np.random.default_rng(1).uniform(-0.5, 0.5, (20_000, 3))
    world = (points / poses.scale[0] + poses.middle[0]) @ axes.T
    assert np.allclose(poses.local(world[None])[0].numpy(), points, atol=1e-6)
    assert np.array_equal(kernels.inside(back, world), kernels.inside(local, points))


def test_a_checkpoint_that_is_none_is_one_line(tmp_path):
    (tmp_path / "bad.safetensors").write_bytes(b"nothing")
    with pytest.raises(ConfigError, match=r"setting stump_checkpoint: .*bad\.safetensors: not a safetensors file"):
        stump_net.load(str(tmp_path / "bad.safetensors"))
    with pytest.raises(ConfigError, match="setting stump_checkpoint: no checkpoint at"):
        stump_net.load(str(tmp_path / "missing.safetensors"))
    assert stump_net.load("none") is None
