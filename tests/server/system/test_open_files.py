"""`ulimit -n` exhausted is an alarm, and what slows the car and judges it goes on."""

from __future__ import annotations

import resource
import subprocess
import sys

import pytest

from server.app.config import Config
from server.rosbridge_server.server import RosBridge
from server.system import process_limits
from server.system.process_limits import KEPT_FREE, FilesExhausted, demand_free
from server.vehicle.vehicle import Vehicle
from tests.server.cars import driving
from tests.server.conftest import serving
from tests.server.viewer import viewer

pytestmark = pytest.mark.world(n=24)


def limited(monkeypatch: pytest.MonkeyPatch, most: int) -> None:
    monkeypatch.setattr(process_limits.resource, "getrlimit", lambda _: (most, most))


def test_enough_is_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    demand_free()
    limited(monkeypatch, resource.RLIM_INFINITY)
    demand_free()


def test_few_left_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    limited(monkeypatch, KEPT_FREE)
    with pytest.raises(FilesExhausted, match=r"more files and connections can be opened, of 32 \(ulimit -n\)"):
        demand_free()


def test_none_left_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the real limit, at what is open now."""
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (0, before[1]))
    try:
        with pytest.raises(FilesExhausted, match="no file or connection can be opened"):
            demand_free()
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)
    demand_free()


async def test_it_is_an_alarm_and_the_checks_go_on(bridge: RosBridge, monkeypatch: pytest.MonkeyPatch) -> None:
    config = Config(vehicles=(Vehicle(name="car", address=bridge.address),))  # type: ignore[attr-defined]
    speed = {"now": 4.2}
    async with serving(config) as base, viewer(base) as page, driving(bridge, speed=lambda _: speed["now"]):
        await page.until(
            lambda: page.states and page.states[-1]["signals"]["speed"]["freshness"] == "fresh", within_s=20.0
        )
        limited(monkeypatch, KEPT_FREE)
        speed["now"] = 14.0

        def standing() -> set[str]:
            return {alarm["id"] for alarm in page.states[-1]["alarms"]}

        await page.until(lambda: {"speed_limit", "monitoring_impaired"} <= standing(), within_s=20.0)
        texts = [str(alarm) for alarm in page.states[-1]["alarms"] if alarm["id"] == "monitoring_impaired"]
        assert "files and connections" in texts[0]


def test_nothing_that_slows_or_serves_is_imported_when_no_file_can_be_opened_any_more() -> None:
    """What libraries import late is imported with the server."""
    script = (
        "import sys, server.app.app, resource, numpy, time\n"
        "resource.setrlimit(resource.RLIMIT_NOFILE, (0, 0))\n"
        "numpy.median([1.0, 2.0, 3.0]); time.strptime('5', '%S'); 'ä.de'.encode('idna')\n"
        "assert 'anyio._backends._asyncio' in sys.modules\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
