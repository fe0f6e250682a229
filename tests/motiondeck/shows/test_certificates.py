"""Who takes part over a network: members with a certificate of the show's authority, and nobody else."""

import json
import stat
import time
from contextlib import ExitStack, closing

import pytest

from motiondeck.shows.link import Link
from motiondeck.shows.membership import deck_in, with_certificates
from motiondeck_base.errors import MotiondeckError
from waiting import free_ports, until

zenoh = pytest.importorskip("zenoh")
make_certificates = pytest.importorskip("motiondeck.shows.certificates").make_certificates


def addresses(*names):
    return {name: f"127.0.0.1:{port}" for name, port in zip(names, free_ports(len(names)), strict=True)}


def plain_peer(port):
    """A zenoh program of somebody else, without encryption, that connects to a member."""
    config = zenoh.Config()
    config.insert_json5("connect/endpoints", json.dumps([f"tcp/127.0.0.1:{port}"]))
    config.insert_json5("connect/timeout_ms", "0")
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("listen/endpoints", "[]")
    return zenoh.open(config)


def test_members_hear_each_other_and_strangers_neither_hear_nor_command(tmp_path):
    members = addresses("conductor", "left")
    folders = {folder.name: folder for folder in make_certificates(tmp_path / "gala", "gala", members)}
    foreign = {**members, "stranger": f"127.0.0.1:{free_ports(1)[0]}"}
    (*_, stranger_folder) = make_certificates(tmp_path / "other", "gala", foreign)
    with ExitStack() as links:
        conductor, left = (links.enter_context(closing(Link(with_certificates(folders[n])))) for n in members)
        stranger = links.enter_context(closing(Link(with_certificates(stranger_folder))))
        plain = plain_peer(int(members["left"].split(":")[1]))
        links.callback(plain.close)
        heard, overheard = [], []
        left.subscribe("**", lambda key, data: heard.append(data))
        stranger.subscribe("**", lambda key, data: overheard.append(data))
        plain.declare_subscriber("**", lambda sample: overheard.append(sample.payload.to_bytes()))
        until(lambda: conductor.neighbours == 1 and left.neighbours == 1, "the link")

        def said():
            conductor.publish("cue", b"true")
            stranger.publish("cue", b"false")
            plain.put("motiondeck/gala/cue", b"false")
            return b"true" in heard

        until(said, "what is said")
        time.sleep(0.5)  # for those that are not meant to arrive
        said()
        assert set(heard) == {b"true"}
        assert b"true" not in overheard  # what they say themselves they do hear
        assert stranger.neighbours == 0
        assert plain.info.peers_zid() == []


def test_only_the_owner_may_read_a_key(tmp_path):
    (folder, _) = make_certificates(tmp_path / "gala", "gala", addresses("conductor", "left"))
    key = folder / "key.pem"
    assert stat.S_IMODE(key.stat().st_mode) == 0o600
    key.chmod(0o640)
    with pytest.raises(MotiondeckError, match=r"others may read this key.*chmod 600"):
        deck_in(str(folder))


def test_the_folder_of_all_members_is_not_that_of_one(tmp_path):
    make_certificates(tmp_path / "gala", "gala", addresses("conductor", "left"))
    with pytest.raises(MotiondeckError, match=r"gala: no folder of one member.*gala/conductor or \S*gala/left"):
        deck_in(str(tmp_path / "gala"))
    with pytest.raises(MotiondeckError, match=r"nothing: there is no such folder.*fleet certificates"):
        with_certificates(tmp_path / "nothing")


def test_members_can_be_added(tmp_path):
    make_certificates(tmp_path / "gala", "gala", addresses("conductor", "left"))
    authority = (tmp_path / "gala" / "authority.pem").read_bytes()
    added = make_certificates(tmp_path / "gala", "gala", addresses("conductor", "left", "right"))
    assert [folder.name for folder in added] == ["conductor", "left", "right"]
    assert {(folder / "authority.pem").read_bytes() for folder in added} == {authority}


@pytest.mark.parametrize(
    ("members", "says"),
    [
        ({"left": "10.0.0.1"}, "address of the conductor"),
        ({"conductor": "10.0.0.1", "Left": "10.0.0.2"}, "'Left' cannot name"),
        ({"conductor": "10.0.0.1:99999"}, "is no address"),
        ({"conductor": "10.0.0.1", "left": "10.0.0.1:7447"}, "conductor and left have one address, 10.0.0.1:7447"),
        ({"conductor": 'x"y/z'}, "is no address"),
    ],
)
def test_a_mistake_is_named_before_a_file_is_written(tmp_path, members, says):
    with pytest.raises(MotiondeckError, match=says):
        make_certificates(tmp_path / "gala", "gala", members)
    assert not (tmp_path / "gala").exists()


@pytest.mark.parametrize(
    ("show", "says"),
    [
        ("gala", "give SHOW/DECK"),
        ("gala/left/arm", "give SHOW/DECK"),
        ("gala/Left", "'Left' cannot name"),
        ("gala/conductor", "that name is for"),
    ],
)
def test_what_a_deck_is_called_is_checked(show, says, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(MotiondeckError, match=says):
        deck_in(show)
