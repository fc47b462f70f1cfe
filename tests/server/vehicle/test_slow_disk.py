"""A disk that does not answer holds up neither the judge nor the pages; settings count once they are stored."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import pytest

from server.judge.settings import SettingsFile
from server.rosbridge_server.server import RosBridge
from tests.server.cars import driving
from tests.server.conftest import serving
from tests.server.vehicle.test_log_trouble import config_of, raised
from tests.server.viewer import viewer

pytestmark = pytest.mark.field

LIMIT = "speed_limit.max_mps"


class SlowDisk:
    """Holds each write of settings until it is let go."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.answers = threading.Event()
        self.written: list[int] = []
        write = SettingsFile.write

        def held(file: SettingsFile, settings: Any) -> None:
            assert self.answers.wait(30)
            write(file, settings)
            self.written.append(settings.version)

        monkeypatch.setattr(SettingsFile, "write", held)


async def test_a_change_counts_once_it_is_stored_and_nothing_waits_for_it(
    bridge: RosBridge, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk = SlowDisk(monkeypatch)
    async with driving(bridge, speed=lambda n: 8.0), serving(config_of(bridge, tmp_path)) as server:
        async with viewer(server) as one, viewer(server) as other:
            await one.state(lambda s: s["signals"]["speed"]["freshness"] == "fresh")
            await one.send({"kind": "set", "values": {LIMIT: 5.0}, "id": "a"})
            await other.send({"kind": "set", "values": {LIMIT: 6.0}, "id": "b"})
            before = len(one.states)
            await one.until(lambda: len(one.states) >= before + 8)  # frames go on at their rate
            assert one.states[-1]["limits"][LIMIT] == 11.0
            assert not any(reply.get("ok") for reply in one.other + other.other)
            disk.answers.set()
            await raised(one, "speed_limit")
            await one.state(lambda s: s["limits"][LIMIT] == 6.0)
            assert disk.written == [1, 2], "one after the other, in the order of their versions"


async def test_a_disk_that_answers_after_the_deadline_leaves_in_force_what_it_stores(
    bridge: RosBridge, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk = SlowDisk(monkeypatch)
    async with driving(bridge, speed=lambda n: 8.0), serving(config_of(bridge, tmp_path)) as server:
        async with viewer(server) as one:
            await one.state(lambda s: s["signals"]["speed"]["freshness"] == "fresh")
            answer = await one.ask(kind="set", values={LIMIT: 5.0})
            assert answer["ok"] is False
            assert "did not answer within 3 s" in answer["reason"]
            disk.answers.set()
            await one.state(lambda s: s["limits"][LIMIT] == 5.0)
    assert "max_mps = 5.0" in (tmp_path / "settings" / "car.toml").read_text(encoding="utf-8")
