"""Who may talk to the lab's server: pages that it served itself, to whom was given the address with its token, and not too many of them.

A browser lets any page open a websocket to a local server, and a name that an attacker owns may come to mean this machine (DNS rebinding).
Both are told by headers that pages cannot forge: Origin must be the host that the request is for, and that host must be local where the
server is. Other programs of this machine, and people of its network, can send any header; they lack the token, the first folder of the
lab's address, which the page's websocket keeps.
"""

from __future__ import annotations

import asyncio
import hmac
import logging
import sys
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any
from urllib.parse import urlsplit

import websockets.asyncio.server as websocket_server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

LOCAL = frozenset(("localhost", "127.0.0.1", "::1"))
MOST_PAGES = 16  # open at once: each has threads of its own
TRY_AGAIN_LATER = 1013  # of the websocket protocol

Answer = Callable[[ServerConnection, Request], Response | None]


@dataclass(frozen=True)
class Rules:
    """A server that listens at `served` answers requests below ``/token/``, and has at most `pages` open."""

    served: str
    token: str
    pages: int = MOST_PAGES


def is_welcome(served: str, host: str, origin: str | None) -> bool:
    """Whether a request for `host`, from a page of `origin` if any, may be answered by a server that listens at `served`."""
    try:
        asked, page = urlsplit(f"//{host}"), urlsplit(origin or "")
        own = origin is None or (page.scheme in ("http", "https") and page.netloc == asked.netloc)
        return own and (served not in LOCAL or asked.hostname in LOCAL)
    except ValueError:
        return False


def path_below(token: str, path: str) -> str | None:
    """What a path asks for below ``/token/``, or None for a path elsewhere."""
    first, _, rest = path.partition("?")[0].lstrip("/").partition("/")
    return f"/{rest}" if hmac.compare_digest(first.encode(), token.encode()) else None


@contextmanager
def guarding(rules: Rules) -> Iterator[None]:
    """Servers that start inside refuse foreign requests (status 403) and pages too many (503) before anything else looks at them.

    Frames that are no messages of the toolkit end their connection, and are told in a line.
    """
    serve = websocket_server.serve
    open_pages: set[ServerConnection] = set()

    def guarded(
        handler: Callable[[ServerConnection], Awaitable[None]], *args: Any, process_request: Answer | None = None, **settings: Any
    ) -> Any:
        def answer(connection: ServerConnection, request: Request) -> Response | None:
            if not is_welcome(rules.served, request.headers.get("Host", ""), request.headers.get("Origin")):
                return connection.respond(HTTPStatus.FORBIDDEN, "this page was not served by the lab\n")
            path = path_below(rules.token, request.path)
            if path is None:
                return connection.respond(
                    HTTPStatus.FORBIDDEN, "open the address that `imdim lab` printed, with all that follows the port\n"
                )
            if len(open_pages) >= rules.pages:
                return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, f"{rules.pages} pages are open already: close one of them\n")
            request.path = path
            return process_request(connection, request) if process_request else None

        async def handle(connection: ServerConnection) -> None:
            if len(open_pages) >= rules.pages:  # several came in the same moment
                await connection.close(TRY_AGAIN_LATER, f"{rules.pages} pages are open already")
                return
            asyncio.get_running_loop().set_exception_handler(_tell_lost_message)
            open_pages.add(connection)
            try:
                await handler(connection)
            finally:
                open_pages.discard(connection)

        return serve(handle, *args, process_request=answer, logger=_one_line_logger(), **settings)

    websocket_server.serve = guarded  # type: ignore[assignment,misc]
    try:
        yield
    finally:
        websocket_server.serve = serve  # type: ignore[assignment,misc]


class _OneLine(logging.Handler):
    """What broke a connection, without the trace through libraries that nobody here wrote."""

    def emit(self, record: logging.LogRecord) -> None:
        error = record.exc_info[1] if record.exc_info else None
        _tell(f"a connection was closed, {record.getMessage()}", error)


def _one_line_logger() -> logging.Logger:
    """A logger of no name: other users of the websockets library keep theirs. Less than errors, such as what was asked for, is not told."""
    logger = logging.Logger("imdim.lab", logging.ERROR)
    logger.addHandler(_OneLine())
    return logger


def _tell_lost_message(_: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    _tell("a message was dropped", context.get("exception"))


def _tell(what: str, error: BaseException | None) -> None:
    why = "" if error is None else f" ({type(error).__name__}: {' '.join(str(error).split())[:160]})"
    sys.stderr.write(f"imdim lab: {what}{why}\n")
