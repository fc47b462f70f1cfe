"""When catgraph slows the car by itself: rules as data, each off until an operator enables it, and testable on any
recording.

A rule watches checks. Once one of them has found FAULT for as long as the rule requires, the rule is due: a countdown
begins, in which the operator may veto it. A veto counts until the fault has gone: it does not switch the rule off.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from monitor.alarm import Alarm
from monitor.checks.slow_down import SlowDownLimits

COUNTDOWN_S = 2.0
GONE_S = 1.0  # a fault that is back within this was never gone
WATCHED_RATES = ("speed", "distance", "position", "scan")


@dataclass(frozen=True, slots=True, kw_only=True)
class Trigger:
    """One rule. `switch` and `after` name its settings among SlowDownLimits."""

    id: str
    title: str  # as the operator reads it
    checks: tuple[str, ...]  # any of them
    switch: str
    after: str


TRIGGERS: tuple[Trigger, ...] = (
    Trigger(
        id="speed", title="Speed above limit", checks=("speed_limit",), switch="on_speed", after="on_speed_after_s"
    ),
    Trigger(
        id="obstacle",
        title="Obstacle within the stopping distance",
        checks=("obstacle", "obstacle_nearest"),
        switch="on_obstacle",
        after="on_obstacle_after_s",
    ),
    Trigger(
        id="reach",
        title="No operator's phone reachable",
        checks=("reach",),
        switch="on_reach",
        after="on_reach_after_s",
    ),
    *(
        Trigger(
            id=f"rate.{signal}",
            title=f"{signal.capitalize()} below its expected rate",
            checks=(f"signal_slow.{signal}", f"signal_stale.{signal}"),
            switch=f"on_rate_{signal}",
            after="on_rate_after_s",
        )
        for signal in WATCHED_RATES
    ),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Due:
    """A rule whose time has come."""

    trigger: Trigger
    text: str  # the check's finding
    since_s: float


class Triggers:
    """Follows the rules of one vehicle. Time is an argument and does not go back."""

    def __init__(self) -> None:
        self._since_s: dict[str, float] = {}  # rule → since when its fault stands
        self._gone_s: dict[str, float] = {}  # rule → when it was last seen to be gone
        self._vetoed: set[str] = set()

    def look(
        self, alarms: Mapping[str, Alarm], limits: SlowDownLimits, now_s: float, *, counting: str | None = None
    ) -> Due | None:
        """The rule that is due now and not vetoed: the one that counts down already, else the first of the list."""
        due: Due | None = None
        for trigger in TRIGGERS:
            alarm = _faulty(trigger.checks, alarms) if getattr(limits, trigger.switch) >= 0.5 else None
            if alarm is None:
                gone_s = self._gone_s.setdefault(trigger.id, now_s)
                if now_s - gone_s >= GONE_S or trigger.id not in self._vetoed:
                    self._since_s.pop(trigger.id, None)
                    self._vetoed.discard(trigger.id)
                continue
            self._gone_s.pop(trigger.id, None)
            since_s = self._since_s.setdefault(trigger.id, now_s)
            is_due = trigger.id not in self._vetoed and now_s - since_s >= getattr(limits, trigger.after)
            if is_due and (due is None or trigger.id == counting):
                text = alarm.finding.text if alarm.finding is not None else trigger.title
                due = Due(trigger=trigger, text=text, since_s=since_s)
        return due

    def veto(self, trigger_id: str) -> None:
        """Veto the rule: it is not due again until its fault has gone."""
        self._vetoed.add(trigger_id)

    def forget(self) -> None:
        """Another drive."""
        self._since_s.clear()
        self._gone_s.clear()
        self._vetoed.clear()


def is_any_on(limits: SlowDownLimits) -> bool:
    return any(getattr(limits, trigger.switch) >= 0.5 for trigger in TRIGGERS)


def _faulty(checks: Collection[str], alarms: Mapping[str, Alarm]) -> Alarm | None:
    for check in checks:
        alarm = alarms.get(check)
        if alarm is not None and alarm.condition and not alarm.suppressed_by:
            return alarm
    return None
