"""The log lines about a car that is ordered to slow down: shown, stopped, already standing, or not confirmed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from monitor.checks.slow_down import STANDS_ALREADY, STANDS_UNPROVEN, SlowDownLimits
from monitor.slow_proof import Shown, SlowProof
from monitor.state import Snapshot
from server.slowdown.order import SlowDown
from server.slowdown.order_log import OrderLog, Response
from tests.monitor.checks.test_three_answers import NOW_S, slowed
from tests.server.slowdown.test_order import DRIVES, WAY, begun

MISSING = "NOT CONFIRMED: the car does not slow. Use the physical stop."


class Car:
    """An order given 2 s ago whose first command went out 1.5 s ago, and its lines in the log."""

    def __init__(self, *, sent: bool = True) -> None:
        self.log: list[tuple[str, str]] = []
        self.life = SlowDown()
        begun(self.life, NOW_S - 2.0)
        assert self.life.order is not None
        self.order = self.life.order
        if sent:
            command = self.life.next(DRIVES, NOW_S - 1.5)
            assert command is not None
            self.life.sent(command, NOW_S - 1.5)
        self.response = Response(self.life, OrderLog(self._note, lambda: WAY))

    def _note(self, change: str, text: str, **more: Any) -> None:
        assert (change, more["order"]) == ("slow_down", 1)
        self.log.append((more["step"], text))

    def judge(self, *snapshots: Snapshot) -> list[tuple[str, str]]:
        for snapshot in snapshots:
            facts = snapshot.slowing
            without = replace(snapshot, slowing=replace(facts, ordered_s=None))  # the facts that are given count
            self.response.judge(self.order, without, facts, SlowDownLimits(), now_s=snapshot.now_s)
        return self.log


def stands(shown: Shown | None = None, *, stood_before: bool = False) -> Snapshot:
    snapshot = slowed(0.0)
    proof = SlowProof(ordered_s=snapshot.slowing.ordered_s, shown=shown, shown_s=NOW_S, stood_before=stood_before)
    return replace(snapshot, slow_proof=proof, standing_since_s=NOW_S - 1.0)


SLOWS, IGNORES, WAITS = slowed(-1.4), slowed(-0.2), slowed(-0.2, shown=False, sending_s=NOW_S - 0.4)


@pytest.mark.parametrize(
    ("snapshots", "log"),
    [
        ([WAITS], []),
        ([WAITS, SLOWS, SLOWS], [("slows", "The car slows: shown by its own speed 1.5 s after the first command.")]),
        (
            [stands("stopped")] * 2,
            [("slows", "The car stopped: shown by its own speed 1.5 s after the first command.")],
        ),
        ([stands(stood_before=True)] * 2, [("stands", f"{STANDS_ALREADY}.")]),
        ([stands()] * 2, [("stands", f"{STANDS_UNPROVEN}.")]),
        ([stands(), stands(stood_before=True)], [("stands", f"{STANDS_UNPROVEN}."), ("stands", f"{STANDS_ALREADY}.")]),
        ([IGNORES, IGNORES], [("not_confirmed", MISSING)]),
        ([IGNORES, WAITS, IGNORES], [("not_confirmed", MISSING)]),  # in between it was only not known
        ([stands(), WAITS, stands()], [("stands", f"{STANDS_UNPROVEN}.")] * 2),
    ],
)
def test_the_log_has_each_change_once(snapshots: list[Snapshot], log: list[tuple[str, str]]) -> None:
    assert Car().judge(*snapshots) == log


def test_what_slows_again_and_stops_slowing_again_is_logged_again() -> None:
    car = Car()
    assert [step for step, _ in car.judge(IGNORES, SLOWS, IGNORES)] == ["not_confirmed", "slows", "not_confirmed"]
    assert car.order.slows_s == NOW_S


def test_missing_until_it_slows_or_another_order_stands() -> None:
    car = Car()
    found = []
    for snapshot in (WAITS, IGNORES, WAITS, SLOWS, IGNORES):
        car.judge(snapshot)
        found.append(car.response.is_missing)
    assert found == [False, True, True, False, True]
    car.response.begin()
    assert car.response.is_missing is False


def test_what_stands_is_kept_until_it_is_known_no_more() -> None:
    car = Car()
    kept = []
    for snapshot in (stands(stood_before=True), stands(), WAITS, stands(), IGNORES):
        car.judge(snapshot)
        kept.append(car.order.stands)
    assert kept == ["before", "unproven", None, "unproven", None]


def test_before_the_first_command_nothing_is_shown() -> None:
    car = Car(sent=False)
    assert car.judge(SLOWS) == []
    assert car.order.slows_s is None
