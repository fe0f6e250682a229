"""The members of a show, and their addresses.

On one machine they meet over Unix sockets in a folder that only their user may enter, and nothing listens to a network:

    COMMANDS/shows/SHOW/MEMBER        COMMANDS as in `local_transport.command_folder`
    COMMANDS/shows/SHOW/MEMBER.stops  emergency stops that a deck was not reset from, also of shows on several machines

On several machines each member has a folder that `motiondeck fleet certificates` made, and TLS on both sides:

    member.toml        show, name, and the address of every member
    authority.pem      whose certificates are accepted
    certificate.pem, key.pem        the member's own
"""

import re
import socket
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from controller.wire.local_transport import command_folder
from motiondeck_base.errors import FileFormatError, MotiondeckError
from motiondeck_base.toml_file import read_toml

CONDUCTOR = "conductor"
PORT = 7447  # the TCP port of a member whose address has none: zenoh's own
MEMBER_FILE, AUTHORITY, CERTIFICATE, KEY = "member.toml", "authority.pem", "certificate.pem", "key.pem"
_NAME = re.compile(r"[a-z0-9][a-z0-9-]{0,30}\Z")


class MemberFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A member.toml."""

    show: str
    name: str
    members: dict[str, str]  # the address of each member, HOST or HOST:PORT


@dataclass(frozen=True)
class Membership:
    """A member of a show."""

    show: str
    name: str
    # Where others reach it, as zenoh writes it; none for a member that only connects.
    listen: list[str] = field(default_factory=list)
    connect: list[str] = field(default_factory=list)
    certificates: Path | None = None  # the folder with its certificate, on several machines

    @property
    def memory(self) -> Path:
        """The file with the emergency stops that the deck was not reset from."""
        return _show_folder(self.show) / f"{self.name}.stops"

    def __str__(self) -> str:
        """Such as "left in gala, on this machine"."""
        where = "on this machine" if self.certificates is None else f"at {', '.join(self.listen)} with certificates"
        return f"{self.name} in {self.show}, {where}"


def check_name(name: str, what: str) -> str:
    """A name of a show or a member; raises a MotiondeckError if it cannot be one."""
    if not _NAME.match(name):
        raise MotiondeckError(f"'{name}' cannot name a {what}: take up to 31 of a-z, 0-9 and -, such as left-2")
    return name


def deck_in(text: str) -> Membership:
    """The membership of a deck: SHOW/DECK on this machine, or a folder with certificates; else a MotiondeckError."""
    folder = Path(text)
    if folder.is_dir():
        return with_certificates(folder)
    show, slash, name = text.partition("/")
    if not slash or "/" in name:
        raise MotiondeckError(
            f"--show {text}: give SHOW/DECK for a show on this machine, such as gala/left, or the folder that "
            "`motiondeck fleet certificates` made for this deck"
        )
    if name == CONDUCTOR:
        raise MotiondeckError(f"--show {text}: that name is for `motiondeck conduct`; call the deck otherwise")
    return on_this_machine(show, name)


def on_this_machine(show: str, name: str, *, listens: bool = True) -> Membership:
    """A member that meets the others over sockets in the user's own folder; MotiondeckError if a name cannot be one."""
    check_name(show, "show")
    check_name(name, "member of a show")
    folder = _show_folder(show)
    own = folder / name
    others = sorted(path for path in folder.iterdir() if path != own and path.is_socket() and _answers(path))
    return Membership(show, name, [_unix(own)] if listens else [], [_unix(path) for path in others])


def with_certificates(folder: Path, *, listens: bool = True) -> Membership:
    """The member whose certificates are in a folder.

    FileFormatError if its member.toml is wrong. MotiondeckError if there is no such folder, others may read its key, or
    a certificate is missing.
    """
    path = folder / MEMBER_FILE
    if not path.exists():
        members = sorted(str(found.parent) for found in folder.glob(f"*/{MEMBER_FILE}"))
        what = "no folder of one member" if folder.is_dir() else "there is no such folder"
        which = f", such as {' or '.join(members)}" if members else ""
        raise MotiondeckError(f"{folder}: {what}; `motiondeck fleet certificates` makes one for each{which}")
    file = read_toml(path, MemberFile)
    with FileFormatError.placed(path):
        for what, name in (("show", file.show), *(("member of a show", name) for name in file.members)):
            check_name(name, what)
        places = {name: host_and_port(address) for name, address in file.members.items()}
    endpoints = {name: f"tls/{f'[{host}]' if ':' in host else host}:{port}" for name, (host, port) in places.items()}
    if file.name not in endpoints:
        raise FileFormatError(f"{path}: its own name '{file.name}' is not among its members")
    for needed in (AUTHORITY, CERTIFICATE, KEY):
        if not (folder / needed).is_file():
            raise MotiondeckError(f"{folder / needed}: missing. Make it with: motiondeck fleet certificates")
    if (folder / KEY).stat().st_mode & 0o077:
        raise MotiondeckError(f"{folder / KEY}: others may read this key. Forbid that with: chmod 600 {folder / KEY}")
    own = endpoints.pop(file.name)
    # Of each two members the later one in the list dials: one connection for each pair.
    earlier = [*file.members][: [*file.members].index(file.name)]
    dialled = [endpoints[name] for name in earlier] if listens else [*endpoints.values()]
    return Membership(file.show, file.name, [own] if listens else [], dialled, folder)


def host_and_port(address: str) -> tuple[str, int]:
    """The parts of HOST, HOST:PORT, or [IPv6]:PORT; raises a MotiondeckError if it is none of them."""
    host, _, port = address.rpartition(":") if re.search(r":\d+\Z", address) else (address, "", str(PORT))
    host = host.removeprefix("[").removesuffix("]")
    if not host or re.search(r"[\s/#?\[\]]", host) or not 0 < int(port) < 65536:
        raise MotiondeckError(f"'{address}' is no address: give HOST or HOST:PORT, such as 192.168.1.20:{PORT}")
    return host, int(port)


def _show_folder(show: str) -> Path:
    """A show's folder of this user, which is made where it is missing."""
    folder = command_folder() / "shows" / show
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    return folder


def _unix(path: Path) -> str:
    return f"unixsock-stream/{path}"


def _answers(path: Path) -> bool:
    """Whether a process listens at a socket; it may have been left by a killed member."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        return probe.connect_ex(str(path)) == 0
