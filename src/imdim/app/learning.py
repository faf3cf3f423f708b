"""The commands that train, behind a check that what they need is installed."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Literal

from imdim.reconstruction.config import LEARNING, ConfigError, require_extra

BAD_SETTINGS, INTERRUPTED = 2, 130


def run(name: Literal["pretrain", "reinforce"], arguments: Sequence[str], configs: Path, say: Callable[[str], object]) -> int:
    """The exit status of the command; 2, with one line on stderr, also where the extra [learn] is not installed, and 130 where it was
    interrupted: what was saved stays."""
    try:
        require_extra("learn", f"{name}.py", *LEARNING, "hydra", "tensorboard")
    except ConfigError as error:
        sys.stderr.write(f"{name}: {error}\n")
        return BAD_SETTINGS
    try:
        return import_module(f"imdim.app.{name}").main(arguments, configs, say)
    except KeyboardInterrupt:
        sys.stderr.write(f"{name}: interrupted\n")
        return INTERRUPTED
