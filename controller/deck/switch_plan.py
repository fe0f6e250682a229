"""The plan of a deck: the switch under way, motions on its way, and the queue; times are s since its start."""

from collections import deque
from collections.abc import Iterable

from controller.deck.performance import Performance
from controller.deck.routes import Routes
from controller.deck.switch import CommandedSwitch
from controller.wire.messages.arguments import MOST_BLENDED, described
from controller.wire.messages.replies import Event, EventKind

REMEMBERED_SWITCHES = 1_000
REMEMBERED_EVENTS = 64
_NO_WEIGHT = 1e-9


class SwitchPlan:
    """The switches that a performance is to play; if `direct`, those in the queue go straight to their motion."""

    def __init__(self, performance: Performance, routes: Routes, *, direct: bool) -> None:
        self._performance, self._routes, self._direct = performance, routes, direct
        self.current: CommandedSwitch | None = None  # the switch that is under way
        self.fading: CommandedSwitch | None = None  # the one whose fade is under way
        self.blending: CommandedSwitch | None = None  # the one whose blend weights are changing
        self.blended: CommandedSwitch | None = None  # the one of the latest blend
        self.ahead: deque[str] = deque()  # the motions that the current switch has still to begin
        self.queued: deque[CommandedSwitch] = deque()  # the switches after it
        self._waits = False  # whether the next of those ahead waits for the end of the present motion
        self.commanded: deque[CommandedSwitch] = deque(maxlen=REMEMBERED_SWITCHES)
        self.events: deque[Event] = deque(maxlen=REMEMBERED_EVENTS)

    def command(self, switch: CommandedSwitch, *, direct: bool) -> CommandedSwitch:
        """Starts a switch; earlier commands are overtaken."""
        time = switch.commanded_s
        self.clear_queue(time)
        if self.current is not None:
            self._mark_overtaken([self.current], time)
        self.ahead.clear()
        self.commanded.append(switch)
        self._start(switch, time, direct)
        return switch

    def enqueue(self, switch: CommandedSwitch) -> CommandedSwitch:
        """Puts a switch at the end of the queue."""
        self.commanded.append(switch)
        self.queued.append(switch)
        return switch

    def clear_queue(self, time: float) -> None:
        """Forgets the queue: its commands are overtaken."""
        self._mark_overtaken(self.queued, time)
        self.queued.clear()

    def take_next(self, time: float) -> str | None:
        """Takes the motion that begins in this tick, if one does."""
        over = self._performance.ended
        if self.current is None and self.queued and over:
            self._start(self.queued.popleft(), time, self._direct)
        if not self.ahead or not (over or not self._waits):
            return None
        motion = self.ahead.popleft()
        if self.ahead:
            self._note("via", f"{motion}, on the way to {self.ahead[-1]}", motion, time)
        self.blending = None
        self._waits = True  # the motions on a way are one-shots, and those are finished
        self.fading = self.current
        return motion

    def finish_fade(self, time: float) -> None:
        """Notes that a fade has ended; the switch then settles, or begins its blend."""
        switch = self.fading
        if switch is None:
            return
        if switch is self.current and not self.ahead:
            if switch.blend:
                self._blend(switch)
            else:
                self._settle(switch, time)
        self.fading = None

    def update_blend(self, switch: CommandedSwitch, time: float) -> None:
        """Notes the progress of a switch's blend, and drops the motions whose weight has become 0."""
        performance = self._performance
        if performance.tracks.crossing or performance.fading:
            return
        self.blending = None
        performance.tracks.drop_weightless(switch.to)
        if switch is self.current and not self.ahead:
            self._settle(switch, time)

    def give_up_blend(self, problem: str, time: float) -> None:
        """Gives a blend up and switches to the motion that has more weight in it."""
        performance, blended = self._performance, self.blended
        blend = performance.tracks.blend
        if not blend or blended is None:
            return
        weights = performance.tracks.weights
        nearer = max(weights, key=weights.__getitem__)
        blended.fell_back = f"{described(performance.motion.name, blend)} {problem}, fell back to {nearer}"
        self._note("gave up", blended.fell_back, nearer, time)
        if self.current is not None:
            self._mark_overtaken([self.current], time)
        switch = CommandedSwitch(nearer, time)
        self.commanded.append(switch)
        self.current, self._waits = switch, False
        self.ahead.append(nearer)

    def _start(self, switch: CommandedSwitch, time: float, direct: bool) -> None:
        performance, here = self._performance, self._performance.motion
        self._note("motion", switch.destination, switch.to, time)
        self.current = switch
        if here.loop and self._goes_on(switch):
            if not switch.blend:
                switch.first_change_s = time
                self._settle(switch, time)
            elif performance.fading:
                self.fading = switch  # its blend begins when the fade has ended
            else:
                self._blend(switch)
            return
        if not direct:
            switch.via = self._routes.way(here.name, switch.to)
            switch.after = "" if here.loop or performance.tracks.leading.ended else here.name
        self.ahead.extend((*switch.via, switch.to))
        self._waits = bool(switch.after)

    def _goes_on(self, switch: CommandedSwitch) -> bool:
        """Whether what is shown, or faded to, plays on in what is commanded, so that only weights change."""
        performance = self._performance
        if not performance.tracks.blend:
            return switch.to == performance.motion.name
        present = {performance.motion.name, *(name for name, _ in performance.tracks.blend)}
        wanted = {switch.to, *(name for name, _ in switch.blend)}
        if not switch.blend or not present & wanted or len(present | wanted) > MOST_BLENDED:
            return False
        new = [(one, other) for one in wanted - present for other in (present | wanted) - {one}]
        return not any(self._routes.between_blended(*pair) for pair in new)

    def _blend(self, switch: CommandedSwitch) -> None:
        blend = dict(switch.blend)
        rest = 1.0 - sum(blend.values())
        # Weights such as 0.1, 0.2 and 0.7 do not sum to 1 exactly.
        self._performance.blend_in({switch.to: rest if abs(rest) > _NO_WEIGHT else 0.0} | blend)
        self.blending = self.blended = switch

    def _settle(self, switch: CommandedSwitch, time: float) -> None:
        switch.settled_s = time
        self.current = None
        self._note("settled", f"{switch.destination} after {time - switch.commanded_s:.2f} s", switch.to, time)

    def _mark_overtaken(self, switches: Iterable[CommandedSwitch], time: float) -> None:
        for switch in switches:
            switch.overtaken = True
            self._note("overtaken", f"another command has overtaken {switch.destination}", switch.to, time)

    def _note(self, kind: EventKind, text: str, motion: str, time: float) -> None:
        self.events.append(Event(kind, text, motion, time))
