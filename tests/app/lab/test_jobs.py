import os
import signal
import time

import numpy as np
import pytest

from imdim.app.lab import protocol, work
from imdim.app.lab.examples import example
from imdim.app.lab.jobs import describe_death
from imdim.app.lab.protocol import Message
from imdim.program.tree import leaves

BALL = "\n".join(f"{x} {y} {z}" for x, y, z in np.random.default_rng(0).normal(size=(5000, 3))).encode()


def request(kind="fit", name="Bracket", **settings):
    message = protocol.target_message(example(name))
    return Message(kind, {**message.values, "settings": settings}, message.arrays)


def upload(name, data, max_points=100_000):
    return Message("open", {"name": name, "max_points": max_points}, {"data": np.frombuffer(data, np.uint8)})


@pytest.mark.parametrize(("language", "size", "choices"), [("csg", 7, 3), ("cad", 7, 2)])
def test_a_run_tells_its_programs(pool, heard, language, size, choices):
    pool.submit(request(budget_s=120.0, language=language), heard)
    assert heard.last().kind == "done"
    snapshots = [m.values for m in heard.messages[:-1]]
    program, constraints = protocol.read_document(snapshots[-1]["document"])
    assert snapshots[-1]["stop"] == "finished"
    assert len(list(leaves(program))) == size
    assert constraints
    assert len(snapshots[-1]["front"]) >= choices


def test_a_killed_run_is_told_and_the_next_one_runs(pool, heard):
    job = pool.submit(request(name="Bracket, scanned", budget_s=60.0), heard)
    while job.worker is None:
        time.sleep(0.01)
    os.kill(job.worker.process.pid, signal.SIGKILL)
    assert heard.last().kind == "died"
    assert "SIGKILL" in heard.last().values["message"]
    again = type(heard)()
    pool.submit(upload("part.xyz", b"1 2 3\n" * 3), again)
    assert again.last().kind == "refused"


class Collected:
    """A process whose end another thread has collected, and notes only a moment later."""

    def __init__(self):
        self._says = iter([None, None, -signal.SIGKILL])

    def join(self, seconds):
        pass

    @property
    def exitcode(self):
        return next(self._says, -signal.SIGKILL)


def test_the_end_of_a_process_is_told_whoever_collects_it():
    assert "SIGKILL" in describe_death(Collected())


def test_a_pause_costs_no_budget_and_a_step_ends_at_the_next_program(pool, heard):
    job = pool.submit(request(name="Bracket", budget_s=30.0), heard)
    heard.first()
    job.pause()
    time.sleep(0.2)
    told = len(heard.messages)
    paused = time.perf_counter()
    time.sleep(1.5)
    assert len(heard.messages) == told
    spent = heard.messages[-1].values["seconds"]
    job.step()
    while len(heard.messages) == told:
        time.sleep(0.01)
    if heard.messages[-1].kind == "snapshot":
        wall = time.perf_counter() - paused
        assert heard.messages[told].values["seconds"] < spent + wall - 1.0
        while job.state == "running":
            time.sleep(0.01)
    if job.state == "paused":
        job.resume()
    assert heard.last().kind == "done"


def test_runs_wait_for_their_turn_and_can_leave_the_queue(pool, heard):
    others = [type(heard)() for _ in range(2)]
    first = pool.submit(request(budget_s=30.0), heard)
    second = pool.submit(request(budget_s=30.0), others[0])
    third = pool.submit(upload("ball.xyz", BALL), others[1])
    assert (first.state, second.state, third.state) == ("running", "waiting", "waiting")
    assert (pool.place(second), pool.place(third)) == (0, 1)
    with pytest.raises(RuntimeError, match="2 runs are waiting"):
        pool.submit(request(), lambda _: None)
    pool.stop(second)
    assert pool.place(third) == 0
    pool.stop(first)
    assert others[1].last().kind == "done"
    assert others[0].messages == []
    assert not any(m.kind in ("done", "died") for m in heard.messages)


@pytest.mark.parametrize(
    ("name", "data", "says"),
    [
        ("part.stl", b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 8, "part.stl: not a whole STL file"),
        ("part.stl", b"", "part.stl: the file is empty (0 bytes)"),
        ("nan.xyz", b"nan nan nan\n" * 100, "nan.xyz: "),
        ("part.exe", b"MZ", "part.exe: unknown format '.exe'"),
        ("few.xyz", b"1 2 3\n4 5 6\n", "few.xyz: "),
    ],
)
def test_what_is_no_part_is_refused_in_one_line_that_names_it(name, data, says):
    (answer,) = work.perform(upload(name, data), time.perf_counter)
    assert answer.kind == "refused"
    assert answer.values["message"].startswith(says)
    assert "\n" not in answer.values["message"]
    assert "/" not in answer.values["message"].removeprefix(says)


def test_a_large_cloud_is_thinned():
    told = list(work.perform(upload("ball.xyz", BALL, 1000), time.perf_counter))
    assert [m.kind for m in told] == ["target", "done"]
    assert len(protocol.target_of(told[0]).points) <= 1000


def test_want_of_memory_is_told(monkeypatch):
    def greedy(*_):
        raise MemoryError
        yield

    monkeypatch.setitem(work.TASKS, "open", greedy)  # type: ignore[arg-type]
    assert [m.kind for m in work.perform(upload("a.stl", b""), time.perf_counter)] == ["refused"]


def test_what_broke_is_told_apart_from_what_cannot_be_used(monkeypatch, capsys):
    def broken(*_):
        raise ValueError("shapes (3,) and (4,)")
        yield

    monkeypatch.setitem(work.TASKS, "open", broken)  # type: ignore[arg-type]
    (answer,) = work.perform(upload("a.stl", b""), time.perf_counter)
    assert answer.kind == "failed"
    assert answer.values["message"] == "the run failed: ValueError: shapes (3,) and (4,); the lab goes on"
    assert "Traceback" in capsys.readouterr().err
