"""What the 3D view shows: from where, cut open where, and which layers."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import viser

from imdim.app.lab import renderers
from imdim.app.lab.camera import STANDARD_VIEWS
from imdim.app.lab.handle_view import HandleView
from imdim.app.lab.input_queue import InputQueue
from imdim.app.lab.section import Section
from imdim.app.lab.style import GREY
from imdim.app.lab.view import LAYERS, SceneView
from imdim.program.constraints import AXES

NONE = "nothing"
HINTS: Mapping[str, str] = {
    "Original": "The mesh of the file, beside the solid",
    "Points": "The points of a cloud",
    "Distance map": "How far the part is from the solid",
    "Relations": "Centres, and lines between what is related",
}


class ShowPanel:
    """Where the view is from, its section and its layers. `changed` is told of the distance map, `cut` of the section."""

    def __init__(
        self,
        gui: viser.GuiApi,
        view: SceneView,
        handles: HandleView,
        queue: InputQueue,
        changed: Callable[[], None],
        cut: Callable[[], None],
    ) -> None:
        self._view, self._queue, self._changed, self._cut = view, queue, changed, cut
        self._from = gui.add_button_group("Look from", tuple(STANDARD_VIEWS), hint="Keys 0 to 6")
        queue.press(self._from, view.camera.look)
        with gui.add_folder("Section"):
            self.across = gui.add_dropdown("Cut across", (NONE, *AXES), hint="Key I")
            self.share = gui.add_slider("At", 0.0, 1.0, 0.01, 0.5, hint="Of the part's extent")
            self.other = gui.add_checkbox("Other half", False)
            self._place = gui.add_html("")
        for box in (self.across, self.share, self.other):
            queue.watch(box, lambda _: self._cut_open())
        self._boxes = {layer: gui.add_checkbox(layer, shown, hint=HINTS.get(layer)) for layer, shown in LAYERS.items()}
        for layer, box in self._boxes.items():
            queue.watch(box, lambda on, layer=layer: self._switch(layer, on))
        queue.watch(gui.add_checkbox("Handles", True, hint="Arrows that move the selected primitive, knobs that resize it"), handles.show)
        self._grid, self.scale = gui.add_html(""), gui.add_html("")
        queue.watch(gui.add_checkbox("Turn slowly", False), view.camera.turn)
        queue.press(gui.add_button("Show the whole part", color=GREY), lambda _: view.camera.look())

    def _switch(self, layer: str, on: bool) -> None:
        self._view.show(layer, on)
        if layer == "Distance map" and on:
            self._changed()

    def section(self) -> Section | None:
        """The section that is asked for."""
        if self.across.value == NONE:
            return None
        return Section(AXES.index(self.across.value), self.share.value, self.other.value)

    def say_section(self, section: Section, level: float, unit: str) -> None:
        """Where the part is cut open."""
        self._place.content = renderers.note(f"cut at {AXES[section.axis]} = {level:.5g} {unit}")

    def toggle_section(self) -> None:
        """Cut open across y, or whole, by key."""
        self.across.value = NONE if self.across.value != NONE else "y"
        self._cut_open()

    def _cut_open(self) -> None:
        if self.across.value == NONE:
            self._place.content = ""
        self._cut()

    def say_grid(self, step: float, unit: str) -> None:
        """How far the lines of the grid are apart."""
        self._grid.content = renderers.note(f"The lines of the grid are {step:g} {unit} apart.")

    def toggle(self, layer: str) -> None:
        """On where it is off, by key."""
        on = not self._view.shown[layer]
        self._queue.show(self._boxes[layer], on)
        self._switch(layer, on)
