"""Undo and redo: a row of theories and the place in it."""

from __future__ import annotations

from dataclasses import dataclass, field

from imdim.app.lab.edits import ConstrainedProgram

MOST = 200  # steps that can be undone
ONE_EDIT_S = 1.5  # keystrokes in one number that follow each other within it are one edit


@dataclass
class History:
    """`revision` counts every change, undone ones too."""

    revision: int = 0
    _past: list[tuple[str, ConstrainedProgram]] = field(default_factory=list)
    _future: list[tuple[str, ConstrainedProgram]] = field(default_factory=list)
    _last: tuple[str, float] = ("", 0.0)

    @property
    def theory(self) -> ConstrainedProgram | None:
        """The present one, None before the first."""
        return self._past[-1][1] if self._past else None

    @property
    def can_undo(self) -> bool:
        return len(self._past) > 1

    def push(self, what: str, theory: ConstrainedProgram, now: float = 0.0) -> None:
        """The next theory. One that continues the same edit takes the place of the one before, so that undo takes the whole edit back."""
        if self.theory == theory:
            return
        same = what.startswith("number ") and self._last[0] == what and now - self._last[1] < ONE_EDIT_S and self.can_undo
        if same:
            self._past.pop()
        self._past = [*self._past, (what, theory)][-MOST:]
        self._future.clear()
        self._last = (what, now)
        self.revision += 1

    def undo(self) -> str | None:
        """Back by one; what was undone, None where nothing can be."""
        if not self.can_undo:
            return None
        self._future.append(self._past.pop())
        return self._note_move(self._future[-1][0])

    def redo(self) -> str | None:
        if not self._future:
            return None
        self._past.append(self._future.pop())
        return self._note_move(self._past[-1][0])

    def _note_move(self, what: str) -> str:
        self._last = ("", 0.0)
        self.revision += 1
        return what
