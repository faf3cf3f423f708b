"""Valid weights, training states and samples to break, and their readers."""

from __future__ import annotations

from pathlib import Path

from kind import refused


def policies(folder: Path) -> list[bytes]:
    import torch

    from imdim.learn.checkpoint import save_net
    from imdim.learn.policy_net import BaseConfig, BasePolicy
    from imdim.learn.seed_policy import SeedConfig, SeedPolicy
    from imdim.learn.stump.net import StumpNet
    from imdim.learn.stump.settings import StumpConfig

    torch.manual_seed(0)
    torch.set_num_threads(1)
    base = BasePolicy(BaseConfig(d_model=8, encoder_layers=1, decoder_layers=1, heads=2, gt_points=16, cur_points=16, point_width=8), 3)
    nets = (
        base,
        SeedPolicy(SeedConfig(d_model=8, layers=1, heads=2, hidden=8), 3),
        StumpNet(StumpConfig(primitives=8, intersections=4, width=8)),
    )
    out = []
    for net in nets:
        save_net(folder / "net.safetensors", net, {"note": "tiny"})
        out.append((folder / "net.safetensors").read_bytes())
    return out


def read_policy(path: Path) -> bool:
    from imdim.learn.checkpoint import CheckpointError, load_policy, load_stump

    both = [refused((CheckpointError,), lambda read=read: read(path)) for read in (load_policy, load_stump)]
    return all(both)


def states(folder: Path) -> list[bytes]:
    import torch

    from imdim.learn.checkpoint import save_state

    save_state(
        folder / "state.pt",
        {"step": 3, "best": 0.5, "config": {"seed": 0}, "policy": {"w": torch.ones(3)}, "average": {"w": torch.ones(3)}, "optimizer": {}},
    )
    return [(folder / "state.pt").read_bytes()]


def read_state(path: Path) -> bool:
    from imdim.learn.checkpoint import CheckpointError, load_own_state

    return refused((CheckpointError, ValueError), lambda: load_own_state(path, {"seed": 0}))


def samples(folder: Path) -> list[bytes]:
    import torch

    from imdim.data.folder import chunk_generator
    from imdim.data.npz import split_samples, write_sample
    from imdim.data.synthesize import SynthesisConfig, synthesize

    torch.set_num_threads(1)
    samples = split_samples(synthesize(4, SynthesisConfig(gt_points=64, cur_points=32, volume_samples=256), chunk_generator(0, 0, 0)))
    out = []
    for sample in samples[:3]:
        write_sample(folder / "sample.npz", sample)
        out.append((folder / "sample.npz").read_bytes())
    return out


def read_sample(path: Path) -> bool:
    from imdim.data.npz import SampleError, read_sample

    return refused((SampleError,), lambda: read_sample(path))
