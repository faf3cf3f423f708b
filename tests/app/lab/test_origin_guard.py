"""Foreign pages reach nothing of a local lab: by rule, and by a real server that is asked over HTTP and by websocket."""

import contextlib
import gc
import http.client
import time

import msgspec
import pytest

viser = pytest.importorskip("viser")
guard = pytest.importorskip("imdim.app.lab.origin_guard")
from websockets.exceptions import ConnectionClosed, InvalidStatus  # noqa: E402 - comes with viser
from websockets.sync.client import connect  # noqa: E402
from websockets.typing import Subprotocol  # noqa: E402

UPGRADE = {
    "Upgrade": "websocket",
    "Connection": "Upgrade",
    "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Protocol": f"viser-v{viser.__version__}",
}


@pytest.mark.parametrize(
    ("served", "host", "origin", "welcome"),
    [
        ("127.0.0.1", "127.0.0.1:8080", None, True),
        ("127.0.0.1", "localhost:8080", "http://localhost:8080", True),
        ("::1", "[::1]:8080", "http://[::1]:8080", True),
        ("127.0.0.1", "127.0.0.1:9000", "http://127.0.0.1:9000", True),  # a forwarded port
        ("127.0.0.1", "127.0.0.1:8080", "http://evil.example", False),
        ("127.0.0.1", "127.0.0.1:8080", "http://127.0.0.1:9000", False),
        ("127.0.0.1", "127.0.0.1:8080", "null", False),
        ("127.0.0.1", "rebind.evil.example:8080", "http://rebind.evil.example:8080", False),
        ("127.0.0.1", "", None, False),
        ("127.0.0.1", "[broken", None, False),
        ("0.0.0.0", "workshop.local:8080", "http://workshop.local:8080", True),
        ("0.0.0.0", "workshop.local:8080", "https://evil.example", False),
    ],
)
def test_who_is_welcome(served, host, origin, welcome):
    assert guard.is_welcome(served, host, origin) is welcome


@pytest.mark.parametrize(
    ("path", "rest"),
    [
        ("/key/", "/"),
        ("/key", "/"),
        ("/key/a/b.js?x=1", "/a/b.js"),
        ("/", None),
        ("/keys/", None),
        ("//key/", "/"),
        ("/x/key/", None),
        ("", None),
    ],
)
def test_what_is_asked_for_below_the_token(path, rest):
    assert guard.path_below("key", path) == rest


def _viser(pages):
    with guard.guarding(guard.Rules("127.0.0.1", "key", pages)):
        return viser.ViserServer(host="127.0.0.1", port=0, verbose=False)


@pytest.fixture(scope="module")
def port():
    server = _viser(4)
    yield server.get_port()
    server.stop()


def _status(port, path, headers):
    link = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    link.request("GET", path, headers=headers)
    answer = link.getresponse()
    said = "" if answer.status == 101 else answer.read().decode(errors="replace")
    link.close()
    return answer.status, said


@pytest.mark.parametrize("upgrade", [False, True])
@pytest.mark.parametrize("headers", [{"Origin": "http://evil.example"}, {"Host": "rebind.evil.example"}, {}])
def test_a_server_answers_its_own_page_alone(port, upgrade, headers):
    status, _ = _status(port, "/key/", (UPGRADE if upgrade else {}) | headers)
    assert status == (403 if headers else 101 if upgrade else 200)


@pytest.mark.parametrize("upgrade", [{}, UPGRADE])
def test_a_server_answers_nobody_without_its_token(port, upgrade):
    status, said = _status(port, "/", upgrade)
    assert (status, said) == (403, "open the address that `imdim lab` printed, with all that follows the port\n")


def _page(port):
    return connect(f"ws://127.0.0.1:{port}/key", subprotocols=[Subprotocol(UPGRADE["Sec-WebSocket-Protocol"])], max_size=None)


def test_pages_beyond_the_limit_are_refused_until_one_closes():
    server = _viser(2)
    one, two = _page(server.get_port()), _page(server.get_port())
    try:
        for page in (one, two):
            page.recv()
        with pytest.raises(InvalidStatus, match="503"):
            _page(server.get_port())
        status, said = _status(server.get_port(), "/key/", {})
        assert (status, said) == (503, "2 pages are open already: close one of them\n")
        one.close()
        _wait(lambda: _status(server.get_port(), "/key/", {})[0] == 200)
    finally:
        two.close()
        server.stop()


def test_frames_that_are_no_messages_are_told_in_a_line_each(port, capfd):
    frames = [b"", b"\x81", b"\xff" * 64, "text", b"\x83\xa4type\xa7Nothing\xa1x\x01\xa1y\x02", b"\xdf\xff\xff\xff\xff", b"\xc1" * 9]
    for frame in frames:
        page = _page(port)
        page.send(frame)
        _wait_for_end(page)
    told = capfd.readouterr()
    lines = [line for line in told.err.splitlines() if line]
    assert len(lines) == len(frames)
    assert all(line.startswith("imdim lab: a connection was closed") for line in lines), lines
    assert "Traceback" not in told.out + told.err


def test_a_message_that_breaks_its_handler_is_told_in_a_line(port, capfd):
    page = _page(port)
    page.send(msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": ["no name"], "updates": {}}))
    page.send(b"")
    _wait_for_end(page)
    gc.collect()  # the loop tells of a task that failed when nobody can ask it any more
    told = capfd.readouterr()
    assert "imdim lab: a message was dropped (TypeError: unhashable type: 'list')\n" in told.err
    assert "Traceback" not in told.out + told.err


def _wait_for_end(page):
    with contextlib.suppress(ConnectionClosed):
        while True:
            page.recv(timeout=10)


def _wait(true):
    for _ in range(100):
        if true():
            return
        time.sleep(0.05)
    raise AssertionError("it never was")
