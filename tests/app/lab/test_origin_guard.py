"""Foreign pages reach nothing of a local lab: by rule, and by a real server that is asked over HTTP and by websocket."""

import http.client

import pytest

viser = pytest.importorskip("viser")
guard = pytest.importorskip("imdim.app.lab.origin_guard")

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


@pytest.fixture(scope="module")
def port():
    with guard.refusing_foreigners("127.0.0.1"):
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield server.get_port()
    server.stop()


@pytest.mark.parametrize("upgrade", [False, True])
@pytest.mark.parametrize("headers", [{"Origin": "http://evil.example"}, {"Host": "rebind.evil.example"}, {}])
def test_a_server_answers_its_own_page_alone(port, upgrade, headers):
    link = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    link.request("GET", "/", headers=(UPGRADE if upgrade else {}) | headers)
    assert link.getresponse().status == (403 if headers else 101 if upgrade else 200)
    link.close()
