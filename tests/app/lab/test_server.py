"""The command: what it prints and opens, what it refuses, and how it ends."""

import signal
import webbrowser
from types import SimpleNamespace

import pytest

from imdim.app.cli import main as imdim

pytest.importorskip("viser")
server = pytest.importorskip("imdim.app.lab.server")


class Quiet:
    """Stands in the lab's place: no port, no process."""

    def __init__(self, host, port, limits, uploads, target, pages):
        self.url, self.closed = f"http://{host}:{port}", False
        self.limits, self.uploads, self.target, self.pages = limits, uploads, target, pages

    def close(self):
        self.closed = True


class Person:
    """Closes the terminal as soon as the page is there. `opened` are addresses, `labs` what was started."""

    def __init__(self):
        self.opened, self.labs = [], []

    def start(self, *given):
        self.labs.append(Quiet(*given))
        return self.labs[-1]

    def browse(self, address):
        self.opened.append(address)
        signal.raise_signal(signal.SIGTERM)


def test_the_page_of_a_client_that_goes_while_it_is_built_is_closed(monkeypatch):
    clients, built = {}, []

    class Slow:
        def __init__(self, client, *_):
            self.opened = self.closed = False
            self.session = SimpleNamespace(open_example=lambda _: setattr(self, "opened", True))
            built.append(self)
            if client.hasty:
                del clients[client.client_id]
                lab._went(client)

        def close(self):
            self.closed = True

    toolkit = SimpleNamespace(
        scene=None,
        initial_camera=None,
        gui=SimpleNamespace(configure_theme=lambda **_: None),
        on_client_connect=lambda _: None,
        on_client_disconnect=lambda _: None,
        get_port=lambda: 0,
        get_event_loop=lambda: None,
        get_clients=clients.copy,
    )
    for name in ("light", "place_first", "_compress"):
        monkeypatch.setattr(server, name, lambda *_: None)
    monkeypatch.setattr(server, "Page", Slow)
    monkeypatch.setattr(server, "WorkerPool", lambda _: SimpleNamespace(prepare=lambda: None))
    monkeypatch.setattr(server.viser, "ViserServer", lambda **_: toolkit)
    lab = server.Lab("127.0.0.1", 0, None, None)
    for number, hasty in enumerate((True, False)):
        client = SimpleNamespace(client_id=number, hasty=hasty)
        clients[number] = client
        lab._came(client)
    assert [(page.opened, page.closed) for page in built] == [(False, True), (True, False)]


@pytest.fixture
def person(monkeypatch):
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    person = Person()
    monkeypatch.setattr(server, "Lab", person.start)
    monkeypatch.setattr(webbrowser, "open", person.browse)
    yield person
    for number, handler in before.items():
        signal.signal(number, handler)


def test_a_part_is_opened_on_a_local_address_with_limits(person, capsys):
    assert server.main(["dataset/examples/bracket.stl"]) == 0
    (lab,) = person.labs
    assert person.opened == ["http://127.0.0.1:8080"]
    assert capsys.readouterr().out == "IMDIM Live Lab: http://127.0.0.1:8080\n"
    assert lab.target.name == "bracket.stl"
    assert lab.closed
    assert (lab.limits.running, lab.limits.memory) == (2, 6 << 30)
    assert (lab.uploads.size, lab.uploads.points) == (64 << 20, 100_000)


def test_limits_are_those_of_the_command(person):
    arguments = ["--runs", "1", "--memory", "1.5", "--upload", "3", "--points", "500", "--host", "0.0.0.0", "--port", "81", "--pages", "4"]
    assert server.main(arguments) == 0
    (lab,) = person.labs
    assert (lab.limits.running, lab.limits.memory, lab.uploads.size, lab.uploads.points) == (1, 3 << 29, 3 << 20, 500)
    assert lab.pages == 4
    assert lab.url == "http://0.0.0.0:81"
    assert lab.target is None


def test_what_is_no_part_ends_with_one_line_and_opens_nothing(person, tmp_path, capsys):
    (tmp_path / "part.stl").write_bytes(b"")
    assert imdim(["lab", str(tmp_path / "part.stl")]) == 2
    said = capsys.readouterr().err
    assert said.startswith("imdim: ")
    assert said.count("\n") == 1
    assert "empty" in said
    assert person.opened == person.labs == []
