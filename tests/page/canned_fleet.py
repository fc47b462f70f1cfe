"""Cars of a fleet as the server states them, for pictures and tests of the page of all cars."""

from __future__ import annotations

import math
import time
from typing import Any

Json = dict[str, Any]
ME = "me"  # replaced by the page's own name once it is known
DESK_2: Json = {"page": "desk2", "name": "Desk 2"}
FIELD_2: Json = {"page": "field2", "name": "Field 2"}


def now_ms() -> int:
    return time.time_ns() // 1_000_000


def worst(title: str, text: str, *, ago_s: float, **more: Any) -> Json:
    """The worst alarm of a car."""
    return {
        "id": title.lower().replace(" ", "_"), "occurrence": 1, "title": title, "priority": "critical",
        "state": "UNACKED", "active": True, "raised_ms": round(now_ms() - ago_s * 1000), "sound": "high",
        "text": text, **more,
    }  # fmt: skip


def attention(*, ago_s: float, left_s: float | None = None, up_s: float | None = None, **more: Any) -> Json:
    """An item: its supervisor is called in `left_s`, or was `up_s` ago."""
    at = now_ms()
    return {
        "since_ms": round(at - ago_s * 1000), "assigned": None, "offered": None,
        "escalates_ms": None if left_s is None else round(at + left_s * 1000),
        "escalated_ms": None if up_s is None else round(at - up_s * 1000), **more,
    }  # fmt: skip


def holder(person: Json, ago_s: float = 20) -> Json:
    return person | {"since_ms": round(now_ms() - ago_s * 1000)}


def car(name: str, speed_mps: float, at: tuple[float, float, float] | None, **more: Any) -> Json:
    """One car, driving or standing; `at`: metres east and north, and the heading in degrees clockwise from north."""
    place = at and {
        "lat_deg": 32.2319 + at[1] / 110_890, "lon_deg": -110.9501 + at[0] / 94_274,
        "heading_rad": math.radians(90 - at[2]), "freshness": "fresh", "age_s": 0.1,
    }  # fmt: skip
    summary = {
        "phase": "monitoring", "paused": False, "waiting": int("worst" in more), "worst": None, "attention": None,
        "link": {"cut": None, "bridge_age_s": 0.1, "car_age_s": 0.1, "trying_for_s": 0.0, "connected_for_s": 252.3},
        "speed": {"value_mps": speed_mps, "freshness": "fresh", "age_s": 0.1, "horizon_s": 1.0},
        "holder": None, "page": None, "recording": "recording", "recording_for_s": 252.0, "slow_down": "not_available",
        "time_ms": now_ms(), "place": place, "energy_percent": 64.0, "people": [DESK_2, FIELD_2], **more,
    }  # fmt: skip
    return {"name": name, "age_s": 0.1, "summary": summary}


def cut(listed: Json, ago_s: float) -> Json:
    """A car without data at its bridge."""
    summary = listed["summary"]
    summary["link"] |= {"cut": "bridge-car", "car_age_s": ago_s}
    summary["speed"] |= {"freshness": "stale", "age_s": ago_s}
    summary["recording"] = "held"
    if summary["place"]:
        summary["place"] |= {"freshness": "stale", "age_s": ago_s}
    return listed


def three() -> list[Json]:
    """Five cars, of which three need a person."""
    margay = car("Margay", 3.1, (470, -260, 225), worst=worst("Bridge silent", "", ago_s=41),
                 attention=attention(ago_s=41, up_s=11), energy_percent=71.0)  # fmt: skip
    serval = car("Serval", 12.6, (50, 120, 100), worst=worst("Speed above limit", "12.6 m/s, limit 11.0 m/s", ago_s=7),
                 attention=attention(ago_s=7, left_s=23))  # fmt: skip
    drift = worst("GPS drift at standstill", "6.3 m, limit 2.0 m", ago_s=156, priority="warning", state="ACKED")
    caracal = car("Caracal", 0.0, (-40, -300, 270), worst=drift, waiting=0, holder="Desk 2", energy_percent=22.0,
                  attention=attention(ago_s=156, assigned=holder(DESK_2)))  # fmt: skip
    kodkod = car("Kodkod", 8.0, (-260, -40, 12), holder="Field 2", energy_percent=58.0)
    return [cut(margay, 41), serval, caracal, kodkod, car("Ocelot", 4.2, (280, -10, 75), energy_percent=87.0)]


def quiet() -> list[Json]:
    """Five cars, of which none needs a person."""
    rows = (
        ("Caracal", 0.0, (-40.0, -300.0, 270.0), "Desk 2"), ("Kodkod", 8.0, (-260.0, -40.0, 12.0), "Field 2"),
        ("Margay", 3.1, (470.0, -260.0, 225.0), None), ("Ocelot", 4.2, (280.0, -10.0, 75.0), None),
        ("Serval", 6.1, (50.0, 120.0, 100.0), "Desk 2"),
    )  # fmt: skip
    return [car(name, speed, at, holder=holder) for name, speed, at, holder in rows]


def events() -> list[Json]:
    rows = ((9, "Caracal", "Assigned to Desk 2.", 152), (8, "Ocelot", "Desk 2 gave it back: unassigned.", 250),
            (7, "Ocelot", "Desk 2 offers it to Field 2.", 570))  # fmt: skip
    return [
        {"vehicle": name, "n": n, "time_ms": now_ms() - 1000 * ago_s, "text": text, "by": "Desk 2"}
        for n, name, text, ago_s in rows
    ]


def hundred(silent: int = 0) -> list[Json]:
    """C001 … C100 on one lap, two of which need a person; `silent` of them lost their bridge a minute ago."""
    cars = []
    for n in range(1, 101):
        turn = 2 * math.pi * n / 100
        at = (900 * math.cos(turn), 420 * math.sin(turn) + 90 * math.sin(3 * turn), (360 - math.degrees(turn)) % 360)
        more: Json = {"energy_percent": 20.0 + (37 * n) % 79, "holder": ("Desk 2", None, "Field 2")[n % 3]}
        if n == 7:
            alarm = worst("Speed above limit", "12.6 m/s, limit 11.0 m/s", ago_s=7)
            more |= {"worst": alarm, "attention": attention(ago_s=7, left_s=23)}
        if n == 29:
            alarm = worst("GPS drift at standstill", "6.3 m, limit 2.0 m", ago_s=156, priority="warning", state="ACKED")
            more |= {"worst": alarm, "waiting": 0, "attention": attention(ago_s=156, assigned=holder(DESK_2))}
        one = car(f"C{n:02}", 0.0 if n % 9 == 0 else 2.0 + (n * 7 % 71) / 10, at, **more)
        if 34 <= n < 34 + silent:
            one["summary"] |= {"worst": worst("Bridge silent", "", ago_s=40 + n / 100), "waiting": 1,
                               "attention": attention(ago_s=40, up_s=10)}  # fmt: skip
            one = cut(one, 40)
        cars.append(one)
    return cars
