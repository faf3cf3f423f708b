"""The settings of a training run, and the fresh network that it starts from."""

from __future__ import annotations

import json
from collections.abc import Collection
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import torch

from imdim.data.synthesize import SynthesisConfig
from imdim.learn.policy import Policy
from imdim.learn.policy_net import BaseConfig, BasePolicy
from imdim.learn.seed_policy import SeedConfig, SeedPolicy
from imdim.learn.stump.net import StumpNet
from imdim.learn.stump.settings import StumpConfig

# where a run computes, how long, and what it reports: a resumed run may change these
FREE = ("resume", "epochs", "max_minutes", "device", "threads", "workers", "precision", "out", "save_every")
FREE += ("val_root", "n_val", "n_measure", "measure_every")
PRECISIONS = {"float32": torch.float32, "bfloat16": torch.bfloat16}


@dataclass
class TrainConfig:
    """`data_root` and `val_root` are folders of npz; where empty, samples are made on the fly and never repeat. An epoch is
    `samples_per_epoch` samples (or the folder, once) and ends with a validation on `n_val` samples; every `measure_every` epochs
    `n_measure` whole programs are written, executed and compared too. Of samples made on the fly a share of `p_expert` is taken from the
    npz of `expert_root`, if given: programs that the whole system found (`scripts/make_expert_targets.py`). `max_seq_len` counts END.
    `weights` is a checkpoint of the same design and sizes whose weights the run begins with (empty: fresh ones); give it another `seed`, or
    it sees the same samples again.

    The learning rate warms up over `warmup` steps, stays, and falls to nothing over the last `cooldown` share of the steps. The run is
    over after `epochs` or after about `max_minutes` (0: no limit) of this command: the fall starts early enough. `ema` is the decay per
    step of the average of the weights that is validated and saved (0: the weights themselves).

    A batch is made of `shards` parts (0: as many as processes), each drawn apart. `workers` processes make samples ahead on the CPU
    (0: they are made between the steps, on `device`; -1: one worker on a CPU, none on a GPU). The samples of `together` steps are made
    at once, which saves a GPU the time of starting many small kernels. `precision` is that of the networks' products: float32, bfloat16,
    or auto, which is bfloat16 on a GPU.
    """

    experiment: str = "base"
    data_root: str = ""
    val_root: str = ""
    expert_root: str = ""
    p_expert: float = 0.25
    weights: str = ""
    out: str = "runs/base"
    epochs: int = 20
    samples_per_epoch: int = 8192
    n_val: int = 192
    n_measure: int = 48
    measure_every: int = 8
    batch_size: int = 32
    shards: int = 0
    together: int = 1
    lr: float = 5e-4
    warmup: int = 200
    cooldown: float = 0.2
    ema: float = 0.999
    clip: float = 1.0
    max_seq_len: int = 13
    device: str = "cpu"
    threads: int = 1
    workers: int = 0
    precision: str = "auto"
    seed: int = 0
    max_minutes: float = 0.0
    save_every: int = 200
    resume: bool = False
    synthesis: SynthesisConfig = field(default_factory=SynthesisConfig)
    base: BaseConfig = field(default_factory=BaseConfig)
    seed_design: SeedConfig = field(default_factory=SeedConfig)
    stump: StumpConfig = field(default_factory=StumpConfig)


def build(config: TrainConfig) -> Policy | StumpNet:
    """A fresh network of `config.experiment`, the same for the same `config.seed`. Raises ValueError for an unknown experiment."""
    kinds = {
        "seed": lambda: SeedPolicy(config.seed_design, config.max_seq_len),
        "base": lambda: BasePolicy(config.base, config.max_seq_len),
        "stump": lambda: StumpNet(config.stump),
    }
    if config.experiment not in kinds:
        raise ValueError(f"unknown experiment {config.experiment!r}; known are {', '.join(kinds)}")
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(config.seed)
        return kinds[config.experiment]()


def precision(config: TrainConfig) -> torch.dtype:
    """Raises ValueError for an unknown one."""
    name = config.precision
    if name == "auto":
        name = "bfloat16" if config.device.startswith("cuda") else "float32"
    if name not in PRECISIONS:
        raise ValueError(f"unknown precision {name!r}; known are auto, {', '.join(PRECISIONS)}")
    return PRECISIONS[name]


def fill_defaults(config: TrainConfig, processes: int) -> TrainConfig:
    """`config` with numbers in place of what it leaves open."""
    workers = (0 if config.device.startswith("cuda") else 1) if config.workers < 0 else config.workers
    return replace(config, shards=config.shards or processes, workers=workers)


def settings_to_keep(config: Any, free: Collection[str] = FREE) -> dict[str, object]:
    """The settings that a resumed run must share: all but the `free` ones, with lists for tuples, as they come back from a file."""
    return json.loads(json.dumps({key: value for key, value in asdict(config).items() if key not in free}))
