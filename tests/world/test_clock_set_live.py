"""A clock that is ahead is set back while a car is monitored: ages, rates and silence go on by the order of receipt."""

from __future__ import annotations

import asyncio
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from server.recording.read.read import open_recording
from tests.reports.cases import judged, raised
from tests.server.cars import twist
from tests.server.vehicle.keeping_bridge import KeepingBridge, Topic, monitored
from tests.server.vehicle.test_compared_cars import fix
from tests.server.vehicle.test_sources import odometry, of_laser

pytestmark = [pytest.mark.virtual_time, pytest.mark.slow]

TOPICS = {
    "/catvehicle/vel": Topic("geometry_msgs/Twist"),
    "/odom": Topic("nav_msgs/Odometry"),
    "/scan": Topic("sensor_msgs/LaserScan"),
    "/fix": Topic("sensor_msgs/NavSatFix"),
}
SIGNALS = ("speed", "odometry", "scan", "position")
AHEAD_S, SET_S, SECONDS, HZ = 90.0, 14.0, 30.0, 10.0
OLDEST_S = 0.8  # an interval, and what the link may have taken since the ping before: those come every 0.5 s
OF_THE_CLOCK = {"clock_jump", "clock_offset"}


@dataclass
class Story:
    """What was shown at each tenth of a second."""

    alarms: set[str] = field(default_factory=set)
    oldest_s: float = 0.0
    stale: list[str] = field(default_factory=list)
    published: int = 0  # messages of each topic since the recording began
    rates_hz: list[float] = field(default_factory=list)


def stamped(message: dict[str, Any], at_s: float) -> dict[str, Any]:
    stamp = {"secs": int(at_s), "nsecs": round(at_s % 1 * 1e9)}
    return message | {"header": message["header"] | {"stamp": stamp}}


async def driven(folder: Path, *, car_steps: bool, server_steps: bool) -> Story:
    bridge, story = KeepingBridge(TOPICS), Story()
    begins_s = time.monotonic()

    def ahead_s() -> float:
        return AHEAD_S if time.monotonic() - begins_s < SET_S else 0.0

    async with monitored(bridge, folder, ahead_s=ahead_s if server_steps else lambda: 0.0) as session:
        while (at_s := time.monotonic() - begins_s) < SECONDS:
            bridge.ahead_s = ahead_s() if car_steps else 0.0
            now_s, mps = time.time() + bridge.ahead_s, 4.0 + at_s % 2.0 / 10
            bridge.publish("/catvehicle/vel", twist(mps))
            bridge.publish("/odom", stamped(odometry(4.1 * at_s, mps), now_s))
            bridge.publish("/scan", stamped(of_laser("laser", 0.0) | {"ranges": [30.0 + at_s % 1.0] * 181}, now_s))
            bridge.publish("/fix", stamped(fix(4.1 * at_s, at_s), now_s))
            story.published += at_s > 1 / HZ / 2  # the first one comes before the subscription
            await asyncio.sleep(1 / HZ)
            state = session.frame()
            story.alarms |= {alarm["id"] for alarm in state["alarms"]}
            if at_s < 5.0:
                continue
            for name in SIGNALS:
                signal = state["signals"][name]
                story.oldest_s = max(story.oldest_s, signal["age_s"] or 0.0)
                story.rates_hz.append(signal["rate_hz"] or 0.0)
                if signal["freshness"] not in ("fresh", "ageing"):
                    story.stale.append(f"{at_s:.1f} {name} {signal['freshness']}")
    return story


@pytest.mark.parametrize(("car_steps", "server_steps"), [(True, False), (False, True), (True, True)])
async def test_nothing_but_the_clock_is_reported(tmp_path: Path, car_steps: bool, server_steps: bool) -> None:
    story = await driven(tmp_path, car_steps=car_steps, server_steps=server_steps)
    assert story.alarms - {"reach"} <= OF_THE_CLOCK
    assert ("clock_jump" in story.alarms) == car_steps
    assert story.stale == []
    assert story.oldest_s < OLDEST_S
    assert all(rate_hz == pytest.approx(HZ, rel=0.05) for rate_hz in story.rates_hz)
    paths = sorted(tmp_path.rglob("*.mcap"))
    report = judged(*paths)
    with open_recording(paths) as recording:
        changes = [event["change"] for _, event in recording.own("/catgraph/alarms")]
        assert recording.duration_s == pytest.approx(SECONDS, abs=0.5)
        assert {info.count for info in recording.topics.values()} == {story.published}
    assert changes.count("clock_set") == server_steps
    assert any("clock was set back by 90 s" in note for note in report.run.notes) == server_steps
    assert raised(report).keys() <= story.alarms, "no alarm of the recording is of the clock alone"
