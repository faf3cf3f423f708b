"""A session against a pool that does nothing by itself: answers are put into its mouth."""

import numpy as np
import pytest

from imdim.app.lab import edits, protocol
from imdim.app.lab.examples import PROGRAMS, example
from imdim.app.lab.jobs import Job
from imdim.app.lab.protocol import Message
from imdim.app.lab.resume import Rates
from imdim.app.lab.session import Session
from imdim.app.lab.solving import Lock
from imdim.app.lab.state import UploadLimits, printable_name
from imdim.program import codec
from imdim.program.front import Choice
from imdim.program.tree import Primitive, leaves
from imdim.reconstruction.fitting import relations_of

PROGRAM, CONSTRAINTS = relations_of(PROGRAMS["Bracket"]())


class Quiet:
    """A pool whose jobs run for ever and say what the test says."""

    def __init__(self):
        self.jobs, self.stopped = [], []

    def submit(self, request, tell):
        self.jobs.append(Job(request, tell, "running"))
        return self.jobs[-1]

    def stop(self, job):
        self.stopped.append(job)

    def place(self, job):
        return 0

    def say(self, kind, values=None, arrays=None):
        job = self.jobs[-1]
        if kind in ("done", "refused", "died"):
            job.state = "ended"
        job.tell(Message(kind, values or {}, arrays or {}))


def snapshot(program=PROGRAM, constraints=(), stop=None, front=(), seconds=1.0):
    values = {"stage": "search", "document": codec.to_json(program, None, constraints), "error": 0.01, "seconds": seconds}
    return {**values, "stop": stop, "front": protocol.front_values(front), "proof": "", "notes": []}


@pytest.fixture
def pool():
    return Quiet()


@pytest.fixture
def session(pool):
    session = Session(pool, lambda *topics: session.heard.append(topics), UploadLimits(size=1000))
    session.heard = []
    session.open_example("Bracket")
    return session


def finished(session, pool, front=()):
    session.start({"budget_s": 5.0})
    pool.say("snapshot", snapshot())
    pool.say("snapshot", snapshot(constraints=CONSTRAINTS, stop="finished", front=front, seconds=2.0))
    pool.say("done")


def radius(session, leaf=1):
    return list(leaves(session.theory.program))[leaf].size[0]


def test_a_run_is_shown_while_it_goes_on_and_is_one_step_that_can_be_undone(session, pool):
    crude = Primitive("box", (80.0, 50.0, 8.0))
    session.start({"budget_s": 5.0, "method": "tree"})
    assert pool.jobs[-1].request.values["settings"]["method"] == "tree"
    pool.say("snapshot", snapshot(crude))
    pool.say("snapshot", snapshot())
    assert session.theory.program == PROGRAM
    assert session.history.theory is None
    assert [c.program for c in session.state.seen] == [crude, PROGRAM], "what the strip shows while there is no front"
    pool.say("snapshot", snapshot(constraints=CONSTRAINTS, stop="finished", seconds=2.0))
    pool.say("done")
    assert session.history.theory.constraints == CONSTRAINTS
    assert not session.history.can_undo
    assert (session.running, session.state.stop) == ("", "finished")
    assert [step.primitives for step in session.state.trace] == [1, 7, 7]
    assert session.state.trace[-1].violation < 1e-9


def test_edits_are_undone_and_redone(session, pool):
    finished(session, pool)
    session.edit("number 1 r", lambda theory: edits.with_number(theory, 1, "r", 15.0, True))
    session.edit("lock", lambda theory: edits.with_lock(theory, Lock(1, "r"), True))
    session.undo()
    assert radius(session) == 15.0
    assert not session.theory.locks
    session.undo()
    assert radius(session) == 14.0
    session.redo()
    assert radius(session) == 15.0


def test_an_edit_that_cannot_be_is_said_and_changes_nothing(session, pool):
    assert not session.edit("number", lambda theory: theory)
    assert session.state.notice == ("error", "there is no program to edit")
    finished(session, pool)
    assert not session.edit("number 1 r", lambda theory: edits.with_number(theory, 1, "r", -1.0))
    assert session.state.notice == ("error", "cylinder needs positive r, got -1.0")
    assert radius(session) == 14.0


def test_the_solver_gets_locks_and_keeps_them(session, pool):
    finished(session, pool)
    session.edit("lock", lambda theory: edits.with_lock(theory, Lock(1, "r"), True))
    session.solve()
    assert pool.jobs[-1].request.kind == "solve"
    assert pool.jobs[-1].request.values["locks"] == [[1, "r"]]
    assert len(pool.jobs[-1].request.values["document"]["constraints"]) == len(CONSTRAINTS)
    pool.say("snapshot", snapshot(constraints=CONSTRAINTS))
    pool.say("done")
    assert session.theory.locks == {Lock(1, "r")}
    assert session.state.notice[1].startswith("fitted")


def test_evolution_goes_on_from_what_is_shown(session, pool):
    session.go_on({}, Rates())
    assert session.state.notice[0] == "error"
    finished(session, pool)
    session.edit("number 1 r", lambda theory: edits.with_number(theory, 1, "r", 15.0, True))
    session.go_on({"budget_s": 9.0}, Rates(mutation=0.5))
    values = pool.jobs[-1].request.values
    assert protocol.read_document(values["document"])[0] == session.theory.program
    assert (values["rates"]["mutation"], values["settings"]["budget_s"]) == (0.5, 9.0)


def test_one_task_at_a_time_and_late_answers_are_dropped(session, pool):
    session.start({})
    first = pool.jobs[-1]
    session.start({})
    assert pool.stopped == [first]
    first.tell(Message("snapshot", snapshot(Primitive("sphere", (1.0,)))))
    assert session.theory is None


def test_settings_out_of_range_are_said(session, pool):
    session.start({"budget_s": float("nan")})
    assert session.state.notice == ("error", "setting budget_s must be a finite number of at least 0, got nan")
    assert not pool.jobs


def test_what_a_run_left_out_is_said(session, pool):
    session.start({})
    pool.say("snapshot", {**snapshot(stop="finished"), "notes": ["part body 2: no inside found; left out"]})
    assert session.state.notice == ("info", "part body 2: no inside found; left out")
    assert "notice" in session.heard[-1]


def test_a_failed_run_is_said_and_what_it_found_stays(session, pool):
    session.start({})
    pool.say("snapshot", snapshot())
    pool.say("died", {"message": "the run was ended by SIGKILL"})
    assert session.state.notice == ("error", "the run was ended by SIGKILL")
    assert session.history.theory.program == PROGRAM
    assert session.running == ""


def test_a_fault_of_ours_is_no_refusal(session, pool):
    finished(session, pool)

    def broken(theory):
        raise ValueError("operands could not be broadcast together")

    with pytest.raises(ValueError, match="broadcast"):
        session.edit("number 0 x", broken)
    assert session.state.notice[0] != "error"


def test_uploads_are_read_elsewhere(session, pool):
    session.open_upload("../../etc/part.stl", b"abc")
    request = pool.jobs[-1].request
    assert (request.kind, request.values["name"], request.arrays["data"].tobytes()) == ("open", "part.stl", b"abc")
    assert request.values["max_points"] == session.limits.points
    message = protocol.target_message(example("Flange"))
    pool.jobs[-1].tell(message)
    assert session.state.target.name == "Flange"
    assert session.theory is None
    assert session.running == ""
    assert not pool.stopped, "the process that read it is warm, and free for the run"
    pool.say("done")
    assert session.state.notice == ("info", "")


def test_a_file_that_is_too_large_never_leaves_the_server(session, pool):
    session.open_upload("big.stl", b"0" * 2000)
    assert not pool.jobs
    assert session.state.notice[0] == "error"
    assert session.state.notice[1].startswith("big.stl: ")


@pytest.mark.parametrize(
    ("name", "shown"),
    [("a.stl", "a.stl"), ("..", ".."), ("C:\\x\\a.stl", "a.stl"), ("/etc/passwd", "passwd"), ("<img>.stl", "_img_.stl"), ("", "upload")],
)
def test_file_names_are_no_paths_and_no_markup(name, shown):
    assert printable_name(name) == shown
    assert len(printable_name("x" * 500 + ".stl")) == 80


def test_downloads_are_made_once_per_program(session, pool):
    finished(session, pool)
    got = []
    session.files(got.append)
    assert pool.jobs[-1].request.kind == "files"
    pool.say("files", {}, {"program.json": np.frombuffer(b"{}", np.uint8)})
    pool.say("done")
    assert got == [{"program.json": b"{}"}]
    made = len(pool.jobs)
    session.files(got.append)
    assert (len(got), len(pool.jobs)) == (2, made)
    session.edit("number 1 r", lambda theory: edits.with_number(theory, 1, "r", 15.0, True))
    session.files(got.append)
    assert len(pool.jobs) == made + 1


def test_an_edit_while_files_are_made_makes_them_again(session, pool):
    finished(session, pool)
    session.files(lambda _: None)
    session.edit("number 1 r", lambda theory: edits.with_number(theory, 1, "r", 15.0, True))
    pool.say("files", {}, {"program.json": np.frombuffer(b"old", np.uint8)})
    pool.say("done")
    got = []
    session.files(got.append)
    assert got == []
    pool.say("files", {}, {"program.json": np.frombuffer(b"new", np.uint8)})
    pool.say("done")
    assert got == [{"program.json": b"new"}]


def test_a_choice_of_the_front_is_loaded(session, pool):
    crude = Choice(Primitive("box", (80.0, 50.0, 8.0)), 0.2)
    finished(session, pool, (crude, Choice(PROGRAM, 0.0)))
    assert [c.error for c in session.state.front] == [0.2, 0.0]
    session.load(session.state.front[0])
    assert session.theory.program == crude.program
    session.undo()
    assert session.theory.program == PROGRAM


def test_a_selection_ends_with_its_primitive(session, pool):
    finished(session, pool)
    session.select(99)
    assert session.state.selected is None
    session.select(6)
    session.edit("remove", lambda theory: edits.without_leaf(theory, 6))
    assert session.state.selected is None
    session.add("difference", Primitive("sphere", (3.0,)))
    assert session.state.selected == 6


def test_a_client_that_goes_frees_its_work(session, pool):
    session.start({})
    session.close()
    assert pool.stopped == pool.jobs
    session.heard.clear()
    pool.say("snapshot", snapshot())
    assert session.heard == []
