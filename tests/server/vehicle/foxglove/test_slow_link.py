"""A slow link before a real server: no age is too young, wherever the messages wait."""

from __future__ import annotations

import asyncio
import struct
import time
from typing import Any

import pytest

from monitor.transport import TransportDelay
from server.recording.read.schemas import TypeBook
from server.rosbridge.address import parse
from server.rosbridge.subscription import Subscription
from server.vehicle.foxglove.source import FoxgloveSource
from tests.server.link_listener import LinkListener, until
from tests.server.slow_proxy import slow_proxy
from tests.server.vehicle.foxglove.peer import ODOMETRY, SCAN, odometry, peer, scan

pytestmark = [pytest.mark.field, pytest.mark.slow]

UNDER_S = 0.2
BEAMS = 20_000  # 80 KB: what the system takes is full within seconds, and then the server's queue
SLOW_BPS = 400_000.0  # of the 1.6 MB/s that the car sends
GAP_BPS = 2_000.0  # one piece of the proxy a second: nearly nothing passes
HZ = 20.0
MOST_QUEUED = 60  # of both topics: 1.5 s of them


class Followed(LinkListener):
    """Follows how old each message is, by its stamp and by what the link is known to need."""

    def __init__(self, delay: TransportDelay) -> None:
        super().__init__()
        self._delay = delay
        self.ages: list[tuple[float, float]] = []  # by what is known, and as it is

    def message_received(self, topic: str, message: Any, note: str | None) -> None:
        stamp = message["header"]["stamp"]
        true_s = time.time() - stamp["sec"] - stamp["nanosec"] / 1e9
        self.ages.append((self._delay.receive(topic, time.monotonic()), true_s))


def rate_Bps(since_s: float) -> float | None:
    """Healthy for 3 s, then slow, with a gap of a second in each four."""
    if since_s < 3.0:
        return None
    return GAP_BPS if since_s % 4.0 > 3.0 else SLOW_BPS


def stamped(raw: bytes) -> bytes:
    """A scan in CDR with the time of now."""
    seconds, rest = divmod(time.time_ns(), 10**9)
    return raw[:4] + struct.pack("<iI", seconds, rest) + raw[12:]


async def test_no_age_is_too_young_on_a_slow_link_with_gaps_and_a_full_queue() -> None:
    delay = TransportDelay()
    listener = Followed(delay)
    schema = TypeBook(2).schema(SCAN)
    assert schema is not None
    assert schema.encode is not None
    raw = schema.encode(scan(2, 0, BEAMS))
    with peer(most_queued=MOST_QUEUED) as car:
        car.offer("/odom", ODOMETRY, "cdr")
        car.offer_raw("/scan", schema.name, "cdr", schema.encoding, schema.data)
        async with slow_proxy(car.port, None) as proxy:
            source = FoxgloveSource(
                parse(f"foxglove://127.0.0.1:{proxy.port}"), listener, now=time.monotonic, marks=delay
            )
            for topic in ("/odom", "/scan"):
                source.subscribe(Subscription(topic=topic, type=None))
            source.start()
            await until(lambda: len(source._rows.channels) == 2)
            began_s = time.monotonic()
            published = 0
            while (since_s := time.monotonic() - began_s) < 24.0:
                proxy.rate_Bps = rate_Bps(since_s)
                car.publish("/odom", odometry(2, 4.2, time.time_ns()))
                car.publish("/scan", stamped(raw))
                published += 2
                await asyncio.sleep(1 / HZ)
            source.stop()
            proxy.rate_Bps = None
            await until(lambda: not proxy._pumps)
    assert max(true_s for _, true_s in listener.ages) > 3.0  # the link was slow indeed
    assert len(listener.ages) < published / 2  # and the server's queue was full
    assert [one for one in listener.ages if one[0] < one[1] - UNDER_S] == []
    healthy = listener.ages[: int(2 * 2 * HZ)]
    assert max(known_s for known_s, _ in healthy) < 1.0
