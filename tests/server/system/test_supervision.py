"""Supervised tasks start again, whatever ended them; a session's parts fail one by one and not together."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from monitor.shell_facts import RecorderFacts
from server.app.app import create_app
from server.app.config import Config
from server.rosbridge_server.server import RosBridge
from server.system.supervision import Supervisor
from server.vehicle.facts import Vitals, problems
from server.vehicle.session import Session
from server.vehicle.vehicle import Vehicle
from tests.http import http_client
from tests.server.cars import driving
from tests.server.conftest import serving_app
from tests.server.viewer import viewer

pytestmark = pytest.mark.world(n=15)


async def until(condition: Any, within_s: float = 20.0) -> None:
    async with asyncio.timeout(within_s):
        while not condition():
            await asyncio.sleep(0.01)


def task_named(name: str) -> asyncio.Task[Any]:
    return next(task for task in asyncio.all_tasks() if task.get_name() == name)


@pytest.mark.parametrize("how", ["raises", "is cancelled", "returns"])
async def test_a_task_starts_again_whatever_ended_it(how: str, caplog: pytest.LogCaptureFixture) -> None:
    starts: list[int] = []
    reported: list[tuple[str, str]] = []

    async def work() -> None:
        starts.append(len(starts))
        if len(starts) > 1:
            await asyncio.Event().wait()
        if how == "raises":
            raise ValueError("broken")
        if how == "is cancelled":
            raise asyncio.CancelledError

    supervisor = Supervisor("car", on_restart=lambda name, why: reported.append((name, why)))
    with caplog.at_level(logging.ERROR):
        supervisor.keep("judge", work)
        await until(lambda: len(starts) == 2)
    why = {"raises": "ValueError: broken", "is cancelled": "it was cancelled", "returns": "it returned"}[how]
    assert reported == [("judge", why)]
    assert why in caplog.text
    assert supervisor.problems() == [f"The task “judge” failed and was restarted: {why}."]
    await supervisor.stop()


async def test_a_report_that_fails_does_not_end_the_supervision(caplog: pytest.LogCaptureFixture) -> None:
    starts: list[int] = []

    async def work() -> None:
        starts.append(1)
        raise ValueError

    def report(name: str, why: str) -> None:
        raise OSError("the log is full")

    supervisor = Supervisor("car", on_restart=report)
    supervisor.keep("judge", work)
    await until(lambda: len(starts) >= 4)
    await supervisor.stop()
    count = len(starts)
    await asyncio.sleep(0)
    assert len(starts) == count


async def test_what_may_end_ends_and_what_is_stopped_stays_stopped() -> None:
    ended = asyncio.Event()

    async def once() -> None:
        ended.set()

    async def stubborn() -> None:
        with contextlib.suppress(asyncio.CancelledError):  # as asyncio.wait_for of Python 3.11 may
            await asyncio.Event().wait()
        await asyncio.Event().wait()

    supervisor = Supervisor("car")
    supervisor.keep("once", once, may_end=True)
    supervisor.keep("stubborn", stubborn)
    await ended.wait()
    await until(lambda: not supervisor.keeps("once"))
    assert supervisor.problems() == []
    async with asyncio.timeout(3):
        await supervisor.stop()


def test_problems_follow_from_ages() -> None:
    well = Vitals(tick_age_s=0.1, state_age_s=0.1, log_trouble=None, recorder=RecorderFacts(), task_problems=())
    assert problems(well) == []
    ill = Vitals(
        tick_age_s=3.0,
        state_age_s=4.0,
        log_trouble="The alarm log is not stored: the disk is full.",
        recorder=RecorderFacts(state="stopped", trouble="Recording stopped: the disk is full.", behind_s=2.5),
        task_problems=("The task “judge” is not running: it was cancelled.",),
    )
    assert problems(ill) == [
        "No check was evaluated for 3.0 s.",
        "No state was sent to pages for 4.0 s.",
        "The task “judge” is not running: it was cancelled.",
        "The alarm log is not stored: the disk is full.",
        "Recording stopped: the disk is full.",
        "The recorder is 2.5 s behind.",
    ]


@pytest.fixture
async def watched(bridge: RosBridge, tmp_path: Path) -> AsyncIterator[tuple[str, Session]]:
    """A server that watches a driving car; its address and its session."""
    config = Config(vehicles=(Vehicle(name="car", address=bridge.address),), data=tmp_path)  # type: ignore[attr-defined]
    app = create_app(config)
    async with serving_app(app, config) as base, driving(bridge, speed=lambda _: 4.2):
        session = app.state.services.sessions["car"]
        await until(lambda: session.phase == "monitoring", 10)
        yield base, session


@pytest.mark.parametrize("name", ["judge", "slow-down", "heartbeat", "subscriptions"])
async def test_a_cancelled_task_of_a_session_runs_again_and_is_reported(
    watched: tuple[str, Session], name: str
) -> None:
    base, session = watched
    task_named(f"car {name}").cancel()
    await until(lambda: session._supervisor.restarts.get(name) == 1)
    assert not task_named(f"car {name}").done()
    async with http_client(base_url=base) as client:
        answer = await client.get("/api/health")
        assert answer.status_code == 503
        assert answer.json()["status"] == "impaired"
        assert f"The task “{name}” failed and was restarted: it was cancelled." in answer.text
        events = (await client.get("/api/events", params={"limit": 1000})).json()["events"]
    text = f"A part of the server failed and was restarted: {name} (it was cancelled)."
    assert [event["text"] for event in events if event["change"] == "restarted"] == [text]


async def test_health_is_impaired_while_no_check_is_judged(
    watched: tuple[str, Session], monkeypatch: pytest.MonkeyPatch
) -> None:
    base, session = watched
    async with http_client(base_url=base) as client:
        assert (await client.get("/api/health")).json()["status"] == "ok"

        def fail(*_: Any) -> None:
            raise RuntimeError("no judge")

        monkeypatch.setattr(session._parts.judgement, "judge", fail)
        await until(lambda: session.vitals().tick_age_s > 1.0)
        answer = await client.get("/api/health")
    assert answer.status_code == 503
    assert answer.json()["problems"][0].startswith("car: No check was evaluated for 1.")


@pytest.mark.parametrize("part", ["watch_recording", "watch_slow_down", "watch_control"])
async def test_a_part_that_fails_is_an_alarm_and_keeps_no_check_from_being_judged(
    bridge: RosBridge, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, part: str
) -> None:
    config = Config(vehicles=(Vehicle(name="car", address=bridge.address),), data=tmp_path)  # type: ignore[attr-defined]
    app = create_app(config)
    speed = {"now": 4.2}
    async with serving_app(app, config) as base, driving(bridge, speed=lambda _: speed["now"]), viewer(base) as page:
        await page.state(lambda state: state["signals"]["speed"]["freshness"] == "fresh")

        def fail(*_: Any) -> None:
            raise RuntimeError("broken")

        monkeypatch.setattr(app.state.services.sessions["car"]._tick, part, fail)
        speed["now"] = 14.0
        state = await page.state(
            lambda state: {"speed_limit", "monitoring_impaired"} <= {alarm["id"] for alarm in state["alarms"]}
        )
    assert state["alarms"]


async def test_a_page_whose_writer_failed_is_closed_and_can_come_back(
    watched: tuple[str, Session], caplog: pytest.LogCaptureFixture
) -> None:
    base, _ = watched
    async with viewer(base) as page:
        await page.state(lambda state: state["signals"]["speed"]["freshness"] == "fresh")
        task_named("page writer").cancel()
        await until(lambda: not any(task.get_name() == "page reader" for task in asyncio.all_tasks()))
    assert "the writer of a page ended" in caplog.text
    async with viewer(base) as page:
        await page.state(lambda state: state["signals"]["speed"]["freshness"] == "fresh")
