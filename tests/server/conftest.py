"""A server and a bridge in the test's own loop, on free ports."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import time
from collections.abc import AsyncIterator

import pytest
import uvicorn
from fastapi import FastAPI

from server.app.app import create_app
from server.app.config import Config
from server.rosbridge_server.server import RosBridge
from server.vehicle.vehicle import Vehicle
from server.web.middleware import http_protocol
from tests.event_loops import pytest_asyncio_loop_factories as pytest_asyncio_loop_factories
from tests.event_loops import virtual_clock as virtual_clock
from tests.virtual_time import real_time


@contextlib.asynccontextmanager
async def serving(config: Config) -> AsyncIterator[str]:
    """The app on a real socket; yields its http address."""
    async with serving_app(create_app(config, now=time.monotonic), config) as base:
        yield base


@contextlib.asynccontextmanager
async def serving_app(app: FastAPI, config: Config) -> AsyncIterator[str]:
    """An app that was made before; yields its http address."""
    listening = socket.socket()
    listening.bind(("127.0.0.1", 0))
    patient = {"ws_ping_timeout": 60.0}  # a test stops reading for half a minute
    server = uvicorn.Server(uvicorn.Config(app, **http_protocol.options(config.limits) | patient))
    running = asyncio.create_task(server.serve(sockets=[listening]))
    while not server.started:
        await asyncio.sleep(0.01)
    try:
        yield f"http://127.0.0.1:{listening.getsockname()[1]}"
    finally:
        async with real_time():  # a server's threads and processes end in theirs
            server.should_exit = True
            await running
        listening.close()


@pytest.fixture
async def bridge() -> AsyncIterator[RosBridge]:
    """A bridge with a car's speed and scan advertised; `bridge.address` is its ws address."""
    one = RosBridge(ros_version=1, now=time.time)
    port = await one.start("127.0.0.1", 0)
    one.address = f"ws://127.0.0.1:{port}"  # type: ignore[attr-defined]
    one.advertise("/catvehicle/vel", "geometry_msgs/Twist")
    one.advertise("/scan", "sensor_msgs/LaserScan")
    yield one
    await one.stop()


@pytest.fixture
async def other() -> AsyncIterator[RosBridge]:
    """A second car."""
    one = RosBridge(ros_version=1)
    one.address = f"ws://127.0.0.1:{await one.start('127.0.0.1', 0)}"  # type: ignore[attr-defined]
    one.advertise("/catvehicle/vel", "geometry_msgs/Twist")
    yield one
    await one.stop()


def two(bridge: RosBridge, other: RosBridge) -> Config:
    """The configuration of a server of both cars."""
    pairs = (("ocelot", bridge), ("serval", other))
    return Config(vehicles=tuple(Vehicle(name=name, address=one.address) for name, one in pairs))  # type: ignore[attr-defined]


@pytest.fixture
async def server(bridge: RosBridge) -> AsyncIterator[str]:
    """A server that watches the bridge; its http address."""
    config = Config(vehicles=(Vehicle(name="car", address=bridge.address),))  # type: ignore[attr-defined]
    async with serving(config) as base:
        yield base
