"""Who may talk to the lab's server: pages that it served itself, asked for by a name of this machine.

A browser lets any page open a websocket to a local server, and a name that an attacker owns may come to mean this machine (DNS rebinding).
Both are told by headers that pages cannot forge: Origin must be the host that the request is for, and that host must be local where the
server is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from typing import Any
from urllib.parse import urlsplit

import websockets.asyncio.server as websocket_server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

LOCAL = frozenset(("localhost", "127.0.0.1", "::1"))

Answer = Callable[[ServerConnection, Request], Response | None]


def is_welcome(served: str, host: str, origin: str | None) -> bool:
    """Whether a request for `host`, from a page of `origin` if any, may be answered by a server that listens at `served`."""
    try:
        asked, page = urlsplit(f"//{host}"), urlsplit(origin or "")
        own = origin is None or (page.scheme in ("http", "https") and page.netloc == asked.netloc)
        return own and (served not in LOCAL or asked.hostname in LOCAL)
    except ValueError:
        return False


@contextmanager
def refusing_foreigners(served: str) -> Iterator[None]:
    """Servers that start inside answer foreign requests with status 403, before anything else looks at them."""
    serve = websocket_server.serve

    def guarded(*args: Any, process_request: Answer | None = None, **settings: Any) -> Any:
        def answer(connection: ServerConnection, request: Request) -> Response | None:
            if not is_welcome(served, request.headers.get("Host", ""), request.headers.get("Origin")):
                return connection.respond(HTTPStatus.FORBIDDEN, "this page was not served by the lab\n")
            return process_request(connection, request) if process_request else None

        return serve(*args, process_request=answer, **settings)

    websocket_server.serve = guarded  # type: ignore[assignment,misc]
    try:
        yield
    finally:
        websocket_server.serve = serve  # type: ignore[assignment,misc]
