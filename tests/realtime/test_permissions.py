import ctypes
import os

import pytest

from controller.realtime.permissions import request_realtime


class Libc:
    """Stands in for the C library; it grants or refuses to lock memory."""

    def __init__(self, answer):
        self.answer = answer
        self.flags = []

    def __call__(self, *_, **__):
        return self

    def mlockall(self, flags):
        self.flags.append(flags)
        return self.answer


@pytest.fixture
def scheduling(monkeypatch):
    asked = []
    monkeypatch.setattr(os, "sched_setscheduler", lambda pid, policy, param: asked.append((pid, policy)))
    return asked


def test_what_is_granted_is_said(monkeypatch, scheduling):
    monkeypatch.setattr(ctypes, "CDLL", Libc(0))
    assert [str(permission) for permission in request_realtime()] == [
        "real-time scheduling (SCHED_FIFO): granted",
        "memory locked in RAM (mlockall): granted",
    ]
    assert scheduling == [(0, os.SCHED_FIFO)]


def test_what_is_refused_is_said_with_the_remedy(monkeypatch):
    def refuse(*_):
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    monkeypatch.setattr(ctypes, "CDLL", Libc(-1))
    fifo, memory = request_realtime()
    assert not fifo.granted
    assert "not permitted" in str(fifo)
    assert "rtprio" in fifo.remedy
    assert not memory.granted
    assert "memlock" in memory.remedy


def test_a_system_that_knows_neither_is_no_error(monkeypatch):
    monkeypatch.delattr(os, "sched_setscheduler")
    monkeypatch.setattr(ctypes, "CDLL", lambda *_, **__: object())
    assert [permission.granted for permission in request_realtime()] == [False, False]


def test_under_a_memory_limit_the_future_is_left_unlocked(monkeypatch, scheduling):
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    libc = Libc(0)
    monkeypatch.setattr(ctypes, "CDLL", libc)
    monkeypatch.setattr("controller.realtime.permissions.resource.getrlimit", lambda _: (65536, 65536))
    request_realtime()
    monkeypatch.setattr("controller.realtime.permissions.resource.getrlimit", lambda _: (-1, -1))
    request_realtime()
    assert libc.flags == [1, 3]
