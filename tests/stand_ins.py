"""Scripts that stand in for commands that a batch starts, the file in which they log what they do, and waiting until they have."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path


def stand_in_for(folder: Path, script: str, **given: object) -> list[str]:
    """The command that runs `script`, which finds what is `given` under those names, and the path of `log` under LOG."""
    path = folder / "stand_in.py"
    lines = [f"{name} = {value!r}\n" for name, value in {"LOG": str(folder / "log"), **given}.items()]
    path.write_text("".join(lines) + script)
    return [sys.executable, "-S", str(path)]


def log(folder: Path) -> list[str]:
    """The lines that stand-ins have written so far."""
    path = folder / "log"
    return path.read_text().splitlines() if path.exists() else []


def wait_for(happened: Callable[[], bool], limit_s: float = 60.0) -> None:
    """Return once it has `happened`; a failure after `limit_s`."""
    end = time.monotonic() + limit_s
    while not happened():
        assert time.monotonic() < end, f"not within {limit_s:g} s"
        time.sleep(0.01)
