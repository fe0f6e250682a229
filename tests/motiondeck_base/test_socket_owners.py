import os
import socket

import pytest

from motiondeck_base import socket_owners
from motiondeck_base.socket_owners import owner_of_connection, owners_of_datagrams


def test_the_owner_of_a_connection_is_found_for_both_kinds_of_socket():
    with socket.create_server(("127.0.0.1", 0)) as server:
        there = server.getsockname()
        with socket.create_connection(there) as client:
            assert owner_of_connection(client.getsockname(), there) == os.geteuid()
            assert owner_of_connection(("127.0.0.9", 1), there) is None
        with socket.socket(socket.AF_INET6) as client:
            client.connect(("::ffff:127.0.0.1", there[1]))
            assert owner_of_connection(("127.0.0.1", client.getsockname()[1]), there) == os.geteuid()


@pytest.mark.parametrize(
    ("family", "address"),
    [
        (socket.AF_INET, "127.0.0.1"),
        (socket.AF_INET, "0.0.0.0"),
        (socket.AF_INET6, "::"),
        (socket.AF_INET6, "::ffff:127.0.0.1"),
    ],
)
def test_the_owners_of_datagrams_are_those_of_the_sockets_they_can_come_from(family, address):
    with socket.socket(family, socket.SOCK_DGRAM) as sender:
        sender.bind((address, 0))
        port = sender.getsockname()[1]
        assert owners_of_datagrams(("127.0.0.1", port)) == {os.geteuid()}
    assert owners_of_datagrams(("127.0.0.1", port)) == set()


def test_all_users_who_can_have_sent_a_datagram_are_found(monkeypatch, tmp_path):
    (tmp_path / "udp").write_text(
        "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode ref pointer\n"
        "  1: 0100007F:2328 00000000:0000 07 00000000:00000000 00:00000000 00000000  1000        0 1 2 0 0\n"
        "  2: 00000000:2328 00000000:0000 07 00000000:00000000 00:00000000 00000000  1001        0 1 2 0 0\n"
        "  3: 0200007F:2328 00000000:0000 07 00000000:00000000 00:00000000 00000000  1002        0 1 2 0 0\n"
        "  4: 0100007F:2329 00000000:0000 07 00000000:00000000 00:00000000 00000000  1003        0 1 2 0 0\n"
    )
    monkeypatch.setattr(socket_owners, "Path", lambda folder, table: tmp_path / table)
    assert owners_of_datagrams(("127.0.0.1", 0x2328)) == {1000, 1001}
