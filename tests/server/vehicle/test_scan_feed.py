"""How many scans a second the pages are offered: all of a laser of 20 Hz, whose scans come early as often as late."""

from __future__ import annotations

import itertools
import random

import pytest

from monitor.instruments import ObstacleLimits
from server.bus.journal import Journal
from server.bus.local import LocalBus
from server.vehicle.scan_feed import ScanFeed
from tests.monitor.checks.known import known
from tests.monitor.test_corridor import sweep

LIMITS = ObstacleLimits()


def offered(period_s: float, jitter_s: float, *, for_s: float = 20.0) -> list[float]:
    """The moments at which a scan was offered [s]."""
    clock = [0.0]
    bus = LocalBus(Journal(None), now=lambda: clock[0])
    bus.want("car", "scan", +1)
    feed, scan, chance = ScanFeed("car", bus), sweep([(9.0, 0.0, 0.4)]), random.Random(1)
    put_s = []
    for number in itertools.count():
        clock[0] = 100.0 + number * period_s + chance.uniform(-jitter_s, jitter_s)
        if number * period_s > for_s:
            return put_s
        if feed.is_due(clock[0]):
            feed.put(known(clock[0], scan=scan), LIMITS, was_active=False, kinds_kept=True)
            put_s.append(clock[0])
    raise AssertionError


@pytest.mark.parametrize(
    ("period_s", "jitter_s", "rate_hz"),
    [
        (0.05, 0.0, 20),
        (0.05, 0.004, 20),
        (0.05, 0.02, 20),
        (0.1, 0.01, 10),
        (0.04, 0.005, 20),
        (0.025, 0.002, 20),
        (0.01, 0.001, 20),
    ],
)
def test_no_scan_of_a_20_hz_laser_is_left_out_for_coming_early(
    period_s: float, jitter_s: float, rate_hz: float
) -> None:
    put_s = offered(period_s, jitter_s)
    assert len(put_s) / 20 == pytest.approx(rate_hz, rel=0.03)


def test_after_a_silence_nothing_is_made_up_for() -> None:
    """The pages get the newest, not a burst."""
    clock = [0.0]
    bus = LocalBus(Journal(None), now=lambda: clock[0])
    bus.want("car", "scan", +1)
    feed, scan = ScanFeed("car", bus), sweep([(9.0, 0.0, 0.4)])
    times = [0.0, 5.0, 5.001, 5.002, 5.003]
    due = []
    for clock[0] in times:
        due.append(feed.is_due(clock[0]))
        if due[-1]:
            feed.put(known(clock[0], scan=scan), LIMITS, was_active=False, kinds_kept=True)
    assert due.count(True) <= 3
