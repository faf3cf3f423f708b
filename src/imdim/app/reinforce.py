"""A reinforcement run on the terminal and in tensorboard."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from imdim.app.arguments import from_arguments
from imdim.app.pretrain import check_device, commit, log_to_tensorboard
from imdim.learn.checkpoint import load_policy
from imdim.learn.optimise import NotFinite
from imdim.learn.reinforce import Progress, ReinforceConfig, reinforce
from imdim.reconstruction.config import ConfigError


def main(arguments: Sequence[str], configs: Path, say: Callable[[str], object]) -> int:
    """Fine-tune as `arguments` say, report to `say` and to tensorboard in the run's folder; exit status 2 for bad settings or files."""
    try:
        config = from_arguments(ReinforceConfig, arguments, configs, "reinforce")
        policy, header = load_policy(Path(config.checkpoint), check_device(config.device))
        notes = {**header, "reinforced_by": "python reinforce.py " + " ".join(arguments), "reinforced_commit": commit()}
        for progress in log_to_tensorboard(config.out, reinforce(policy.requires_grad_(True), config, notes), log):
            say(line(progress))
    except (ConfigError, ValueError, OSError, NotFinite) as error:
        sys.stderr.write(f"reinforce: {error}\n")
        return 1 if isinstance(error, NotFinite) else 2
    return 0


def log(writer: Any, progress: Progress) -> None:
    """All numbers against steps."""
    groups = {"train": progress.train, "val": progress.val, "run": {"programs_per_second": progress.programs_per_second}}
    for group, values in groups.items():
        for name, value in values.items():
            writer.add_scalar(f"{group}/{name}", value, progress.step)


def line(progress: Progress) -> str:
    """One line for people."""
    val = " ".join(f"{name} {value:.3f}" for name, value in progress.val.items())
    train = f", sampled reward {progress.train['reward']:.3f}, {progress.programs_per_second:.0f} programs/s" if progress.train else ""
    mark = " *" if progress.best else ""
    return f"step {progress.step}: val {val}{train}{mark}{f', stopped: {progress.stop}' if progress.stop else ''}"
