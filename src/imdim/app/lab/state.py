"""What a client's lab holds beside its history, and what it may be given."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import PurePosixPath

from imdim.app.lab.edits import ConstrainedProgram
from imdim.program.front import Choice
from imdim.program.tree import Program
from imdim.target.target import Target

MiB = 1 << 20


@dataclass(frozen=True)
class UploadLimits:
    """What a client may upload: `size` in bytes; clouds are thinned to `points`."""

    size: int = 64 * MiB
    points: int = 100_000


@dataclass(frozen=True)
class CurvePoint:
    """One point of the curves: seconds of the run, error, primitives, largest violation of a constraint."""

    seconds: float
    error: float
    primitives: int
    violation: float


@dataclass
class State:
    """What the page draws. `live` is the program of a run that goes on; `seen` are programs that it went through, with their errors."""

    target: Target | None = None
    live: ConstrainedProgram | None = None
    selected: int | None = None
    stage: str = ""
    task: str = ""
    stop: str = ""
    proof: str = ""  # what a run says of its program `proved`
    proved: Program | None = None
    notice: tuple[str, str] = ("", "")  # "info" or "error", and one line
    trace: list[CurvePoint] = field(default_factory=list)
    seen: list[Choice] = field(default_factory=list)
    front: tuple[Choice, ...] = ()


def printable_name(name: str) -> str:
    """A file's name as it is said back: its last part, printable, not too long. It is never a path."""
    last = PurePosixPath(name.replace("\\", "/")).name
    plain = "".join(c if c.isprintable() and c not in "<>&\"'`" else "_" for c in last)
    return plain[-80:] or "upload"
