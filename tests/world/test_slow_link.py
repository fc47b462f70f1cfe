"""The age that is shown includes the delay of the way, on every link; on a healthy one it is not inflated."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import pytest

from monitor.checks.link_late import LateLimits
from monitor.rates import STALE_FLOOR_S
from monitor.signals import SIGNALS
from monitor.transport import TransportDelay
from server.judge.signals import TOPICS
from server.vehicle.link_load import LEVELS, RESTORE_AFTER_S, RESTORE_BELOW_S, SETTLE_S, LinkLoad
from tests.monitor.slow_links import Link, Stream, run

SHORT = 40
LONG = 3_000
UNDER_S, OVER_S = 0.2, 0.3

pytestmark = pytest.mark.world(n=6)


PACES = {"fast": 4.0, "slow": 0.25, "a little fast": 1.005, "a little slow": 0.98}
OTHERS_AHEAD_S = (0.0, 0.05, -0.05, 0.3, -0.3, 1.0, -1.0)


def streams(rng: random.Random) -> list[Stream]:
    """A car: what is fast carries no stamp, as on the CATVehicle."""
    offset_s = rng.choice([0.0, 5 * 3600.0, -7200.5, -1.6e9])
    ppm = rng.uniform(-100, 100)
    began_s = rng.uniform(2.0, 15.0)
    odd = rng.choice(["even", "even", "jump ahead", "jump back", "constant", "none", *PACES])

    def stamp(at_s: float) -> float:
        if odd == "constant":
            return offset_s
        if odd in PACES:
            return offset_s + at_s * PACES[odd]
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


def ros_clock(rng: random.Random, car: list[Stream]) -> Callable[[float], float] | None:
    """The clock of ROS: the one of the stamps, one of another computer, or unknown. They are set together."""
    stamped = next((one for one in car if one.stamp_s(0.0) is not None), None)
    kind = rng.choice(["the one of the stamps", "another computer's", "unknown"])
    if stamped is None or kind == "unknown":
        return None
    ahead_s = rng.choice(OTHERS_AHEAD_S) if kind == "another computer's" else 0.0
    return lambda at_s: (stamped.stamp_s(at_s) or 0.0) + ahead_s


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
        for one in run(link, car, lasts_s=20.0, seed=seed, ros_s=ros_clock(rng, car)):
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


def whole_car() -> list[Stream]:
    """134 kB/s, of which 54 are only recorded."""
    rows = [
        ("/vel", 190, "speed", False),
        ("/brake", 190, "brake", False),
        ("/steering", 190, "steering", False),
        ("/dist", 75, "distance", False),
        ("/odom", 1100, "odometry", True),
        ("/scan", 2200, "scan", True),
        ("/noise", 2700, None, False),
    ]
    return [
        Stream(topic=topic, hz=20, size=size, signal=signal, offset_s=0.0 if stamped else None, queue_length=1)
        for topic, size, signal, stamped in rows
    ]


MOMENT_S = 0.5  # half of what the warning waits
QUEUE_LENGTHS = {topic.signal: topic.queue_length for topic in TOPICS}


def queued_car() -> list[Stream]:
    """The same with queues as they are subscribed to, a mode and a command."""
    more = [Stream(topic=f"/{name}", hz=20, size=120, signal=name, offset_s=None) for name in ("mode", "command")]
    return [replace(one, queue_length=QUEUE_LENGTHS.get(one.signal or "", 1)) for one in [*whole_car(), *more]]


class Watched:
    """A run over a link whose load follows how late it is."""

    def __init__(
        self,
        link: Link,
        lasts_s: float,
        seed: int = 1,
        car: Callable[[], list[Stream]] = whole_car,
        ros_s: Callable[[float], float] | None = None,
    ) -> None:
        load = LinkLoad()
        self.steps: list[tuple[float, int]] = [(0.0, 0)]
        self.rows: list[tuple[float, float, float]] = []  # time, how late it is stated to be, how late it is
        newest: dict[str, float] = {}
        for one in run(link, car(), lasts_s=lasts_s, seed=seed, load=load, ros_s=ros_s):
            if load.step != self.steps[-1][1]:
                self.steps.append((one.at_s, load.step))
            if one.topic != "/noise":
                newest[one.topic] = one.true_s
                self.rows.append((one.at_s, one.late_s, max(newest.values())))

    def between(self, from_s: float, to_s: float) -> list[tuple[float, float]]:
        return [(late_s, true_s) for at_s, late_s, true_s in self.rows if from_s <= at_s < to_s]

    def may_alarm(self, from_s: float, to_s: float) -> float:
        """The share of the time in which the link is called late."""
        found = self.between(from_s, to_s)
        return sum(late_s > LateLimits().late_s for late_s, _ in found) / len(found)

    def longest_late_s(self, from_s: float = 0.0, true_below_s: float = math.inf) -> float:
        """For how long the link is called late at once, while it is less late than that."""
        longest_s, since_s = 0.0, math.inf
        for at_s, late_s, true_s in self.rows:
            if at_s < from_s:
                continue
            since_s = min(since_s, at_s) if late_s > LateLimits().late_s and true_s < true_below_s else math.inf
            longest_s = max(longest_s, at_s - since_s)
        return longest_s


def even(rate_Bps: Callable[[float], float], *, kernel_bytes: int = 10_000) -> Link:
    return Link(rate_Bps=rate_Bps, down_s=lambda _: 0.01, up_s=lambda _: 0.01, kernel_bytes=kernel_bytes)


@pytest.mark.parametrize("kernel_bytes", [10_000, 100_000])
def test_a_link_that_carries_what_is_left_is_not_called_late_and_one_that_is_well_again_has_all_of_it_in_seconds(
    kernel_bytes: int,
) -> None:
    rate_Bps = lambda at_s: 14_500.0 if 10.0 <= at_s < 70.0 else 140_000.0  # noqa: E731
    seen = Watched(even(rate_Bps, kernel_bytes=kernel_bytes), 85.0)
    assert max(step for _, step in seen.steps) == len(LEVELS) - 1
    drained_s = 20.0 + kernel_bytes / 10_000 * 2.0
    assert seen.may_alarm(drained_s, 85.0) == 0.0
    errors_s = sorted(late_s - true_s for late_s, true_s in seen.between(drained_s, 85.0))
    assert errors_s[0] >= -UNDER_S
    assert errors_s[len(errors_s) // 2] <= OVER_S
    assert seen.steps[-1][1] == 0
    assert seen.steps[-1][0] < 70.0 + 6.0


def test_after_a_minute_of_a_bad_radio_the_link_has_all_of_it_in_seconds() -> None:
    rng = random.Random(3)

    def way_s(at_s: float) -> float:
        return 0.2 + rng.random() * 0.2 + (0.6 if rng.random() < 0.01 else 0.0) if 10.0 <= at_s < 70.0 else 0.01

    rate_Bps = lambda at_s: 60_000.0 if 10.0 <= at_s < 70.0 else 150_000.0  # noqa: E731
    seen = Watched(Link(rate_Bps=rate_Bps, down_s=way_s, up_s=way_s, kernel_bytes=100_000), 85.0)
    assert (seen.steps[-1][1], seen.steps[-1][0] < 70.0 + 6.0) == (0, True), seen.steps


@pytest.mark.parametrize("rate_Bps", [20_000.0, 60_000.0, 110_000.0])
def test_a_link_that_stays_slow_is_tried_ever_more_seldom(rate_Bps: float) -> None:
    seen = Watched(even(lambda _: rate_Bps, kernel_bytes=50_000), 150.0)
    tried = [at_s for (at_s, step), (_, before) in zip(seen.steps[1:], seen.steps, strict=False) if step < before]
    assert sum(at_s > 75.0 for at_s in tried) <= 6, seen.steps
    assert seen.may_alarm(30.0, 150.0) < 0.02


def test_a_minute_of_a_fair_radio_is_no_alarm() -> None:
    rng = random.Random(3)

    def way_s(_: float) -> float:
        return 0.06 + rng.random() * 0.04 + (0.25 if rng.random() < 0.02 else 0.0)

    seen = Watched(Link(rate_Bps=lambda _: 250_000.0, down_s=way_s, up_s=way_s), 60.0)
    assert seen.may_alarm(1.0, 60.0) == 0.0
    assert seen.steps == [(0.0, 0)]


def test_a_change_of_the_mode_is_not_lost_while_the_link_takes_nothing_for_more_than_a_second() -> None:
    link = even(lambda at_s: 1.0 if 5.0 <= at_s < 6.3 else 250_000.0)
    sent_s = [one.at_s - one.true_s for one in run(link, queued_car(), lasts_s=8.0, seed=1) if one.topic == "/mode"]
    assert len(sent_s) > 100
    assert max(b - a for a, b in pairwise(sent_s)) == pytest.approx(0.05)


@pytest.mark.parametrize(("seed", "jitter_s", "loss"), [(1, 0.08, 0.06), (3, 0.04, 0.02)])
def test_a_link_that_becomes_a_fair_radio_is_no_alarm(seed: int, jitter_s: float, loss: float) -> None:
    """With queues as they are subscribed to, before round trips that vary."""
    rng = random.Random(seed)

    def way_s(at_s: float) -> float:
        return 0.06 + rng.random() * jitter_s + (0.25 if rng.random() < loss else 0.0) if at_s >= 10.0 else 0.01

    link = Link(rate_Bps=lambda _: 250_000.0, down_s=way_s, up_s=way_s)
    seen = Watched(link, 40.0, seed, queued_car)
    errors_s = sorted(late_s - true_s for late_s, true_s in seen.between(11.0, 40.0))
    assert errors_s[0] >= -UNDER_S
    assert errors_s[len(errors_s) // 2] <= OVER_S
    assert seen.longest_late_s() < MOMENT_S


@pytest.mark.parametrize(("down_s", "up_s"), [(0.29, 0.01), (0.01, 0.29), (0.8, 0.05), (0.15, 0.15)])
def test_the_middle_of_a_round_trip_is_little_below_the_truth_where_its_ways_differ(down_s: float, up_s: float) -> None:
    link = Link(rate_Bps=lambda _: 250_000.0, down_s=lambda _: down_s, up_s=lambda _: up_s)
    seen = Watched(link, 20.0, 1, queued_car)
    assert min(late_s - true_s for late_s, true_s in seen.between(2.0, 20.0)) >= -UNDER_S


@pytest.mark.parametrize("seed", range(1, 4))
def test_a_weak_radio_is_as_late_as_stated(seed: int) -> None:
    rng = random.Random(seed)

    def way_s(at_s: float) -> float:
        return 0.1 + rng.random() * 0.1 + (0.2 if rng.random() < 0.05 else 0.0) if at_s >= 10.0 else 0.01

    link = Link(rate_Bps=lambda at_s: 50_000.0 if at_s >= 10.0 else 250_000.0, down_s=way_s, up_s=way_s)
    seen = Watched(link, 60.0, seed, queued_car)
    errors_s = sorted(late_s - true_s for late_s, true_s in seen.between(15.0, 60.0))
    assert errors_s[0] >= -UNDER_S
    assert errors_s[len(errors_s) // 2] <= OVER_S
    assert seen.longest_late_s(20.0, LateLimits().late_s - OVER_S) < 1.0


def test_a_slow_link_is_asked_for_less_step_by_step_and_for_more_again_with_patience() -> None:
    load = LinkLoad()
    steps = [load.step]
    for tick in range(60):
        if load.look(0.8 + tick * 0.01, tick / 10, 0.0):
            steps.append(load.step)
    assert steps == list(range(len(LEVELS)))
    now_s = 6.0
    restored = []
    while load.step:
        now_s += 0.1
        if load.look(0.05, now_s, 0.0):
            restored.append(now_s)
    assert len(restored) == len(LEVELS) - 1
    assert all(after - before >= RESTORE_AFTER_S - 0.11 for before, after in pairwise([6.0, *restored]))


def test_a_very_slow_link_is_asked_for_the_least_at_once_a_hiccup_for_nothing_less() -> None:
    load = LinkLoad()
    assert not any(load.look(2.0, tick / 10, 0.0) for tick in range(4))
    assert not load.look(0.1, 0.4, 0.0)
    assert any(load.look(2.0, 1.0 + tick / 10, 0.0) for tick in range(6))
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
