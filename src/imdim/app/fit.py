"""One reconstruction from the command line: check, load, reconstruct, deliver, say where the results are."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable, Iterator
from os import environ
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

from imdim.app.progress import shown
from imdim.config import ConfigError, Settings

if TYPE_CHECKING:
    import numpy as np

    from imdim.geometry.cloud import Target
    from imdim.pipeline import Snapshot

Reconstruct = Callable[["Target", Settings, "np.random.Generator"], "Iterator[Snapshot]"]

BAD_INPUT = 2
INTERRUPTED = 130


def main(settings_of: Callable[[], Settings], reconstruct: Reconstruct | None = None) -> int:
    """Compose settings and fit; the exit status: 0 fine, 2 for input, settings or an output that cannot be used (one line on stderr)."""
    from imdim.deliver import OutputError
    from imdim.geometry.cloud import InputError

    sys.excepthook = one_line
    try:
        folder, summary = fit(settings_of(), reconstruct)
    except (InputError, ConfigError, OutputError) as error:
        sys.stderr.write(f"imdim: {error}\n")
        return BAD_INPUT
    except KeyboardInterrupt:
        sys.stderr.write("imdim: interrupted, nothing was written\n")
        return INTERRUPTED
    sys.stdout.write(
        f"{summary}\n  picture  {folder / 'preview.png'}\n  program  {folder / 'program.scad'}\n  report   {folder / 'report.json'}\n"
    )
    return 0


def fit(settings: Settings, reconstruct: Reconstruct | None = None) -> tuple[Path, str]:
    """Reconstruct ``settings.input`` into the folder ``settings.output``; returns the folder and a one-line summary.

    Raises ConfigError where input or output is not given, OutputError where the folder cannot be written and InputError
    where the input cannot be used: in each case before anything was written.
    """
    for key in ("input", "output"):
        if not getattr(settings, key):
            raise ConfigError(f"setting {key} is missing: give {key}=...")
    from imdim.deliver import check_writable, deliver

    folder = Path(settings.output)
    check_writable(folder)
    target, snapshots = _start(settings, reconstruct)
    raise NotImplementedError


def one_line(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """An excepthook for defects: one line with the place, or the whole traceback where IMDIM_TRACEBACK is set."""
    if environ.get("IMDIM_TRACEBACK"):
        traceback.print_exception(kind, error, trace)
        return
    frames = traceback.extract_tb(trace)
    place = f" at {Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else ""
    message = next(iter(str(error).splitlines()), "")
    sys.stderr.write(f"imdim: internal error, {kind.__name__}: {message}{place} (set IMDIM_TRACEBACK=1 for the whole trace)\n")
