"""The limit on uploads stands in front of private names of the toolkit: here it meets the real ones."""

from types import SimpleNamespace

import pytest

viser = pytest.importorskip("viser")
messages = pytest.importorskip("viser._messages")
uploads = pytest.importorskip("imdim.app.lab.uploads")


@pytest.fixture(scope="module")
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


def test_a_toolkit_without_the_names_is_named(gui):
    with pytest.raises(RuntimeError, match=r"viser .* has no _handle_file_transfer_start, on which the limit"):
        uploads.limit_uploads(SimpleNamespace(gui=SimpleNamespace(_websock_interface=None)), 1, print, print)
