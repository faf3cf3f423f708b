"""The status says what is so, whichever of the page's threads writes it last."""

import threading
from types import SimpleNamespace

import pytest

pytest.importorskip("viser")

from imdim.app.lab.page import Page

WAIT_S = 20.0


def test_a_thread_that_was_held_up_does_not_put_an_old_status_over_a_new_one():
    written, state = [], {"volume": "old"}
    held, go_on = threading.Event(), threading.Event()

    def draw(part, lines, notice):
        if lines == "old":
            held.set()
            go_on.wait(0.5)
        written.append(lines)

    page = Page.__new__(Page)
    page._stating, page._told = threading.Lock(), ("", "")
    page.session = SimpleNamespace(state=SimpleNamespace(notice=("info", ""), target=None))
    page.status = SimpleNamespace(draw=draw)
    page.run = page.edit = page.take = SimpleNamespace(draw_state=lambda: None)
    page._lines = lambda: state["volume"]
    slow = threading.Thread(target=page._draw_state)
    slow.start()
    assert held.wait(WAIT_S)
    state["volume"] = "new"
    page._draw_state()
    go_on.set()
    slow.join(WAIT_S)
    assert written[-1] == "new"


@pytest.mark.parametrize(
    ("task", "stage", "said"), [("fit", "", "fit: finding surfaces"), ("fit", "search", "fit: search"), ("solve", "", "solve: begun")]
)
def test_a_task_that_has_told_nothing_yet_has_a_line(task, stage, said):
    page = Page.__new__(Page)
    state = SimpleNamespace(target=None, stop="", stage=stage, task=task, trace=[])
    page.session, page._scene = SimpleNamespace(state=state, theory=None, running="running"), None
    assert page._lines() == [("stage", said)]
