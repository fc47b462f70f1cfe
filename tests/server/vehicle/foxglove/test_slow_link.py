"""A slow link before a real server: no age is too young, wherever the messages wait."""

from __future__ import annotations

import asyncio
import time
from typing import Any

import pytest

from monitor.transport import TransportDelay
from server.rosbridge.address import parse
from server.rosbridge.subscription import Subscription
from server.vehicle.foxglove.source import FoxgloveSource
from tests.server.ear import Ear, until
from tests.server.slow_proxy import slow_proxy
from tests.server.vehicle.foxglove.peer import ODOMETRY, SCAN, odometry, peer, scan

pytestmark = [pytest.mark.field, pytest.mark.slow]

UNDER_S = 0.2
SLOW_BPS = 40_000.0  # of the 60 000 that the car sends
HZ = 20.0


class Followed(Ear):
    """Follows how old each message is, by its stamp and by what the link is known to need."""

    def __init__(self, delay: TransportDelay) -> None:
        super().__init__()
        self._delay = delay
        self.ages: list[tuple[float, float]] = []  # by what is known, and as it is

    def message_received(self, topic: str, message: Any, note: str | None) -> None:
        stamp = message["header"]["stamp"]
        true_s = time.time() - stamp["sec"] - stamp["nanosec"] / 1e9
        self.ages.append((self._delay.receive(topic, time.monotonic()), true_s))


async def test_no_age_is_too_young_on_a_slow_link() -> None:
    delay = TransportDelay()
    ear = Followed(delay)
    with peer() as car:
        car.offer("/odom", ODOMETRY, "cdr")
        car.offer("/scan", SCAN, "cdr")
        async with slow_proxy(car.port, None) as proxy:
            source = FoxgloveSource(parse(f"foxglove://127.0.0.1:{proxy.port}"), ear, now=time.monotonic, marks=delay)
            for topic in ("/odom", "/scan"):
                source.subscribe(Subscription(topic=topic, type=None))
            source.start()
            await until(lambda: len(source._rows.channels) == 2)
            began_s = time.monotonic()
            while (since_s := time.monotonic() - began_s) < 20.0:
                proxy.rate_Bps = SLOW_BPS if since_s > 3.0 else None
                car.publish("/odom", odometry(2, 4.2, time.time_ns()))
                car.publish("/scan", scan(2, time.time_ns(), beams=540))
                await asyncio.sleep(1 / HZ)
            source.stop()
            proxy.rate_Bps = None
            await until(lambda: not proxy._pumps)
    assert max(true_s for _, true_s in ear.ages) > 3.0  # the link was slow indeed
    assert [one for one in ear.ages if one[0] < one[1] - UNDER_S] == []
    healthy = ear.ages[: int(2 * 2 * HZ)]
    assert max(known_s for known_s, _ in healthy) < 1.0
