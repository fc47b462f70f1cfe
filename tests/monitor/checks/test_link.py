"""Connecting failed, no message, link lost, car silent: the report's cases 1, 3, 12 and 13."""

from __future__ import annotations

from dataclasses import replace

import pytest

from monitor.check import Finding, Verdict
from monitor.shell_facts import LinkFacts, Phase
from monitor.state import Reading, Snapshot
from tests.monitor.checks.known import ask

OK, FAULT, UNKNOWN = Verdict.OK, Verdict.FAULT, Verdict.UNKNOWN
OPEN = LinkFacts(phase="monitoring", since_s=50.0, connected_s=50.0, bridge_answers=True, topics_subscribed=9)


def found(check: str, link: LinkFacts, now_s: float = 100.0, heard_s: float | None = None) -> Finding:
    return ask(check, Snapshot(now_s=now_s, link=link, heard_s=heard_s))


@pytest.mark.parametrize(
    ("phase", "failed", "lost"),
    [
        ("connecting", UNKNOWN, UNKNOWN),
        ("failed", FAULT, UNKNOWN),
        ("monitoring", OK, OK),
        ("lost", OK, FAULT),
    ],
)
def test_each_phase_has_its_own_verdict(phase: Phase, failed: Verdict, lost: Verdict) -> None:
    link = LinkFacts(phase=phase, since_s=90.0)
    assert found("connect_failed", link).verdict is failed
    assert found("link_lost", link).verdict is lost


def test_case_01_the_reason_of_a_failure_is_reported() -> None:
    link = LinkFacts(
        phase="failed",
        problem_title="192.168.4.1 is there, but nothing listens on port 9090.",
        problem_hint="Start rosbridge on the car, or check the port.",
    )
    assert found("connect_failed", link).text == (
        "192.168.4.1 is there, but nothing listens on port 9090. Start rosbridge on the car, or check the port."
    )
    assert found("connect_failed", LinkFacts(phase="failed")).text == "The car cannot be reached."


def test_case_12_a_lost_link_reports_what_fell_silent_and_for_how_long() -> None:
    lost = found("link_lost", LinkFacts(phase="lost", since_s=93.8, problem_title="The bridge stopped answering."))
    assert lost.text == "The bridge stopped answering."
    assert lost.measured is not None
    assert lost.measured.value == pytest.approx(6.2)


@pytest.mark.parametrize(
    ("now_s", "heard_s", "last_message_s", "verdict"),
    [
        pytest.param(54.9, None, None, UNKNOWN, id="not yet 5 s"),
        pytest.param(55.0, None, None, FAULT, id="5 s"),
        pytest.param(99.0, 40.0, 40.0, FAULT, id="nothing since the link came back"),
        pytest.param(99.0, 50.0, None, OK, id="a signal came"),
        pytest.param(99.0, None, 60.0, OK, id="a topic spoke that carries no signal"),
    ],
)
def test_case_03_no_message(
    now_s: float, heard_s: float | None, last_message_s: float | None, verdict: Verdict
) -> None:
    link = replace(OPEN, last_message_s=last_message_s)
    assert found("no_message", link, now_s, heard_s).verdict is verdict


@pytest.mark.parametrize("phase", ["connecting", "failed", "lost"])
def test_without_a_link_no_message_is_expected(phase: Phase) -> None:
    assert found("no_message", LinkFacts(phase=phase)).verdict is UNKNOWN


@pytest.mark.parametrize(
    ("answers", "topics", "text"),
    [
        (True, 9, "The bridge answers, the car publishes nothing. 0 of 9 topics sent data within 5 s."),
        (True, 0, "The bridge answers, but offers no topic that catgraph knows."),
        (
            False,
            9,
            "Connected, but neither the bridge's ROS side nor the car answers. 0 of 9 topics sent data within 5 s.",
        ),
    ],
)
def test_whose_silence_it_is(answers: bool, topics: int, text: str) -> None:
    link = replace(OPEN, bridge_answers=answers, topics_subscribed=topics)
    assert found("no_message", link).text == text


def silent(
    *ages_s: float,
    bridge_s: float | None = None,
    was_active: bool = False,
    slow_s: float | None = None,
    command_s: float | None = None,
    position_s: float | None = None,
    check: str = "car_silent",
) -> Finding:
    """A car at 100 s whose fast signals are so old; diagnostics and position, once a second, may be younger."""
    names = ("speed", "brake", "steering", "distance")
    readings = {
        name: Reading(value=0, received_s=100.0 - age_s, horizon_s=1.0, period_s=0.05, count=9)
        for name, age_s in zip(names, ages_s, strict=False)
    }
    if slow_s is not None:
        readings["diagnostics"] = Reading(value=0, received_s=100.0 - slow_s, horizon_s=10.0, period_s=1.0, count=9)
    if position_s is not None:
        readings["position"] = Reading(value=0, received_s=100.0 - position_s, horizon_s=10.0, period_s=1.0, count=9)
    if command_s is not None:
        readings["command"] = Reading(value=0, received_s=100.0 - command_s, horizon_s=1.0, period_s=0.05, count=9)
    heard_s = max((reading.received_s for reading in readings.values()), default=None)
    link = replace(OPEN, bridge_heard_s=bridge_s)
    return ask(check, Snapshot(now_s=100.0, readings=readings, link=link, heard_s=heard_s), was_active=was_active)


@pytest.mark.parametrize(
    ("finding", "verdict"),
    [
        pytest.param(silent(0.01, 0.02, 0.03), OK, id="all fresh"),
        pytest.param(silent(9.0, 9.0, 0.03), OK, id="one still comes"),
        pytest.param(silent(1.01, 1.02, 1.03, bridge_s=99.5), FAULT, id="all stale, the bridge lives"),
        pytest.param(silent(1.0, 1.02, 1.03, bridge_s=99.5), OK, id="one just not stale"),
        pytest.param(silent(1.5, 1.5, 1.5, bridge_s=98.6), UNKNOWN, id="nothing from the bridge since either"),
        pytest.param(silent(1.5, 1.5, 1.5), UNKNOWN, id="nothing known of the bridge"),
        pytest.param(silent(2.7, 2.7, 2.7), FAULT, id="whatever the bridge, it must be reported"),
        pytest.param(silent(1.5, 1.5, 1.5, was_active=True), FAULT, id="active, it stays"),
        pytest.param(silent(1.5, 1.5, 1.5, slow_s=0.1), FAULT, id="diagnostics alone are not a car"),
        pytest.param(silent(1.5, 1.5, 1.5, command_s=0.1), FAULT, id="a command to the car is no message of the car"),
        pytest.param(silent(1.5, slow_s=0.1), OK, id="one fast signal alone is the signal's own alarm"),
        pytest.param(silent(1.5, slow_s=2.0, bridge_s=99.9), FAULT, id="one fast signal and nothing since"),
        pytest.param(silent(), UNKNOWN, id="never spoke"),
        pytest.param(silent(1.5, 1.5, 1.5, bridge_s=99.9, position_s=0.4), OK, id="another signal goes on"),
        pytest.param(silent(1.5, 1.5, 1.5, bridge_s=99.9, position_s=1.4), FAULT, id="it came last with the others"),
        pytest.param(silent(4.0, 4.0, 4.0, bridge_s=99.9, position_s=2.0), FAULT, id="it has ended too"),
        pytest.param(silent(1.5, 1.5, 1.5, was_active=True, position_s=0.1), OK, id="active, and another signal comes"),
    ],
)
def test_the_car_fell_silent(finding: Finding, verdict: Verdict) -> None:
    assert finding.verdict is verdict


@pytest.mark.parametrize(("position_s", "verdict"), [(0.4, FAULT), (1.5, UNKNOWN)])
def test_signals_that_stop_while_another_goes_on_are_silent_themselves(position_s: float, verdict: Verdict) -> None:
    found = silent(1.5, 1.5, 1.5, bridge_s=99.9, position_s=position_s, check="signal_stale.speed")
    assert found.verdict is verdict


def test_what_came_before_the_link_was_lost_does_not_count() -> None:
    old = Reading(value=0, received_s=40.0, horizon_s=1.0, period_s=0.05, count=9)
    assert ask("car_silent", Snapshot(now_s=100.0, readings={"speed": old}, link=OPEN, heard_s=40.0)).verdict is UNKNOWN


def test_who_is_silent_is_reported() -> None:
    assert (
        silent(3.4, 3.4, 3.4, bridge_s=99.5).text
        == "No message for 3.4 s: the bridge answers, no signal of the car comes"
    )
    assert silent(3.4, 3.4, 3.4).text == "No message for 3.4 s: neither car nor bridge answers"
