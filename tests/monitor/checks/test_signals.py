"""Each signal silent or slow: the three answers of both families, for one signal each of every kind."""

from __future__ import annotations

from dataclasses import replace

import pytest

from monitor.check import Finding, Verdict
from monitor.rates import Rate
from monitor.shell_facts import LinkFacts
from monitor.signals import SIGNALS
from monitor.state import Reading, Snapshot
from tests.monitor.checks.known import ask

OK, FAULT, UNKNOWN = Verdict.OK, Verdict.FAULT, Verdict.UNKNOWN
NOW_S = 100.0
OPEN = LinkFacts(phase="monitoring", since_s=0.0, connected_s=0.0, published=frozenset(SIGNALS))


def received(
    age_s: float, period_s: float = 0.05, horizon_s: float = 1.0, derived_from: str | None = None
) -> Reading[int]:
    return Reading(
        value=0,
        received_s=NOW_S - age_s,
        horizon_s=horizon_s,
        period_s=period_s,
        count=0 if derived_from else 9,
        derived_from=derived_from,
    )


def snapshot(link: LinkFacts = OPEN, rates: dict[str, Rate] | None = None, **readings: Reading[int]) -> Snapshot:
    """At 100 s, while `steering` and `position` keep coming, so that the car as a whole is not silent."""
    known = {"steering": received(0.01), "position": received(0.05, 0.1), **readings}
    newest_s = max(reading.received_s for reading in known.values())
    return Snapshot(now_s=NOW_S, readings=known, link=link, heard_s=newest_s, rates=rates or {})


def stale(signal: str, of: Snapshot, **limits: float) -> Finding:
    return ask(f"signal_stale.{signal}", of, **limits)


@pytest.mark.parametrize(
    ("age_s", "horizon_s", "verdict"),
    [
        pytest.param(0.0, 1.0, OK, id="new"),
        pytest.param(1.0, 1.0, OK, id="at the horizon"),
        pytest.param(1.01, 1.0, FAULT, id="beyond it"),
        pytest.param(9.9, 10.0, OK, id="a slow signal has longer"),
        pytest.param(10.1, 10.0, FAULT, id="but not for ever"),
    ],
)
def test_silent(age_s: float, horizon_s: float, verdict: Verdict) -> None:
    assert stale("brake", snapshot(brake=received(age_s, horizon_s=horizon_s))).verdict is verdict


@pytest.mark.parametrize(
    ("waited_s", "hz", "verdict", "text"),
    [
        (4.9, 0.0, UNKNOWN, "waiting for its first message"),
        (5.1, 0.0, UNKNOWN, "nothing received in 5 s since connecting; its interval is not known"),
        (149.0, 0.0, UNKNOWN, "nothing received in 149 s since connecting; its interval is not known"),
        (151.0, 0.0, FAULT, "nothing received in 151 s since connecting"),
        (5.1, 1.0, FAULT, "nothing received in 5 s since connecting"),
    ],
)
def test_diagnostics_of_which_nothing_came_are_never_called_fine(
    waited_s: float, hz: float, verdict: Verdict, text: str
) -> None:
    opened_s = NOW_S - waited_s
    found = stale("diagnostics", snapshot(replace(OPEN, since_s=opened_s, connected_s=opened_s)), diagnostics_hz=hz)
    assert (found.verdict, found.text) == (verdict, f"Diagnostics: {text}")


def test_what_is_reported_of_a_silent_signal() -> None:
    found = stale("brake", snapshot(brake=received(3.4)))
    assert (found.text, found.brief, found.causes) == ("Brake: no message for 3.4 s", "FAULT: Brake 3 s", ("brake",))
    assert stale("distance", snapshot(distance=received(3.4))).brief == "FAULT: Nearest object"


NOT_FOUND = replace(OPEN, published=frozenset())
JUST_OPENED = replace(OPEN, since_s=97.0)


@pytest.mark.parametrize(
    ("signal", "link", "verdict", "applies", "brief"),
    [
        pytest.param("speed", NOT_FOUND, UNKNOWN, True, "not checked: no data", id="wanted, not published"),
        pytest.param("odometry", NOT_FOUND, UNKNOWN, False, "not published", id="optional, not published"),
        pytest.param("fuel", NOT_FOUND, UNKNOWN, False, "not published", id="event-like, not published"),
        pytest.param("speed", JUST_OPENED, UNKNOWN, True, "not checked: waiting", id="wanted, just connected"),
        pytest.param("speed", OPEN, FAULT, True, "FAULT: Speed", id="wanted, published, never came"),
        pytest.param("odometry", OPEN, UNKNOWN, False, "nothing received", id="optional, published, never came"),
        pytest.param("command", OPEN, UNKNOWN, False, "nothing received", id="event-like, published, never came"),
    ],
)
def test_never_came(signal: str, link: LinkFacts, verdict: Verdict, applies: bool, brief: str) -> None:
    found = stale(signal, snapshot(link))
    assert (found.verdict, found.applies, found.brief) == (verdict, applies, brief)


def test_an_optional_signal_whose_rate_the_operator_set_is_wanted() -> None:
    assert stale("odometry", snapshot(), odometry_hz=10.0).verdict is FAULT


def test_a_derived_signal_is_not_received_at_all() -> None:
    found = stale("acceleration", snapshot(NOT_FOUND, acceleration=received(5.0, derived_from="speed")))
    assert (found.verdict, found.applies) == (UNKNOWN, False)


def test_an_event_like_signal_is_not_missed_unless_the_operator_sets_its_rate() -> None:
    quiet = snapshot(command=received(60.0))
    assert stale("command", quiet).verdict is OK
    assert stale("command", quiet, command_hz=5.0).verdict is FAULT


@pytest.mark.parametrize(
    ("since_s", "verdict"),
    [
        pytest.param(99.0, UNKNOWN, id="just back"),
        pytest.param(97.0, UNKNOWN, id="within the grace"),
        pytest.param(96.9, FAULT, id="after it"),
    ],
)
def test_after_the_link_came_back_it_has_its_time_anew(since_s: float, verdict: Verdict) -> None:
    assert stale("brake", snapshot(replace(OPEN, since_s=since_s), brake=received(20.0))).verdict is verdict


def test_a_slow_signal_has_its_own_horizon_after_the_link_came_back() -> None:
    back = replace(OPEN, since_s=92.0)
    assert stale("diagnostics", snapshot(back, diagnostics=received(30.0, 1.0, 10.0))).verdict is UNKNOWN


def test_while_the_whole_car_is_silent_no_signal_is_blamed() -> None:
    together = snapshot(brake=received(1.2), steering=received(1.3), position=received(1.1))
    assert stale("brake", together).brief == "not checked: silent"


def test_the_first_of_a_silent_crowd_is_not_blamed_though_diagnostics_still_come() -> None:
    crowd = snapshot(
        brake=received(1.1), steering=received(0.9), position=received(0.8, 0.1), diagnostics=received(0.1, 1.0, 10.0)
    )
    assert stale("brake", crowd).brief == "not checked: silent"


def test_a_reading_from_the_future_is_waited_for() -> None:
    """The clock went back, and nothing came since."""
    assert stale("brake", snapshot(brake=received(-50.0))).verdict is UNKNOWN


def rate(measured_hz: float | None, expected_hz: float | None = 20.0, settled: bool = True) -> Rate:
    return Rate(measured_hz=measured_hz, expected_hz=expected_hz, settled=settled, learning=not settled)


def slow(of: Rate, *, was_active: bool = False, age_s: float = 0.05, **limits: float) -> Finding:
    known = snapshot(brake=received(age_s), rates={"brake": of})
    return ask("signal_slow.brake", known, was_active=was_active, **limits)


@pytest.mark.parametrize(
    ("of", "was_active", "age_s", "verdict"),
    [
        pytest.param(rate(20.0), False, 0.05, OK, id="as expected"),
        pytest.param(rate(18.0), False, 0.05, OK, id="at 90 %"),
        pytest.param(rate(17.99), False, 0.05, FAULT, id="below"),
        pytest.param(rate(18.5), True, 0.05, FAULT, id="within the deadband while active"),
        pytest.param(rate(18.6), True, 0.05, OK, id="above the deadband"),
        pytest.param(rate(40.0), False, 0.05, OK, id="faster is not slower"),
        pytest.param(rate(2.0), False, 1.1, UNKNOWN, id="while silent there is no rate"),
        pytest.param(rate(2.0, settled=False), False, 0.05, UNKNOWN, id="not settled"),
        pytest.param(rate(None), False, 0.05, UNKNOWN, id="not measured"),
        pytest.param(rate(2.0, expected_hz=None), False, 0.05, UNKNOWN, id="nothing expected"),
    ],
)
def test_slow(of: Rate, was_active: bool, age_s: float, verdict: Verdict) -> None:
    assert slow(of, was_active=was_active, age_s=age_s).verdict is verdict


def test_what_is_reported_of_a_slow_signal() -> None:
    found = slow(rate(12.0))
    assert (found.text, found.brief) == ("Brake: 12.0 Hz, expected 20.0 Hz", "FAULT: Brake 12 Hz")


@pytest.mark.parametrize(("percent", "verdict"), [(59.0, OK), (61.0, FAULT)])
def test_how_much_slower_is_a_threshold(percent: float, verdict: Verdict) -> None:
    assert slow(rate(12.0), slow_below_percent=percent).verdict is verdict


def test_demanding_all_of_the_rate_still_clears() -> None:
    assert slow(rate(20.0), was_active=True, slow_below_percent=100.0).verdict is OK


def test_a_signal_that_keeps_no_rate_is_not_held_to_one() -> None:
    found = slow(Rate(measured_hz=7.0, expected_hz=None, settled=False, learning=False))
    assert (found.verdict, found.applies) == (UNKNOWN, False)


@pytest.mark.parametrize(("set_hz", "verdict"), [(0.0, UNKNOWN), (5.0, FAULT)])
def test_an_event_like_signal_has_a_rate_only_when_the_operator_sets_it(set_hz: float, verdict: Verdict) -> None:
    known = snapshot(command=received(0.05), rates={"command": rate(2.0, 5.0)})
    assert ask("signal_slow.command", known, command_hz=set_hz).verdict is verdict
