"""What one page says reaches the cars that it concerns, also where its own car is not served."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any, cast

import pytest

from server.access.identity import LOCAL
from server.bus.journal import Journal
from server.bus.local import LocalBus
from server.protocol.rate_limit import Limits
from server.replay.view_source import ViewSource
from server.web.page_commands import PageCommands

pytestmark = pytest.mark.virtual_time


async def test_another_car_that_is_lost_does_not_hold_up_the_page() -> None:
    requested = asyncio.Event()

    async def lost(_: Mapping[str, Any]) -> Mapping[str, Any]:
        requested.set()
        await asyncio.sleep(60)
        return {"ok": True}

    async def own(_: Mapping[str, Any]) -> Mapping[str, Any]:
        return {"ok": True}

    bus = LocalBus(Journal(None), now=lambda: 0.0)
    bus.serve("ocelot", own)
    bus.serve("serval", lost)
    view = cast(ViewSource, SimpleNamespace(is_replaying=False))
    page = PageCommands(
        bus, "ocelot", view, LOCAL, Limits(), now=lambda: 0.0, wall_ms=lambda: 0, send=lambda _: None, complain=print
    )
    async with asyncio.timeout(0.5):
        for _ in range(3):
            await page.present(
                {"kind": "present", "visible": True, "sound": "ready", "awake": "ready", "announces": ["serval"]}
            )
        await requested.wait()
        await page.close()


async def test_other_cars_are_announced_while_the_own_one_is_not_served() -> None:
    heard: list[Mapping[str, Any]] = []

    async def serval(command: Mapping[str, Any]) -> Mapping[str, Any]:
        heard.append(command)
        return {"ok": True}

    bus = LocalBus(Journal(None), now=lambda: 0.0)
    bus.serve("serval", serval)
    complaints: list[str] = []
    view = cast(ViewSource, SimpleNamespace(is_replaying=False))
    page = PageCommands(
        bus,
        "ocelot",
        view,
        LOCAL,
        Limits(),
        now=lambda: 0.0,
        wall_ms=lambda: 0,
        send=lambda _: None,
        complain=complaints.append,
    )
    await page.present(
        {"kind": "present", "visible": True, "sound": "ready", "awake": "ready", "announces": ["serval"]}
    )
    await page.leave()
    assert [(one["kind"], one["leaves"]) for one in heard] == [("announces", False), ("announces", True)]
    assert complaints == []
