"""Reconstruct a part: an example, the settings of a run, and its buttons."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import viser

from imdim.app.lab.examples import NAMES
from imdim.app.lab.input_queue import InputQueue
from imdim.app.lab.resume import Rates
from imdim.app.lab.session import Session
from imdim.app.lab.style import BLUE, GREY
from imdim.reconstruction.methods import METHODS

NONE = "none"


class RunPanel:
    """See the module."""

    def __init__(self, gui: viser.GuiApi, session: Session, ear: InputQueue) -> None:
        self._session, self._ear = session, ear
        self.example = gui.add_dropdown("Example", (NONE, *NAMES))
        ear.hear(self.example, self._open)
        self.start = self._button(gui, "Start", lambda: session.start(self.settings()), BLUE)
        with gui.add_folder(None):
            self.go = gui.add_button_group("Run", ("Pause", "Resume", "Step", "Stop"))
            ear.press(self.go, self._on_press)
        with gui.add_folder("Settings"):
            self.method = gui.add_dropdown("Method", tuple(METHODS), hint="auto searches, proves and repairs; evolve breeds")
            self.budget = gui.add_number("Seconds", 60.0, min=1.0, max=3600.0, step=1.0, hint="Time budget; a pause does not count")
            self.price = gui.add_number("Lambda", 2.5e-4, min=1e-6, max=0.5, step=1e-5, hint="Price of a primitive, a share of the volume")
            self.seed = gui.add_number("Seed", 0, min=0, max=2**31 - 1, step=1)
        with gui.add_folder("Evolve from here", expand_by_default=False):
            self.mutation = gui.add_slider("Mutation", 0.0, 1.0, 0.05, Rates.mutation, hint="Share of children mutated; others crossed")
            self.elitism = gui.add_slider("Elitism", 0.0, 1.0, 0.05, Rates.elitism, hint="Share of parents from the fitter half")
            self.population = gui.add_number("Population", Rates.population, min=8, max=512, step=8)
            self.tolerance = gui.add_number("Tolerance", Rates.tolerance, min=1e-6, max=0.1, step=1e-5, hint="Error that is good enough")
            self._button(gui, "Continue from this program", lambda: session.go_on(self.settings(), self.rates()))

    def _button(self, gui: viser.GuiApi, label: str, call: Callable[[], None], color: tuple[int, int, int] = GREY) -> viser.GuiButtonHandle:
        button = gui.add_button(label, color=color)
        self._ear.press(button, lambda _: call())
        return button

    def _open(self, name: str) -> None:
        if name != NONE:
            self._session.open_example(name)

    def draw(self, part: str) -> None:
        """The example that is open, none where a file is: the browser tells of a choice only where it changes one."""
        self._ear.show(self.example, part if part in NAMES else NONE)

    def _on_press(self, what: str) -> None:
        {"Pause": self._session.pause, "Resume": self._session.resume, "Step": self.step, "Stop": self._session.stop}[what]()

    def step(self) -> None:
        """One snapshot further; starts a run where there is none."""
        if not self._session.running:
            self._session.start(self.settings())
        self._session.step()

    def settings(self) -> dict[str, Any]:
        """Values of Settings as they stand on the page."""
        return {
            "method": self.method.value,
            "budget_s": float(self.budget.value),
            "size_weight": float(self.price.value),
            "seed": int(self.seed.value),
        }

    def rates(self) -> Rates:
        return Rates(self.mutation.value, self.elitism.value, int(self.population.value), float(self.tolerance.value))
