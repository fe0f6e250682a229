"""A member's link to a show over Eclipse zenoh: tokens, publications, questions; the only file that knows zenoh.

Every member is connected to every other one directly, so that an emergency stop needs no relay. Scouting is off:
no member is searched for on the network. A link that is silent for LEASE counts as lost, and is dialled repeatedly.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from motiondeck.shows.membership import AUTHORITY, CERTIFICATE, KEY, Membership
from motiondeck.shows.messages import EmergencyStopAll, encode
from motiondeck_base.errors import MotiondeckError

if TYPE_CHECKING:
    import zenoh

LEASE = 2.0  # after this silence a link is lost, s; a live one says something four times as often
STOP_SAID, STOP_AGAIN = 5, 0.02  # how often a new emergency stop is published, and the period of that, s
_RECEIVING_THREADS = 64

Received = Callable[[str, bytes], None]  # called with a key within the show and the data, in a thread of zenoh


class Link:
    """Connected to a show; keys are below `motiondeck/SHOW/`."""

    def __init__(self, member: Membership) -> None:
        """Opens it; absent members are dialled. MotiondeckError without zenoh, an address or good certificates."""
        # Zenoh blocks a thread that receives for up to 10 s while it closes a lost link; with its usual two, one cut
        # link can keep all others from being heard.
        os.environ.setdefault("ZENOH_RUNTIME", f"(rx: (worker_threads: {_RECEIVING_THREADS}))")
        try:
            import zenoh
        except ImportError:
            raise MotiondeckError("a show needs Eclipse zenoh: pip install 'motiondeck[fleet]'") from None
        zenoh.init_log_from_env_or("off")
        self._zenoh = zenoh
        self._root = f"motiondeck/{member.show}/"
        try:
            self._session = zenoh.open(_config(member))
        except zenoh.ZError as error:
            reason = str(error).split(" at /", 1)[0][:300]  # without zenoh's source files
            if "acquire lock" in reason or "already in use" in reason:
                reason = f"another {member.name} is running there, or something else has that port"
            raise MotiondeckError(f"{member}: no link to the show can be opened ({reason})") from None
        self._kept: list[Any] = []

    @property
    def neighbours(self) -> int:
        """The number of connected members."""
        return len(self._session.info.peers_zid())

    def announce(self, key: str) -> None:
        """Announces a key until the link is closed or lost."""
        self._kept.append(self._session.liveliness().declare_token(self._root + key))

    def watch(self, keys: str, seen: Callable[[str, bool], None]) -> None:
        """Calls `seen` with each announced key, present ones included, and with those that are gone."""
        here = self._zenoh.SampleKind.PUT

        def changed(sample: zenoh.Sample) -> None:
            seen(self._within(sample.key_expr), sample.kind == here)

        self._kept.append(self._session.liveliness().declare_subscriber(self._root + keys, changed, history=True))

    def subscribe(self, keys: str, received: Received) -> None:
        """Calls `received` with what others publish."""

        def arrived(sample: zenoh.Sample) -> None:
            received(self._within(sample.key_expr), sample.payload.to_bytes())

        self._kept.append(self._session.declare_subscriber(self._root + keys, arrived))

    def publish(self, key: str, data: bytes) -> None:
        """Publishes with the highest priority; drops what cannot be sent at once."""
        self._session.put(
            self._root + key,
            data,
            congestion_control=self._zenoh.CongestionControl.DROP,
            priority=self._zenoh.Priority.REAL_TIME,
            express=True,
        )

    def answer(self, key: str, answer: Callable[[], bytes]) -> None:
        """Answers queries, in a thread of zenoh."""

        def asked(query: zenoh.Query) -> None:
            with query:
                query.reply(self._root + key, answer())

        self._kept.append(self._session.declare_queryable(self._root + key, asked, complete=True))

    def ask(self, keys: str, received: Received, patience: float = 1.0) -> None:
        """Queries all members that answer, without waiting; answers after `patience`, s, are lost."""

        def replied(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                received(self._within(reply.ok.key_expr), reply.ok.payload.to_bytes())

        # Without consolidation an answer comes when it arrives, not when all have answered.
        self._session.get(
            self._root + keys,
            replied,
            consolidation=self._zenoh.ConsolidationMode.NONE,
            target=self._zenoh.QueryTarget.ALL,
            timeout=patience,
            priority=self._zenoh.Priority.REAL_TIME,
            express=True,
        )

    def close(self) -> None:
        """Ends the link; may be called twice."""
        if not self._session.is_closed():
            self._session.close()

    def _within(self, key: zenoh.KeyExpr) -> str:
        return str(key).removeprefix(self._root)


class StopRepeater:
    """Publishes a new emergency stop several times: what cannot be sent at once is dropped."""

    def __init__(self, link: Link) -> None:
        self._link, self._data = link, b""
        self._times: list[float] = []

    @property
    def due(self) -> float:
        """When `step` has something to do, s; infinite for never."""
        return self._times[0] if self._times else math.inf

    def start(self, stop: EmergencyStopAll, now: float) -> None:
        """Publishes a stop for the first time."""
        self._data, self._times = encode(stop), [now + STOP_AGAIN * again for again in range(STOP_SAID)]
        self.step(now)

    def step(self, now: float) -> None:
        """Publishes it again where that is due."""
        while self.due <= now:
            del self._times[0]
            self._link.publish("stop", self._data)


def _config(member: Membership) -> zenoh.Config:
    import zenoh

    settings: dict[str, Any] = {
        "mode": "peer",
        "listen/endpoints": member.listen,
        "connect/endpoints": member.connect,
        "connect/timeout_ms": -1,  # tries for ever, in the background
        "connect/exit_on_failure": False,
        "connect/retry": {"period_init_ms": 200, "period_max_ms": 1000, "period_increase_factor": 1.5},
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 1,  # ms; opening does not wait for members that are away (by itself 500 ms)
        "transport/link/tx/lease": round(1e3 * LEASE),
        "transport/unicast/open_timeout": round(1e3 * LEASE),
        "transport/link/protocols": ["unixsock-stream" if member.certificates is None else "tls"],
        "transport/shared_memory/enabled": False,
    }
    if member.certificates is not None:
        folder = member.certificates.resolve()
        settings |= {
            "transport/link/tls": {
                "root_ca_certificate": str(folder / AUTHORITY),
                "enable_mtls": True,
                "verify_name_on_connect": True,
                "close_link_on_expiration": True,
                **{f"{side}_certificate": str(folder / CERTIFICATE) for side in ("listen", "connect")},
                **{f"{side}_private_key": str(folder / KEY) for side in ("listen", "connect")},
            }
        }
    config = zenoh.Config()
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return config
