"""The cause of incidents: a port that falls silent, or some of its servos, is one event, which says what to check."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING

from motiondeck_base.files import listed

if TYPE_CHECKING:
    from hardware.rig.supervision.health import Incident

SILENT = ("does not answer", "was cut off")
FOLLOWS = ("does not follow", "has lost its torque", *SILENT)  # what else comes of a silent port
FOLLOWS_WITHIN = 3.0  # s
# By the beginning of an incident: what to check of one servo, and of several of a port at once.
_CHECKS = {
    **dict.fromkeys(SILENT, ("its plug and cable", "their plugs and cables")),
    "has lost its torque": ("its supply", "the supply"),
    "has a low supply voltage": ("supply and cable", "the supply"),
    "is getting hot": ("what it carries", "what they carry"),
    "pushes against": ("what is in its way", "what is in their way"),
}
_OF_SEVERAL = {"does": "do", "has": "have", "is": "are", "was": "were", "pushes": "push", "answers": "answer"}


def explained(
    incidents: Collection[Incident], new: Collection[str], ports: Mapping[str, str]
) -> list[tuple[str, bool]]:
    """The new ones of the latest incidents by port and cause: what has happened, what to check, and whether a fault.

    `new` has them in words, source and what; `ports` are by the sources of incidents, in the order of the rig file.
    """
    ended = max((one.time for one in incidents), default=0.0)
    quiet = defaultdict[str, dict[str, str]](dict)  # by port, what the servos did that fell silent together
    latest = dict[str, float]()
    for one in incidents:
        if one.fault and one.what.startswith(SILENT) and ended - one.time < FOLLOWS_WITHIN:
            port = ports.get(one.source, "")
            if one.silent and one.time > latest.get(port, one.time):
                quiet[port].clear()  # more is known by now
            latest[port] = one.time
            quiet[port] |= dict.fromkeys((*one.silent, one.source), one.what)
    groups: dict[tuple[str, str, bool], dict[str, str]] = {}
    for one in incidents:
        if f"{one.source} {one.what}" in new:
            port = ports.get(one.source, "")
            together = one.fault and one.what.startswith(FOLLOWS) and one.source in quiet[port] and len(quiet[port]) > 1
            kind, group = ("", quiet[port]) if together else (one.what.partition(":")[0], dict[str, str]())
            groups.setdefault((port, kind, one.fault), group).setdefault(one.source, one.what)
    return [(_text(port, kind, happened, ports), fault) for (port, kind, fault), happened in groups.items()]


def _text(port: str, kind: str, happened: Mapping[str, str], ports: Mapping[str, str]) -> str:
    (source, what), *others = happened.items()
    if not kind:
        chain, count = [source for source in ports if ports[source] == port], len(happened)
        cause, check = f"the port {port} was silent", "adapter, cable and supply"
        if count < len(chain):
            cause = f"{count} of {len(chain)} servos of {port} stopped answering"
            are_last = set(chain[-count:]) == happened.keys()
            check = f"the cable after {chain[-count - 1]}" if are_last else "the cable to their branch"
    else:
        checks = next((checks for begins, checks in _CHECKS.items() if what.startswith(begins)), ("", ""))
        cause, check = f"{source} {what}", checks[0]
        if others:
            verb, _, rest = kind.partition(" ")
            of_all = rest.replace("its target", "their targets").replace("its", "their")
            of_all = of_all.replace("without it", "without them")
            cause, check = f"{len(happened)} servos {_OF_SEVERAL.get(verb, verb)} {of_all}", checks[1]
    said = cause + (f". Check {check}." if check else "." * bool(others))
    return said + f" Servos: {listed(source.partition(' (')[0] for source in happened)}" if others or not kind else said
