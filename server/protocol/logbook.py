"""The logbook of a car: its drives, weeks and totals, and the course of a drive, to compare two of them."""

from __future__ import annotations

from typing import Annotated, Literal

from typing_extensions import TypedDict

from server.protocol.departure import RecurringItem
from server.protocol.doc import doc


class LogbookDrive(TypedDict):
    """One drive; its parts are recordings of one session, and of those that went on after a restart of the server."""

    id: Annotated[str, doc("of its first recording")]
    parts: int
    recordings: Annotated[list[str], doc("its parts, oldest first")]
    vehicle: str
    started_ms: int
    title: str
    tags: list[str]
    people: Annotated[list[str], doc("who was on duty, or gave an order")]
    distance_m: Annotated[float | None, doc("null: neither positions nor a speed")]
    driven_s: Annotated[float, doc("how long was recorded")]
    modes_m: Annotated[dict[str, float | None], doc("by autonomous, manual, unknown")]
    modes_s: dict[str, float]
    interventions: Annotated[int | None, doc("null: the mode of the car was not recorded, in a part at least")]
    undescribed: Annotated[int | None, doc("interventions that nobody has described; null: not known")]
    alarms: Annotated[int | None, doc("raised; null: no log was recorded, in a part at least")]
    marks: Annotated[int | None, doc("those that came later too")]
    blind_s: Annotated[float, doc("without a message for longer than 1 s, all together")]
    departure: Annotated[Literal["none", "open", "signed"] | None, doc("the departure check; null: not known")]
    departure_ms: Annotated[int | None, doc("when it was signed")]
    departure_by: Annotated[str, doc('who signed; "": not signed, or not known')]
    departure_failed: Annotated[int, doc("items that had failed when it was signed")]
    failed_items: Annotated[list[str], doc("those, as far as the recording names them; at most 20")]
    recurring: Annotated[list[RecurringItem], doc("items of the signed check that have an interval")]
    components: Annotated[dict[str, int], doc("alarms by what they are about")]


class LogbookWeek(TypedDict):
    """A week from Monday, UTC."""

    from_ms: int
    drives: int
    modes_m: dict[str, float]
    interventions: Annotated[
        float | None, doc("per 100 km that the car drove by itself; null: not known, or less than 100 m of it")
    ]
    alarms: Annotated[float | None, doc("per 100 km of all; null: the same")]
    interventions_median: Annotated[float | None, doc("of this and the four weeks before, without a week of no drives")]
    alarms_median: float | None


class LogbookTotals(TypedDict):
    """Over all drives that were requested."""

    drives: int
    distance_m: float
    driven_s: float
    modes_m: dict[str, float]
    modes_s: dict[str, float]
    interventions: Annotated[
        float | None, doc("per 100 km that the car drove by itself, over the drives that know their mode")
    ]
    alarms: Annotated[float | None, doc("per 100 km, over the drives with a log")]
    checks_missing: Annotated[int, doc("drives without a signed departure check")]
    checks_known: Annotated[int, doc("of so many drives")]


class LogbookDue(TypedDict):
    """When an item of the departure check that has an interval is due again."""

    item: str
    title: str
    every_days: int | None
    every_km: float | None
    done_ms: Annotated[int | None, doc("the newest signed check in which it was done; null: in none")]
    distance_m: Annotated[float | None, doc("driven since; null: not known, or never done")]
    is_least: Annotated[bool, doc("it was farther: the distance of a drive since is not known")]
    due_days: Annotated[int | None, doc("whole days left, negative: late; null: not due by time, or never done")]
    due_km: Annotated[float | None, doc("distance left, negative: late; null: not due by distance, or not known")]
    is_overdue: Annotated[bool, doc("late by time or distance, or never done")]


class LogbookCheck(TypedDict):
    """The newest signed departure check of a car, whatever drives were requested."""

    vehicle: str
    signed_ms: Annotated[int | None, doc("null: no drive has one")]
    by: str
    failed: Annotated[int, doc("items that had failed when it was signed")]
    failed_items: Annotated[list[str], doc("as far as the recording names them")]
    distance_m: Annotated[float | None, doc("driven since, the drive it was made for among it; null: not known")]
    unmeasured: Annotated[int, doc("of those drives, whose distance is not known: it was farther")]
    drives: Annotated[int, doc("since, without a signed check: that for which it was made is none of them")]
    not_known: Annotated[int, doc("of those, whose recording does not say whether they were checked")]
    recurring: Annotated[
        list[LogbookDue], doc("items with an interval, as the newest signed list has them; most late first")
    ]


class LogbookAnswer(TypedDict):
    """`GET /api/logbook`."""

    totals: LogbookTotals
    weeks: list[LogbookWeek]
    components: Annotated[dict[str, int], doc("alarms by what they are about, most first")]
    drives: Annotated[list[LogbookDrive], doc("the newest 200, newest first; the CSV has all")]
    people: Annotated[list[str], doc("to choose among")]
    checks: Annotated[list[LogbookCheck], doc("of each car, over all its drives")]
    unread: Annotated[int, doc("recordings that are yet to be read: their drives are missing")]


class CoursePoints(TypedDict):
    """Numbers at evenly spaced places or moments; null: not known there."""

    t: Annotated[list[float], doc("s since the drive began")]
    m: Annotated[list[float | None], doc("distance driven")]
    speed: Annotated[list[float | None], doc("m/s")]
    steering: Annotated[list[float | None], doc("%, negative = left")]
    follow: Annotated[list[float | None], doc("m/s, speed minus the commanded speed")]
    gps: Annotated[list[float | None], doc("m, error of the position as the receiver states it, one sigma")]
    lat: list[float | None]
    lon: list[float | None]


class CourseEvent(TypedDict):
    """An alarm, a mark or an intervention."""

    t: float
    m: float | None
    kind: Annotated[str, doc("critical · warning · advisory · mark · intervention")]
    text: str


class Course(TypedDict):
    """`GET /api/recordings/{id}/course`: of the whole drive of which the recording is a part."""

    start_ms: int
    length_s: float
    length_m: Annotated[float | None, doc("null: not known; then `way` is empty")]
    step_m: Annotated[float, doc("between two points of `way`")]
    step_s: Annotated[float, doc("between two points of `time`")]
    way: CoursePoints
    time: CoursePoints
    events: list[CourseEvent]
    are_interventions_known: Annotated[
        bool, doc("false: the mode of the car was not recorded, in a part at least; a missing one is no zero")
    ]
    are_alarms_known: Annotated[bool, doc("false: no log was recorded, in a part at least; the same")]
    are_events_cut: Annotated[bool, doc("there were more than 300: `events` lacks later ones")]
    limit_mps: Annotated[float | None, doc("the speed limit at the beginning; null: not recorded")]
