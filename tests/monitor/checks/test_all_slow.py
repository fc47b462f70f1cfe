"""Everything slow at once: one announcement in place of twelve."""

from __future__ import annotations

from dataclasses import replace

import pytest

from monitor.check import Verdict
from monitor.rates import Rate
from monitor.signals import SIGNALS
from monitor.state import Reading, Snapshot
from tests.monitor.checks.known import LINK, ask
from tests.monitor.drive import REAL_HZ, Drive

OK, FAULT, UNKNOWN = Verdict.OK, Verdict.FAULT, Verdict.UNKNOWN
NAMES = [name for name in REAL_HZ if not SIGNALS[name].by_parts]


def slowed(slow: int, of: int, *, to: float = 0.5, **changes: object) -> Snapshot:
    """So many signals of a car, the first few at a part of their rate."""
    names = NAMES[:of]
    rates = {
        name: replace(
            Rate(measured_hz=REAL_HZ[name] * (to if n < slow else 1.0), expected_hz=REAL_HZ[name], settled=True),
            **changes,  # type: ignore[arg-type]
        )
        for n, name in enumerate(names)
    }
    readings = {name: Reading(value=0, received_s=100.0, horizon_s=1.0, count=9) for name in names}
    return Snapshot(now_s=100.0, readings=readings, link=LINK, rates=rates)


@pytest.mark.parametrize(
    ("snapshot", "was_active", "verdict"),
    [
        pytest.param(slowed(0, 10), False, OK, id="none"),
        pytest.param(slowed(4, 10), False, OK, id="four of ten"),
        pytest.param(slowed(5, 10), False, FAULT, id="half"),
        pytest.param(slowed(10, 10), False, FAULT, id="all"),
        pytest.param(slowed(2, 4), False, OK, id="two are each judged alone, even if they are half"),
        pytest.param(slowed(3, 4), False, FAULT, id="three of four"),
        pytest.param(slowed(3, 10), True, FAULT, id="not yet cleared"),
        pytest.param(slowed(2, 10), True, OK, id="cleared"),
        pytest.param(slowed(10, 10, to=0.9), False, OK, id="at the limit"),
        pytest.param(slowed(10, 10, to=0.89), False, FAULT, id="below it"),
        pytest.param(slowed(2, 2), False, UNKNOWN, id="too few to compare"),
        pytest.param(slowed(0, 0), False, UNKNOWN, id="nothing"),
        pytest.param(slowed(10, 10, settled=False), False, UNKNOWN, id="rates not settled"),
        pytest.param(slowed(10, 10, measured_hz=None), False, UNKNOWN, id="not measured"),
        pytest.param(slowed(10, 10, measured_hz=0.0), False, UNKNOWN, id="silent is another alarm"),
        pytest.param(slowed(10, 10, expected_hz=None), False, UNKNOWN, id="nothing expected"),
    ],
)
def test_verdict(snapshot: Snapshot, was_active: bool, verdict: Verdict) -> None:
    assert ask("all_slow", snapshot, was_active=was_active).verdict is verdict


def test_what_the_operator_reads() -> None:
    found = ask("all_slow", slowed(7, 9))
    assert found.text == "7 of 9 signals come slower than expected, down to 50 %: bridge, radio or server overloaded"
    assert found.brief == "FAULT 7 of 9"


def test_an_overloaded_bridge_is_one_announcement_and_its_end_none() -> None:
    car = Drive().open().to(12.0)
    usual = dict(car.hz)
    car.hz = {name: 0.6 * hz for name, hz in usual.items()}
    car.to(40.0)
    assert car.announced == ["all_slow"]
    assert 17.0 <= car.happened[0].at_s <= 22.0
    car.hz = usual
    car.to(80.0)
    assert [name for name in car.announced if "slow" in name] == ["all_slow"]


def test_a_single_slow_signal_is_still_its_own() -> None:
    car = Drive().open().to(12.0)
    car.hz["brake"] = 12.0
    car.to(30.0)
    assert car.announced == ["signal_slow.brake"]


def test_what_stays_slow_when_the_rest_is_well_again_is_reported_then() -> None:
    car = Drive().open().to(12.0)
    usual = dict(car.hz)
    car.hz = {name: 0.6 * hz for name, hz in usual.items()}
    car.to(40.0)
    car.hz = {**usual, "brake": 12.0}
    car.to(80.0)
    assert car.announced == ["all_slow", "signal_slow.brake"]
