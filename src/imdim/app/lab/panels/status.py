"""The state of the run in words, and the way in for files; above the tabs, so that both are always there."""

from __future__ import annotations

import html

import viser

from imdim.app.lab.input_queue import InputQueue
from imdim.app.lab.session import Session
from imdim.app.lab.style import GREY, MUTED, style

STATES = {"": "ready", "waiting": "waiting for its turn", "running": "running", "paused": "paused"}
SHORT = ("state", "primitives", "volume", "error")  # two of these fit on a line
NOTICE = 37  # pixels of a message of one line, kept free: what stands below must not move while somebody reaches for it
HINT = "Or drop it anywhere on the page: STL, OBJ, OFF, PLY, 3MF, GLB, XYZ, TXT, CSV, PCD, NPY, NPZ"


class StatusPanel:
    """See the module."""

    def __init__(self, gui: viser.GuiApi, session: Session, ear: InputQueue) -> None:
        self._session = session
        gui.add_html(style())
        self._text = gui.add_html("")
        upload = gui.add_upload_button("Open a file", hint=HINT, color=GREY)
        upload.on_upload(lambda event: ear.do(lambda file=event.target.value: session.open_upload(file.name, file.content)))

    def draw(self, lines: list[tuple[str, str]], notice: tuple[str, str]) -> None:
        """The state of the run, name and value a line, and the last message."""
        state = STATES[self._session.running]
        if self._session.running == "waiting":
            state += f", {self._session.waiting_behind} before it"
        rows = "".join(_row(name, value) for name, value in [("state", state), *lines])
        table = f'<table class="lab-status" style="width:100%;color:#212529"><tbody>{rows}</tbody></table>'
        self._text.content = f'<div style="padding:6px 12px 8px;font-size:13px;line-height:1.45">{table}{_notice_html(*notice)}</div>'


def _row(name: str, value: str) -> str:
    wide = "" if name in SHORT else ' class="wide"'
    text = html.escape(value)
    return f'<tr{wide}><td style="color:{MUTED}">{name}</td><td title="{text}"><b>{text}</b></td></tr>'


def _notice_html(kind: str, line: str) -> str:
    tint = "color:#a61e1e;background:#fff0f0" if kind == "error" else "color:#0b5345;background:#e8f7f1"
    box = f'<div class="lab-notice" style="{tint};border-radius:6px;padding:6px 8px;margin:6px 0 0">{html.escape(line)}</div>'
    return f'<div role="alert" style="min-height:{NOTICE}px">{box if line else ""}</div>'
