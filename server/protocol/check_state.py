"""One check in detail, as a page requests it when the check is opened."""

from __future__ import annotations

from typing import Annotated, Literal, NotRequired

from typing_extensions import TypedDict

from monitor.alarm_spec import Priority
from monitor.check import Verdict
from server.protocol.alarm_state import LogEvent, Quantity
from server.protocol.doc import doc


class TileCheck(TypedDict):
    """A check of the same tile."""

    id: str
    label: str
    verdict: Verdict
    text: str


class CheckEnd(TypedDict):
    """The value at which the alarm ends, where it is another one than its limit; SI."""

    side: Literal["below", "above"]
    value: float | None
    unit: str


class CheckDelays(TypedDict):
    """When a fault becomes an alarm, and when the alarm ends."""

    on_s: float
    off_s: float


class CheckMinuteState(TypedDict):
    """What the check measured in the last minute, a number each step, the newest last."""

    step_s: float
    values: Annotated[list[float | None], doc("null: not checked then")]
    limits: list[float | None]


class CheckAnswer(TypedDict):
    """`GET /api/checks/{name}`."""

    id: str
    label: str
    tile: Annotated[str, doc("label of its tile")]
    checks: Annotated[list[TileCheck], doc("all checks of this tile, this one included")]
    verdict: Verdict
    text: str
    for_s: Annotated[float | None, doc("since when it answers so; null: it has not answered")]
    measured: Quantity | None
    limit: Quantity | None
    checked_when: Annotated[str, doc("what makes it checked, as a sentence")]
    settings: Annotated[list[str], doc("full names of its thresholds")]
    title: Annotated[str, doc("of its alarm")]
    priority: Priority
    delays: CheckDelays
    ends: Annotated[CheckEnd | None, doc("null: it ends at the limit that raises it, or by no single value")]
    advice: str
    suppressed_by: Annotated[list[str], doc("titles of the alarms that explain its alarm now")]
    signal: Annotated[str | None, doc("the signal whose trend shows what it measures; null: none does")]
    minute: CheckMinuteState
    history: NotRequired[
        Annotated[
            list[LogEvent] | None,
            doc("of a replay: its alarms up to the moment shown, as the log has them; null: not read so far"),
        ]
    ]
