"""Where only signals without a rate of their own were received, what is missing is named in the usual time."""

from __future__ import annotations

from dataclasses import replace

import pytest

from monitor.signals import SIGNALS
from monitor.values import Level
from tests.monitor.drive import REAL_HZ, Drive

MISSING = {f"signal_stale.{name}" for name in REAL_HZ if name != "diagnostics" and not SIGNALS[name].optional}


def opened(*received: str, reports: int) -> Drive:
    """A car that has all topics and sends only these, so many times."""
    car = Drive()
    car.link = replace(car.link, published=frozenset({*REAL_HZ, "fuel"}))
    car.silent = set(REAL_HZ)
    car.open()
    for number in range(reports):
        for name in received:
            car.send(name, car.values.get(name, Level(value=60.0, unit="%")))
        car.to(number + 1.0)
    return car


@pytest.mark.parametrize("received", ["diagnostics", "fuel"])
@pytest.mark.parametrize("reports", [1, 2, 4])
def test_one_report_or_two_do_not_hide_that_nothing_else_comes(received: str, reports: int) -> None:
    car = opened(received, reports=reports)
    car.to(4.9)
    assert not MISSING & set(car.announced)
    car.to(10.0)
    assert set(car.announced) >= MISSING
    assert "car_silent" not in car.announced  # which is not known: nothing regular ever came
    assert car.monitor.findings["car_silent"].text == "No regular signal received since connecting"


def test_after_the_link_came_back_too() -> None:
    car = Drive().open().to(10.0)
    car.silent = set(REAL_HZ)
    car.lose().to(12.0).open().send("diagnostics", car.values["diagnostics"]).to(20.0)
    assert set(car.announced) >= MISSING


def test_nothing_at_all_is_one_announcement() -> None:
    assert opened(reports=0).to(20.0).announced == ["no_message"]
