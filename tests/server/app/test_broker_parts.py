"""How the parts of an agent work together at its broker."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from server.app.build import build
from server.app.config import Config
from server.bus import broker_users
from server.bus.broker import Broker
from server.bus.nats_agent import NatsAgent


@pytest.mark.parametrize("has_key", [False, True])
async def test_an_agent_announces_itself_once_all_else_is_subscribed_to(tmp_path: Path, has_key: bool) -> None:
    key = tmp_path / "ocelot.key"
    key.write_text(broker_users.add(tmp_path, "ocelot", "agent", today="2026-11-29")[1])
    broker = Broker(address="nats://127.0.0.1:1", key=key if has_key else None)
    running, _, storage = build(Config(broker=broker), now=time.monotonic, wall_ms=lambda: 0, checks=None)
    try:
        *_, last = running.link._parts  # type: ignore[union-attr]
        assert isinstance(last, NatsAgent)
        assert last._is_limited == has_key
        assert last.beside == running.link.beside, "by which it sends its first states as well"  # type: ignore[union-attr]
    finally:
        storage.close()
