"""The age that is shown includes the delay of the way, on every link; on a healthy one it is not inflated."""

from __future__ import annotations

import math
import random
from itertools import pairwise

import pytest

from monitor.rates import STALE_FLOOR_S
from monitor.signals import SIGNALS
from monitor.transport import TransportDelay
from server.vehicle.link_load import LEVELS, RESTORE_AFTER_S, RESTORE_BELOW_S, SETTLE_S, LinkLoad
from tests.monitor.slow_links import Link, Stream, run

SHORT = 40
LONG = 3_000
UNDER_S, OVER_S = 0.2, 0.3

pytestmark = pytest.mark.world(n=6)


def streams(rng: random.Random) -> list[Stream]:
    """A car: what is fast carries no stamp, as on the CATVehicle."""
    offset_s = rng.choice([0.0, 5 * 3600.0, -7200.5, -1.6e9])
    ppm = rng.uniform(-100, 100)
    began_s = rng.uniform(2.0, 15.0)
    odd = rng.choice(["even", "jump ahead", "jump back", "constant", "fast", "slow", "none"])

    def stamp(at_s: float) -> float:
        if odd == "constant":
            return offset_s
        if odd in ("fast", "slow"):
            return offset_s + at_s * (4.0 if odd == "fast" else 0.25)
        return offset_s + at_s + (at_s > began_s) * {"jump ahead": 1.5, "jump back": -3.0}.get(odd, 0.0)

    def one(topic: str, hz: float, size: int, *, queue_length: int = 1, stamped: bool = False) -> Stream:
        return Stream(
            topic=topic,
            hz=hz,
            size=size,
            offset_s=offset_s if stamped and odd != "none" else None,
            ppm=ppm,
            queue_length=queue_length,
            stamp=stamp if stamped and odd not in ("even", "none") else None,
        )

    return [
        one("/vel", 20, 190),
        one("/brake", 20, 190),
        one("/steering", 20, 190),
        one("/dist", 75, 75, queue_length=rng.choice([1, 5, 10])),
        one("/gps", 10, 400, stamped=True),
        one("/odom", 20, 1100, stamped=True, queue_length=rng.choice([1, 50])),
        one("/scan", rng.choice([10, 30, 75]), rng.choice([900, 4600]), stamped=True),
        one("/diagnostics", 1, 600, stamped=True),
    ]


def any_link(rng: random.Random) -> Link:
    base_Bps = rng.choice([12e3, 15e3, 20e3, 60e3, 200e3, 2e6])
    kind = rng.choice(["constant", "drops", "bursts", "swings"])
    drops_s = rng.uniform(2.0, 8.0)

    def rate_Bps(at_s: float) -> float:
        if kind == "drops":
            return 3e6 if at_s < drops_s else base_Bps
        if kind == "bursts":
            return 0.0 if (at_s * 0.37) % 1 < 0.3 else max(base_Bps * 2, 1e5)
        return base_Bps if kind == "constant" else base_Bps * (1 + 0.9 * math.sin(at_s))

    down_s, up_s = rng.choice([0.001, 0.03, 0.4, 1.5]), rng.choice([0.001, 0.03, 0.3])
    jitter_s = rng.choice([0.0, 0.02, 0.3])
    return Link(
        rate_Bps=rate_Bps,
        down_s=lambda _: down_s + rng.random() * jitter_s,
        up_s=lambda _: up_s + rng.random() * jitter_s / 2,
        kernel_bytes=rng.choice([10_000, 100_000, 400_000]),
        is_fifo=rng.random() < 0.4,
    )


def never_younger_than_true(seeds: range) -> None:
    for seed in seeds:
        rng = random.Random(seed)
        link, car = any_link(rng), streams(rng)
        for one in run(link, car, lasts_s=20.0, seed=seed):
            assert one.delay_s >= one.true_s - UNDER_S, f"seed {seed}: {one}"


def test_no_link_shows_a_value_younger_than_it_is() -> None:
    never_younger_than_true(range(SHORT))


@pytest.mark.soak
def test_no_link_shows_a_value_younger_than_it_is_in_many_runs() -> None:
    never_younger_than_true(range(SHORT, LONG))


@pytest.mark.parametrize("seed", range(8))
def test_a_healthy_link_is_not_called_late(seed: int) -> None:
    rng = random.Random(seed)
    trip_s, jitter_s = rng.choice([0.001, 0.01, 0.03]), rng.choice([0.0, 0.01, 0.03])
    link = Link(
        rate_Bps=lambda _: 2e6,
        down_s=lambda _: trip_s + rng.random() * jitter_s,
        up_s=lambda _: trip_s + rng.random() * jitter_s,
        is_fifo=bool(seed % 2),
    )
    car = [one for one in streams(rng) if one.queue_length < 50]
    for one in run(link, car, lasts_s=20.0, seed=seed):
        assert one.true_s - UNDER_S <= one.delay_s <= one.true_s + OVER_S, f"seed {seed}: {one}"


def test_without_the_pings_a_constant_delay_would_be_invisible() -> None:
    """The same messages, the same stamps: only the answers to the pings differ."""
    ages = []
    for answered_after_s in (0.002, 3.0):
        transport = TransportDelay()
        transport.open(-10.0)
        for n in range(100):
            at_s = n * 0.1
            transport.sent(at_s)
            if at_s >= answered_after_s:
                transport.answered(at_s - answered_after_s, at_s)
            age_s = transport.receive("/gps", at_s + 0.001, 1e9 + at_s)
        ages.append(age_s)
    assert ages[0] < 0.3
    assert 3.0 <= ages[1] < 3.3


@pytest.mark.parametrize("is_stamped", [True, False])
def test_what_waits_before_the_bridge_is_seen_by_the_clock_of_ros(is_stamped: bool) -> None:
    """A bridge too busy answers pings at once, and its messages come 4 s late."""
    transport = TransportDelay()
    transport.open(0.0)
    for n in range(300):
        at_s = n * 0.05
        transport.sent(at_s)
        transport.answered(at_s, at_s + 0.001)
        if n % 20 == 0:
            transport.clock.answered(at_s, at_s + 0.004, 5000.0 + at_s + 0.002)
        late_s = min(4.0, max(0.0, at_s - 5.0))
        for topic in ("/gps", "/odom"):
            delay_s = transport.receive(topic, at_s + 0.001, 5000.0 + at_s + 0.001 - late_s)
        if not is_stamped:
            delay_s = transport.receive("/vel", at_s + 0.001)
        assert late_s - UNDER_S <= delay_s <= late_s + OVER_S


def test_a_slow_link_is_asked_for_less_step_by_step_and_for_more_again_with_patience() -> None:
    load = LinkLoad()
    steps = [load.step]
    for tick in range(60):
        if load.look(0.8 + tick * 0.01, tick / 10):
            steps.append(load.step)
    assert steps == list(range(len(LEVELS)))
    now_s = 6.0
    restored = []
    while load.step:
        now_s += 0.1
        if load.look(0.05, now_s):
            restored.append(now_s)
    assert len(restored) == len(LEVELS) - 1
    assert all(after - before >= RESTORE_AFTER_S - 0.11 for before, after in pairwise([6.0, *restored]))


def test_a_very_slow_link_is_asked_for_the_least_at_once_a_hiccup_for_nothing_less() -> None:
    load = LinkLoad()
    assert not any(load.look(2.0, tick / 10) for tick in range(4))
    assert not load.look(0.1, 0.4)
    assert any(load.look(2.0, 1.0 + tick / 10) for tick in range(6))
    assert load.step == len(LEVELS) - 1


def test_while_less_is_asked_for_no_rate_is_the_car_s() -> None:
    """The bridge keeps one message of each topic then, and loses the others of a burst."""
    load = LinkLoad()
    assert not load.throttled(0.0)
    load.step = 1
    assert load.throttled(1.0) == set(SIGNALS)
    load.step = 0
    assert load.throttled(1.0 + SETTLE_S) == set(SIGNALS), "the rate has to be measured anew"
    assert not load.throttled(1.1 + SETTLE_S)


def test_no_signal_falls_silent_because_less_is_asked_for() -> None:
    """Between two messages a value grows as old as the pause, beyond how late it came."""
    for level in LEVELS:
        assert max(level.judged_ms, level.scan_ms, level.trends_ms) / 1000 + RESTORE_BELOW_S < STALE_FLOOR_S


def test_what_is_judged_is_thinned_last() -> None:
    before = LEVELS[0]
    for level in LEVELS[1:]:
        assert not level.records_others
        assert level.judged_ms >= before.judged_ms
        assert level.scan_ms >= before.scan_ms
        assert level.trends_ms >= before.trends_ms
        before = level
    assert [level.judged_ms for level in LEVELS[:3]] == [0, 0, 0]
