"""The parameter table: the first panel, what a person changes most."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection

import viser

from imdim.app.lab import renderers
from imdim.app.lab.edits import ConstrainedProgram
from imdim.app.lab.input_queue import InputQueue
from imdim.app.lab.parameters import ParameterRow, list_parameters, picture_edit
from imdim.app.lab.session import Session
from imdim.app.lab.state import ParameterEdit
from imdim.app.lab.table import ACTIONS, parameter_table

NONE_YET = "No program yet: press Start. Its dimensions stand here then, by name."
COMING = "The dimensions get their names when the run is done."
NO_NAMES = "This program has no named dimensions."
STRICT = "Strict"
PICTURE = 140  # pixels of each of two pictures, which the panel has room for
HINT = "Refuse an edit after which the part has other bodies, through-holes or voids"


class ParametersPanel:
    """See the module."""

    def __init__(self, gui: viser.GuiApi, panel: viser.PanelHandle, session: Session, queue: InputQueue) -> None:
        self._session, self._rows = session, list[ParameterRow]()
        self._shown, self._picturing = None, threading.Lock()  # the program of the table; its picture comes from another thread
        with panel.add_tab("Parameters"):
            self._table = gui.add_html(renderers.note(NONE_YET))
            self.strict = gui.add_checkbox(STRICT, False, hint=HINT, visible=False)
            self._picture = gui.add_html("")
        queue.watch(self.strict, lambda _: None)

    def listen(self, gui: viser.GuiApi, queue: InputQueue, show: Callable[[Collection[int]], None]) -> None:
        """Add the inputs by which the page tells of the table, to a place that is always there. `show` gets the features of a row."""
        renderers.add_clicks(gui, "Parameter", queue, self._act)
        renderers.add_texts(gui, "ParameterValue", queue, self._set)
        renderers.add_texts(gui, "ParameterRow", queue, lambda text: show(self._shown_by(text)))

    def _set(self, text: str) -> None:
        name, _, value = text.partition("=")
        self._session.set_parameter(name, value, self.strict.value)

    def _act(self, number: int) -> None:
        row, action = divmod(number, ACTIONS)
        (self._session.untie_parameter if action else self._session.hold_parameter)(row)

    def _shown_by(self, text: str) -> Collection[int]:
        number = int(text) if text.isdecimal() else -1
        return self._rows[number].shown if 0 <= number < len(self._rows) else ()

    def draw(self, theory: ConstrainedProgram | None, selected: int | None, unit: str) -> None:
        """The rows of the program that is shown."""
        with self._picturing:
            if theory is not self._shown:
                self._shown, self._picture.content = theory, ""
        self._rows = [] if theory is None else list_parameters(theory)
        self.strict.visible = bool(self._rows)
        if self._rows:
            self._table.content = parameter_table(self._rows, unit, selected, self._session.state.refused)
        else:
            is_coming = theory is not None and theory.names is None
            self._table.content = renderers.note(NONE_YET if theory is None else COMING if is_coming else NO_NAMES)

    def draw_edit(self, edit: ParameterEdit) -> None:
        """The part before and after an edit below the table, as long as that program is shown. It takes its time."""
        if edit.before.names is None or edit.after.names is None:
            return
        picture = picture_edit(edit.before.names.delivered, edit.after.names.delivered, PICTURE)
        with self._picturing:
            if self._shown is edit.after:
                self._picture.content = renderers.edit_picture(edit.what, picture)
