"""What a person does reaches the lab as it was when it came, whatever the server writes meanwhile."""

import asyncio
import threading
from types import SimpleNamespace

import pytest

pytest.importorskip("viser")

from imdim.app.lab.input_queue import InputQueue

WAIT_S = 20.0
PERSON, SERVER = SimpleNamespace(client="a page"), SimpleNamespace(client=None)


class Input:
    """As the toolkit's: listeners are called on its event loop, and the server may write from any thread."""

    def __init__(self, value):
        self.value, self.listeners = value, []

    def on_update(self, listener):
        self.listeners.append(listener)

    on_click = on_update

    async def given(self, value, event=PERSON):
        self.value = value
        for listener in self.listeners:
            await listener(event)


@pytest.fixture
def queue(loop):
    queue = InputQueue(loop)
    yield queue
    queue.close()


def on(loop, task):
    return asyncio.run_coroutine_threadsafe(task, loop).result(WAIT_S)


async def nothing():
    """What was asked of the loop before has been done after it."""


def at_rest(loop, queue):
    """All that came has been done, and what was to be shown is."""
    done = threading.Event()
    queue.do(done.set)
    assert done.wait(WAIT_S)
    on(loop, nothing())


class Slow:
    """Keeps the hand busy until it is told to go on, and notes what it is called with."""

    def __init__(self):
        self.said, self.begun, self.go = [], threading.Event(), threading.Event()

    def __call__(self, value):
        self.begun.set()
        assert self.go.wait(WAIT_S)
        self.said.append(value)


def test_what_the_server_writes_meanwhile_is_not_what_the_person_gave(loop, queue):
    box, act = Input(3.0), Slow()
    queue.watch(box, act)
    on(loop, box.given(5.0))
    box.value = 3.0  # before the listener's turn
    act.go.set()
    at_rest(loop, queue)
    assert act.said == [5.0]


def test_an_input_shows_nothing_else_until_what_was_given_is_done(loop, queue):
    box, act = Input(3.0), Slow()
    queue.watch(box, act)
    on(loop, box.given(5.0))
    assert act.begun.wait(WAIT_S)
    queue.show(box, 3.0)  # of a drawing that knows nothing of it yet
    on(loop, nothing())
    assert box.value == 5.0
    act.go.set()
    at_rest(loop, queue)
    queue.show(box, 4.0)
    on(loop, nothing())
    assert box.value == 4.0


def test_things_are_done_in_the_order_in_which_they_came(loop, queue):
    first, second, act = Input(0), Input(0), Slow()
    queue.watch(first, act)
    queue.press(second, act)
    for value in range(1, 40):
        on(loop, (first, second)[value % 2].given(value))
    queue.do(lambda: act("key"))
    act.go.set()
    at_rest(loop, queue)
    assert act.said == [*range(1, 40), "key"]


def test_what_the_server_gives_an_input_is_not_heard(loop, queue):
    box, said = Input(0), []
    queue.watch(box, said.append)
    on(loop, box.given(1, SERVER))
    at_rest(loop, queue)
    assert said == []


def test_a_value_as_near_as_it_is_shown_stays(loop, queue):
    box = Input(3.0)
    queue.watch(box, print)
    queue.show(box, 3.0004, within=0.0005)
    on(loop, nothing())
    assert box.value == 3.0
    queue.show(box, 3.0006, within=0.0005)
    on(loop, nothing())
    assert box.value == 3.0006


def test_an_input_that_is_no_more_is_neither_heard_nor_written(loop, queue):
    box, said = Input(3.0), []
    queue.watch(box, said.append)
    queue.forget(box)
    queue.show(box, 4.0)
    on(loop, nothing())
    on(loop, box.given(5.0))
    at_rest(loop, queue)
    assert (box.value, said) == (5.0, [])


def test_what_breaks_is_told_and_the_next_thing_is_done(loop, queue, capsys):
    box, said = Input(3.0), []
    queue.watch(box, lambda value: said.append(1 / value))
    on(loop, box.given(0.0))
    on(loop, box.given(2.0))
    at_rest(loop, queue)
    assert said == [0.5]
    assert "ZeroDivisionError" in capsys.readouterr().err
    on(loop, box.given(4.0))
    queue.show(box, 7.0)
    at_rest(loop, queue)
    queue.show(box, 8.0)
    on(loop, nothing())
    assert box.value == 8.0, "what broke is not owed for ever"


def test_nothing_is_done_for_a_page_that_has_gone(loop):
    queue, said = InputQueue(loop), []
    box = Input(0)
    queue.watch(box, said.append)
    queue.close()
    on(loop, box.given(1))
    queue.do(lambda: said.append("key"))
    assert said == []
