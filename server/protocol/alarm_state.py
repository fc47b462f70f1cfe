"""The alarms of a state, the tiles of the checks, one check in detail, and the events of the log."""

from __future__ import annotations

from typing import Annotated, Any, Literal, NotRequired, Protocol

from typing_extensions import TypedDict, Unpack

from monitor.alarm import AlarmState
from monitor.alarm_spec import Action, Place, Priority, Sound
from monitor.check import Verdict
from monitor.interventions import By, KindOf
from monitor.planned_stop import StopReason
from monitor.values import Mode
from server.protocol.departure import DepartureResult, RecurringItem
from server.protocol.doc import doc
from server.protocol.driving_state import DriveSample
from server.protocol.marks import HasPhoto, HasVoice, MarkedBy, MarkedMs, MarkId, MarkText
from server.protocol.people import DutyRole


class Tile(TypedDict):
    """One tile of Home: a check, or several of one thing."""

    id: str
    label: str
    verdict: Verdict
    text: str
    brief: Annotated[str, doc('at most 21 letters for the tile: "FAULT 12.6 m/s", "not checked: no link"')]
    checks: Annotated[list[str], doc("ids of the checks behind this tile")]


class Quantity(TypedDict):
    label: str
    value: float | None
    unit: str


class Worst(Quantity):
    side: Literal["above", "below"]


class StandingAlarm(TypedDict):
    """An alarm that is active, or has ended and is not acknowledged."""

    id: str
    occurrence: Annotated[int, doc("counts announcements; below")]
    title: str
    ended_title: NotRequired[Annotated[str, doc("its title once it is not active; not from older agents")]]
    priority: Priority
    place: Annotated[Place, doc("where it is shown now")]
    sound: Annotated[Sound, doc("none: it makes no sound because of a planned stop")]
    planned_stop: NotRequired[Annotated[bool, doc("the car stands on purpose; not from older agents")]]
    state: AlarmState
    active: bool
    needs_ack: Annotated[bool, doc("it stays until it is acknowledged, although its condition has gone")]
    raised_ms: int
    for_s: float
    verdict: Annotated[
        Verdict,
        doc("what its check finds now: ok: it clears after its delay; unknown: it stays active, and is not checked"),
    ]
    text: str
    trip_text: Annotated[str, doc("as it was announced")]
    measured: Quantity | None
    limit: Quantity | None
    worst: Annotated[Worst | None, doc("what was measured furthest beyond its limit since it was raised")]
    causes: list[str]
    actions: Annotated[
        list[Action], doc("possible now: acknowledge while nobody has, also once it returned; unshelve while shelved")
    ]
    advice: str
    acknowledged_by: str | None
    off_duty_ms: NotRequired[
        Annotated[int | None, doc("when the duty of who acknowledged it ended; null: on duty, or not known")]
    ]
    shelved_until_ms: int | None
    shelved_by: str | None
    silenced_until_ms: Annotated[int | None, doc("no sound until then; null: it sounds while it is unacknowledged")]
    silenced_by: str | None


class SuppressedAlarm(TypedDict):
    """Not announced, because others explain it."""

    id: str
    title: str
    priority: Priority
    by: Annotated[list[str], doc("titles of the alarms that explain it")]
    raised_ms: int | None


class AlarmLoad(TypedDict):
    """What the alarms ask of the operator now."""

    in_10_min: Annotated[int, doc("announced in the last 10 minutes")]
    flood: bool
    bearable: bool
    chattering: Annotated[list[str], doc("titles of the alarms that come and go")]


class EventDetails(TypedDict, total=False):
    """What an event of no alarm may say besides."""

    # Of what a person on duty did.
    person: Annotated[str, doc("who was on duty at the device that did it; left out: nobody")]
    role: Annotated[DutyRole, doc("of that person")]
    # Of control, and of an item of the attention queue.
    act: Annotated[str, doc("what happened to control, or to the item; below")]
    by_page: str | None
    holder: Annotated[str | None, doc("who is in control now, or to whom the item is assigned")]
    page: str | None
    before: Annotated[
        str | list[DriveSample] | None,
        doc("the one before, where that is another; of an intervention: the 10 s before it, twice a second"),
    ]
    before_page: str | None
    fence: int | None
    # Of a slow-down, and of a slow link.
    step: Annotated[str | int, doc("ordered · sent · slows · not_confirmed · released …; of reduced: how far")]
    order: Annotated[int, doc("number of the order")]
    why: str
    ordered_by: str
    commanded_mps: float | None
    tyre_rad: float | None
    topic: str
    stands: Literal["before", "unproven"] | None
    trigger: Annotated[str, doc("the rule that counts down")]
    hold: Annotated[int, doc("number of the guard's hold")]
    # Of the driving mode, and of interventions.
    mode: Mode
    mode_source: Annotated[str, doc('the topic, "commands" or ""')]
    moment_ms: Annotated[int, doc("when it happened; it is logged a moment later")]
    flickers: Annotated[int, doc("single changes of a mode that flickers, which are not events of their own")]
    intervention: Annotated[str, doc("its id")]
    kind_of: KindOf
    speed_mps: float | None
    lat_deg: float | None
    lon_deg: float | None
    initiated_by: By
    active: Annotated[list[str], doc("ids of the alarms that were active")]
    brake_percent: float | None
    acted_before_s: Annotated[float | None, doc("brake or wheel so long before the mode changed")]
    what: Annotated[str, doc("the description of an intervention")]
    # Of the departure check.
    check: Annotated[str, doc("id of the departure check")]
    item: Annotated[str, doc("id of the item that turned")]
    item_title: str
    result: DepartureResult
    value: Annotated[str, doc("what was seen")]
    note: str
    done: Annotated[int, doc("items of the departure check; so are `failed`, `not_applicable` and `of`")]
    failed: int
    not_applicable: int
    of: int
    fixed: Annotated[int, doc("items that had failed first")]
    recurring: Annotated[list[RecurringItem], doc("of a signed departure check: its items that have an interval")]
    hash: Annotated[str, doc("SHA-256 of the list and its results [hex]; with an item: of its question")]
    # Of the owner of acknowledged alarms.
    owner: Annotated[str, doc("under whose name alarms were acknowledged")]
    off_duty_ms: Annotated[int | None, doc("when their duty ended; null: they are on duty again")]
    # Of the rest.
    address: str
    settings: Annotated[dict[str, Any], doc("all that are in force, as monitoring begins")]
    changes: Annotated[dict[str, list[Any]], doc("name of a setting → from, to")]
    recording: Annotated[str, doc("the recording that was recovered")]
    phone: Annotated[str | None, doc("the phone that was chosen")]
    since_ms: Annotated[int, doc("when the pause or the planned stop began")]
    reason: Annotated[StopReason, doc("of a planned stop")]
    resumes: Annotated[bool, doc("monitoring continues after a restart of the server: the drive is the same")]
    # Of a mark.
    mark: MarkId
    marked_ms: MarkedMs
    category: str | None
    words: MarkText
    voice: HasVoice
    photo: HasPhoto
    source: MarkedBy


class NotedEvent(EventDetails):
    """An event of no alarm before the log numbers it."""

    at_ms: int
    alarm: Annotated[str | None, doc("null: of no alarm")]
    change: Annotated[str, doc("what happened; below")]
    text: str
    by: Annotated[str | None, doc("who did it, where a person did")]
    settings_version: int


class NewEvent(NotedEvent):
    """Any event before the log numbers it; what is of an alarm is active in addition."""

    occurrence: NotRequired[int]
    title: NotRequired[str]
    priority: NotRequired[Priority]
    place: NotRequired[Place]
    sound: NotRequired[Sound]
    announces: NotRequired[Annotated[bool, doc("the operator is to be alerted")]]
    state: NotRequired[AlarmState]
    causes: NotRequired[list[str]]
    suppressed_by: NotRequired[list[str]]
    shelved_until_ms: NotRequired[int | None]
    planned_stop: NotRequired[Annotated[StopReason, doc("it happened in a planned stop, for this reason")]]
    measured: NotRequired[Quantity | None]
    limit: NotRequired[Quantity | None]
    worst: NotRequired[Annotated[Worst | None, doc("furthest beyond its limit since it was raised")]]


class LogEvent(NewEvent):
    """One event of the log."""

    n: Annotated[int, doc("its number: grows by one, never given twice")]
    brought_from: NotRequired[Annotated[str, doc("the log had lost it, and it was brought back from this recording")]]
    was_cut: NotRequired[
        Annotated[
            bool, doc("it follows the log without a gap, and the server was killed then: state is restored from it too")
        ]
    ]


class Note(Protocol):
    """Writes an event of no alarm into the log."""

    def __call__(self, change: str, text: str, *, by: str | None = None, **more: Unpack[EventDetails]) -> None: ...


class TileCheck(TypedDict):
    """A check of the same tile."""

    id: str
    label: str
    verdict: Verdict
    text: str
    priority: Annotated[NotRequired[Priority], doc("of its alarm; absent from agents before 2026-12")]


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
