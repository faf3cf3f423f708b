"""Reconstruct a part: the state of the run in words, the way in for files, an example, the settings of a run, and its buttons."""

from __future__ import annotations

import html
import json
from collections.abc import Callable
from typing import Any

import viser

from imdim.app.lab.examples import NAMES
from imdim.app.lab.input_queue import InputQueue
from imdim.app.lab.panels.buttons import enable, offer
from imdim.app.lab.resume import Rates
from imdim.app.lab.session import Session
from imdim.app.lab.style import BLUE, GREY, MUTED, NOTHING, style
from imdim.app.lab.table import SCRIPT
from imdim.program.units import READ_AS
from imdim.reconstruction.config import LANGUAGES, Settings
from imdim.reconstruction.methods import METHODS

NONE = "none"
STATES = {"": "ready", "waiting": "waiting for its turn", "running": "running", "paused": "paused"}
OFFERED = {"": ("Step",), "waiting": ("Stop",), "running": ("Pause", "Stop"), "paused": ("Resume", "Stop", "Step")}
SHORT = ("state", "primitives", "features", "volume")  # two of these fit on a line
TINTS = {
    "": "",
    "error": "color:#a61e1e;background:#fff0f0",
    "warning": "color:#7a4100;background:#fff4e0",
    "info": "color:#0b5345;background:#e8f7f1",
}
NOTICE = 37  # pixels of a message of one line, kept free: what stands below must not move while somebody reaches for it
HINT = "Or drop it anywhere on the page: STL, OBJ, OFF, PLY, 3MF, GLB, XYZ, TXT, CSV, PCD, NPY, NPZ"


class RunPanel:
    """The settings and buttons of a run."""

    def __init__(self, gui: viser.GuiApi, session: Session, queue: InputQueue) -> None:
        self._session, self._queue = session, queue
        self.example = gui.add_dropdown("Example", (NONE, *NAMES))
        queue.watch(self.example, self._open)
        self.start = self._button(gui, "Start", lambda: session.start(self.settings()), BLUE)
        with gui.add_folder(None):
            self.go = gui.add_button_group("Run", OFFERED[""])
            queue.press(self.go, self._on_press)
        with gui.add_folder("Settings"):
            self.method = gui.add_dropdown("Method", tuple(METHODS), hint="auto searches, proves and repairs; evolve changes at random")
            self.language = gui.add_dropdown(
                "Language", LANGUAGES, initial_value=Settings.language, hint="cad: primitives and outlines; csg: the six primitives alone"
            )
            self.budget = gui.add_number("Seconds", 60.0, min=1.0, max=3600.0, step=1.0, hint="Time budget; a pause does not count")
            self.price = gui.add_number(
                "Complexity price", 2.5e-4, min=1e-6, max=0.5, step=1e-5, hint="What one more primitive must gain, as a share of the volume"
            )
            self.seed = gui.add_number("Random seed", 0, min=0, max=2**31 - 1, step=1, hint="The same seed gives the same result")
            self.units = gui.add_dropdown("Units", READ_AS, hint="What the lengths of the file are; they become mm, and a run starts anew")
            queue.watch(self.units, session.set_units)
        with gui.add_folder("Search on from here", expand_by_default=False):
            self.mutation = gui.add_slider("Random changes", 0.0, 1.0, 0.05, Rates.mutation, hint="Share of new programs; others mix two")
            self.elitism = gui.add_slider("Best first", 0.0, 1.0, 0.05, Rates.elitism, hint="Share that comes of the better half")
            self.population = gui.add_number("Programs at once", Rates.population, min=8, max=512, step=8)
            self.tolerance = gui.add_number("Good enough", Rates.tolerance, min=1e-6, max=0.1, step=1e-5, hint="Error, of the part's size")
            self._on = self._button(gui, "Search on from this program", lambda: session.go_on(self.settings(), self.rates()))

    def _button(self, gui: viser.GuiApi, label: str, call: Callable[[], None], color: tuple[int, int, int] = GREY) -> viser.GuiButtonHandle:
        button = gui.add_button(label, color=color)
        self._queue.press(button, lambda _: call())
        return button

    def _open(self, name: str) -> None:
        if name != NONE:
            self._session.open_example(name)

    def draw(self, part: str, units: str) -> None:
        """The example that is open, none where a file is: the browser tells of a choice only where it changes one. And its units."""
        self._queue.show(self.example, part if part in NAMES else NONE)
        self._queue.show(self.units, units)

    def draw_state(self) -> None:
        """What the buttons can do now."""
        offer(self.go, OFFERED[self._session.running])
        enable(self._on, self._session.theory is not None)

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
            "language": self.language.value,
            "budget_s": float(self.budget.value),
            "size_weight": float(self.price.value),
            "seed": int(self.seed.value),
        }

    def rates(self) -> Rates:
        return Rates(self.mutation.value, self.elitism.value, int(self.population.value), float(self.tolerance.value))


class StatusPanel:
    """State and way in stand above the tabs, so that both are always there."""

    """See the module."""

    def __init__(self, gui: viser.GuiApi, session: Session, queue: InputQueue) -> None:
        self._session = session
        gui.add_html(style(SCRIPT))
        self._text, self._title = gui.add_html(""), gui.add_html("")
        upload = gui.add_upload_button("Open a file", hint=HINT, color=GREY)
        upload.on_upload(lambda event: queue.do(lambda file=event.target.value: session.open_upload(file.name, file.content)))

    def draw(self, part: str, lines: list[tuple[str, str]], notice: tuple[str, str]) -> None:
        """The state of the run, name and value a line, and the last message; the tab of the browser is called by the part."""
        title = html.escape(f"document.title={json.dumps(f'{part} - IMDIM lab' if part else 'IMDIM lab')}", quote=True)
        self._title.content = f'<img alt="" src="{NOTHING}" style="display:none" onload="{title}">'
        state = STATES[self._session.running]
        if self._session.running == "waiting":
            state += f", {self._session.waiting_behind} before it"
        rows = "".join(_row(name, value) for name, value in [("state", state), *lines])
        table = f'<table class="lab-status" style="width:100%;color:#212529"><tbody>{rows}</tbody></table>'
        self._text.content = f'<div style="padding:6px 12px 8px;font-size:13px;line-height:1.45">{table}{_said(*notice)}</div>'


def _row(name: str, value: str) -> str:
    wide = "" if name in SHORT else ' class="wide"'
    text = html.escape(value)
    return f'<tr{wide}><td style="color:{MUTED}">{name}</td><td title="{text}"><b>{text}</b></td></tr>'


def _said(kind: str, line: str) -> str:
    tint = TINTS[kind]
    box = f'<div class="lab-notice" style="{tint};border-radius:6px;padding:6px 8px;margin:6px 0 0">{html.escape(line)}</div>'
    return f'<div role="alert" style="min-height:{NOTICE}px">{box if line else ""}</div>'
