"""The departure check: its state in a frame, and the answer with all its items."""

from __future__ import annotations

from typing import Annotated, Literal

from typing_extensions import TypedDict

from server.protocol.doc import doc

DepartureGroup = Literal["manual", "automatic", "active"]
DepartureKind = Literal[
    "manual", "check", "topic", "recorder", "sound", "disk", "clock", "brake", "accelerator", "steering", "slow_down"
]
DepartureResult = Literal["open", "done", "failed", "not_applicable"]
DepartureStep = Literal["begun", "item", "signed", "reopened", "without"]


class DepartureCounts(TypedDict):
    done: int
    failed: int
    not_applicable: int
    of: Annotated[int, doc("items of the list")]


class DepartureState(DepartureCounts):
    """The departure check of this drive, in short."""

    state: Annotated[Literal["none", "open", "signed"], doc("none: it was not begun in this drive")]
    by: Annotated[str | None, doc("who signed it, or began it")]
    at_ms: Annotated[int | None, doc("when that was")]


class RecurringItem(TypedDict):
    """An item that has an interval, as a check was signed."""

    item: str
    title: str
    every_days: Annotated[int | None, doc("due again after so long; null: no matter how long")]
    every_km: Annotated[float | None, doc("due again after so far; null: no matter how far")]
    is_done: bool


class DepartureItem(TypedDict):
    """One item of the list, and what became of it."""

    id: str
    title: str
    kind: DepartureKind
    group: Annotated[
        DepartureGroup,
        doc("manual: by a person; automatic: turns by itself; active: do it, and it is seen"),
    ]
    of: Annotated[str, doc('the check or the topic; "": none')]
    need: Annotated[float | None, doc("at least so much; of a clock at most")]
    unit: str
    fix: Annotated[str, doc("what to do where it fails")]
    every_days: Annotated[int | None, doc("due again after so many days; null: at each departure, or by distance")]
    every_km: Annotated[float | None, doc("due again after so far; null: at each departure, or by time")]
    result: DepartureResult
    value: Annotated[str, doc("what was seen")]
    note: Annotated[str, doc("why it failed or is not applicable, as a person wrote it")]
    by: Annotated[str | None, doc("who set it; null: it turned by itself, or is open")]
    at_ms: Annotated[int | None, doc("when it turned")]
    is_fixed: Annotated[bool, doc("it had failed in this check")]
    now: Annotated[float | None, doc("of an active item: the value now")]
    peak: Annotated[float | None, doc("of an active item: the highest since the check began")]


class DepartureSignature(DepartureCounts):
    by: str
    role: Annotated[str, doc('title of who is on duty; "": nobody is')]
    at_ms: int
    fixed: Annotated[int, doc("items that had failed first")]
    hash: Annotated[str, doc("SHA-256 of `document` [hex]")]
    document: Annotated[str, doc('canonical JSON of the list and its results; "": signed before a restart')]


class DepartureKindRow(TypedDict):
    """A kind of item, for who edits the list."""

    kind: DepartureKind
    group: DepartureGroup
    title: str
    of: Annotated[str, doc('what `of` names; "": it has none')]
    unit: str
    need: float | None
    lowest: float
    highest: float


class DepartureAnswer(DepartureState):
    """`GET /api/departure`."""

    check: Annotated[str | None, doc("null: not begun")]
    items: list[DepartureItem]
    signature: DepartureSignature | None
    is_default: Annotated[bool, doc("the list is the one of the vehicle profile")]
    complaint: Annotated[str | None, doc("why the stored list cannot be used, as a sentence")]
    kinds: list[DepartureKindRow]
    toml: Annotated[str, doc("the list as a file")]
