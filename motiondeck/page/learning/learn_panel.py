"""Learn a recording on the page: drop it or record the rig, trim it between two handles, name it, learn it, play it.

Learning runs in a separate process. The deck plays on meanwhile, and comes to rest only to start again with the
library that has the new motion.
"""

import html
import re
from collections.abc import Callable
from pathlib import Path

import viser
from viser._messages import FileTransferPart, FileTransferPartAck, FileTransferStartUpload, RemoveNotificationMessage
from viser.infra import ClientId

from controller.wire.messages.commands import LoadLibrary
from motiondeck.page.learning.learning_process import Learned, LearningStep, LearnRequest, News, NotLearned, Seen, work
from motiondeck.page.web.parts import Ask, PageParts
from motiondeck_base.files import shortened

LONGEST_NAME = 40
MOST_BYTES = 64 * 2**20  # of a dropped file
STARTS_AGAIN = "The robot comes to rest, the deck starts again with the new library, and this page comes back."
NEEDS_SKELETON = "Its skeleton is a separate file: drop the .asf too (both at once will do)."


class LearnPanel:
    """The widgets of learning, where the page's widgets are being added; a motion is added to the file of the library.

    The command starts the learning process, without its request.
    """

    def __init__(self, parts: PageParts, command: list[str], library: Path, folder: Path, ask: Ask) -> None:
        self._command, self._library, self._folder = command, library, folder
        self._file: Path | None = None
        self._learned: Learned | None = None
        gui = parts.page.gui
        parts.add("drop-zone", "drop-zone").show("Drop a recording anywhere on the page: BVH, C3D, AMC with ASF, …")
        upload = gui.add_upload_button("Choose a recording", icon=viser.Icon.UPLOAD, color="gray")
        upload.on_upload(lambda event: self._take(event.target.value))
        limit_uploads(parts.page, MOST_BYTES, self._refuse)
        self._said = gui.add_html("")
        self._strip = parts.add("film-strip", "film-strip")
        self._part = gui.add_multi_slider(
            "part, s", min=0.0, max=1.0, step=0.01, initial_value=(0.0, 1.0), visible=False
        )
        self._name = gui.add_text("name", "", visible=False)
        self._learn = gui.add_button("Learn it", icon=viser.Icon.SCHOOL, visible=False)
        self._progress = gui.add_progress_bar(0.0, animated=True, visible=False)
        self._play = gui.add_button("Play it", icon=viser.Icon.PLAYER_PLAY, color="green", visible=False)
        self._learn.on_click(lambda _: self._start())

        @self._play.on_click
        def _(event: viser.GuiEvent) -> None:
            if (new := self._learned) is not None:
                load = LoadLibrary(new.library, new.motion)
                ask(event, f"Play {new.motion}?", STARTS_AGAIN, "Start again with it", load)

    def _take(self, dropped: viser.UploadedFile) -> None:
        name = re.sub(r"[^\w.\- ]", "_", Path(dropped.name).name)[-80:]
        self._folder.mkdir(mode=0o700, exist_ok=True)
        file = self._folder / (name.lstrip(".") or "recording")
        file.write_bytes(dropped.content)
        if file.suffix.lower() == ".asf":
            self._say(f"{name} is kept. Now drop the recording (.amc).")
            return
        if file.suffix.lower() == ".amc" and not [*self._folder.glob("*.asf")]:
            self._say(NEEDS_SKELETON, wrong=True)
            return
        self.look_at(file)

    def _refuse(self, name: str, size: int) -> None:
        most = f"the page takes at most {MOST_BYTES:,} bytes"
        self._say(f"{shortened(name)} has {size:,} bytes; {most}. Give it to: motiondeck learn", wrong=True)

    def look_at(self, file: Path) -> None:
        """Reads a recording, and offers to learn it."""
        self._file, self._learned = file, None
        self._show_choices(visible=False)
        self._say(f"reading {file.name}")
        self._work(LearnRequest(str(file)))

    def _start(self) -> None:
        if self._file is None:
            return
        low, high = (float(value) for value in self._part.value)
        name = str(self._name.value).strip()
        self._learn.disabled = True
        try:
            self._work(LearnRequest(str(self._file), name, (low, high), str(self._library)))
        finally:
            self._learn.disabled = False

    def _work(self, request: LearnRequest) -> None:
        self._play.visible = False
        self._progress.value, self._progress.visible = 15.0, True
        for news in work(self._command, request):
            self._show(news)
        self._progress.visible = False

    def _show(self, news: News) -> None:
        match news:
            case LearningStep(text=text):
                self._say(text)
                self._progress.value = min(90.0, float(self._progress.value) + 30.0)
            case Seen(seconds=seconds, moving=moving):
                self._show_recording(news, seconds, moving)
            case Learned(text=text):
                self._learned = news
                self._library = Path(news.library)  # the next motion comes beside this one
                self._say(text)
                self._play.visible = True
            case NotLearned(reason=reason):
                self._say(reason.replace(f"{self._folder}/", "").replace(str(self._folder), "the page"), wrong=True)

    def _show_recording(self, seen: Seen, seconds: float, moving: tuple[float, float]) -> None:
        self._file = Path(seen.file)
        self._strip.show({"figures": seen.figures, "parents": seen.parents, "angles": seen.angles})
        self._part.min, self._part.max = 0.0, round(seconds, 2)
        self._part.value = (round(moving[0], 2), round(moving[1], 2))
        self._name.value = re.sub(r"[^a-z0-9-]+", "-", self._file.stem.lower()).strip("-")[:LONGEST_NAME]
        self._say(f"{self._file.stem}: {seconds:.1f} s. Choose the part, give it a name, and learn it.")
        self._show_choices(visible=True)

    def _show_choices(self, *, visible: bool) -> None:
        if not visible:
            self._strip.show(None)
        for widget in (self._part, self._name, self._learn):
            widget.visible = visible

    def _say(self, text: str, *, wrong: bool = False) -> None:
        colour = "color:var(--fault);font-weight:600" if wrong else ""
        self._said.content = f'<div class="part" id="learning" style="{colour}">{html.escape(text)}</div>'


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
