"""The limit on uploads stands in front of private names of the toolkit: here it meets the real ones."""

from types import SimpleNamespace

import pytest

viser = pytest.importorskip("viser")
messages = pytest.importorskip("viser._messages")
uploads = pytest.importorskip("imdim.app.lab.uploads")


@pytest.fixture
def gui():
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield server.gui
    server.stop()


def test_large_files_are_refused_before_they_come(gui):
    told, sent = [], []
    uploads.limit_uploads(SimpleNamespace(gui=gui), 1000, told.append, lambda *what: told.append(what))
    link = gui._websock_interface
    button = gui.add_upload_button("Open")
    link.queue_message = sent.append
    try:
        for name, size in (("small.stl", 1000), ("large.stl", 1001)):
            start = messages.FileTransferStartUpload(button._impl.uuid, name, name, "", 1, size)
            for call in link._incoming_handlers[messages.FileTransferStartUpload]:
                call(0, start)
    finally:
        del link.queue_message
    assert told == ["small.stl", ("large.stl", 1001)]
    assert list(gui._current_file_upload_states) == ["small.stl"]
    assert [m.uuid for m in sent if isinstance(m, messages.RemoveNotificationMessage)] == ["upload-large.stl"]
    (ack,) = [m for m in sent if isinstance(m, messages.FileTransferPartAck)]
    assert ack.as_serializable_dict([]), "it can be sent"
    assert ack.transferred_bytes >= ack.total_bytes, "the browser does not wait for the rest"
    assert ack.transferred_bytes / ack.total_bytes < 1, "the browser does not say that all of it was taken"


def test_what_is_more_than_was_declared_is_not_kept(gui):
    told = []
    uploads.limit_uploads(SimpleNamespace(gui=gui), 1000, told.append, lambda *what: told.append(what))
    link, coming = gui._websock_interface, gui._current_file_upload_states
    coming.clear()
    button = gui.add_upload_button("Open")

    def send(message):
        for call in link._incoming_handlers[type(message)]:
            call(0, message)

    link.queue_message = lambda _: None
    try:
        for name in ("a.stl", "b.stl", "c.stl"):
            send(messages.FileTransferStartUpload(button._impl.uuid, name, name, "", 1000, 600))
        assert list(coming) == ["a.stl", "b.stl"], "two at once"
        send(messages.FileTransferPart(button._impl.uuid, "a.stl", 0, b"x" * 600))
        assert coming["a.stl"]["transferred_bytes"] == 600
        send(messages.FileTransferPart(button._impl.uuid, "a.stl", 1, b"x"))
        assert list(coming) == ["b.stl"]
        send(messages.FileTransferPart(button._impl.uuid, "a.stl", 2, b"x" * 900))
        assert list(coming) == ["b.stl"], "what still comes is dropped"
    finally:
        del link.queue_message
        coming.clear()
    assert told == ["a.stl", "b.stl", ("a.stl", 601)]


def test_a_toolkit_without_the_names_is_named(gui):
    with pytest.raises(RuntimeError, match=r"viser .* has no _handle_file_transfer_start, .*_states, on which the limit"):
        uploads.limit_uploads(SimpleNamespace(gui=SimpleNamespace(_websock_interface=None)), 1, print, print)
