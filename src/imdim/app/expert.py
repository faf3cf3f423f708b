"""Targets for expert iteration: noisy clouds without a program, and the programs that the whole system finds for them.

A policy that learns from what a search made of its proposals learns to propose what the search ends with (Anthony et al. 2017, "Thinking
fast and slow with deep learning and tree search"). The samples are npz files as `scripts/make_dataset.py` writes them.
"""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch

from imdim.app.arguments import from_arguments
from imdim.data.canonical import canonical
from imdim.data.folder import chunk_generator
from imdim.data.npz import write_sample
from imdim.data.solids import from_signed, to_sequences
from imdim.data.synthesize import MAX_PRIMITIVES, SynthesisConfig, synthesize
from imdim.delivery.result import reconstruct
from imdim.detection.noise import measure_noise
from imdim.geometry import kernels
from imdim.program.sequence import of_primitives, to_sequence
from imdim.program.tree import Program
from imdim.reconstruction.config import ConfigError, Settings
from imdim.target.target import InputError, target_from

STREAM = 30  # of the clouds: none that training or its validation sees
EXPLAINED, NEAR = 0.9, 3.0  # the share of a cloud that a target explains, and within how many deviations of its noise
BAD_INPUT, INTERRUPTED = 2, 130


@dataclass
class ExpertConfig:
    """`out` gets what is found for clouds `first` to `first` + `n` of `synthesis`, within `budget_s` seconds each, by the policy at
    `checkpoint` (empty: the shipped one) and the search; `seed` fixes the clouds. What is there is not found again."""

    out: str = "expert"
    n: int = 100
    first: int = 0
    seed: int = 0
    budget_s: float = 20.0
    checkpoint: str = ""
    synthesis: SynthesisConfig = field(default_factory=SynthesisConfig)


def main(arguments: Sequence[str], say: Callable[[str], None]) -> int:
    """Find targets, or go on with it; the exit status."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        config = from_arguments(ExpertConfig, arguments)
        if config.n < 1 or config.first < 0 or config.budget_s <= 0:
            raise ConfigError(
                f"settings n and budget_s need positive numbers and first none below 0: {config.n}, {config.budget_s}, {config.first}"
            )
        for line in find_targets(config):
            say(line)
    except (ConfigError, ValueError, OSError) as error:
        sys.stderr.write(f"make_expert_targets: {error}\n")
        return BAD_INPUT
    except KeyboardInterrupt:
        sys.stderr.write("make_expert_targets: stopped; the same command continues\n")
        return INTERRUPTED
    return 0


def find_targets(config: ExpertConfig) -> Iterator[str]:
    """Write the samples; a line for each cloud."""
    out = Path(config.out)
    out.mkdir(parents=True, exist_ok=True)
    for index in range(config.first, config.first + config.n):
        path, none = out / f"found_{index:06d}.npz", out / f"found_{index:06d}.none"
        if path.exists() or none.exists():
            continue
        begun = time.process_time()
        cloud = draw_cloud(config, index)
        sample = find_target(cloud, Settings(budget_s=config.budget_s, checkpoint=config.checkpoint), config.seed)
        if sample is None:
            none.touch()
        else:
            write_sample(path, sample)
        said = "no target" if sample is None else f"{len(sample['gt_tokens']) - 1} primitives"
        yield f"{path.name}  {said}  {time.process_time() - begun:.1f} s"


def draw_cloud(config: ExpertConfig, index: int) -> np.ndarray:
    """Cloud number `index` [n, 3], float64, of box diagonal about 1."""
    samples = synthesize(1, config.synthesis, chunk_generator(config.seed, STREAM, index))
    return samples.gt_points[0].double().numpy()


def find_target(cloud: np.ndarray, settings: Settings, seed: int) -> dict[str, np.ndarray] | None:
    """The sample that the system makes of a cloud; None where it finds no program, one that leaves much of the cloud unexplained, or one
    that no sequence of the policy's vocabulary says."""
    try:
        program = reconstruct(target_from(cloud), settings, seed).program
    except InputError:
        return None
    return to_sample(program, cloud) if _explains(program, cloud, seed) else None


def _explains(program: Program, cloud: np.ndarray, seed: int) -> bool:
    sigma = measure_noise(cloud, np.random.default_rng(seed))[0].sigma
    reach = NEAR * max(sigma, 1e-3 * float(np.linalg.norm(np.ptp(cloud, axis=0))))
    return float((np.abs(kernels.program_sdf(program, cloud)) < reach).mean()) >= EXPLAINED


def to_sample(program: Program, cloud: np.ndarray) -> dict[str, np.ndarray] | None:
    """Cloud and program as the arrays of one file; None where no sequence says the program."""
    sequence = of_primitives(to_sequence(program, apart=True))
    if sequence is None or len(sequence) > MAX_PRIMITIVES:
        return None
    try:
        tokens, params = to_sequences(canonical(from_signed([sequence])))
    except ValueError:
        return None
    arrays = {"gt_points": torch.as_tensor(cloud), "cur_points": torch.zeros(0, 3), "gt_tokens": tokens[0], "gt_params": params[0]}
    return {name: (v.short() if name == "gt_tokens" else v.float()).numpy() for name, v in arrays.items()}
