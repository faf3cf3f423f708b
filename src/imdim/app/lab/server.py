"""The lab's server: one page per client, processes for their work, nothing reachable from outside unless asked for."""

from __future__ import annotations

import argparse
import http.client
import secrets
import signal
import sys
import threading
import webbrowser
from collections.abc import Sequence
from pathlib import Path

import viser

from imdim.app.lab.camera import light, place_first
from imdim.app.lab.examples import NAMES
from imdim.app.lab.input_queue import InputQueue
from imdim.app.lab.jobs import GiB, PoolLimits, WorkerPool
from imdim.app.lab.origin_guard import MOST_PAGES, Rules, guarding
from imdim.app.lab.page import Page
from imdim.app.lab.state import MiB, UploadLimits
from imdim.reconstruction.config import ConfigError
from imdim.target.target import InputError, Target, load_target


class Lab:
    """A running server. `close` ends it and all that it started."""

    def __init__(
        self, host: str, port: int, limits: PoolLimits, uploads: UploadLimits, target: Target | None = None, pages: int = MOST_PAGES
    ) -> None:
        self.pool, self._uploads, self._target = WorkerPool(limits), uploads, target
        self._pages: dict[int, Page] = {}
        self._lock = threading.Lock()
        rules = Rules(host, secrets.token_urlsafe(16), pages)
        with guarding(rules):
            self._server = viser.ViserServer(host=host, port=port, label="IMDIM Live Lab", verbose=False)
        self._server.request_share_url = _refuse_to_share  # type: ignore[method-assign]
        self._server.gui.configure_theme(show_logo=False, show_share_button=False)
        light(self._server.scene)
        place_first(self._server.initial_camera)
        self._server.on_client_connect(self._came)
        self._server.on_client_disconnect(self._went)
        path = f"/{rules.token}/"
        self.url = f"http://{host}:{self._server.get_port()}{path}"
        self.pool.prepare()
        _compress(host, self._server.get_port(), path)

    def _came(self, client: viser.ClientHandle) -> None:
        page = Page(client, self.pool, self._uploads, InputQueue(self._server.get_event_loop()))
        with self._lock:
            self._pages[client.client_id] = page
        if client.client_id not in self._server.get_clients():  # it went while its page was built
            self._went(client)
        elif self._target is None:
            page.session.open_example(NAMES[0])
        else:
            page.session.open_target(self._target)

    def _went(self, client: viser.ClientHandle) -> None:
        with self._lock:
            page = self._pages.pop(client.client_id, None)
        if page is not None:
            page.close()

    def close(self) -> None:
        with self._lock:
            pages = list(self._pages.values())
        for page in pages:
            page.close()
        self.pool.close()
        self._server.stop()


def _refuse_to_share(verbose: bool = True) -> None:
    """The toolkit can open a tunnel to a public server when a page asks for it; here no page can."""


def _compress(host: str, port: int, path: str) -> None:
    """The toolkit compresses its page when it is first asked for, which takes a tenth of a second: here nobody waits for it."""
    link = http.client.HTTPConnection(host, port)
    link.request("GET", path, headers={"Accept-Encoding": "gzip"})
    link.getresponse().read()
    link.close()


def parser() -> argparse.ArgumentParser:
    """The arguments of the command."""
    out = argparse.ArgumentParser(prog="imdim lab", description="Reconstruct a part in a browser page: watch, correct, download.")
    out.add_argument("input", nargs="?", help="a mesh or a cloud; without it an example is opened")
    out.add_argument("--host", default="127.0.0.1", help="address to listen at (default: this machine alone)")
    out.add_argument("--port", type=int, default=8080, help="the first free one from here on (default 8080)")
    out.add_argument("--no-browser", action="store_true", help="print the address only")
    out.add_argument("--pages", type=int, default=MOST_PAGES, help=f"pages open at once (default {MOST_PAGES})")
    out.add_argument("--runs", type=int, default=2, help="runs at once, of all clients (default 2)")
    out.add_argument("--memory", type=float, default=6.0, metavar="GB", help="for each run (default 6)")
    out.add_argument("--upload", type=float, default=64.0, metavar="MB", help="largest file (default 64)")
    out.add_argument("--points", type=int, default=100_000, help="larger clouds are thinned to this (default 100000)")
    return out


def main(argv: Sequence[str]) -> int:
    """The exit status 0; raises ConfigError for a file that cannot be used."""
    given = parser().parse_args(argv)
    try:
        target = load_target(Path(given.input), given.points) if given.input else None
    except InputError as error:
        raise ConfigError(str(error)) from error
    limits = PoolLimits(given.runs, memory=int(given.memory * GiB))
    lab = Lab(given.host, given.port, limits, UploadLimits(int(given.upload * MiB), given.points), target, given.pages)
    sys.stdout.write(f"IMDIM Live Lab: {lab.url}\n")
    sys.stdout.flush()
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    if not given.no_browser:
        webbrowser.open(lab.url)
    ended.wait()
    lab.close()
    return 0
