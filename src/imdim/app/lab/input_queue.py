"""What a person does on the page, done in the order in which it came and with the values that it came with.

The toolkit calls a listener in some thread, some time later, and lets it read its input then: what the server wrote to that input meanwhile
would be taken for the person's. Here a value is read in the very step of the toolkit's event loop that brings it, and the server's own
writes go through the same loop, never over what a person did that has not been done yet.
"""

from __future__ import annotations

import asyncio
import contextlib
import sys
import traceback
from collections.abc import Callable, Coroutine
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import viser


class InputQueue:
    """See the module. One for each page; `loop` is the server's."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop, self._hand = loop, ThreadPoolExecutor(1, "hand")
        self._last: dict[str, Callable[[], object]] = {}  # what is wanted last, of what comes faster than it is done
        self._owed: dict[int, int] = {}  # of each input that is watched, what came and is not done yet

    def watch(self, handle: Any, act: Callable[[Any], object]) -> None:
        """Call `act` with each value that the person gives an input."""
        handle.on_update(self._listener(handle, act))

    def press(self, button: viser.GuiButtonHandle | viser.GuiButtonGroupHandle, act: Callable[[Any], object]) -> None:
        """Call `act` whenever a button is pressed: with the option, where there are some."""
        button.on_click(self._listener(button, act))

    def then(self, act: Callable[[], object]) -> Callable[[Any], Coroutine[Any, Any, None]]:
        """A listener that calls `act`, for what gives no value: a key, a click in the view."""

        async def came(_: Any) -> None:  # on the event loop: a thread for it could come to its turn after what was done later
            self.do(act)

        return came

    def pass_event(self, act: Callable[[Any], object]) -> Callable[[Any], Coroutine[Any, Any, None]]:
        """A listener that calls `act` with the event."""

        async def came(event: Any) -> None:
            self.do(lambda: act(event))

        return came

    def now(self, act: Callable[[Any], object]) -> Callable[[Any], Coroutine[Any, Any, None]]:
        """A listener that calls `act` with the event at once, which must not block."""

        async def came(event: Any) -> None:
            act(event)

        return came

    def do_last(self, what: str, act: Callable[[], object]) -> None:
        """Call `act` after all that was done before, unless `what` is wanted otherwise until then."""
        is_due = what in self._last
        self._last[what] = act
        if not is_due:
            self.do(lambda: self._last.pop(what)())

    def do(self, act: Callable[[], object]) -> None:
        """Call `act` after all that was done before."""
        with contextlib.suppress(RuntimeError):  # the page has gone
            self._hand.submit(_log_errors, act)

    def soon(self, act: Callable[[], object]) -> None:
        """Call `act`, which must not block, in a step of the loop, within which nothing comes from the browser."""
        with contextlib.suppress(RuntimeError):  # the server has stopped
            self._loop.call_soon_threadsafe(act)

    def show(self, handle: Any, value: Any, within: float = 0.0) -> None:
        """Write a value into an input that is watched, unless it is as near as `within`, or the person has just given it another."""

        def write() -> None:
            if self._owed.get(id(handle)) == 0 and (abs(handle.value - value) > within if within else handle.value != value):
                handle.value = value

        self.soon(write)

    def forget(self, *handles: Any) -> None:
        """Inputs that are no more."""
        self.soon(lambda: [self._owed.pop(id(handle), 0) for handle in handles])

    def close(self) -> None:
        """The page has gone."""
        self._hand.shutdown(wait=False, cancel_futures=True)

    def _listener(self, handle: Any, act: Callable[[Any], object]) -> Callable[[Any], Coroutine[Any, Any, None]]:
        self._owed[id(handle)] = 0

        async def came(event: Any) -> None:
            if event.client is not None and id(handle) in self._owed:
                self._owed[id(handle)] += 1
                value = handle.value
                self.do(lambda: self._perform(handle, lambda: act(value)))

        return came

    def _perform(self, handle: Any, act: Callable[[], object]) -> None:
        try:
            act()
        finally:
            self.soon(lambda: self._settle_debt(handle))

    def _settle_debt(self, handle: Any) -> None:
        if id(handle) in self._owed:
            self._owed[id(handle)] -= 1


def _log_errors(act: Callable[[], object]) -> None:
    try:
        act()
    except Exception:  # noqa: BLE001 - what cannot be done must not end the page; the terminal is told what broke
        sys.stderr.write(f"imdim lab: {traceback.format_exc()}")
