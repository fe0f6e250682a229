"""Tables of the rig in a window: the registers of a servo, some of them writable, and the servos on the ports."""

import html
from collections.abc import Callable

import viser
from viser._gui_handles import GuiModalHandle

from controller.wire.command_socket import CommandClient
from controller.wire.messages.commands import DeckCommand, ReadRegisters, ScanPorts, WriteRegister
from controller.wire.messages.replies import OnPorts, Refused, Registers
from motiondeck.page.web.parts import Ask, PageParts
from motiondeck_base.errors import MotiondeckError

# Asks the deck and waits for what it finds; None where that was refused, which is shown.
Look = Callable[[DeckCommand], Registers | OnPorts | None]
FIRST_WITHIN, LAST_WITHIN = 2.0, 20.0  # s
SCAN = (
    "All servos hold for less than a second (with some servos: five), and then come slowly to where they "
    "should be. Every servo that answers at the rig's baud rate is listed."
)
WRITES = "The rig does not rely on this register; whether the value is a good one, nothing checks. It was {before}."
TORQUE_FIRST = "To write a register, switch the torque of this servo off first."


def query_servos(
    client: CommandClient, refuse: Callable[[str], None], message: DeckCommand
) -> Registers | OnPorts | None:
    """Queries servos through a client; what else threads request of it does not wait meanwhile."""
    try:
        reply = client.request(message, FIRST_WITHIN)
        last = reply if isinstance(reply, Refused) else client.wait_settled(reply.id, LAST_WITHIN)
    except MotiondeckError as error:
        last = Refused(str(error))
    if isinstance(last, Registers | OnPorts):
        return last
    refuse(last.reason if isinstance(last, Refused) else "the rig does not answer")
    return None


class ServoTables:
    """Windows with tables, in the browser that requested them."""

    def __init__(self, parts: PageParts, look: Look, ask: Ask) -> None:
        self._gui, self._look, self._ask = parts.gui_of, look, ask

    def scan(self, event: viser.GuiEvent) -> None:
        """Asks for confirmation; then lists the servos on the ports."""
        self._ask(event, "Scan the rig's ports?", SCAN, "Scan", lambda: self._show_ports(event))

    def show_registers(self, message: ReadRegisters | WriteRegister, event: viser.GuiEvent, *, off: bool) -> None:
        """Shows the registers of a servo after a command; with its torque off some can be written."""
        found = self._look(message)
        if not isinstance(found, Registers):
            return
        gui = self._gui(event)
        rows = [(str(row.address), row.name, str(row.count), row.meaning) for row in found.registers]
        with gui.add_modal(f"{found.joint}: {found.model}") as window:
            gui.add_html(_table(("address", "register", "count", "meaning"), rows))
            if off:
                self._add_writing(found, event, window)
            else:
                gui.add_html(f'<div class="part">{TORQUE_FIRST}</div>')
            gui.add_button("Close", color="gray").on_click(lambda _: window.close())

    def _add_writing(self, found: Registers, event: viser.GuiEvent, window: GuiModalHandle) -> None:
        gui = self._gui(event)
        held = {row.name: row.count for row in found.registers if row.writable}
        register = gui.add_dropdown("register", [*held])
        count = gui.add_number("count", held[register.value], step=1)

        @register.on_update
        def _(_: viser.GuiEvent) -> None:
            count.value = held[register.value]

        @gui.add_button("Write ...", color="gray").on_click
        def _(click: viser.GuiEvent) -> None:
            window.close()
            name, value = register.value, int(count.value)
            text = WRITES.format(before=held[name])
            write = WriteRegister(found.joint, name, value)
            title = f"Write {value} into {name} of {found.joint}?"
            self._ask(click, title, text, "Write", lambda: self.show_registers(write, click, off=True))

    def _show_ports(self, event: viser.GuiEvent) -> None:
        found = self._look(ScanPorts())
        if not isinstance(found, OnPorts):
            return
        rows = [
            (str(one.servo), one.joint or "not in the rig file", one.model, str(one.firmware)) for one in found.servos
        ]
        rows += [("", joint, "does not answer", "") for joint in found.missing]
        gui = self._gui(event)
        with gui.add_modal("On the rig's ports") as window:
            gui.add_html(_table(("id", "joint", "model", "firmware"), rows))
            gui.add_button("Close", color="gray").on_click(lambda _: window.close())


def _table(heads: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    head = "".join(f"<th>{one}</th>" for one in heads)
    body = "".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    # The window gives its focus to the table: a list that has it would stand open.
    opened = '<div class="servo-table" tabindex="0" data-autofocus>'
    return f"{opened}<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
