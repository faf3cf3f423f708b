"""A limit on uploads that holds before a file is in memory.

The toolkit has none, and its public calls see a file only when all of it has come; so this stands in front of its own handlers. The names
that it needs are private, and the toolkit is pinned to a minor version. What a sender declares is not
believed: bytes are counted as they come, and a page has few transfers at once.
"""

from __future__ import annotations

from collections.abc import Callable

import viser
from viser import _messages as messages

PRIVATE = (  # of a client's gui
    "_websock_interface",
    "_handle_file_transfer_start",
    "_handle_file_transfer_part",
    "_current_file_upload_states",
)
MOST_TRANSFERS = 2  # of one page at once


def limit_uploads(client: viser.ClientHandle, most: int, began: Callable[[str], None], refuse: Callable[[str, int], None]) -> None:
    """Files of more than `most` bytes are not taken: `refuse` gets their name and size, and what the browser sends of them is dropped.

    `began` gets the names of the others. Raises RuntimeError for a toolkit without the names that this needs.
    """
    gui = client.gui
    missing = [name for name in PRIVATE if not hasattr(gui, name)]
    if missing:
        raise RuntimeError(f"viser {viser.__version__} has no {', '.join(missing)}, on which the limit on uploads rests")
    link, accept, take, coming = (getattr(gui, name) for name in PRIVATE)

    def end(source: str | None, transfer: str) -> None:
        """What ends an upload for the browser, which would take no other file before: neither all came nor too few."""
        link.queue_message(messages.FileTransferPartAck(source, transfer, transferred_bytes=0, total_bytes=-1))
        link.queue_message(messages.RemoveNotificationMessage(f"upload-{transfer}"))

    def start(client_id: int, message: messages.FileTransferStartUpload) -> None:
        if message.size_bytes <= most and len(coming) < MOST_TRANSFERS:
            began(message.filename)
            accept(client_id, message)
            return
        end(message.source_component_uuid, message.transfer_uuid)
        if message.size_bytes > most:  # no browser begins a third transfer beside two of its own
            refuse(message.filename, message.size_bytes)

    def part(client_id: int, message: messages.FileTransferPart) -> None:
        state = coming.get(message.transfer_uuid)
        size = 0 if state is None else state["transferred_bytes"] + len(message.content)
        if state is None or size <= min(state["total_bytes"], most):
            take(client_id, message)
            return
        coming.pop(message.transfer_uuid)
        end(message.source_component_uuid, message.transfer_uuid)
        refuse(state["filename"], size)

    for kind, theirs, ours in ((messages.FileTransferStartUpload, accept, start), (messages.FileTransferPart, take, part)):
        link.unregister_handler(kind, theirs)
        link.register_handler(kind, ours)
