"""The program that a person has in hand: edited, undone, selected. What runs for it is another matter (`session`)."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from imdim.app.lab import edits
from imdim.app.lab.edits import ConstrainedProgram, LabEditError
from imdim.app.lab.state import History, State
from imdim.program.constraints import ConstraintError
from imdim.program.front import Choice
from imdim.reconstruction.config import first_line


class Document:
    """See the module. `changed` is told what changed and must not block: "target", "program", "selection", "run", "front", "notice"."""

    def __init__(self, changed: Callable[..., None]) -> None:
        self.changed = changed
        self.history, self.state = History(), State()
        self.lock = threading.RLock()

    @property
    def theory(self) -> ConstrainedProgram | None:
        """The program that is shown: that of a run that goes on, else the person's."""
        return self.state.live or self.history.theory

    def edit(self, what: str, change: Callable[[ConstrainedProgram], ConstrainedProgram]) -> bool:
        """Change the theory; what cannot be is said, and nothing changes. A run that goes on keeps its own program."""
        with self.lock:
            theory = self._program_to("edit")
            if theory is None:
                return False
            try:
                after = change(theory)
            except (LabEditError, ConstraintError) as error:
                self._say("error", first_line(error))
                return False
            self._commit(what, after)
        return True

    def add(self, op: Any, part: Any) -> None:
        """One more primitive, the first one too."""
        with self.lock:
            self._commit("add", edits.with_added(self.theory, op, part))
            self.state.selected = self._size() - 1 - len(self.theory.edges if self.theory else ())
        self.changed("selection")

    def load(self, choice: Choice) -> None:
        """A program of the front or of the strip becomes the person's."""
        with self.lock:
            theory = self.theory
            is_same = theory is not None and theory.program == choice.program
            edges = theory.edges if theory is not None and is_same else ()
            self._commit("choice", ConstrainedProgram(choice.program, edges=edges, knows_edges=is_same))

    def undo(self) -> None:
        self._step_history(self.history.undo)

    def redo(self) -> None:
        self._step_history(self.history.redo)

    def select(self, leaf: int | None) -> None:
        """A primitive by its number, a feature of edges by a number after those, or nothing."""
        with self.lock:
            self.state.selected = leaf if leaf is not None and 0 <= leaf < self._size() else None
        self.changed("selection")

    def _commit(self, what: str, theory: ConstrainedProgram) -> None:
        self.state.live = None
        self.history.push(what, theory, time.monotonic())
        self.state.notice = ("info", "")
        self._forget_selection()
        self.changed("program", "notice")

    def _step_history(self, move: Callable[[], str | None]) -> None:
        with self.lock:
            self._keep_live(self.state.task)
            move()
            self._forget_selection()
        self.changed("program", "run")

    def _forget_selection(self) -> None:
        if self.state.selected is not None and self.state.selected >= self._size():
            self.state.selected = None

    def _size(self) -> int:
        return self.theory.size if self.theory else 0

    def _program_to(self, what: str) -> ConstrainedProgram | None:
        """The program that is shown; where there is none, that is said."""
        if self.theory is None:
            self._say("error", f"there is no program to {what}")
        return self.theory

    def _keep_live(self, what: str) -> None:
        """What a run found becomes the person's program, as one step that can be undone."""
        live, self.state.live = self.state.live, None
        if live is not None:
            self.history.push(what, live)

    def _say(self, kind: str, line: str) -> None:
        self.state.notice = (kind, line)
        self.changed("notice")
