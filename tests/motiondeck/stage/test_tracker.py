"""A person leads a deck by datagrams that are written here byte by byte, as JSON and as VMC."""

import json
import select
import socket
import struct
from contextlib import closing

import numpy as np
import pytest

import synthetic
from controller.deck.person_follower import PersonFollower
from controller.motion.skeleton import walk_path
from controller.wire.messages.commands import FollowPerson, LockPhase
from motiondeck.stage.stage_file import read_stage
from motiondeck_base.errors import FileFormatError, MotiondeckError
from waiting import PATIENCE, free_port

pytest.importorskip("pythonosc")
tracker = pytest.importorskip("motiondeck.stage.tracker")

POINTS = ("head", "rarm", "larm")
RATE = 30.0


def osc(address, *values):
    """An OSC message by its specification: padded strings, big-endian floats."""

    def padded(text):
        data = text.encode() + b"\0"
        return data + b"\0" * (-len(data) % 4)

    tags = "," + "".join("s" if isinstance(value, str) else "f" for value in values)
    body = b"".join(padded(value) if isinstance(value, str) else struct.pack(">f", value) for value in values)
    return padded(address) + padded(tags) + body


def bundle(*messages):
    return b"#bundle\0" + struct.pack(">Q", 1) + b"".join(struct.pack(">i", len(one)) + one for one in messages)


def unity(place):
    """x forward, y left, z up as Unity's x right, y up, z forward."""
    return -place[1], place[2], place[0]


class Sender:
    """A program that sends to an input, whose clock is `now`."""

    def __init__(self, points=POINTS, names=None):
        self.told, self.signals, self.now = [], [], 100.0
        self.port = free_port()
        follower = PersonFollower(synthetic.small_phase_library(), points)
        self.input = tracker.TrackerInput(self.port, follower, names or {}, self.told.append)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def close(self):
        self.input.close()
        self.socket.close()

    def send(self, data, later=1.0 / RATE):
        self.socket.sendto(data, ("127.0.0.1", self.port))
        assert select.select([self.input], [], [], PATIENCE)[0]
        self.now += later
        self.signals += self.input.read(self.now)

    @property
    def place(self):
        assert isinstance(self.signals[-1].command, FollowPerson)
        return self.signals[-1].command


@pytest.fixture
def sender():
    with closing(Sender()) as made:
        yield made


@pytest.fixture(scope="module")
def waving():
    """Where head and arms of somebody are who waves, 30 times a second, and the phases."""
    library = synthetic.small_phase_library()
    network, frames = library.network.twin(), np.empty((240, library.encoding.channels))
    network.seek("wave", 0.0)
    for frame in frames:
        network.advance(frame)
    pose = walk_path(library.encoding.decode(frames), 1.0 / 120.0)
    skeleton = library.encoding.skeleton
    joints = skeleton.joints(pose.root_position, pose.rotation)[::4]
    own = joints[:, [1 + skeleton.bones.index(point) for point in POINTS]]
    return own, (np.arange(240) / 120.0 % 1.0)[::4]


def check(sender, phases):
    assert isinstance(sender.signals[0].command, LockPhase)
    assert sender.place.to == "wave"
    assert abs((sender.place.phase - phases[-1] + 0.5) % 1.0 - 0.5) < 0.05
    assert sender.told == []


def test_points_in_json_lead(sender, waving):
    for points in waving[0]:
        places = dict(zip(POINTS, points.tolist(), strict=True))
        sender.send(json.dumps({"points": places}).encode())
    check(sender, waving[1])


def test_angles_in_json_are_those_of_joints(sender):
    sender.send(b'{"angles": {"neck": 0.25, "larm": -1}, "points": {"head": [1, 2, 3]}}')
    seen = sender.input._seen(sender.now)
    assert (seen["neck"][2], seen["larm"][2], seen["head"][2]) == (0.25, -1.0, 3.0)
    assert sender.told == []


def test_trackers_of_vmc_lead_by_their_serial_numbers(waving):
    names = {"HMD-1": "head", "LHR-2": "rarm", "LHR-3": "larm"}
    with closing(Sender(names=names)) as sender:
        for points in waving[0]:
            messages = [
                osc(f"/VMC/Ext/{kind}/Pos", name, *unity(place), 0.0, 0.0, 0.0, 1.0)
                for kind, name, place in zip(("Hmd", "Con", "Tra"), names, points, strict=True)
            ]
            sender.send(bundle(*messages))
        check(sender, waving[1])


def test_bones_of_vmc_are_placed_one_in_the_other():
    with closing(Sender(points=("head", "root"))) as sender:
        quarter = np.sqrt(0.5)
        bones = [
            ("Hips", (0.0, 0.9, 0.0), (0.0, quarter, 0.0, quarter)),  # a quarter turn about Unity's y: z becomes x
            ("Spine", (0.0, 0.1, 0.0), (0.0, 0.0, 0.0, 1.0)),
            ("Neck", (0.0, 0.4, 0.2), (0.0, 0.0, 0.0, 1.0)),  # Chest and UpperChest are not sent
            ("Head", (0.0, 0.1, 0.0), (0.0, 0.0, 0.0, 1.0)),
            ("LeftHand", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
        ]
        sender.send(bundle(*(osc("/VMC/Ext/Bone/Pos", name, *place, *turn) for name, place, turn in bones)))
        seen = sender.input._seen(sender.now)
        assert seen["root"] == pytest.approx((0.0, 0.0, 0.9), abs=1e-6)
        assert seen["head"] == pytest.approx((0.0, -0.2, 1.5), abs=1e-6)


def test_what_is_no_tracker_data_is_told_and_left_out(sender, waving):
    for data in (
        b'{"points": {"head": [1, 2]}}',
        b'{"points": {"head": [1, 2, NaN]}}',
        b'{"joints": {}}',
        b"{",
        osc("/VMC/Ext/Tra/Pos", "a", 1.0),
        osc("/VMC/Ext/Bone/Pos", 1.0, *[0.0] * 7),
        b"\xff\xfe",
    ):
        sender.send(data)
        assert len(sender.told) == 1, data
        sender.told.clear()
    sender.send(osc("/VMC/Ext/OK", 1.0))
    sender.send(osc("/VMC/Ext/Bone/Pos", "Tail", *[0.0] * 7))
    sender.send(json.dumps({"points": {"tail": [1.0, 2.0, 3.0]}}).encode())
    assert sender.told == []
    for points in waving[0]:
        sender.send(json.dumps({"points": dict(zip(POINTS, points.tolist(), strict=True))}).encode())
    check(sender, waving[1])


def test_infinite_and_huge_numbers_do_not_stop_it(sender, waving):
    for value in (float("inf"), float("nan"), 3e38):
        sender.send(osc("/VMC/Ext/Tra/Pos", "head", value, value, value, 0.0, 0.0, 0.0, 1.0))
    sender.send(b'{"points": {"larm": [1e308, 1e308, -1e308]}}')
    for points in waving[0]:
        sender.send(json.dumps({"points": dict(zip(POINTS, points.tolist(), strict=True))}).encode())
    check(sender, waving[1])


def test_a_port_in_use_is_refused_with_the_place_in_the_file(sender):
    with pytest.raises(MotiondeckError, match=r"trackers cannot listen.*\[tracker\]"):
        tracker.TrackerInput(sender.port, sender.input._follower, {}, print)


def test_a_stage_file_with_a_tracker_alone_is_read(tmp_path):
    file = tmp_path / "follow.toml"
    file.write_text('[tracker]\nlisten = 39539\nlibrary = "thesis15"\nnames = { "LHR-1" = "lhan" }\n')
    mapped = read_stage(file).tracker
    assert (mapped.listen, mapped.library, mapped.points) == (39539, "thesis15", ("head", "lhan", "rhan"))
    assert mapped.names == {"LHR-1": "lhan"}
    file.write_text("[tracker]\nlisten = 39539\n")
    with pytest.raises(FileFormatError, match="library"):
        read_stage(file)
