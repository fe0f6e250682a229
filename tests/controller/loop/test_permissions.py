import ctypes
import os

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from controller.loop.permissions import (
    FIFO_PRIORITY,
    handed_back,
    permission_lines,
    request_core,
    request_one_blas_thread,
    request_realtime,
)


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
    monkeypatch.setattr(
        os, "sched_setscheduler", lambda pid, policy, param: asked.append((pid, policy, param.sched_priority))
    )
    return asked


def test_what_is_granted_is_said(monkeypatch, scheduling):
    monkeypatch.setattr(ctypes, "CDLL", Libc(0))
    assert permission_lines(request_realtime()) == [
        "granted: real-time scheduling (SCHED_FIFO), memory locked in RAM (mlockall)"
    ]
    request_realtime(7)
    assert scheduling == [(0, os.SCHED_FIFO, FIFO_PRIORITY), (0, os.SCHED_FIFO, 7)]


def test_what_is_refused_is_said_with_the_remedy(monkeypatch):
    def refuse(*_):
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    monkeypatch.setattr(ctypes, "CDLL", Libc(-1))
    fifo, memory = request_realtime()
    assert not fifo.granted
    (line,) = permission_lines([fifo, memory])
    assert line.startswith("not permitted: real-time scheduling (SCHED_FIFO). Allow it with 'ulimit -r 60'")
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
    monkeypatch.setattr("controller.loop.permissions.resource.getrlimit", lambda _: (65536, 65536))
    request_realtime()
    monkeypatch.setattr("controller.loop.permissions.resource.getrlimit", lambda _: (-1, -1))
    request_realtime()
    assert libc.flags == [1, 3]


def test_afterwards_scheduling_cores_and_memory_are_handed_back(monkeypatch):
    now = {"policy": os.SCHED_OTHER, "cores": {0, 1}}
    monkeypatch.setattr(os, "sched_getscheduler", lambda _: now["policy"])
    monkeypatch.setattr(os, "sched_setscheduler", lambda _, policy, __: now.update(policy=policy))
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: now["cores"])
    monkeypatch.setattr(os, "sched_setaffinity", lambda _, cores: now.update(cores=set(cores)))
    libc = Libc(0)
    libc.munlockall = lambda: libc.flags.append("unlocked")
    monkeypatch.setattr(ctypes, "CDLL", libc)

    def play():
        with handed_back():
            request_realtime()
            assert request_core(1).granted
            assert now == {"policy": os.SCHED_FIFO, "cores": {1}}
            raise KeyError

    with pytest.raises(KeyError):
        play()
    assert now == {"policy": os.SCHED_OTHER, "cores": {0, 1}}
    assert libc.flags[-1] == "unlocked"


def test_a_core_that_is_not_there_is_refused_with_those_that_are(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 3})

    def refuse(*_):
        raise OSError

    monkeypatch.setattr(os, "sched_setaffinity", refuse)
    permission = request_core(7)
    assert not permission.granted
    assert "core 7" in permission.name
    assert "cores 0, 3" in permission.remedy


def test_where_there_is_no_affinity_or_scheduling_nothing_is_handed_back(monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity")
    assert not request_core(0).granted
    with handed_back():
        pass


def test_linear_algebra_is_kept_to_one_thread():
    with threadpool_limits(None):
        assert request_one_blas_thread().granted
        assert {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"} <= {1}
