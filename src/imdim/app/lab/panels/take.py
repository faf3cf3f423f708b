"""Take the part away, in every format; and what the 3D view shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import viser

from imdim.app.lab import renderers
from imdim.app.lab.downloads import Files
from imdim.app.lab.input_queue import InputQueue
from imdim.app.lab.session import Session
from imdim.app.lab.style import GREY
from imdim.app.lab.view import LAYERS, SceneView
from imdim.program import codec

FORMATS: Mapping[str, str] = {
    "JSON": "program.json",
    "OpenSCAD": "program.scad",
    "STEP": "program.step",
    "build123d": "program.py",
    "CadQuery": "program.cq.py",
    "STL": "mesh.stl",
    "GLB": "mesh.glb",
    "3MF": "mesh.3mf",
    "PNG": "preview.png",
    "HTML report": "report.html",
}


class TakePanel:
    """Downloads. All files come from one delivery, as `imdim fit` writes them."""

    def __init__(self, client: viser.ClientHandle, session: Session, ear: InputQueue, units: Callable[[], str]) -> None:
        self._client, self._session, self._units = client, session, units
        text = "The files are made together, which takes some seconds the first time."
        client.gui.add_html(renderers.note(text))
        for label in FORMATS:
            ear.press(client.gui.add_button(f"Download {label}", color=GREY), lambda _, label=label: self.take(label))

    def take(self, label: str) -> None:
        """Send the file of one format once it is there."""
        name = FORMATS[label]

        def send(files: Files) -> None:
            if name not in files:
                self._client.add_notification("Not available", f"{name} could not be made: report.json says why", color="red")
                return
            data = in_units(files[name], self._units()) if name == "program.json" else files[name]
            self._client.send_file_download(name, data, save_immediately=True)

        self._session.files(send)


def in_units(document: bytes, units: str) -> bytes:
    """A program.json that says what its lengths are."""
    parsed = codec.parse(document)
    meta = codec.meta_of(parsed)
    named = codec.Meta(units, meta.center, meta.scale)
    program, folded, edges = codec.from_json(parsed), codec.read_folded(parsed), codec.edges_of(parsed)
    return codec.dumps(program, named, codec.constraints_of(parsed), folded, edges).encode()


class ShowPanel:
    """Layers of the view."""

    def __init__(self, gui: viser.GuiApi, view: SceneView, ear: InputQueue, changed: Callable[[], None]) -> None:
        self._view, self._ear, self._changed = view, ear, changed
        self._boxes = {layer: gui.add_checkbox(layer, shown) for layer, shown in LAYERS.items()}
        for layer, box in self._boxes.items():
            ear.hear(box, lambda on, layer=layer: self._switch(layer, on))
        self.scale = gui.add_html("")
        ear.hear(gui.add_checkbox("Turn slowly", False), view.turn)
        ear.press(gui.add_button("Show the whole part", color=GREY), lambda _: view.look())

    def _switch(self, layer: str, on: bool) -> None:
        self._view.show(layer, on)
        if layer == "Distance map" and on:
            self._changed()

    def toggle(self, layer: str) -> None:
        """On where it is off, by key."""
        on = not self._view.shown[layer]
        self._ear.show(self._boxes[layer], on)
        self._switch(layer, on)
