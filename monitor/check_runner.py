"""Runs one check after another, so that one which fails silences none of the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from traceback import format_exception
from typing import Any, NamedTuple

from monitor.catalog import AnyCheck
from monitor.check import OK, Finding, Scope, fault, unknown
from monitor.snapshot import NotFresh, Snapshot

NO_LINK = unknown("No link to the car", short="no link")
PAUSED = unknown("Monitoring is paused", short="paused")


@dataclass(frozen=True, slots=True, kw_only=True)
class Crash:
    """A check that fails, for the shell to log once."""

    check_id: str
    error: str  # "ZeroDivisionError: division by zero"
    where: str  # traceback
    count: int  # ever; 1 is worth a line in the log


class CheckRow(NamedTuple):
    """A check and the limits in force for it."""

    check: AnyCheck
    limits: Any


def blind_to_the_car(snapshot: Snapshot) -> Finding | None:
    """Why nothing of the car can be judged now; None: it can."""
    if snapshot.link.phase != "monitoring":
        return NO_LINK
    return PAUSED if snapshot.paused else None


class CheckRunner:
    """Runs the checks, and records which of them raise."""

    __slots__ = ("_declared", "_failed", "crashes")

    def __init__(self, declared: Sequence[AnyCheck]) -> None:
        self._declared = declared
        self._failed: dict[str, int] = {}  # how often ever, by check id
        self.crashes: dict[str, Crash] = {}  # checks that fail now, by check id

    def find(self, row: CheckRow, snapshot: Snapshot, blind: Finding | None, *, is_active: bool) -> Finding:
        """What the check finds; `is_active`: whether its alarm is. A check that fails finds UNKNOWN.

        `blind`: what every check of the car finds, see `blind_to_the_car`.
        """
        check = row.check
        if blind is not None and check.scope is Scope.CAR:
            return blind
        try:
            finding = check.find(snapshot, row.limits, is_active)
            if type(finding) is not Finding:
                raise TypeError(f"{check.id} found {finding!r}, which is no finding")
        except NotFresh as missing:
            finding = unknown(missing.why, short=missing.short)
        except Exception as error:  # the one net: a broken check must not silence the others
            self._failed[check.id] = self._failed.get(check.id, 0) + 1
            self.crashes[check.id] = Crash(
                check_id=check.id,
                error=f"{type(error).__name__}: {error}",
                where="".join(format_exception(error)),
                count=self._failed[check.id],
            )
            return unknown("This check fails", short="failed")
        if self.crashes:
            self.crashes.pop(check.id, None)
        return finding

    def impaired(self, failed_parts: tuple[str, ...]) -> Finding:
        """Whether all is watched; `failed_parts`: what fails of that which feeds the checks."""
        if not self.crashes and not failed_parts:
            return OK
        labels = (*(check.label for check in self._declared if check.id in self.crashes), *failed_parts)
        return fault(f"Not watched: {', '.join(labels)}", causes=labels)
