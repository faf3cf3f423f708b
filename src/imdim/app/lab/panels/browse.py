"""The program to read: as a tree, as code, as a front of programs, and the curves of the run."""

from __future__ import annotations

from collections.abc import Sequence

import viser

from imdim.app.lab import plots, renderers
from imdim.app.lab.edits import ConstrainedProgram
from imdim.app.lab.input_queue import InputQueue
from imdim.app.lab.session import Session
from imdim.app.lab.state import CurvePoint
from imdim.program.front import Choice
from imdim.program.tree import Program


class TreePanel:
    """The program as a tree and as code, in step with each other."""

    def __init__(self, gui: viser.GuiApi, panel: viser.PanelHandle) -> None:
        with panel.add_tab("Program"):
            self._tree = gui.add_html("")
        with panel.add_tab("Code"):
            self._code = gui.add_html("")

    def draw(self, theory: ConstrainedProgram | None, selected: int | None, unit: str) -> None:
        self._tree.content = renderers.tree(theory, selected, unit)
        self._code.content = renderers.code(theory, selected)


class FrontPanel:
    """Programs as small solids and as points of a plot; what is clicked is loaded."""

    def __init__(self, gui: viser.GuiApi, panel: viser.PanelHandle, session: Session, queue: InputQueue) -> None:
        self._session = session
        self._choices: list[Choice] = []
        with panel.add_tab("Alternatives"):
            self._strip = gui.add_html("")
            renderers.add_clicks(gui, "Choice", queue, self._load)
            self._plot = gui.add_html("")

    def _load(self, number: int) -> None:
        if 1 <= number <= len(self._choices):
            self._session.load(self._choices[number - 1])

    def draw(self, choices: Sequence[Choice], shown: Program | None) -> None:
        self._choices = list(choices)
        self._strip.content = renderers.strip(choices, shown)
        self._plot.content = plots.front(choices, shown)


class CurvesPanel:
    """Error, primitives and violation of constraints over the seconds of the run."""

    def __init__(self, gui: viser.GuiApi, panel: viser.PanelHandle) -> None:
        with panel.add_tab("Curves"):
            self._plot = gui.add_html(plots.curves(()))

    def draw(self, steps: Sequence[CurvePoint]) -> None:
        self._plot.content = plots.curves(steps)
