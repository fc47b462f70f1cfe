"""Runs the checks over a snapshot and keeps their alarms."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from monitor.alarm import Alarm, Refused, Transition
from monitor.catalog import AllLimits, AnyCheck
from monitor.check import Finding, Verdict
from monitor.state import Snapshot

__all__ = ["Crash", "Monitor", "Refused", "Tile", "Transition"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Tile:
    """One tile of the home tab: the worst of the checks it stands for. The protocol's `checks` are these."""

    id: str
    label: str
    verdict: Verdict
    text: str
    brief: str  # at most 20 letters
    checks: tuple[str, ...]  # ids


@dataclass(frozen=True, slots=True, kw_only=True)
class Crash:
    """A check that failed, for the shell to log once."""

    check_id: str
    error: str  # "ZeroDivisionError: division by zero"
    where: str  # traceback
    count: int


class Monitor:
    """All checks of one vehicle and their alarms."""

    findings: dict[str, Finding]  # by check id
    alarms: dict[str, Alarm]  # by alarm id, which is the check's
    crashes: dict[str, Crash]  # checks that fail now, by id

    def __init__(self, checks: Sequence[AnyCheck] | None = None, limits: AllLimits | None = None) -> None:
        raise NotImplementedError

    limits: AllLimits  # may be replaced at any time; judged by from the next step

    def step(self, snapshot: Snapshot, changed: Collection[str] | None = None) -> tuple[Transition, ...]:
        """Judge. None: a tick, all checks; else only those that need one of the `changed` signals.

        With the link idle every alarm ends: there is nothing to monitor.
        """
        raise NotImplementedError

    def standing(self) -> list[Alarm]:
        """Alarms to show, most urgent first: active or unacknowledged, shelved ones included, suppressed ones not."""
        raise NotImplementedError

    def tiles(self) -> list[Tile]:
        """What the home tab shows of the checks."""
        raise NotImplementedError

    def acknowledge(self, alarm_id: str, occurrence: int, by: str, now_s: float) -> tuple[Transition, ...]:
        """Raises Refused with the reason, as do `shelve` and `unshelve`."""
        raise NotImplementedError

    def shelve(self, alarm_id: str, occurrence: int, minutes: float, by: str, now_s: float) -> tuple[Transition, ...]:
        raise NotImplementedError

    def unshelve(self, alarm_id: str, by: str, now_s: float) -> tuple[Transition, ...]:
        raise NotImplementedError
