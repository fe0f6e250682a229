"""How the page shows each kind of event: as a notice or an alarm, as a mark of the last minutes, and to whom."""

from typing import NamedTuple

from controller.wire.messages.replies import EventKind


class EventLook(NamedTuple):
    """One kind of event; a row of `LOOKS`."""

    title: str = ""  # of its notice; without one there is none
    mark: str | None = None  # on the strip: "bad" for what went wrong, "" for else; None without one
    calls_back: bool = False  # whether every browser sees what happens now, wherever it looked
    alarming: bool = False  # whether its notice stays until somebody acknowledges it


LOOKS: dict[EventKind, EventLook] = {
    "motion": EventLook(calls_back=True),
    "via": EventLook("On the way"),
    "gave up": EventLook("Blend given up", "bad", calls_back=True),
    "paused": EventLook(mark="", calls_back=True),
    "resumed": EventLook(mark="", calls_back=True),
    "mode": EventLook(mark="", calls_back=True),
    "fault": EventLook("Fault", "bad", calls_back=True, alarming=True),
    "servo": EventLook(mark="", calls_back=True),
    "layer": EventLook("Layers", calls_back=True),
    "push": EventLook("Push", "", calls_back=True),
    "fell": EventLook("Fallen", "bad", calls_back=True, alarming=True),
    "stands": EventLook("Stands again", ""),
    "replayed": EventLook("Command refused", "bad", alarming=True),
    "lost": EventLook("Contact lost", "bad", calls_back=True, alarming=True),
}
ROUTINE = EventLook()  # of all other kinds
