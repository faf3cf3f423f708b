"""The command's own server refuses foreign pages; no browser is needed to see that."""

import http.client
from urllib.parse import urlsplit

import pytest

pytest.importorskip("viser")

FOREIGN = {"Origin": "http://evil.example"}, {"Host": "rebind.evil.example"}
UPGRADE = {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==", "Sec-WebSocket-Version": "13"}


@pytest.mark.parametrize("headers", FOREIGN)
@pytest.mark.parametrize("upgrade", [{}, UPGRADE])
def test_foreign_pages_get_nothing(server, headers, upgrade):
    address = urlsplit(server.url)
    link = http.client.HTTPConnection(address.hostname, address.port, timeout=10)
    link.request("GET", "/", headers=upgrade | headers)
    assert link.getresponse().status == 403
    link.close()
