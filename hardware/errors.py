"""The errors between a rig file and a turning servo; each message is one line with the remedy."""

from collections.abc import Collection, Sequence

from motiondeck_base.errors import MotiondeckError


class SerialPortError(MotiondeckError):
    """A serial port that cannot be opened, or that vanished in use: whatever takes a bus may raise it."""


class ServoError(MotiondeckError):
    """A servo that did not carry out an instruction."""


class NoReplyError(ServoError):
    """A servo that stayed silent until the deadline, each time it was asked."""


class RefusedError(ServoError):
    """A servo that answered with an error number."""


class RigError(MotiondeckError):
    """A rig that differs from its file, or is not fit to be switched on; the message names the joints."""


class LostServosError(RigError):
    """Servos of a rig that do not answer, or have shut down: the names of their joints, and which of both."""

    def __init__(self, message: str, names: Collection[str] = (), what: str = "") -> None:
        super().__init__(message)
        self.names, self.what = names, what


def still_on(joints: Sequence[str]) -> str:
    """The warning about joints that did not confirm the end of a rig."""
    return f"torque may still be on: {', '.join(joints)}. Switch the power off first."


def with_torque(error: MotiondeckError, joints: Sequence[str]) -> MotiondeckError:
    """The same error, with the joints that did not confirm the end of the rig added."""
    return type(error)(f"{error} And {still_on(joints)}") if joints else error
