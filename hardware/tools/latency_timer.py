"""The latency timer of a USB adapter: how long it holds received bytes back."""

from __future__ import annotations

from pathlib import Path

_USB_SERIAL = Path("/sys/bus/usb-serial/devices")


def latency_timer(port: str) -> int | None:
    """The latency timer of a USB adapter, ms; None where the system has none for this port."""
    try:
        return int(latency_file(port).read_text())
    except (OSError, ValueError):
        return None


def shorten_latency(port: str) -> str:
    """Sets the latency timer of a USB adapter to 1 ms; what was done, or what to do for it, in words.

    The adapter forgets it when it is unplugged.
    """
    before, file = latency_timer(port), latency_file(port)
    if before is None:
        return f"{port} has no latency timer that could be set"
    if before <= 1:
        return f"the latency timer of {port} is 1 ms already"
    try:
        file.write_text("1")
    except OSError as error:
        return f"the latency timer of {port} stays {before} ms ({error.strerror}): echo 1 | sudo tee {file}"
    return f"the latency timer of {port} was {before} ms and is {latency_timer(port)} ms now, until it is unplugged"


def latency_file(port: str) -> Path:
    """Where the system shows the latency timer of a port."""
    return _USB_SERIAL / Path(port).resolve().name / "latency_timer"
