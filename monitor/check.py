"""What a check is made of: its answer, its thresholds, its declaration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar

from pydantic import BaseModel, ConfigDict, Field

from monitor.alarm_spec import Action, AlarmSpec, Place, Priority, Sound
from monitor.snapshot import NotFresh, Snapshot

__all__ = [
    "OK",
    "Action",
    "AlarmSpec",
    "Check",
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
    "fault",
    "ok",
    "threshold",
    "unknown",
]

BRIEF_LETTERS = 21  # what fits a tile of the home tab beside its mark: "not checked: standing"


class Verdict(StrEnum):
    OK = "ok"
    FAULT = "fault"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True, kw_only=True)
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
    causes: tuple[str, ...] = ()  # what is at fault, where one alarm stands for several things; a new one re-alarms
    level: int = 0  # how bad, where a check knows degrees; a higher one re-alarms
    applies: bool = True  # False: there is nothing here to check (an optional signal that is not published)


OK = Finding(verdict=Verdict.OK, text="OK", brief="OK")


def ok(text: str, *, measured: Quantity | None = None, limit: Quantity | None = None) -> Finding:
    """All is well; `text` says how well."""
    return Finding(verdict=Verdict.OK, text=text, brief="OK", measured=measured, limit=limit)


def fault(
    text: str,
    *,
    brief: str = "",
    measured: Quantity | None = None,
    limit: Quantity | None = None,
    causes: tuple[str, ...] = (),
    level: int = 0,
) -> Finding:
    """Something is wrong. `brief` follows the word FAULT on the tile ("12.6 m/s"); what does not fit is left out."""
    short = f"FAULT {brief}" if brief else "FAULT"
    return Finding(
        verdict=Verdict.FAULT,
        text=text,
        brief=short if len(short) <= BRIEF_LETTERS else "FAULT",
        measured=measured,
        limit=limit,
        causes=causes,
        level=level,
    )


def unknown(why: str, *, short: str = "") -> Finding:
    """It cannot be told. `short` (at most 8 letters: "no link", "stale") follows "not checked:" on the tile."""
    brief = f"not checked: {short}" if short else "not checked"
    return Finding(verdict=Verdict.UNKNOWN, text=why, brief=brief if len(brief) <= BRIEF_LETTERS else "not checked")


def absent(why: str, *, brief: str = "not published") -> Finding:
    """There is nothing to check: unknown, but no reason to call the tile unknown."""
    return Finding(verdict=Verdict.UNKNOWN, text=why, brief=brief, applies=False)


class Limits(BaseModel):
    """The thresholds of one check or family; every field is made by `threshold`."""

    model_config: ClassVar[ConfigDict] = ConfigDict(frozen=True, extra="forbid", strict=True, validate_default=True)


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

    `heading`: where it stands in Settings, if not under the tile of its check.
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


class Scope(StrEnum):
    """What a check watches, and so what can blind it."""

    CAR = "car"  # blind without a link and while paused
    LINK = "link"  # always judged
    SERVER = "server"  # always judged


@dataclass(frozen=True, slots=True, kw_only=True)
class Check(Generic[L]):
    """A rule: what it reads, what it says, and the alarm it lights."""

    id: str
    label: str  # as the operator reads it
    alarm: AlarmSpec
    limits: type[L]
    find: Callable[[Snapshot, L, bool], Finding]  # (snapshot, limits, was_active)
    needs: frozenset[str] = frozenset()  # signals that it reads
    immediate: bool = False  # judged with each message of a signal it needs too; every check is judged on each tick
    group: str = ""  # name of its thresholds; a family shares one; "" = id
    tile: str = ""  # the tile of the home tab it belongs to; "" = label
    scope: Scope = Scope.CAR
    order: int = 500  # place of its tile on the home tab, which never moves: smaller comes first

    @property
    def limits_group(self) -> str:
        return self.group or self.id

    @property
    def tile_label(self) -> str:
        return self.tile or self.label
