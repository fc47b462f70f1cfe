"""What a check is made of: its answer, its thresholds, its declaration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from typing import Any, ClassVar, Generic, Literal, NamedTuple, TypeVar

from pydantic import BaseModel, ConfigDict, Field

from monitor.alarm_spec import Action, AlarmSpec, Place, Priority, Sound
from monitor.immutable import immutable
from monitor.snapshot import NotFresh, Snapshot

__all__ = [
    "OK",
    "Action",
    "AlarmSpec",
    "Check",
    "End",
    "Finding",
    "Limits",
    "NotFresh",
    "Place",
    "Priority",
    "Quantity",
    "Scope",
    "Sound",
    "Verdict",
    "absent",
    "beside",
    "fault",
    "fits_tile",
    "ok",
    "on_tile",
    "threshold",
    "unknown",
]

KEPT_FINDINGS = 1024  # half of all findings are that a signal is absent, in a few dozen texts
BRIEF_LETTERS = 21  # what fits a tile of the home tab beside its mark: "not checked: standing"


class Verdict(StrEnum):
    OK = "ok"
    FAULT = "fault"
    UNKNOWN = "unknown"


@immutable
class Quantity:
    """A number the operator reads, in SI."""

    label: str
    value: float
    unit: str


class Finding(NamedTuple):
    """What a check found. A tuple, because every check makes one with each tick."""

    verdict: Verdict
    text: str  # what, how much, against what
    brief: str  # at most 21 letters, for the tile
    measured: Quantity | None = None
    limit: Quantity | None = None
    causes: tuple[str, ...] = ()  # the faulty parts, if one alarm covers several; a new one re-alarms
    level: int = 0  # how bad, where a check has degrees; a higher one re-alarms
    applies: bool = True  # False: there is nothing here to check (an optional signal that is not published)
    ended: str = ""  # title of its alarm once that has ended, where the declared one would not be true of this finding


OK = Finding(verdict=Verdict.OK, text="OK", brief="OK")


def ok(text: str, *, measured: Quantity | None = None, limit: Quantity | None = None, ended: str = "") -> Finding:
    """The verdict OK, with `text`."""
    return Finding(Verdict.OK, text, "OK", measured, limit, ended=ended)


def on_tile(brief: str) -> str:
    """FAULT and what follows it on a tile: "FAULT 12.6 m/s", "FAULT: another node"."""
    return f"FAULT{':' if brief[:1].isalpha() else ''} {brief}" if brief else "FAULT"


def fits_tile(brief: str) -> bool:
    return len(on_tile(brief)) <= BRIEF_LETTERS


def fault(
    text: str,
    *,
    brief: str = "",
    measured: Quantity | None = None,
    limit: Quantity | None = None,
    causes: tuple[str, ...] = (),
    level: int = 0,
) -> Finding:
    """The verdict FAULT. `brief` follows "FAULT" on the tile ("12.6 m/s"), where it fits."""
    short = on_tile(brief)
    return Finding(
        verdict=Verdict.FAULT,
        text=text,
        brief=short if fits_tile(brief) else "FAULT",
        measured=measured,
        limit=limit,
        causes=causes,
        level=level,
    )


@lru_cache(maxsize=KEPT_FINDINGS)
def unknown(why: str, *, short: str = "") -> Finding:
    """The verdict UNKNOWN. `short` (at most 8 letters: "no link", "stale") follows "not checked:" on the tile."""
    brief = f"not checked: {short}" if short else "not checked"
    return Finding(verdict=Verdict.UNKNOWN, text=why, brief=brief if len(brief) <= BRIEF_LETTERS else "not checked")


@lru_cache(maxsize=KEPT_FINDINGS)
def absent(why: str, *, brief: str = "not published") -> Finding:
    """The verdict UNKNOWN because there is nothing to check: it does not make the tile unknown."""
    return Finding(verdict=Verdict.UNKNOWN, text=why, brief=brief, applies=False)


class Limits(BaseModel):
    """The thresholds of one check or family; every field is made by `threshold`."""

    model_config: ClassVar[ConfigDict] = ConfigDict(frozen=True, extra="forbid", strict=True, validate_default=True)


EXPERT = "Expert"  # the last heading of Settings, folded away


def threshold(
    default: float,
    label: str,
    *,
    unit: str,
    low: float,
    high: float,
    help: str = "",
    step: float | None = None,
    heading: str = "",
) -> Any:
    """A field of `Limits`, in SI: what the settings page shows, what the server accepts and what the check reads.

    `heading`: its group in Settings, if not the tile of its check; EXPERT for what is seldom changed.
    """
    extra: dict[str, Any] = {"unit": unit}
    if heading:
        extra["heading"] = heading
    if step is not None:
        extra["step"] = step
    return Field(
        default=default,
        title=label,
        description=help or None,
        ge=low,
        le=high,
        allow_inf_nan=False,
        json_schema_extra=extra,
    )


L = TypeVar("L", bound=Limits)


class End(NamedTuple):
    """The value at which an active alarm ends, in SI."""

    side: Literal["below", "above"]
    value: float
    unit: str


class Scope(StrEnum):
    """What a check watches, and so what can blind it."""

    CAR = "car"  # blind without a link and while paused
    LINK = "link"  # always judged
    SERVER = "server"  # always judged


@dataclass(frozen=True, slots=True, kw_only=True)
class Check(Generic[L]):
    """A rule: its signals, its function and its alarm."""

    id: str
    label: str  # as the operator reads it
    alarm: AlarmSpec
    limits: type[L]
    find: Callable[[Snapshot, L, bool], Finding]  # (snapshot, limits, was_active)
    needs: frozenset[str] = frozenset()  # signals that it reads
    immediate: bool = False  # judged with each message of a signal it needs too; every check is judged on each tick
    ends: Callable[[L], End] | None = None  # where the alarm ends at another value than that which raises it
    group: str = ""  # name of its thresholds; a family shares one; "" = id
    tile: str = ""  # the tile of the home tab it belongs to; "" = label
    checked_when: str = ""  # when it is checked, as a sentence; shown where it is not
    scope: Scope = Scope.CAR
    order: int = 500  # place of its tile on the home tab, which never moves: smaller comes first

    @property
    def limits_group(self) -> str:
        return self.group or self.id

    @property
    def tile_label(self) -> str:
        return self.tile or self.label


FINEST = 3  # digits after the point; what is nearer to its limit than that is at it
APART = 2.0  # numbers that are further apart never read the same


def beside(value: float, limit: float, digits: int = 1) -> str:
    """Format `value` with the given decimals, or with as many as distinguish it from `limit`: 4.97 beside 5.0."""
    if 0.0 < abs(value - limit) < APART:
        for finer in range(digits, FINEST + 1):
            text = f"{value:.{finer}f}"
            if float(text) != round(limit, finer):
                return text
    return f"{value:.{digits}f}"
