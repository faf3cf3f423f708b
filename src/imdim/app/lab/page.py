"""The page of one client: the 3D view and the panels, drawn from the state of its session."""

from __future__ import annotations

import threading
from collections.abc import Set
from functools import partial

import numpy as np
import viser

from imdim.app.lab import drawing, renderers
from imdim.app.lab.camera import STANDARD_VIEWS
from imdim.app.lab.edits import ConstrainedProgram
from imdim.app.lab.ground import Ground
from imdim.app.lab.handle_view import HandleView
from imdim.app.lab.input_queue import InputQueue
from imdim.app.lab.jobs import WorkerPool
from imdim.app.lab.panels.browse import CurvesPanel, FrontPanel, TreePanel
from imdim.app.lab.panels.edit import FIT, EditPanel
from imdim.app.lab.panels.parameters import ParametersPanel
from imdim.app.lab.panels.relate import RelatePanel
from imdim.app.lab.panels.run import RunPanel, StatusPanel
from imdim.app.lab.panels.show import ShowPanel
from imdim.app.lab.panels.take import TakePanel
from imdim.app.lab.refresher import Refresher
from imdim.app.lab.section import Section, cut_drawing, cut_original, cut_points
from imdim.app.lab.session import Session
from imdim.app.lab.state import UploadLimits
from imdim.app.lab.style import BRAND
from imdim.app.lab.uploads import limit_uploads
from imdim.app.lab.view import SceneView
from imdim.delivery.evaluate import Scores, evaluate
from imdim.geometry.edge_solids import blend_solids, join_blends
from imdim.program.cost import count
from imdim.program.tree import Program
from imdim.target.target import Frame, Target

SCORE_SAMPLES = 5_000
SCORE_AFTER_S = 0.4, 1.0  # the picture has the core for itself until then: after an edit, and while a run goes on
NAME_AFTER_S = 0.4  # as do the names of a program, and the report of an edit
BEGUN = {"fit": "finding surfaces", "open": "reading the file", "files": "writing the files"}  # of tasks that have told nothing yet
COMING = "\N{HORIZONTAL ELLIPSIS}"  # what is being measured
SAID_S = 10.0  # that an error stays on the picture
SCORE_NICE = 10  # and where it takes longer, it still goes first
UNIT = "mm"  # files that say another are read in it, and what says none is taken for it
LEFT, RIGHT = 304, 328  # pixels


class Page:
    """See the module. `close` when the client has gone."""

    def __init__(self, client: viser.ClientHandle, pool: WorkerPool, limits: UploadLimits, queue: InputQueue) -> None:
        self._client, self._queue = client, queue
        self._drawing = Refresher(self._draw_at_once, "draw")
        self._naming = Refresher(self._name, "name", lambda: NAME_AFTER_S, SCORE_NICE)
        self._scoring = Refresher(self._score, "score", lambda: SCORE_AFTER_S[self.session.state.live is not None], SCORE_NICE)
        self.session = Session(pool, self._drawing.poke, limits)
        self.view = SceneView(client, queue, lambda click: self.relate.picks.click(click, self._drawn, UNIT))
        self._scene: drawing.Drawing | None = None
        self._drawn: drawing.Drawing | None = None  # the same, cut open where there is a section
        self._scored: ConstrainedProgram | None = None
        self._scores: Scores | None = None
        self._told = ("", "")
        self._stating = threading.Lock()  # of two threads that write the status, the later one says what is so now
        limit_uploads(client, limits.size, self.session.upload_began, self.session.refuse_upload)
        self._build()

    def close(self) -> None:
        """Frees all that this client used."""
        self.session.close()
        self._queue.close()
        self.view.close()
        self._drawing.close()
        self._naming.close()
        self._scoring.close()

    def _build(self) -> None:
        gui, session, queue = self._client.gui, self.session, self._queue
        gui.configure_theme(show_logo=False, show_share_button=False, brand_color=BRAND)
        gui.set_panel_label("IMDIM Live Lab")
        gui.main_panel.dock_right()
        gui.main_panel.set_width(RIGHT)
        self.status = StatusPanel(gui, session, queue)
        renderers.add_clicks(gui, "Primitive", queue, session.select)
        renderers.add_clicks(gui, "Fitting", queue, lambda number: self.relate.picks.choose(number))
        upper, lower = gui.add_panel(), gui.add_panel()
        self.parameters = ParametersPanel(gui, upper, session, queue)
        self.parameters.listen(gui, queue, self.view.light_up)
        tabs = gui.add_tab_group()
        with tabs.add_tab("Run"):
            self.run = RunPanel(gui, session, queue)
        with tabs.add_tab("Edit") as place:
            self.edit = EditPanel(gui, place, session, queue)
        self.handles = HandleView(self._client, self.view.camera, session, queue, lambda: self.edit.follow.value)
        with tabs.add_tab("Relations"):
            self.relate = RelatePanel(gui, session, queue, self.view, self._draw_again)
        with tabs.add_tab("View"):
            self.show = ShowPanel(
                gui, self.view, self.handles, queue, lambda: self._scoring.poke("map"), lambda: self._drawing.poke("section")
            )
        with tabs.add_tab("Download"):
            self.take = TakePanel(self._client, session, queue)
        self.tree = TreePanel(gui, upper)
        self.front, self.curves = FrontPanel(gui, lower, session, queue), CurvesPanel(gui, lower)
        upper.dock_left()
        upper.set_width(LEFT)
        lower.dock_below(upper)
        self._commands()

    def _commands(self) -> None:
        """What the keyboard can do; the toolkit lists it under ctrl+K."""
        session, gui, queue = self.session, self._client.gui, self._queue
        keys = (
            ("Start a run", "R", None, lambda: session.start(self.run.settings())),
            ("Pause or resume", "P", None, lambda: session.resume() if session.running == "paused" else session.pause()),
            ("One step", "N", None, self.run.step),
            ("Stop", "X", None, session.stop),
            (FIT, "L", None, session.solve),
            ("Undo", "Z", "cmd/ctrl", session.undo),
            ("Redo", "Y", "cmd/ctrl", session.redo),
            ("Select the next primitive", "J", None, lambda: self._select_by(1)),
            ("Select the previous primitive", "K", None, lambda: self._select_by(-1)),
            ("Select nothing", "escape", None, self._select_nothing),
            ("Remove the selected primitive", "delete", None, self.edit.remove),
            ("Distance map on or off", "M", None, lambda: self.show.toggle("Distance map")),
            ("Centres and relations on or off", "O", None, lambda: self.show.toggle("Relations")),
            ("Cutters on or off", "C", None, lambda: self.show.toggle("Cutters")),
            ("Grid and axes on or off", "G", None, lambda: self.show.toggle("Grid and axes")),
            ("Original on or off", "T", None, lambda: self.show.toggle("Original")),
            ("Section on or off", "I", None, self.show.toggle_section),
            ("Show the whole part", "F", None, self.view.camera.look),
            *((f"Look from: {name}", str(i), None, partial(self.view.camera.look, name)) for i, name in enumerate(STANDARD_VIEWS)),
        )
        for label, key, modifier, call in keys:
            command = gui.add_command(label, hotkey=key, modifier=modifier)  # type: ignore[arg-type]
            command.on_trigger(queue.then(call))

    def _select_by(self, step: int) -> None:
        theory, now = self.session.theory, self.session.state.selected
        if theory is not None:
            self.session.select((now + step) % theory.size if now is not None else (0 if step > 0 else theory.size - 1))

    def _select_nothing(self) -> None:
        self.relate.picks.forget(UNIT)
        self.session.select(None)

    def _draw_again(self) -> None:
        self._drawing.poke("program")

    # --- drawing, each in a thread of its own ----------------------------------------------------------------------------

    def _draw_at_once(self, topics: Set[str]) -> None:
        """One picture for all that changed: without a graphics card, each one takes its time."""
        with self._client.atomic():
            self._draw(topics)

    def _draw(self, topics: Set[str]) -> None:
        with self.session.lock:
            state, theory = self.session.state, self.session.theory
            target, selected = state.target, state.selected
        if "target" in topics and target is not None:
            self.view.forget()
            frame, ground = Frame.of(target), Ground.of(target)
            self.view.draw_ground(ground, frame)
            self.show.say_grid(ground.step, UNIT)
            self._draw_target(target, frame)
            self.run.draw(target.name, state.units)
            self._scene = None
        elif "section" in topics and target is not None:
            self._draw_target(target, Frame.of(target))
        if topics & {"program", "selection", "target", "section"}:
            self._draw_program(theory, selected)
            self._naming.poke("names")
        elif "names" in topics:
            self._draw_texts(theory, selected)
        self._draw_state()
        if topics & {"run", "target"}:
            self.curves.draw(state.trace)
        if topics & {"program", "front", "target"}:
            self._scoring.poke("front", "score")

    def _draw_target(self, target: Target, frame: Frame) -> None:
        """The part as it was read, cut open where there is a section."""
        cut, whole = self._section_of(target), drawing.original(target, frame)
        if whole is None:
            points = drawing.cloud(target, frame)
            self.view.draw_cloud(points if cut is None else cut_points(points, *cut, frame))
        else:
            pieces, edges = ([whole[0]], whole[1]) if cut is None else cut_original(*whole, *cut, frame)
            self.view.draw_original(pieces, edges)

    def _section_of(self, target: Target) -> tuple[Section, float] | None:
        """The section, and where its plane is, which is said."""
        section = self.show.section()
        if section is None:
            return None
        level = section.level(np.min(target.points, axis=0), np.max(target.points, axis=0))
        self.show.say_section(section, level, UNIT)
        return section, level

    def _draw_program(self, theory: ConstrainedProgram | None, selected: int | None) -> None:
        target = self.session.state.target
        if theory is None or target is None:
            self._scene = self._drawn = None
            self.view.draw(None, None)
            self.view.name(None, "")
            self.handles.draw(None, None, None)
        else:
            frame = Frame.of(target)
            self._scene = drawing.scene(theory, frame, selected)
            over = drawing.overlay(theory, frame)
            cut = self._section_of(target)
            self._drawn = self._scene if cut is None else cut_drawing(self._scene, *cut, frame)
            self.view.draw(self._drawn, over)
            at = None
            if selected is not None:
                drawn = theory.edge_feature(selected) is None
                at = over.points[selected] if drawn else drawing.middle_of(self._scene, selected)
            self.handles.draw(theory if self.session.state.live is None else None, selected, frame)
            self.view.name(at, drawing.names(theory)[selected] if selected is not None else "")
        self._draw_texts(theory, selected)

    def _draw_texts(self, theory: ConstrainedProgram | None, selected: int | None) -> None:
        """What is read of the program."""
        self.parameters.draw(theory, selected, UNIT)
        self.edit.draw(theory, selected, UNIT)
        self.tree.draw(theory, selected, UNIT)
        self.relate.draw(theory, selected, UNIT)

    def _name(self, _: Set[str]) -> None:
        """What the last edit did, with a picture, and names for the program, which may wait for the scene."""
        edit = self.session.report()
        self.session.give_names()
        if edit is not None:
            self.parameters.draw_edit(edit)

    def _draw_state(self) -> None:
        with self._stating:
            state = self.session.state
            kind, line = notice = state.notice
            self.status.draw(state.target.name if state.target else "", self._lines(), notice)
            for panel in (self.run, self.edit, self.take):
                panel.draw_state()
            if kind == "error" and line and notice is not self._told:
                self._client.add_notification("That did not work", line, color="red", auto_close_seconds=SAID_S)
            self._told = notice

    def _lines(self) -> list[tuple[str, str]]:
        """What the status says."""
        state, theory = self.session.state, self.session.theory
        lines = [("part", state.target.name)] if state.target else []
        if self.session.running or state.stop:
            ended = f" ({state.stop.replace('_', ' ')})" if state.stop not in ("", state.stage) else ""
            spent = f", {state.trace[-1].seconds:.1f} s" if state.trace else ""
            lines.append(("stage", f"{state.task}: {state.stage or BEGUN.get(state.task, 'begun')}{ended}{spent}"))
        if theory is None or self._scene is None:
            return lines
        counts = count(theory.program)
        size = ("features", f"{counts.primitives}, {counts.curves} curves") if counts.curves else ("primitives", str(counts.primitives))
        lines += [size, ("volume", f"{self._scene.volume:.5g} {UNIT}³")]
        # a row that came and went would move all that stands below it away from under the pointer
        error = distance = COMING
        if self._scores is not None and self._scored == theory:
            scores = self._scores
            far = scores.relative(scores.to_result)
            error = "no closed target" if scores.volume_iou is None else f"{1 - scores.volume_iou:.2%} of the volume"
            distance = f"mean {far.mean:.2%}, max {far.max:.2%}"
        proved = state.proof if state.proved == theory.program else ""
        return [*lines, ("error", error), ("distance", distance), ("proof", proved)]

    def _score(self, topics: Set[str]) -> None:
        """Scores, the distance map, and small pictures: what the eye can wait a moment for."""
        with self.session.lock:
            state, theory, target, scene = self.session.state, self.session.theory, self.session.state.target, self._scene
            choices = list(state.front or state.seen)
        if theory is not None and target is not None and scene is not None and len(scene.surface.faces):
            if theory != self._scored:
                self._scores, self._scored = evaluate(_with_edges(theory), target, SCORE_SAMPLES), theory
                self._draw_state()
            if self.view.shown["Distance map"]:
                points, tints, top = drawing.distance_map(target, scene.surface, Frame.of(target))
                self.view.draw_map(points, tints)
                self._say_scale(top)
        if topics & {"front"}:
            self.front.draw(choices, None if theory is None else theory.found)

    def _say_scale(self, top: float) -> None:
        bar = "linear-gradient(90deg,rgb(222,226,230),rgb(250,214,140),rgb(244,142,60),rgb(204,40,40),rgb(96,0,30))"
        text = f'<div style="height:10px;border-radius:5px;background:{bar}"></div>0 to {top:.3g} {UNIT} from the result'
        self.show.scale.content = f'<div style="padding:0 12px 8px;font-size:12.5px;color:#343a40">{text}</div>'


def _with_edges(theory: ConstrainedProgram) -> Program:
    """The program as it is drawn."""
    return join_blends(drawing.enlarge_cutters(theory.program), blend_solids(theory.program, theory.edges))
