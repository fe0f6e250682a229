"""Breakages of a show's sources that its schedules must notice."""

from __future__ import annotations

_MEMBER, _CONDUCTOR = "motiondeck.shows.member", "motiondeck.shows.conductor"
_COMMANDS = "controller.wire.messages.commands"
_PASSED_ON = "self._notify(f\"emergency stop by {'the conductor' if stop.by == CONDUCTOR else stop.by}\")\n"

MUTANTS = {
    "no member passes a stop on": [
        (_MEMBER, _PASSED_ON + '        self._link.publish("stop", messages.encode(stop))', _PASSED_ON),
        (_MEMBER, 'for stop in self._held:\n            self._link.publish("stop", messages.encode(stop))', ""),
        (_CONDUCTOR, 'self._link.publish("stop", data)', "pass"),
    ],
    "no check of what a cue may say, at member and deck": [
        (_MEMBER, 'command.row.check_use("cue")\n                command.check()', "pass"),
        (_COMMANDS, 'self.say.row.check_use("timed")', "pass"),
        (_COMMANDS, 'CommandRow(("replay",))', 'CommandRow(("replay",), ALWAYS)'),
    ],
    "a restarted deck does not wait": [(_MEMBER, "if now < self._joined_at", "if False")],
    "a restarted deck remembers nothing": [(_MEMBER, "memory.read() if memory is not None else ()", "()")],
    "no ids in clock answers": [(_CONDUCTOR, "*lost, self._stops.latest)", "*lost, [])")],
    "a second press is swallowed": [
        (_MEMBER, "others <= self._passed_on:", "others <= self._passed_on or self._held:")
    ],
    "a deck does not repeat its stop": [
        (_MEMBER, 'for stop in self._held:\n            self._link.publish("stop", messages.encode(stop))', "")
    ],
}
"""Each with its module, a text of it, and what is there instead; repeated."""
