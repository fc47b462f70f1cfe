"""The course of a drive in some hundred numbers, by distance and by time: what two drives are compared by."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from typing import Any, cast

from server.protocol.logbook import Course, CourseEvent, CoursePoints
from server.protocol.marks import DriveMark
from server.recording.drive.facts import DriveFacts

POINTS = 600
LEAST_M = 2.0  # between two points by distance
LEAST_S = 0.2  # by time
PLACE_S = 1.5  # between two positions: what lies in a longer gap is not known
Place = tuple[float, float, float]  # s, latitude, longitude
MOST_EVENTS = 300
NUMBERS = ("speed", "steering", "follow", "gps", "lat", "lon")  # beside time and distance


def course_of(facts: DriveFacts) -> Course:
    """Without a distance only by time; None in a list: not known there."""
    length_m = facts.motion.distance_m
    step_s = max(LEAST_S, facts.length_s / POINTS)
    by_time = [number * step_s for number in range(int(facts.length_s / step_s) + 1)]
    by_way: list[float] = []
    step_m = LEAST_M
    if length_m:
        step_m = max(LEAST_M, length_m / POINTS)
        places = (facts.motion.when(min(number * step_m, length_m)) for number in range(int(length_m / step_m) + 1))
        by_way = [at_s for at_s in places if at_s is not None]
    events, log = _events(facts), facts.log
    return {
        "start_ms": facts.start_ms,
        "length_s": round(facts.length_s, 2),
        "length_m": None if length_m is None else round(length_m, 1),
        "step_m": round(step_m, 4),
        "step_s": round(step_s, 4),
        "way": _points(facts, by_way),
        "time": _points(facts, by_time),
        "events": events[:MOST_EVENTS],
        "are_interventions_known": log is not None and log.are_modes_known,
        "are_alarms_known": log is not None,
        "are_events_cut": len(events) > MOST_EVENTS,
        "limit_mps": facts.limits[0][1] if facts.limits else None,
    }


def joined(courses: Sequence[Course]) -> Course:
    """That of a drive, from those of its parts, oldest first; between two parts nothing is known. The distance goes on
    where it was: what was driven between two parts, or in one without a distance, is not counted."""
    if len(courses) == 1:
        return courses[0]
    first, last = courses[0], courses[-1]
    begins_s = [(one["start_ms"] - first["start_ms"]) / 1000 for one in courses]
    length_s = begins_s[-1] + last["length_s"]
    lengths_m = [one["length_m"] for one in courses]
    begins_m = [sum(m or 0.0 for m in lengths_m[:number]) for number in range(len(courses))]
    length_m = None if lengths_m == [None] * len(courses) else round(sum(m or 0.0 for m in lengths_m), 1)
    step_s, step_m = max(LEAST_S, length_s / POINTS), max(LEAST_M, (length_m or 0.0) / POINTS)
    parts = list(zip(courses, begins_s, begins_m, strict=True))
    measured = [part for part in parts if part[0]["length_m"]]
    way, time = _empty(), _empty()
    for number in range(int(length_s / step_s) + 1):
        at_s = number * step_s
        course, begin_s, begin_m = parts[max(0, bisect_right(begins_s, at_s) - 1)]
        _copy(course["time"], round((at_s - begin_s) / course["step_s"]), time, (at_s, None), (begin_s, begin_m))
    for number in range(int(length_m / step_m) + 1 if length_m else 0):
        at_m = number * step_m
        course, begin_s, begin_m = measured[max(0, bisect_right(measured, at_m, key=lambda part: part[2]) - 1)]
        index = min(round((at_m - begin_m) / course["step_m"]), len(course["way"]["t"]) - 1)
        _copy(course["way"], index, way, (begin_s, at_m), (begin_s, begin_m))
    events: list[CourseEvent] = []
    for course, begin_s, begin_m in parts:
        for event in course["events"]:
            event_m = None if event["m"] is None or length_m is None else round(event["m"] + begin_m, 1)
            events.append({**event, "t": round(event["t"] + begin_s, 2), "m": event_m})
    return {
        **first,
        "length_s": round(length_s, 2),
        "length_m": length_m,
        "step_m": round(step_m, 4),
        "step_s": round(step_s, 4),
        "way": way,
        "time": time,
        "events": events[:MOST_EVENTS],
        "are_interventions_known": all(one.get("are_interventions_known") for one in courses),
        "are_alarms_known": all(one.get("are_alarms_known") for one in courses),
        "are_events_cut": len(events) > MOST_EVENTS or any(one.get("are_events_cut") for one in courses),
    }


def _empty() -> CoursePoints:
    found: Any = {name: [] for name in ("t", "m", *NUMBERS)}
    return cast("CoursePoints", found)


def _copy(
    of: CoursePoints, index: int, into: CoursePoints, otherwise: tuple[float, float | None], begin: tuple[float, float]
) -> None:
    """One point of a part, as one of the drive; in none of its points nothing is known."""
    is_there = 0 <= index < len(of["t"])
    source, target = cast("Any", of), cast("Any", into)
    target["t"].append(round(of["t"][index] + begin[0] if is_there else otherwise[0], 2))
    at_m = of["m"][index] if is_there else None
    target["m"].append(otherwise[1] if at_m is None else round(at_m + begin[1], 1))
    for name in NUMBERS:
        values = source.get(name) or []  # a course of an older version lacks some
        target[name].append(values[index] if is_there and index < len(values) else None)


def with_marks(course: Course, marks: Sequence[DriveMark]) -> Course:
    """With these marks in place of those that were there when it was computed."""
    moments, metres = course["time"]["t"], course["time"]["m"]
    events = [event for event in course["events"] if event["kind"] != "mark"]
    for row in marks[:MOST_EVENTS]:
        at_s = (row["marked_ms"] - course["start_ms"]) / 1000
        if 0 <= at_s <= course["length_s"]:
            place = min(bisect_left(moments, at_s), len(moments) - 1)
            text = (row["words"] or row["category"] or "")[:120]
            events.append({"t": round(at_s, 2), "m": metres[place], "kind": "mark", "text": text})
    is_cut = course.get("are_events_cut") is True or len(events) > MOST_EVENTS
    events.sort(key=lambda event: event["t"])
    return {**course, "events": events[:MOST_EVENTS], "are_events_cut": is_cut}


def _points(facts: DriveFacts, moments: list[float]) -> CoursePoints:
    motion, places = facts.motion, facts.motion.places
    found = _empty()
    place_times = [place[0] for place in places]
    for at_s in moments:
        found["t"].append(round(at_s, 2))
        found["m"].append(_rounded(motion.until(at_s), 1))
        found["speed"].append(_rounded(motion.speed.at(at_s), 2))
        found["steering"].append(_rounded(motion.steering.at(at_s), 1))
        found["follow"].append(_rounded(motion.following_mps(at_s), 2))
        found["gps"].append(_rounded(motion.sigma_m.at(at_s), 2))
        place = _place(places, place_times, at_s)
        found["lat"].append(None if place is None else round(place[0], 7))
        found["lon"].append(None if place is None else round(place[1], 7))
    return found


def _place(places: Sequence[Place], times: Sequence[float], at_s: float) -> tuple[float, float] | None:
    """Between two positions that are near each other in time; None: in a gap."""
    after = bisect_left(times, at_s)
    if after == len(times) or (after == 0 and times[0] > at_s):
        near = after - 1 if after else 0
        return places[near][1:] if times and abs(times[near] - at_s) <= PLACE_S else None
    if after == 0 or times[after] == at_s:
        return places[after][1:]
    (from_s, lat0, lon0), (to_s, lat1, lon1) = places[after - 1], places[after]
    if to_s - from_s > PLACE_S:
        return None
    share = (at_s - from_s) / (to_s - from_s)
    lon_turn = (lon1 - lon0 + 180) % 360 - 180
    return lat0 + share * (lat1 - lat0), lon0 + share * lon_turn


def _events(facts: DriveFacts) -> list[CourseEvent]:
    """All of them, in order."""
    if facts.log is None:
        return []
    logged: list[tuple[int, str, str]] = [(one.raised_ms, one.priority, one.title) for one in facts.log.alarms]
    logged += [(row["marked_ms"], "mark", row["words"] or row["category"] or "") for row in facts.log.marks]
    logged += [(one.at_ms, "intervention", one.kind) for one in facts.log.interventions]
    events: list[CourseEvent] = []
    for at_ms, kind, text in sorted(logged):
        at_s = facts.at_s(at_ms)
        if 0 <= at_s <= facts.length_s:
            metres = _rounded(facts.motion.until(at_s), 1)
            events.append({"t": round(at_s, 2), "m": metres, "kind": kind, "text": text[:120]})
    return events


def _rounded(value: Any, digits: int) -> float | None:
    return None if value is None else round(float(value), digits)
