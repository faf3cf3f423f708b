"""Download the part, in every format."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import viser

from imdim.app.lab import renderers
from imdim.app.lab.downloads import Files
from imdim.app.lab.input_queue import InputQueue
from imdim.app.lab.panels.buttons import enable
from imdim.app.lab.session import Session
from imdim.app.lab.style import GREY
from imdim.target.readers import FORMATS as READABLE

FORMATS: Mapping[str, str] = {
    "JSON": "program.json",
    "OpenSCAD": "program.scad",
    "STEP": "program.step",
    "build123d": "program.py",
    "CadQuery": "program.cq.py",
    "FreeCAD": "program.FCMacro",
    "STL": "mesh.stl",
    "GLB": "mesh.glb",
    "3MF": "mesh.3mf",
    "PNG": "preview.png",
    "HTML report": "report.html",
}


FORMATS_READ = frozenset(name.removeprefix(".") for name in READABLE)
_ENDINGS: Mapping[str, str] = {"program.py": ".build123d.py", "program.cq.py": ".cadquery.py"}


class TakePanel:
    """Downloads. All files come from one delivery, as `imdim fit` writes them."""

    def __init__(self, client: viser.ClientHandle, session: Session, queue: InputQueue) -> None:
        self._client, self._session = client, session
        text = "The files are made together, which takes some seconds the first time."
        client.gui.add_html(renderers.note(text))
        self._buttons = {label: client.gui.add_button(f"Download {label}", color=GREY, disabled=True) for label in FORMATS}
        for label, button in self._buttons.items():
            queue.press(button, lambda _, label=label: self.take(label))

    def draw_state(self) -> None:
        """There is something to download where there is a program."""
        for button in self._buttons.values():
            enable(button, self._session.theory is not None)

    def take(self, label: str) -> None:
        """Send the file of one format once it is there."""
        name = FORMATS[label]

        def send(files: Files) -> None:
            if name not in files:
                self._client.add_notification("Not available", f"{name} could not be made: report.json says why", color="red")
                return
            self._client.send_file_download(file_name(part, name), files[name], save_immediately=True)

        target = self._session.state.target
        part = "part" if target is None else target.name
        self._session.files(send)


def file_name(part: str, name: str) -> str:
    """What a file of a part is called on the person's disk: "bracket.scad" for "program.scad" of "bracket.stl"."""
    stem = re.sub(r"[^\w.-]+", "_", Path(part).stem if Path(part).suffix[1:].lower() in FORMATS_READ else part).strip("_.")
    return f"{stem or 'part'}{_ENDINGS.get(name, Path(name).suffix)}"
