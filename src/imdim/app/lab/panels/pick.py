"""Measure and relate: the faces that were clicked, what lies between them, and the relations that fit, to be chosen in words."""

from __future__ import annotations

import html
import threading
from collections.abc import Callable, Sequence

import viser

from imdim.app.lab import edits, renderers
from imdim.app.lab.drawing import Drawing
from imdim.app.lab.edits import ConstrainedProgram
from imdim.app.lab.fitting_relations import FittingRelation, find_fitting
from imdim.app.lab.input_queue import InputQueue
from imdim.app.lab.measure import Measurement, measure, name_pick
from imdim.app.lab.picks import Pick, is_same_face, pick_face
from imdim.app.lab.relation_words import say_relation
from imdim.app.lab.session import Session
from imdim.app.lab.style import MUTED
from imdim.app.lab.view import Click, SceneView
from imdim.geometry.lowering import lower
from imdim.geometry.pose import Pose
from imdim.program.tree import leaves
from imdim.target.target import Frame

MOST = 12  # faces
HOW = "Click a face in the picture, then others with ctrl held or with Keep picking on: what lies between them and what fits stands here."
KEEP = "Keep picking"
KEEP_HINT = "Each click in the picture adds a face to those that are measured, as with ctrl held"
CHOOSE = "Choose what is to hold:"


class PickPanel:
    """See the module. `chosen` is told the number of a relation that was added, or is there already."""

    def __init__(self, gui: viser.GuiApi, session: Session, queue: InputQueue, view: SceneView, chosen: Callable[[int], None]) -> None:
        self._session, self._view, self._chosen = session, view, chosen
        self._picks: list[Pick] = []
        self._of: ConstrainedProgram | None = None
        self._fitting: list[FittingRelation] = []
        self._lock = threading.RLock()  # a person clicks, and the program changes
        self.keep = gui.add_checkbox(KEEP, False, hint=KEEP_HINT)
        queue.watch(self.keep, lambda _: None)
        self._text = gui.add_html(renderers.note(HOW))

    def click(self, click: Click, scene: Drawing | None, unit: str) -> None:
        """A face was clicked: the first one selects what it belongs to, further ones are measured from there."""
        theory, target = self._session.theory, self._session.state.target
        adds = click.adds or self.keep.value
        if not adds:
            is_selected = self._session.state.selected == click.leaf
            self._session.select(None if is_selected else click.leaf)
        if theory is None or target is None or scene is None:
            return
        frame = Frame.of(target)
        pick = pick_face(theory, scene, frame, click.leaf, click.origin, click.direction)
        with self._lock:
            kept = self._picks if adds and self._of == theory else []
            found = [] if pick is None or (not adds and self._session.state.selected is None) else [pick]
            left = [one for one in kept if not any(is_same_face(one, other) for other in found)]
            self._show([*left, *(found if len(left) == len(kept) else [])][-MOST:], theory, frame, unit)

    def draw(self, theory: ConstrainedProgram | None, unit: str) -> None:
        """The faces of another program are none of this one."""
        with self._lock:
            if theory is None or theory != self._of:
                self.forget(unit)

    def forget(self, unit: str) -> None:
        """No faces."""
        target = self._session.state.target
        with self._lock:
            if self._picks and target is not None:
                self._show([], None, Frame.of(target), unit)

    def choose(self, number: int) -> None:
        """One of the relations that fit is to hold."""
        with self._lock:
            found = self._fitting[number] if 0 <= number < len(self._fitting) else None
        if found is None:
            return
        if found.is_there is not None:
            self._chosen(found.is_there)
        elif self._session.edit("relation", lambda theory: edits.with_constraint(theory, found.constraint)) and self._session.theory:
            self._chosen(len(self._session.theory.constraints) - 1)

    def _show(self, picks: list[Pick], theory: ConstrainedProgram | None, frame: Frame, unit: str) -> None:
        self._picks, self._of = picks, theory
        if theory is None or not picks:
            self._fitting, self._text.content = [], renderers.note(HOW)
            self._view.draw_picks([], None, "")
            return
        found = measure(picks, Pose.of(lower(theory.program)), unit)
        self._fitting = find_fitting(picks, theory)
        self._text.content = _to_html(picks, theory, found, self._fitting, unit)
        ends = None if found.ends is None else frame.to_unit(found.ends)
        self._view.draw_picks([pick.triangles for pick in picks], ends, found.label)


def _to_html(picks: Sequence[Pick], theory: ConstrainedProgram, found: Measurement, fitting: Sequence[FittingRelation], unit: str) -> str:
    named = "".join(f"<div>{i}: {html.escape(name_pick(pick, theory))}</div>" for i, pick in enumerate(picks, 1))
    first, *others = found.lines or ("",)
    said = f'<div class="lab-measured" style="font-size:14px;font-weight:600">{html.escape(first)}</div>'
    said += "".join(f'<div style="color:{MUTED}">{html.escape(line)}</div>' for line in others)
    text = f'<div class="lab-picked" style="padding:0 12px 6px;font-size:12.5px;line-height:1.4;color:#212529">{named}{said}</div>'
    if not fitting:
        return text
    labels, parts = theory.labels, list(leaves(theory.program))
    rows = "".join(_row(i, one, say_relation(one.constraint, labels, parts, unit)) for i, one in enumerate(fitting))
    return text + renderers.clickable("Fitting", f'<div style="font-size:12px;color:{MUTED}">{CHOOSE}</div>{rows}')


def _row(number: int, one: FittingRelation, words: str) -> str:
    state = "" if one.is_there is None else ", already asked for"
    now = "holds now" if one.holds else "moves the part"
    return (
        f'<button type="button" data-n="{number}" style="{renderers.BUTTON}background:#e7f5ff;color:#212529;font-size:12px">'
        f'{html.escape(words)} <span style="color:{MUTED}">({now}{state})</span></button>'
    )
