"""The camera of a client looks at the part, whatever the browser says meanwhile."""

import contextlib
import threading
import time

import numpy as np
import pytest

camera = pytest.importorskip("imdim.app.lab.camera")
InputQueue = pytest.importorskip("imdim.app.lab.input_queue").InputQueue
SPEAKS_S = 0.05


class Browser:
    """Tells the server where it looked, on the server's loop, while the server moves it; the setters are the toolkit's: the point looked at
    goes with the eye, and a number that is as the server believes it is not sent."""

    def __init__(self, loop):
        self._loop = loop
        self._eye, self._at = np.full(3, 3.0), np.zeros(3)
        self.looks_at = np.zeros(3)  # what it was sent
        self.up_direction = (0.0, 0.0, 1.0)

    @property
    def position(self):
        return self._eye

    @position.setter
    def position(self, eye):
        eye_before, at_before = self._eye, self._at
        self._loop.call_soon_threadsafe(self._tell, eye_before, at_before)
        self._eye = eye
        self.look_at = at_before + eye - eye_before
        time.sleep(SPEAKS_S)

    @property
    def look_at(self):
        return self._at

    @look_at.setter
    def look_at(self, at):
        if not np.allclose(at, self._at):
            self._at = self.looks_at = at

    def _tell(self, eye, at):
        self._eye, self._at = eye, at


def test_a_word_of_the_browser_leaves_the_part_in_sight(loop):
    browser, queue = Browser(loop), InputQueue(loop)
    looking = camera.PageCamera(browser, contextlib.nullcontext, queue.soon)
    looking.look("Top")
    looking.look("Front")
    done = threading.Event()
    queue.soon(done.set)
    assert done.wait(5)
    queue.close()
    assert np.allclose(browser.looks_at, 0.0)
    assert browser.up_direction == (0.0, 0.0, 1.0)
