"""A limit on uploads that holds before a file is in memory. The toolkit has none, and its public calls see a file only when all of it has
come; so this stands in front of its own handler, whose names are private, and the toolkit's version is pinned to a minor one."""

from __future__ import annotations

from collections.abc import Callable

import viser
from viser import _messages as messages


def limit_uploads(client: viser.ClientHandle, most: int, refuse: Callable[[str, int], None]) -> None:
    """Files of more than `most` bytes are not taken: `refuse` gets their name and size, and what the browser sends of them is dropped."""
    link, accept = client.gui._websock_interface, client.gui._handle_file_transfer_start

    def start(client_id: int, message: messages.FileTransferStartUpload) -> None:
        if message.size_bytes <= most:
            accept(client_id, message)  # type: ignore[arg-type]
            return
        # the browser waits for its last byte to be acknowledged, and takes no other file until then
        link.queue_message(
            messages.FileTransferPartAck(message.source_component_uuid, message.transfer_uuid, message.size_bytes, message.size_bytes)
        )
        link.queue_message(messages.RemoveNotificationMessage(f"upload-{message.transfer_uuid}"))  # which would say that all went well
        refuse(message.filename, message.size_bytes)

    link.unregister_handler(messages.FileTransferStartUpload, accept)
    link.register_handler(messages.FileTransferStartUpload, start)  # type: ignore[arg-type]
