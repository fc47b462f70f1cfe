"""A bridge of either ROS version, and clients for it."""

from __future__ import annotations

import contextlib
import time
from collections.abc import AsyncIterator, Callable
from typing import Any

import pytest

from server.rosbridge_server.server import RosBridge
from tests.server.rosbridge_server.probe import Probe, probing

Connect = Callable[[], "contextlib.AbstractAsyncContextManager[Probe]"]


@contextlib.asynccontextmanager
async def bridging(**options: Any) -> AsyncIterator[tuple[RosBridge, int]]:
    bridge = RosBridge(**({"now": time.time} | options))  # the clock of now, which may be virtual
    port = await bridge.start()
    try:
        yield bridge, port
    finally:
        await bridge.stop()


@pytest.fixture
async def started() -> AsyncIterator[tuple[RosBridge, int]]:
    """A ROS 1 bridge with nothing on it, and its port."""
    async with bridging() as (bridge, port):
        yield bridge, port


@pytest.fixture
def bridge(started: tuple[RosBridge, int]) -> RosBridge:
    return started[0]


@pytest.fixture
def port(started: tuple[RosBridge, int]) -> int:
    return started[1]


@pytest.fixture
async def probe(port: int) -> AsyncIterator[Probe]:
    """A client of the bridge."""
    async with probing(port) as client:
        yield client
