"""While commands are spoken the server's loop goes before what is ordinary, and not a moment longer."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from server.slowdown.urgency import PRIORITY, Urgency
from tests.server.slowdown.conftest import field

PROJECT = Path(__file__).resolve().parents[3]


def policy() -> tuple[int, int]:
    """Of the calling thread, without the flag for what it starts; and its priority."""
    return os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK, os.sched_getparam(0).sched_priority


def is_allowed() -> bool:
    with Urgency().held():
        return policy()[0] == os.SCHED_RR


needs_right = pytest.mark.skipif(not is_allowed(), reason="the system allows no real-time policy here (CAP_SYS_NICE)")


@needs_right
def test_the_last_one_to_end_gives_the_processor_back() -> None:
    before, urgency = policy(), Urgency()
    one, other = urgency.held(), urgency.held()
    one.__enter__()
    assert policy() == (os.SCHED_RR, PRIORITY)
    other.__enter__()
    one.__exit__(None, None, None)
    assert policy() == (os.SCHED_RR, PRIORITY)
    other.__exit__(None, None, None)
    assert policy() == before


@needs_right
def test_a_fault_gives_it_back_too() -> None:
    before = policy()
    with pytest.raises(ZeroDivisionError), Urgency().held():
        raise ZeroDivisionError
    assert policy() == before


@needs_right
def test_what_is_started_meanwhile_is_ordinary() -> None:
    with Urgency().held():
        said = subprocess.run(
            [sys.executable, "-c", "import os; print(os.sched_getscheduler(0))"], capture_output=True, text=True
        )
    assert int(said.stdout) == os.SCHED_OTHER


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can be somebody else")
def test_where_the_system_refuses_it_is_said_once_and_nothing_else_changes() -> None:
    program = """
        import os, sys
        sys.path.insert(0, sys.argv[1])
        from server.slowdown.urgency import Urgency
        os.setresuid(65534, 65534, 65534)
        urgency = Urgency()
        for _ in range(2):
            with urgency.held():
                print(os.sched_getscheduler(0))
    """
    said = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program), str(PROJECT)], capture_output=True, text=True, check=True
    )
    assert said.stdout.split() == [str(os.SCHED_OTHER)] * 2
    assert said.stderr.count("ordinary priority") == 1


@needs_right
@pytest.mark.slow
async def test_an_order_has_it_from_its_beginning_to_its_release() -> None:
    async with field() as car:  # the server is on this thread
        await car.armed()
        assert policy()[0] == os.SCHED_OTHER
        await car.post("order")
        assert policy() == (os.SCHED_RR, PRIORITY)
        await car.post("release", number=(await car.slow())["order"]["number"])
        await car.until(lambda _: policy()[0] == os.SCHED_OTHER)
