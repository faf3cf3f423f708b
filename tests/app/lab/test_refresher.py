"""Drawing in a thread of its own."""

import threading
import time

from imdim.app.lab.refresher import Refresher


class Drawn:
    """What was drawn, and when."""

    def __init__(self):
        self.seen, self.some = [], threading.Event()

    def __call__(self, topics):
        self.seen.append((time.perf_counter(), set(topics)))
        self.some.set()
        if "bad" in topics:
            raise RuntimeError("a picture that fails")


def test_what_changes_meanwhile_is_drawn_together_after_the_rest():
    drawn, start = Drawn(), time.perf_counter()
    refresher = Refresher(drawn, "test", lambda: 0.2)
    refresher.poke("a")
    refresher.poke("b", "c")
    assert drawn.some.wait(5.0)
    refresher.close()
    ((when, topics),) = drawn.seen
    assert topics == {"a", "b", "c"}
    assert when - start >= 0.2


def test_a_picture_that_fails_is_told_and_the_next_one_is_drawn(capsys):
    drawn = Drawn()
    refresher = Refresher(drawn, "test")
    refresher.poke("bad")
    assert drawn.some.wait(5.0)
    drawn.some.clear()
    refresher.poke("good")
    assert drawn.some.wait(5.0)
    refresher.close()
    assert [topics for _, topics in drawn.seen] == [{"bad"}, {"good"}]
    assert "a picture that fails" in capsys.readouterr().err


def test_nothing_is_drawn_after_the_end():
    drawn = Drawn()
    refresher = Refresher(drawn, "test", lambda: 0.1)
    refresher.poke("late")
    refresher.close()
    assert not drawn.some.wait(0.3)
