"""Uploads of a page up to a size: a larger file, which viser would collect, is refused when it is announced."""

from collections.abc import Callable

import viser
from viser._messages import FileTransferPart, FileTransferPartAck, FileTransferStartUpload, RemoveNotificationMessage
from viser.infra import ClientId


def limit_uploads(page: viser.ViserServer, most: int, refuse: Callable[[str, int], None]) -> None:
    """Refuses files of a page's upload buttons that are larger than `most` bytes, also all that are under way together.

    `refuse` is called with the name and the size, bytes, of a refused file, in the thread of the page's sockets.
    """
    gui, sockets = page.gui, page._websock_server
    open_uploads = gui._current_file_upload_states

    def start(client: ClientId, message: FileTransferStartUpload) -> None:
        under_way = sum(one["total_bytes"] for one in open_uploads.values())
        if 0 <= message.size_bytes <= most - under_way and message.part_count <= message.size_bytes:
            gui._handle_file_transfer_start(client, message)
            return
        refuse(message.filename, message.size_bytes)
        # As far as the browser is concerned it is done with, which makes the button usable; "uploaded" is not shown.
        source, transfer, size = message.source_component_uuid, message.transfer_uuid, message.size_bytes
        sockets.queue_message(FileTransferPartAck(source, transfer, size, size))
        sockets.queue_message(RemoveNotificationMessage(f"upload-{transfer}"))

    def take(client: ClientId, message: FileTransferPart) -> None:
        upload = open_uploads.get(message.transfer_uuid)
        if upload is None:
            return
        if upload["transferred_bytes"] + len(message.content) > upload["total_bytes"]:
            del open_uploads[message.transfer_uuid]  # more than was announced
            refuse(upload["filename"], upload["transferred_bytes"] + len(message.content))
            return
        gui._handle_file_transfer_part(client, message)

    sockets.unregister_handler(FileTransferStartUpload)
    sockets.unregister_handler(FileTransferPart)
    sockets.register_handler(FileTransferStartUpload, start)
    sockets.register_handler(FileTransferPart, take)
