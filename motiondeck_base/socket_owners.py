"""The users that own sockets on this machine, from the tables of /proc/net."""

import contextlib
import socket
import sys
from collections.abc import Iterator
from pathlib import Path

_MAPPED = "0000000000000000FFFF0000"  # in front of an IPv4 address in a table of IPv6

_ANY = ("00000000", "0" * 32)  # the address of a socket that was bound to none, in either table

End = tuple[str, int]  # an IPv4 address and a port


def owner_of_connection(here: End, there: End) -> int | None:
    """The user that has a TCP connection over IPv4 between two addresses on this machine; None if none has."""
    plain = (_as_listed(here), _as_listed(there))
    mapped = (_MAPPED + plain[0], _MAPPED + plain[1])
    found = ((ends, user) for table in ("tcp", "tcp6") for *ends, user in _sockets(table))
    return next((user for ends, user in found if tuple(ends) in (plain, mapped)), None)


def owners_of_datagrams(sender: End) -> set[int]:
    """The users with a UDP socket from which datagrams of an IPv4 address and port of this machine can come."""
    # A program that has sent its datagram and ended is not found any more.
    address, _, port = _as_listed(sender).partition(":")
    near = {f"{listed}:{port}" for listed in (address, _MAPPED + address, *_ANY)}
    return {user for table in ("udp", "udp6") for bound, _, user in _sockets(table) if bound in near}


def _sockets(table: str) -> Iterator[tuple[str, str, int]]:
    """Both ends and the user of each socket in a table of /proc/net, as that lists them."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/net", table).read_text().splitlines()[1:]:
            _, near, far, _, _, _, _, user, *_ = line.split()
            yield near, far, int(user)


def _as_listed(end: End) -> str:
    """An address and port as /proc/net/tcp has them: the address in the order of this machine's bytes."""
    return f"{int.from_bytes(socket.inet_aton(end[0]), sys.byteorder):08X}:{end[1]:04X}"
