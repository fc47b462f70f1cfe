"""A car in a few numbers, for the pages that show another car of the same server."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Collection, Iterable

import orjson

from monitor.alarm import Alarm, AlarmState
from monitor.alarm_spec import Sound
from monitor.state import Snapshot
from server.bus.bus import ALL, SessionBus
from server.protocol import serialize
from server.protocol.cars_state import CarAlarm, CarPlace, CarSpeed, CarSummary, Unowned
from server.protocol.state import ServerState
from server.vehicle import facts
from server.vehicle.session_parts import SessionParts
from server.vehicle.state_frame import silent_at, where_cut

log = logging.getLogger("catgraph.session")

EVERY_S = 0.5
TEXT_LETTERS = 100  # of the sentence of an alarm; a summary is bounded
MOST_REQUESTS = 3  # for control
_RANK = {"critical": 3, "warning": 2, "advisory": 1}
_ASKING = ("UNACKED", "RTN_UNACKED")


class SummaryPublisher:
    """Puts the summary of one vehicle on the bus, while a page of several cars is open.

    `now` is a monotonic clock in seconds, `wall_ms` the time of day in ms since 1970.
    """

    def __init__(
        self,
        vehicle: str,
        parts: SessionParts,
        bus: SessionBus,
        server: Callable[[], ServerState],
        *,
        now: Callable[[], float],
        wall_ms: Callable[[], int],
    ) -> None:
        self._server = server
        self._vehicle = vehicle
        self._parts = parts
        self._bus = bus
        self._now = now
        self._wall_ms = wall_ms
        self._put_s = -EVERY_S
        self._failure = ""  # why none can be made, as last logged

    def tick(self, now_s: float) -> None:
        """Time passed: one is put when it is due. All sessions put theirs at the same moments, so that none is old when
        they are sent together."""
        if now_s // EVERY_S != self._put_s // EVERY_S:
            self.put()

    def put(self) -> None:
        """Never raises: a car whose summary cannot be made is shown as unknown on the pages of the other cars."""
        if not self._bus.watched(ALL):
            return
        self._put_s = self._now()
        try:
            summary = self._make()
            if (challenge := self._server().get("challenge")) is not None:
                summary["challenge"] = challenge
            self._bus.put(ALL, self._vehicle, orjson.dumps(summary).decode(), made_s=self._put_s)
            self._failure = ""
        except Exception as error:
            if self._failure != (failure := f"{type(error).__name__}: {error}"):
                self._failure = failure
                log.exception("summary failed: vehicle=%s", self._vehicle)

    def _make(self) -> CarSummary:
        parts, now_s, wall_ms = self._parts, self._now(), self._wall_ms()
        found = facts.frame_facts(
            self._vehicle, parts, now_s, wall_ms=wall_ms, configured=None, held=None, log_trouble=None
        )
        snapshot = parts.judgement.state.snapshot(now_s)
        cut, _, _ = where_cut(found, snapshot)
        bridge_s = found.link.heard_s if found.link is not None else None
        is_trying = found.phase in ("connecting", "failed", "lost")
        standing = [alarm for alarm in parts.judgement.monitor.standing() if alarm.state != "SHELVED"]
        control, slow_down = found.operators["control"], found.decelerate
        return {
            "phase": found.phase,
            "paused": found.paused_since_s is not None,
            "link": {
                "cut": cut,
                "bridge_age_s": _since(bridge_s, now_s),
                "car_age_s": _since(found.last_message_s, now_s),
                "trying_for_s": round(now_s - found.dialled_s, 1) if is_trying else 0.0,
                "connected_for_s": _since(found.connected_s, now_s),
            },
            "planned_stop": None if found.planned_stop is None else found.planned_stop.reason,
            "worst": worst(standing, now_s, wall_ms, silent_at(found.planned_stop, parts.judgement.monitor)),
            "waiting": sum(alarm.state in _ASKING for alarm in standing),
            "unowned": unowned(standing, parts.authorization.off_duty_ms),
            "speed": _speed(snapshot, now_s),
            "holder": control["holder"],
            "page": control.get("page"),
            "recording": found.recording["state"],
            "recording_for_s": found.recording["for_s"],
            "slow_down": slow_down["state"],
            "time_ms": wall_ms,
            "attention": parts.attention.as_json(now_s, wall_ms),
            "place": place(snapshot, now_s),
            "energy_percent": energy_percent(snapshot, now_s),
            "requests": [
                {"page": one["page"], "name": one["name"], "left_s": one["left_s"]}
                for one in control.get("requests", [])[:MOST_REQUESTS]
            ],
            "people": parts.attention.people(now_s),
        }


def worst(
    standing: Iterable[Alarm], now_s: float, wall_ms: int, silent_at_stop: Collection[str] | None = None
) -> CarAlarm | None:
    """The alarm that needs a person most: one that stands unanswered, then one that ended so, then the others.
    `silent_at_stop`: as of `serialize.alarm`. Of two alike it is the one that sounds: only this one sounds on
    pages of other cars.
    """
    order = {"UNACKED": 2, "RTN_UNACKED": 1}
    shown = [serialize.alarm(alarm, now_s, wall_ms, silent_at_stop) for alarm in standing]
    if not shown:
        return None
    first = max(
        shown,
        key=lambda one: (
            order.get(one["state"], 0),
            _RANK[one["priority"]],
            one["sound"] != Sound.NONE,
            one["raised_ms"],
        ),
    )
    return {
        "id": first["id"],
        "occurrence": first["occurrence"],
        "title": first["title"],
        "ended_title": first["ended_title"],
        "priority": first["priority"],
        "state": first["state"],
        "active": first["active"],
        "raised_ms": first["raised_ms"],
        "sound": Sound.NONE if first["silenced_until_ms"] else first["sound"],
        "text": (first["text"] or first["trip_text"])[:TEXT_LETTERS],
    }


def unowned(standing: Iterable[Alarm], off_duty_ms: Callable[[str | None], int | None]) -> Unowned | None:
    """Of the acknowledged alarms those whose owners are off duty; None: there is none."""
    found = [
        (since_ms, alarm.acknowledged_by or "")
        for alarm in standing
        if alarm.state is AlarmState.ACKED and (since_ms := off_duty_ms(alarm.acknowledged_by)) is not None
    ]
    if not found:
        return None
    since_ms, by = min(found)
    return {"count": len(found), "by": by, "since_ms": since_ms}


def _speed(snapshot: Snapshot, now_s: float) -> CarSpeed:
    reading = snapshot.readings.get("speed")
    if reading is None:
        return {"value_mps": None, "freshness": "never", "age_s": None, "horizon_s": None}
    return {
        "value_mps": serialize.plain(reading.value.speed_mps),
        "freshness": reading.freshness(now_s),
        "age_s": serialize.plain(reading.age_s(now_s), 3),
        "horizon_s": serialize.plain(reading.horizon_s, 2),
    }


def place(snapshot: Snapshot, now_s: float) -> CarPlace | None:
    """Where the car is by its own GPS; None where it has no fix, however old. A heading that is old is none."""
    reading, heading = snapshot.readings.get("position"), snapshot.readings.get("heading")
    if reading is None or reading.value.status < 0:
        return None
    lat_deg, lon_deg = serialize.plain(reading.value.lat_deg, 7), serialize.plain(reading.value.lon_deg, 7)
    if lat_deg is None or lon_deg is None:
        return None
    heading_deg = heading.value.heading_deg if heading is not None and heading.is_fresh(now_s) else None
    return {
        "lat_deg": lat_deg,
        "lon_deg": lon_deg,
        "heading_rad": None
        if heading_deg is None
        else serialize.plain(math.remainder(math.radians(90 - heading_deg), math.tau)),
        "freshness": reading.freshness(now_s),
        "age_s": serialize.plain(reading.age_s(now_s), 2),
    }


def energy_percent(snapshot: Snapshot, now_s: float) -> float | None:
    """Of the tank or battery; None where the car does not send it in percent, or the newest value is too old."""
    reading = snapshot.readings.get("fuel")
    if reading is None or reading.value.unit != "%" or not reading.is_fresh(now_s):
        return None
    return serialize.plain(reading.value.value, 1)


def _since(moment_s: float | None, now_s: float) -> float | None:
    return None if moment_s is None else serialize.plain(now_s - moment_s, 2)
