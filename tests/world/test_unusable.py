"""A value that is not a number is called that, and not silence."""

from __future__ import annotations

import pytest

from monitor.state import LinkFacts, Reading, State
from monitor.values import Effort, Twist
from server.judge import pipeline
from server.judge.profiles import GENERIC
from server.judge.reception_stats import Reception
from server.judge.sources.choice import choose
from tests.monitor.drive import REAL_HZ, Drive

pytestmark = pytest.mark.world(n=7)


def refuse_all(drive: Drive, names: list[str], *, until_s: float) -> None:
    """Messages of these signals come at 20 Hz, and none of their values can be used."""
    drive.silent |= set(names)
    while drive.now_s < until_s:
        drive.to(drive.now_s + 0.05)
        for name in names:
            drive.state.refuse(name, "linear.x is not a number", drive.now_s)


def test_one_signal_without_numbers_is_named_and_not_called_silent() -> None:
    drive = Drive().open().to(8.0)
    refuse_all(drive, ["speed"], until_s=18.0)
    assert drive.announced == ["signal_unusable.speed"]
    text = drive.monitor.alarms["signal_unusable.speed"].finding.text
    assert text.startswith("Speed: not a number (linear.x)")
    assert "no message" not in text
    assert drive.monitor.findings["speed_limit"].text == "Speed: not a number (linear.x)"


def test_a_car_without_any_number_is_not_called_silent() -> None:
    drive = Drive().open().to(8.0)
    refuse_all(drive, list(REAL_HZ), until_s=18.0)
    assert drive.announced == ["car_unusable"]
    assert not drive.monitor.alarms["car_silent"].active
    drive.silent.clear()
    drive.to(30.0)
    assert not drive.monitor.alarms["car_unusable"].active


def test_only_when_nothing_comes_is_the_car_silent() -> None:
    drive = Drive().open().to(8.0)
    refuse_all(drive, list(REAL_HZ), until_s=12.0)
    drive.to(18.0)
    assert "car_silent" in drive.announced


def test_a_message_that_cannot_be_used_is_counted_as_one_that_came() -> None:
    state = State()
    state.link(LinkFacts(phase="monitoring", since_s=0.0, connected_s=0.0, published=frozenset({"speed"})))
    reception = Reception()
    sources = tuple(choose({"/vel": "geometry_msgs/Twist"}).sources.values())
    for n in range(100):
        pipeline.receive(
            sources,
            {"linear": {"x": None}},
            n * 0.05,
            None,
            reception=reception,
            state=state,
            profile=GENERIC,
            tyre_rad_per_unit=0.0,
        )
    snapshot = state.snapshot(5.0)
    assert snapshot.heard_s == pytest.approx(4.95)
    assert snapshot.unusable["speed"].count == 100
    assert snapshot.unusable["speed"].text == "not a number (linear.x)"
    assert snapshot.rates["speed"].measured_hz == pytest.approx(20.0, rel=0.1)
    pipeline.receive(
        sources,
        {"linear": {"x": 1.0}},
        5.0,
        None,
        reception=reception,
        state=state,
        profile=GENERIC,
        tyre_rad_per_unit=0.0,
    )
    assert not state.snapshot(5.0).unusable


def test_an_old_value_is_stale_however_often_messages_come() -> None:
    reading = Reading(value=Twist(speed_mps=1.0), received_s=10.0, horizon_s=10.0, period_s=1.0, delay_s=2.5)
    assert reading.freshness(10.0) == "stale"
    assert reading.is_coming(10.0)
    assert reading.age_s(10.5) == pytest.approx(3.0)
    state = State()
    state.receive("brake", Effort(percent=1.0), 1.0, None, 0.8)
    assert state.snapshot(1.1).readings["brake"].age_s(1.1) == pytest.approx(0.9)
