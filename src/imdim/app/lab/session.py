"""One client's lab without its page: the target, the program in hand, the task that runs for it. Any thread may call its methods."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from imdim.app.lab import answers, protocol
from imdim.app.lab.document import Document
from imdim.app.lab.downloads import Downloads, Wanted
from imdim.app.lab.examples import example
from imdim.app.lab.jobs import END_KINDS, Job, WorkerPool
from imdim.app.lab.protocol import Message
from imdim.app.lab.requests import request
from imdim.app.lab.resume import Rates
from imdim.app.lab.state import History, MiB, State, UploadLimits, printable_name
from imdim.reconstruction.config import ConfigError, Settings, check
from imdim.target.placement import place
from imdim.target.readers import InputError
from imdim.target.target import Target


class Session(Document):
    """See the module."""

    def __init__(self, pool: WorkerPool, changed: Callable[..., None], limits: UploadLimits | None = None) -> None:
        super().__init__(changed)
        self.pool, self.limits, self.settings = pool, limits or UploadLimits(), Settings()
        self._job: Job | None = None
        self._as_read: Target | None = None
        self._downloads = Downloads()

    # --- what is there -------------------------------------------------------------------------------------------------

    @property
    def running(self) -> str:
        """ "", "waiting", "running" or "paused"."""
        job = self._job
        return "" if job is None or job.state == "ended" else job.state

    @property
    def waiting_behind(self) -> int:
        return self.pool.place(self._job) if self._job else 0

    @property
    def _target(self) -> Target:
        if self.state.target is None:
            raise ValueError("open a file or an example first")
        return self.state.target

    # --- targets -------------------------------------------------------------------------------------------------------

    def open_example(self, name: str) -> None:
        """One of `examples.NAMES` becomes the target."""
        self.open_target(example(name))

    def open_target(self, target: Target) -> None:
        """What is open makes room: its task ends, its program and its undo go."""
        with self.lock:
            self._end_job()
            self._as_read = target
            self.state, self.history, self._downloads = State(target=target), History(self.history.revision + 1), Downloads()
            notes = " ".join(target.notes)
            self.state.notice = ("info", f"{target.name}: {notes}" if notes else "")
        self.changed("target", "program", "run", "front", "notice", "selection")

    def set_units(self, units: str) -> None:
        """What the lengths of the file are, by the setting `units`: the target is read anew, in millimetres."""
        with self.lock:
            as_read = self._as_read
            if as_read is None or units == self.state.units:
                return
            try:
                placed = place(as_read, units)
            except InputError as error:
                return self._say("error", str(error))
            self.open_target(placed)
            self._as_read, self.state.units = as_read, units
        self.changed("target")

    def open_upload(self, name: str, data: bytes) -> None:
        """A file becomes the target; another process reads it."""
        shown = printable_name(name)
        if len(data) > self.limits.size:
            return self.refuse_upload(shown, len(data))
        values = {"name": shown, "max_points": self.limits.points}
        self._submit(Message("open", values, {"data": np.frombuffer(data, np.uint8)}))

    def upload_began(self, name: str) -> None:
        """Say that a file is coming."""
        self._say("info", f"{printable_name(name)}: being read")

    def refuse_upload(self, name: str, size: int) -> None:
        """Say that a file is too large."""
        most = f"at most {self.limits.size / MiB:.0f} MB can be uploaded"
        self._say("error", f"{printable_name(name)}: {size / MiB:.0f} MB are too large, {most}")

    # --- runs ----------------------------------------------------------------------------------------------------------

    def start(self, values: Mapping[str, Any]) -> None:
        """A reconstruction from nothing with `values` of Settings."""
        with self.lock:
            if self._use(values):
                self.state.seen, self.state.front = [], ()
                self._submit(request("fit", self._target, self.settings))

    def go_on(self, values: Mapping[str, Any], rates: Rates) -> None:
        """Evolution from the program that is shown."""
        with self.lock:
            theory = self._program_to("go on from: press Start")
            if theory and self._use(values):
                self._submit(request("continue", self._target, self.settings, theory, rates=asdict(rates)))

    def solve(self) -> None:
        """Let the solver finish from what is shown: constraints and locks hold."""
        with self.lock:
            if theory := self._program_to("solve"):
                locks = [[lock.leaf, lock.name] for lock in sorted(theory.locks)]
                self._submit(request("solve", self._target, self.settings, theory, locks=locks))

    def relate(self) -> None:
        """Look for relations among the numbers."""
        with self.lock:
            if theory := self._program_to("relate"):
                self._submit(request("relate", self._target, self.settings, theory))

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

    def _submit(self, asked: Message) -> None:
        """Run a task in place of the one before."""
        with self.lock:
            self._end_job()
            task = self.state.task = asked.kind
            self.state.stop = self.state.stage = ""
            if task in answers.FREE:
                self.state.proof = ""
            if task in answers.TRACED:
                self.state.trace = []
            job: list[Job] = []
            try:
                job.append(self.pool.submit(asked, lambda message: self._on_answer(job, task, message)))
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

    def _on_answer(self, job: list[Job], task: str, message: Message) -> None:
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
        held = frozenset() if task in answers.FREE or self.theory is None else self.theory.locks
        answers.take_snapshot(self.state, task, message, held)
        self._forget_selection()
        return "program", "run", "front", *(("notice",) if message.values["notes"] else ())

    def _on_target(self, task: str, message: Message) -> tuple[str, ...]:
        self._job = None  # it has done its work: ended as one that goes on, it would take its process, warm for the run, along
        self.open_target(protocol.target_of(message))
        return ()

    def _on_files(self, task: str, message: Message) -> tuple[str, ...]:
        self._downloads.keep_files(message)
        return ()

    def _on_done(self, task: str, message: Message) -> tuple[str, ...]:
        if task == "files":
            self._downloads.send()
        said = answers.final_message(task, self.theory)
        if said:
            self.state.notice = ("info", said)
        return ("notice",) if said else ()

    def _on_failed(self, task: str, message: Message) -> tuple[str, ...]:
        self.state.notice, self.state.stop = ("error", message.values["message"]), "failed"
        self._downloads.forget_wishes()
        return ("notice",)

    # --- downloads -----------------------------------------------------------------------------------------------------

    def files(self, wanted: Wanted) -> None:
        """Call `wanted` with all files of the program that is shown; they are made where they are not there yet."""
        with self.lock:
            theory, state = self._program_to("download"), self.state
            if theory is None:
                return None
            revision = self.history.revision
            ready = self._downloads.of(revision) if state.live is None else None
            if ready is None:
                if self.running and state.task != "files":
                    return self._say("error", "a run is going on: stop it, or wait for its end, and download then")
                self._downloads.wish(wanted)
                if not self.running or self._downloads.making != revision:
                    front, stop = protocol.front_values(state.front), state.stop or "edited"
                    self._downloads.making = revision
                    self._submit(request("files", self._target, self.settings, theory, front=front, stop=stop))
                return None
        wanted(ready)


_ANSWERS: Mapping[str, Callable[[Session, str, Message], tuple[str, ...]]] = {
    "snapshot": Session._on_snapshot,
    "target": Session._on_target,
    "files": Session._on_files,
    "done": Session._on_done,
    "refused": Session._on_failed,
    "failed": Session._on_failed,
    "died": Session._on_failed,
}
