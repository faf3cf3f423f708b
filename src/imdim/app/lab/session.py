"""One client's lab without its page: the target, the program with its history, the task that runs for it. All methods may be called from
any thread; `changed` is told which parts of the state have changed, and must not block."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from imdim.app.lab import edits, wire
from imdim.app.lab.continuing import Rates
from imdim.app.lab.edits import Theory
from imdim.app.lab.examples import example
from imdim.app.lab.history import History
from imdim.app.lab.jobs import END_KINDS, Job, Pool
from imdim.app.lab.solving import violations
from imdim.app.lab.state import MiB, State, Step, UploadLimits, shown_name
from imdim.app.lab.wire import Message
from imdim.config import ConfigError, Settings, check
from imdim.geometry.cloud import Target
from imdim.program.cost import count
from imdim.program.front import Choice
from imdim.program.tree import Program, leaves

MOST_STEPS = 500  # of the curves
TRACED = ("fit", "continue", "solve")  # tasks that the curves show
STRIP = 8  # programs in the strip


class Session:
    """See the module. `changed` gets the names of what changed: "target", "program", "selection", "run", "front", "notice"."""

    def __init__(self, pool: Pool, changed: Callable[..., None], limits: UploadLimits | None = None) -> None:
        self.pool, self.changed, self.limits = pool, changed, limits or UploadLimits()
        self.history, self.state, self.settings = History(), State(), Settings()
        self.lock = threading.RLock()
        self._job: Job | None = None
        self._files: tuple[int, dict[str, bytes]] | None = None
        self._wanted: list[Callable[[dict[str, bytes]], None]] = []

    # --- what is there -------------------------------------------------------------------------------------------------

    @property
    def theory(self) -> Theory | None:
        """The program that is shown: that of a run that goes on, else the person's."""
        return self.state.live or self.history.theory

    @property
    def running(self) -> str:
        """ "", "waiting", "running" or "paused"."""
        job = self._job
        return "" if job is None or job.state == "ended" else job.state

    @property
    def waiting_behind(self) -> int:
        return self.pool.place(self._job) if self._job else 0

    # --- targets -------------------------------------------------------------------------------------------------------

    def open_example(self, name: str) -> None:
        """One of `examples.NAMES` becomes the target."""
        self._opened(example(name))

    def open_target(self, target: Target) -> None:
        self._opened(target)

    def open_upload(self, name: str, data: bytes) -> None:
        """A file becomes the target; another process reads it."""
        shown = shown_name(name)
        if len(data) > self.limits.size:
            return self.refuse_upload(shown, len(data))
        values = {"name": shown, "max_points": self.limits.points}
        self._submit("open", Message("open", values, {"data": np.frombuffer(data, np.uint8)}))

    def refuse_upload(self, name: str, size: int) -> None:
        """Say that a file is too large."""
        most = f"at most {self.limits.size / MiB:.0f} MB can be uploaded"
        self._say("error", f"{shown_name(name)}: {size / MiB:.0f} MB are too large, {most}")

    def _opened(self, target: Target) -> None:
        with self.lock:
            self._end_job()
            self.state, self.history, self._files = State(target=target), History(self.history.revision + 1), None
            notes = " ".join(target.notes)
            self.state.notice = ("info", f"{target.name}: {notes}" if notes else "")
        self.changed("target", "program", "run", "front", "notice", "selection")

    # --- runs ----------------------------------------------------------------------------------------------------------

    def start(self, values: Mapping[str, Any]) -> None:
        """A reconstruction from nothing with `values` of Settings."""
        with self.lock:
            if self._use(values):
                self.state.seen, self.state.front = [], ()
                self._submit("fit", self._request("fit"))

    def go_on(self, values: Mapping[str, Any], rates: Rates) -> None:
        """Evolution from the program that is shown."""
        with self.lock:
            if self.theory is None:
                return self._say("error", "there is no program to go on from: press Start")
            if self._use(values):
                self._submit("continue", self._request("continue", document=self._document(), rates=asdict(rates)))

    def solve(self) -> None:
        """Let the solver finish from what is shown: constraints and locks hold."""
        with self.lock:
            if self.theory is None:
                return self._say("error", "there is no program to solve")
            locks = [[lock.leaf, lock.name] for lock in sorted(self.theory.locks)]
            self._submit("solve", self._request("solve", document=self._document(), locks=locks))

    def relate(self) -> None:
        """Look for relations among the numbers."""
        with self.lock:
            if self.theory is None:
                return self._say("error", "there is no program to relate")
            self._submit("relate", self._request("relate", document=self._document()))

    def pause(self) -> None:
        if self._job:
            self._job.pause()
            self._keep_live("run")
            self.changed("run", "program")

    def resume(self) -> None:
        if self._job:
            self._job.resume()
            self.changed("run")

    def step(self) -> None:
        """To the next snapshot, then pause."""
        if self._job:
            self._job.step()
            self.changed("run")

    def stop(self) -> None:
        """End the task; what it found so far stays."""
        with self.lock:
            task = self.state.task if self.running else ""
            self._end_job()
            self.state.stop = "stopped" if task else self.state.stop
        self.changed("run", "program")

    def close(self) -> None:
        """The client has gone: nothing goes on for it."""
        with self.lock:
            self.changed = lambda *_: None
            self._end_job()

    def _use(self, values: Mapping[str, Any]) -> bool:
        try:
            self.settings = check(replace(self.settings, **values))
        except ConfigError as error:
            self._say("error", str(error))
            return False
        return True

    def _request(self, kind: str, **values: Any) -> Message:
        if self.state.target is None:
            raise ValueError("open a file or an example first")
        message = wire.target_message(self.state.target)
        plain = {k: v for k, v in asdict(self.settings).items() if k not in ("input", "output", "logdir")}
        return Message(kind, {**message.values, "settings": plain, **values}, message.arrays)

    def _document(self) -> dict[str, Any]:
        assert self.theory is not None
        return wire.document(self.theory.program, self.theory.constraints)

    def _submit(self, task: str, request: Message) -> None:
        """Run a task in place of the one before."""
        with self.lock:
            self._end_job()
            self.state.task, self.state.stop, self.state.proof = task, "", ""
            if task in TRACED:
                self.state.trace = []
            job: list[Job] = []
            try:
                job.append(self.pool.submit(request, lambda message: self._answered(job, task, message)))
            except RuntimeError as error:
                return self._say("error", str(error))
            self._job = job[0]
        self.changed("run")

    def _end_job(self) -> None:
        job, self._job = self._job, None
        if job is not None and job.state != "ended":
            self.pool.stop(job)
            job.state = "ended"
        self._keep_live(self.state.task)

    def _answered(self, job: list[Job], task: str, message: Message) -> None:
        """An answer of the task, in a thread of its job. Those of a task that was ended meanwhile are late, and are dropped."""
        with self.lock:
            if self._job is not None and job and job[0] is not self._job:
                return
            topics = _ANSWERS[message.kind](self, task, message)
            if message.kind in END_KINDS:
                self._keep_live(task)
                topics = (*topics, "run", "program")
        self.changed(*topics)

    def _on_snapshot(self, task: str, message: Message) -> tuple[str, ...]:
        values, state = message.values, self.state
        program, constraints = wire.read_document(values["document"])
        locks = frozenset() if task in ("fit", "continue") or self.theory is None else self.theory.locks
        state.live = Theory(program, constraints, locks)
        state.stage, state.proof = values["stage"], values["proof"] or state.proof
        state.stop = values["stop"] or state.stop
        if task in TRACED:
            state.trace = [*state.trace, self._step(values["seconds"], values["error"])][-MOST_STEPS:]
        if task in ("fit", "continue"):
            self._see(program, values["error"])
            state.front = wire.read_front(values["front"]) or state.front
        self._forget_selection()
        return "program", "run", "front"

    def _on_target(self, task: str, message: Message) -> tuple[str, ...]:
        self._opened(wire.target_of(message))
        return ()

    def _on_files(self, task: str, message: Message) -> tuple[str, ...]:
        self._files = (self.history.revision, {name: data.tobytes() for name, data in message.arrays.items()})
        return ()

    def _on_done(self, task: str, message: Message) -> tuple[str, ...]:
        if task == "files" and self._files:
            for wanted in self._wanted:
                wanted(self._files[1])
            self._wanted = []
        said = {"solve": "solved: all constraints and locks hold", "relate": self._related()}.get(task)
        if said:
            self.state.notice = ("info", said)
        return ("notice",) if said else ()

    def _on_failed(self, task: str, message: Message) -> tuple[str, ...]:
        self.state.notice, self.state.stop, self._wanted = ("error", message.values["message"]), "failed", []
        return ("notice",)

    def _related(self) -> str:
        found = len(self.theory.constraints) if self.theory else 0
        return f"{found} relation{'' if found == 1 else 's'} found" if found else "no relations found"

    def _step(self, seconds: float, error: float) -> Step:
        assert self.state.live is not None
        program, constraints = self.state.live.program, self.state.live.constraints
        return Step(seconds, error, count(program).primitives, max(violations(program, constraints), default=0.0))

    def _see(self, program: Program, error: float) -> None:
        if not self.state.seen or self.state.seen[-1].program != program:
            self.state.seen = [*self.state.seen, Choice(program, error)][-STRIP:]

    def _keep_live(self, what: str) -> None:
        """What a run found becomes the person's program, as one step that can be undone."""
        live, self.state.live = self.state.live, None
        if live is not None:
            self.history.push(what, live)

    # --- edits ---------------------------------------------------------------------------------------------------------

    def edit(self, what: str, change: Callable[[Theory], Theory]) -> bool:
        """Change the theory; what cannot be is said, and nothing changes. A run that goes on keeps its own program."""
        with self.lock:
            theory = self.theory
            if theory is None:
                self._say("error", "there is no program to edit")
                return False
            try:
                after = change(theory)
            except ValueError as error:
                self._say("error", next(iter(str(error).splitlines()), "that cannot be"))
                return False
            self._commit(what, after)
        return True

    def add(self, op: Any, part: Any) -> None:
        """One more primitive, the first one too."""
        with self.lock:
            self._commit("add", edits.with_added(self.theory, op, part))
            assert self.theory is not None
            self.state.selected = sum(1 for _ in leaves(self.theory.program)) - 1
        self.changed("selection")

    def load(self, choice: Choice) -> None:
        """A program of the front or of the strip becomes the person's."""
        with self.lock:
            self._commit("choice", Theory(choice.program))

    def undo(self) -> None:
        self._moved(self.history.undo)

    def redo(self) -> None:
        self._moved(self.history.redo)

    def select(self, leaf: int | None) -> None:
        """A primitive by its number, or none."""
        with self.lock:
            size = sum(1 for _ in leaves(self.theory.program)) if self.theory else 0
            self.state.selected = leaf if leaf is not None and 0 <= leaf < size else None
        self.changed("selection")

    def _commit(self, what: str, theory: Theory) -> None:
        self.state.live = None
        self.history.push(what, theory, time.monotonic())
        self.state.notice = ("info", "")
        self._forget_selection()
        self.changed("program", "notice")

    def _moved(self, move: Callable[[], str | None]) -> None:
        with self.lock:
            self._keep_live(self.state.task)
            move()
            self._forget_selection()
        self.changed("program", "run")

    def _forget_selection(self) -> None:
        size = sum(1 for _ in leaves(self.theory.program)) if self.theory else 0
        if self.state.selected is not None and self.state.selected >= size:
            self.state.selected = None

    # --- downloads -----------------------------------------------------------------------------------------------------

    def files(self, wanted: Callable[[dict[str, bytes]], None]) -> None:
        """Call `wanted` with all files of the program that is shown; they are made where they are not there yet."""
        with self.lock:
            if self.theory is None:
                return self._say("error", "there is no program to download")
            if self._files and self._files[0] == self.history.revision and self.state.live is None:
                ready = self._files[1]
            elif self.running and self.state.task != "files":
                return self._say("error", "a run is going on: stop it, or wait for its end, and download then")
            else:
                self._wanted.append(wanted)
                if not self.running:
                    front = wire.front_values(self.state.front)
                    stop = self.state.stop or "edited"
                    self._submit("files", self._request("files", document=self._document(), front=front, stop=stop))
                return None
        wanted(ready)

    def _say(self, kind: str, line: str) -> None:
        self.state.notice = (kind, line)
        self.changed("notice")


_ANSWERS: Mapping[str, Callable[[Session, str, Message], tuple[str, ...]]] = {
    "snapshot": Session._on_snapshot,
    "target": Session._on_target,
    "files": Session._on_files,
    "done": Session._on_done,
    "refused": Session._on_failed,
    "died": Session._on_failed,
}
