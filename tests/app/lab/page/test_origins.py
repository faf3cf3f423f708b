"""The command's own server refuses foreign pages and those without its token; no browser is needed to see that."""

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
    link.request("GET", address.path, headers=upgrade | headers)
    assert link.getresponse().status == 403
    link.close()


@pytest.mark.parametrize("upgrade", [{}, UPGRADE])
def test_the_address_has_a_token_without_which_nothing_is_answered(server, upgrade):
    address = urlsplit(server.url)
    assert len(address.path) > 20
    for path in ("/", "/index.html", address.path[:-3], f"/x{address.path}"):
        link = http.client.HTTPConnection(address.hostname, address.port, timeout=10)
        link.request("GET", path, headers=upgrade)
        assert link.getresponse().status == 403
        link.close()
