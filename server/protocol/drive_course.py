"""The course of a drive, to compare two of them."""

from __future__ import annotations

from typing import Annotated

from typing_extensions import TypedDict

from server.protocol.doc import doc


class CoursePoints(TypedDict):
    """Numbers at evenly spaced places or moments; null: not known there."""

    t: Annotated[list[float], doc("s since the drive began")]
    m: Annotated[list[float | None], doc("distance driven")]
    speed: Annotated[list[float | None], doc("m/s")]
    steering: Annotated[list[float | None], doc("%, negative = left")]
    follow: Annotated[list[float | None], doc("m/s, speed minus the commanded speed")]
    gps: Annotated[list[float | None], doc("m, error of the position as the receiver says it, one sigma")]
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
    limit_mps: Annotated[float | None, doc("the speed limit at the beginning; null: not recorded")]
