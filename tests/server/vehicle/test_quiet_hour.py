"""A healthy car with four pages that come and go: at most one announcement in ten minutes."""

from __future__ import annotations

import random
from dataclasses import dataclass

import pytest

from monitor.phones import PhoneReport, Why
from monitor.state import State
from server.control.alarm_reach import AlarmReach, Present, Ready
from server.control.lease import Operator
from tests.server.judged import Raised, judged

pytestmark = pytest.mark.world(n=20)
TEN_MIN_S = 600.0


@dataclass(slots=True)
class Page:
    """One page: here for 20 to 90 s, away for 5 to 60 s; half of its departures are without a farewell."""

    number: int
    sound: Ready
    why: Why
    rng: random.Random
    is_here: bool = False
    turns_s: float = 0.0

    def step(self, state: State, reach: AlarmReach, now_s: float) -> None:
        operator = Operator(who=f"device {self.number}", page=f"page {self.number}", name=f"Phone {self.number}")
        if now_s >= self.turns_s:
            self.is_here = not self.is_here
            self.turns_s = now_s + (self.rng.uniform(20.0, 90.0) if self.is_here else self.rng.uniform(5.0, 60.0))
            if not self.is_here and self.rng.random() < 0.5:
                reach.leave(operator)
                state.receive_phone(PhoneReport(phone=str(self.number), is_handheld=True, why="off"), now_s)
        if self.is_here:
            reach.update_status(operator, Present(is_visible=True, sound=self.sound, awake="ready"), now_s)
            state.receive_phone(PhoneReport(phone=str(self.number), is_handheld=True, why=self.why), now_s)


class Crew:
    """Four pages: two that sound, one that was not touched, one whose sound was refused; none has a position."""

    def __init__(self, seed: int) -> None:
        rng = random.Random(seed)
        kinds: list[tuple[Ready, Why]] = [
            ("ready", "denied"),
            ("asks", "unavailable"),
            ("ready", "timeout"),
            ("refused", "denied"),
        ]
        self._pages = [Page(n, sound, why, rng, turns_s=rng.uniform(0, 10)) for n, (sound, why) in enumerate(kinds)]
        self._reach = AlarmReach()
        self._due_s = 0.0

    def __call__(self, state: State, now_s: float) -> None:
        if now_s >= self._due_s:
            self._due_s = now_s + 1.0
            for page in self._pages:
                page.step(state, self._reach, now_s)
        state.reach(self._reach.facts(now_s))


def assert_quiet(raised: list[Raised], minutes: float) -> None:
    listed = [(round(one.at_s, 1), one.alarm, one.text) for one in raised]
    assert len(raised) <= max(2.0, minutes / 10.0), listed


@pytest.mark.slow
def test_some_healthy_minutes_are_quiet() -> None:
    assert_quiet(judged([], 240.0, crew=Crew(1)), 4.0)


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(1, 4))
def test_a_healthy_hour_is_quiet(seed: int) -> None:
    raised = judged([], 3600.0, seed=seed, crew=Crew(seed))
    assert_quiet(raised, 60.0)
    assert len(raised) <= 6
