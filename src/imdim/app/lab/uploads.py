"""A limit on uploads that holds before a file is in memory. The toolkit has none, and its public calls see a file only when all of it has
come; so this stands in front of its own handler. The names that it needs are private, and the toolkit is pinned to a minor version."""

from __future__ import annotations

from collections.abc import Callable

import viser
from viser import _messages as messages

PRIVATE = ("_websock_interface", "_handle_file_transfer_start")  # of a client's gui


def limit_uploads(client: viser.ClientHandle, most: int, began: Callable[[str], None], refuse: Callable[[str, int], None]) -> None:
    """Files of more than `most` bytes are not taken: `refuse` gets their name and size, and what the browser sends of them is dropped.

    `began` gets the names of the others. Raises RuntimeError for a toolkit without the names that this needs.
    """
    gui = client.gui
    missing = [name for name in PRIVATE if not hasattr(gui, name)]
    if missing:
        raise RuntimeError(f"viser {viser.__version__} has no {', '.join(missing)}, on which the limit on uploads rests")
    link, accept = gui._websock_interface, gui._handle_file_transfer_start

    def start(client_id: int, message: messages.FileTransferStartUpload) -> None:
        if message.size_bytes <= most:
            began(message.filename)
            accept(client_id, message)  # type: ignore[arg-type]
            return
        # what ends an upload for the browser, which would take no other file before: neither all came nor too few
        ids = message.source_component_uuid, message.transfer_uuid
        link.queue_message(messages.FileTransferPartAck(*ids, transferred_bytes=0, total_bytes=-1))
        link.queue_message(messages.RemoveNotificationMessage(f"upload-{message.transfer_uuid}"))
        refuse(message.filename, message.size_bytes)

    link.unregister_handler(messages.FileTransferStartUpload, accept)
    link.register_handler(messages.FileTransferStartUpload, start)  # type: ignore[arg-type]
