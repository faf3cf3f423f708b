"""The program to read: as a tree, as code, as a front of programs, and the curves of the run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import viser
from viser import uplot

from imdim.app.lab import texts
from imdim.app.lab.edits import Theory
from imdim.app.lab.session import Session
from imdim.app.lab.state import Step
from imdim.program.front import Choice
from imdim.program.tree import Program

LEAST = 1e-7  # what a curve of logarithms shows of zero


class TreePanel:
    """The program as a tree and as code, in step with each other."""

    def __init__(self, gui: viser.GuiApi, panel: viser.PanelHandle) -> None:
        with panel.add_tab("Program"):
            self._tree = gui.add_html("")
        with panel.add_tab("Code"):
            self._code = gui.add_html("")

    def draw(self, theory: Theory | None, selected: int | None, unit: str) -> None:
        self._tree.content = texts.tree(theory, selected, unit)
        self._code.content = texts.code(theory, selected)


class FrontPanel:
    """Programs as small solids and as points of a plot; what is clicked is loaded."""

    def __init__(self, gui: viser.GuiApi, panel: viser.PanelHandle, session: Session) -> None:
        self._session = session
        self._choices: list[Choice] = []
        with panel.add_tab("Front"):
            self._strip = gui.add_html("")
            self.choice = gui.add_number("Choice", 0, min=0, max=999, step=1, hint="The program to load, numbered as in the pictures")
            self.choice.on_update(lambda event: self._load(int(event.target.value)) if event.client else None)
            self._plot = gui.add_html("")

    def _load(self, number: int) -> None:
        if 1 <= number <= len(self._choices):
            self._session.load(self._choices[number - 1])

    def draw(self, choices: Sequence[Choice], shown: Program | None) -> None:
        self._choices = list(choices)
        now = next((i for i, c in enumerate(choices, 1) if c.program == shown), 0)
        if self.choice.value != now:
            self.choice.value = now
        self._strip.content = texts.strip(choices, shown)
        self._plot.content = texts.front(choices, shown)


class CurvesPanel:
    """Error, primitives and violation of constraints over the seconds of the run."""

    def __init__(self, gui: viser.GuiApi, panel: viser.PanelHandle) -> None:
        names, inks = ("error", "primitives", "violation"), ("#c2255c", "#1864ab", "#2b8a3e")
        self._plots: list[viser.GuiUplotHandle] = []
        with panel.add_tab("Curves"):
            for name, ink in zip(names, inks, strict=True):
                scale = uplot.Scale(distr=3) if name != "primitives" else uplot.Scale()
                series = (uplot.Series(label="seconds"), uplot.Series(label=name, stroke=ink, width=2))
                plot = gui.add_uplot(
                    (np.array([0.0, 1.0]), np.array([1.0, 1.0])),
                    series,
                    title=name,
                    height=150,
                    scales={"x": uplot.Scale(time=False), "y": scale},
                    legend=uplot.Legend(show=False),
                )
                self._plots.append(plot)

    def draw(self, steps: Sequence[Step]) -> None:
        if not steps:
            return
        rows = curves(steps)
        for column, plot in enumerate(self._plots, 1):
            plot.data = (rows[:, 0].copy(), rows[:, column].copy())


def curves(steps: Sequence[Step]) -> np.ndarray:
    """Seconds, error, primitives and violation [n, 4]; one step alone holds from the start, since a single point is no line."""
    rows = np.array([(s.seconds, max(s.error, LEAST), s.primitives, max(s.violation, LEAST)) for s in steps], float)
    return np.concatenate([rows * [0.0, 1.0, 1.0, 1.0], rows]) if len(rows) == 1 else rows
