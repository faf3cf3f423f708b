"""The program that a person has in hand: edited, undone, selected. What runs for it is another matter (`session`)."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from imdim.app.lab import edits
from imdim.app.lab.edits import ConstrainedProgram, LabEditError
from imdim.app.lab.naming import name_as_it_is
from imdim.app.lab.parameters import hold_value, list_parameters, read_number, report_edit, set_value, untie_name
from imdim.app.lab.state import History, ParameterEdit, State
from imdim.export.delivered import EditError
from imdim.program.constraints import ConstraintError
from imdim.program.front import Choice
from imdim.reconstruction.config import first_line
from imdim.target.target import frame_meta


class Document:
    """See the module. `changed` is told what changed and must not block: "target", "program", "selection", "run", "front", "notice",
    "names"."""

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
            except (LabEditError, EditError, ConstraintError) as error:
                self._say("error", first_line(error))
                return False
            self._commit(what, after)
        return True

    def set_parameter(self, name: str, text: str, strict: bool = False) -> None:
        """A name at another value, as a person typed it. What the edit does to the solid is told by `report`."""
        with self.lock:
            before = self.theory
            if self.edit(f"parameter {name}", lambda theory: set_value(theory, name, read_number(text), strict)):
                if before is not None and self.theory is not None and self.theory is not before:
                    self.state.edited = ParameterEdit(f"{name} = {read_number(text):g}", before, self.theory)
                return
            self.state.refused += 1
        self.changed("names")

    def report(self) -> ParameterEdit | None:
        """Say what the last edit of a parameter did to the solid, and return it; nothing where another one came since."""
        with self.lock:
            edit, self.state.edited = self.state.edited, None
        if edit is None or edit.before.names is None or edit.after.names is None:
            return None
        lost = len(edit.before.constraints) - len(edit.after.constraints)
        changed, line = report_edit(edit.before.names.delivered, edit.after.names.delivered, max(lost, 0))
        with self.lock:
            if self.theory is not edit.after:
                return None
            self._say("warning" if changed else "info", f"{edit.what}: {line}")
        return edit

    def hold_parameter(self, number: int) -> None:
        """Have the solver keep what the row with that number says, or let it go."""
        with self.lock:
            rows = [] if self.theory is None else list_parameters(self.theory)
            if number < len(rows) and rows[number].locks:
                self.edit("lock", lambda theory: hold_value(theory, rows[number]))

    def untie_parameter(self, number: int) -> None:
        """Give each feature that shares the name of that row one of its own."""
        with self.lock:
            rows = [] if self.theory is None else list_parameters(self.theory)
            if number < len(rows) and rows[number].tied:
                name = rows[number].name
                if self.edit(f"untie {name}", lambda theory: untie_name(theory, name)):
                    self._say("info", f"{name} is untied: each feature has a name of its own")

    def give_names(self) -> None:
        """Names for the program in hand, which takes its time where it is long."""
        with self.lock:
            theory, target = self.history.theory, self.state.target
            if theory is None or target is None or self.state.live is not None or theory.names is not None:
                return
        named = name_as_it_is(theory.program, theory.constraints, theory.edges, frame_meta(target))
        with self.lock:
            if self.history.theory is not theory:
                return
            self.history.name(named)
        self.changed("names")

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
