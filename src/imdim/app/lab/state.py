"""What a client's lab holds: undo and redo, a row of theories and the place in it; what else the page draws; and what it may be given."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import PurePosixPath

from imdim.app.lab.edits import ConstrainedProgram
from imdim.app.lab.naming import NamedProgram
from imdim.program.front import Choice
from imdim.program.tree import Program
from imdim.target.target import Target

MiB = 1 << 20
MOST = 200  # steps that can be undone
ONE_EDIT_S = 1.5  # keystrokes in one number that follow each other within it are one edit


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


@dataclass(frozen=True, eq=False)
class ParameterEdit:
    """What a person set, in words, and the theories before and after it."""

    what: str
    before: ConstrainedProgram
    after: ConstrainedProgram


@dataclass
class State:
    """What the page draws. `live` is the program of a run that goes on; `seen` are programs that it went through, with their errors.

    `edited` is the last edit of a parameter until it is reported; `refused` counts what was typed in vain."""

    target: Target | None = None
    units: str = "auto"  # what its file's lengths were read as
    live: ConstrainedProgram | None = None
    selected: int | None = None
    stage: str = ""
    task: str = ""
    stop: str = ""
    proof: str = ""  # what a run says of its program `proved`
    proved: Program | None = None
    notice: tuple[str, str] = ("", "")  # "info", "warning" or "error", and one line
    trace: list[CurvePoint] = field(default_factory=list)
    seen: list[Choice] = field(default_factory=list)
    front: tuple[Choice, ...] = ()
    edited: ParameterEdit | None = None
    refused: int = 0


def printable_name(name: str) -> str:
    """A file's name as it is said back: its last part, printable, not too long. It is never a path."""
    last = PurePosixPath(name.replace("\\", "/")).name
    plain = "".join(c if c.isprintable() and c not in "<>&\"'`" else "_" for c in last)
    return plain[-80:] or "upload"


@dataclass
class History:
    """`revision` counts every change, undone ones too."""

    revision: int = 0
    _past: list[tuple[str, ConstrainedProgram]] = field(default_factory=list)
    _future: list[tuple[str, ConstrainedProgram]] = field(default_factory=list)
    _last: tuple[str, float] = ("", 0.0)

    @property
    def can_redo(self) -> bool:
        return bool(self._future)

    @property
    def theory(self) -> ConstrainedProgram | None:
        """The present one, None before the first."""
        return self._past[-1][1] if self._past else None

    @property
    def can_undo(self) -> bool:
        return len(self._past) > 1

    def push(self, what: str, theory: ConstrainedProgram, now: float = 0.0) -> None:
        """The next theory. One that continues the same edit takes the place of the one before, so that undo takes the whole edit back."""
        shown = self.theory
        if shown is not None and shown == theory and theory.named in (None, shown.named):
            return
        is_soon = what.startswith("drag ") or (what.startswith("number ") and now - self._last[1] < ONE_EDIT_S)
        if is_soon and self._last[0] == what and self.can_undo:
            self._past.pop()
        self._past = [*self._past, (what, theory)][-MOST:]
        self._future.clear()
        self._last = (what, now)
        self.revision += 1

    def name(self, named: NamedProgram) -> None:
        """The present theory with names, which is no step."""
        what, theory = self._past[-1]
        self._past[-1] = what, replace(theory, named=named)

    def undo(self) -> str | None:
        """Back by one; what was undone, None where nothing can be."""
        if not self.can_undo:
            return None
        self._future.append(self._past.pop())
        return self._moved(self._future[-1][0])

    def redo(self) -> str | None:
        if not self._future:
            return None
        self._past.append(self._future.pop())
        return self._moved(self._past[-1][0])

    def _moved(self, what: str) -> str:
        self._last = ("", 0.0)
        self.revision += 1
        return what
