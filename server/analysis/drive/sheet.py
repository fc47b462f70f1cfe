"""The drive's report as HTML: the first part of the page of a drive, and all of it on paper."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from jinja2 import Environment
from markupsafe import Markup

from monitor.load import BEARABLE_IN_10_MIN, FLOOD_IN_10_MIN
from monitor.unseen import unseen_words
from server.analysis import report_text
from server.analysis.drive import drawings, link_drawing, sheet_things
from server.analysis.drive.axis import day_time
from server.analysis.drive.sheet_things import MOST_ROWS, Media
from server.recording.drive.alarms import marks_of
from server.recording.drive.facts import DriveFacts
from server.recording.drive.link_way import LinkStretch, link_along
from server.version import catgraph_version

MOST_NO_RECORD = 20  # times without a record that are shown
MOST_CHAINS = 3  # at the top of the report; each part has its own in the list of parts
_MODES = {"autonomous": "Autonomous", "manual": "Manual", "unknown": "Not known"}
_RESULTS = {"failed": "critical", "not_applicable": "na", "open": "unknown", "done": "ok"}


def sheet(environment: Environment, template: str, facts: DriveFacts, found: Mapping[str, Any], media: Media) -> Markup:
    """`found`: the result of report_json. Every text of it is escaped by the template."""
    return Markup(environment.from_string(template).render(view=_view(facts, found, media), version=catgraph_version()))


def _view(facts: DriveFacts, found: Mapping[str, Any], media: Media) -> dict[str, Any]:
    alarms, stretches = _alarms(found["alarms"]), link_along(facts)
    no_record = [f"{one['what']} {one['time']}" for one in found["no_record"]]
    return {
        "about": _about(found),
        **{name: found[name] for name in ("title", "weather", "remarks", "tags")},
        "chain": [*_chain(found["chain"]), *_parts_missing(found)],
        "parts": sheet_things.parts(found),
        "figures": _figures(found),
        "people": None if found["people"] is None else _people(found["people"]),
        "departure": _departure(found["departure"]),
        "departure_head": _departure_head(found["departure"]),
        "map": _both(drawings.drive_map, facts, (476, 340), (340, 360)),
        "load": _load(found),
        "modes": _modes(found),
        "speed": _both(drawings.speed_plot, facts, (700, 210), (340, 230), (510, 220)),
        "has_limit": bool(facts.limits),
        "alarms": None if alarms is None else alarms[:MOST_ROWS],
        "no_record": no_record[:MOST_NO_RECORD],
        "no_record_left": max(0, len(no_record) - MOST_NO_RECORD),
        "none": "none in what was recorded" if _is_partial(found) else "none",
        "alarms_left": 0 if alarms is None else max(0, len(alarms) - MOST_ROWS),
        "interventions": sheet_things.interventions(found["interventions"]),
        "marks": sheet_things.marks(found["marks"], media),
        "media_left": media.left_out,
        "slow_downs": sheet_things.slow_downs(found["slow_downs"]),
        "planned_stops": sheet_things.planned_stops(found["planned_stops"], found["end_ms"]),
        "link": link_drawing.over_time(facts, 340, 150),
        "link_way": link_drawing.along_way(facts, stretches, 340, 150),
        "link_step": _stretch(stretches),
        "link_head": _link_head(found["link_delay"]),
        "blind": _blind(found, facts.start_ms),
        "blind_head": _blind_head(found),
        "lost": _lost(found),
        "nothing_lost": "none: nothing is missing that was to be recorded"
        if found["alarms"] is not None
        else "no gap in the messages; whether topics were left out is not known",
        "distance_by": {"position": "from positions", "speed": "from the wheels' speed", None: "not known"}[
            found["figures"]["distance_by"]
        ],
    }


def _is_partial(found: Mapping[str, Any]) -> bool:
    """Whether there may have been more than the files say."""
    is_broken = any(one["is_broken"] for one in found["chain"])
    return bool(found["no_record"] or found["damage"] or is_broken)


def _both(draw: Any, facts: DriveFacts, *sizes: tuple[int, int]) -> list[Markup] | None:
    drawn = [draw(facts, *size) for size in sizes]
    return None if drawn[0] is None else drawn


def _about(found: Mapping[str, Any]) -> str:
    car = found["vehicle"] or "car not known"
    if found["start"] is None:
        return f"{car}, time not known"
    begin = datetime.fromtimestamp(found["start_ms"] / 1000, UTC)
    parts = len(found["parts"])
    part = f", in {parts} parts" if parts > 1 else f", part {found['part']}" if found["part"] not in (None, "1") else ""
    return f"{car}, {begin:%-d %b %Y}, {day_time(found['start_ms'])} to {day_time(found['end_ms'])} UTC{part}"


def _chain(chain: Sequence[Mapping[str, Any]]) -> list[tuple[str, str, bool]]:
    """State and head of each file, and whether it is broken; of many, those that are and how many are not."""
    if len(chain) <= MOST_CHAINS:
        return [(_state(one), _head(one), bool(one["is_broken"])) for one in chain]
    broken = [(f"{one['recording']}: {_state(one)}", _head(one), True) for one in chain if one["is_broken"]]
    intact = sum(one["state"] == "intact" and not one["is_broken"] for one in chain)
    return [(f"{intact} of {len(chain)} parts intact", "heads below", False), *broken[:MOST_CHAINS]]


def _parts_missing(found: Mapping[str, Any]) -> list[tuple[str, str, bool]]:
    """Beside chains that are intact: what is not there has none."""
    numbers = [str(number) for one in found["no_record"] for number in one["parts"]]
    which = ", ".join(numbers[:MOST_CHAINS]) + (" …" if len(numbers) > MOST_CHAINS else "")
    return [(f"Missing: part{'s' if len(numbers) > 1 else ''} {which}", "see data lost", True)] if numbers else []


def _state(one: Mapping[str, Any]) -> str:
    is_intact = one["state"] == "intact" and not one["is_broken"]
    return f"Intact: {report_text.counted(one['records'], 'record')}" if is_intact else str(one["short"])


def _head(one: Mapping[str, Any]) -> str:
    head = one["head"]
    return "" if not head else f"head {head[:4]} {head[4:8]} {head[8:12]} {head[12:16]}"


def _figures(found: Mapping[str, Any]) -> list[tuple[str, str | None, str, str, bool]]:
    """Title, value (None: not known), unit, what stands below, whether it is above its benchmark."""
    f, load = found["figures"], found["load"]
    metres, modes = f["distance_m"], f["modes"]
    km = None if metres is None else metres / 1000
    auto_m = modes["autonomous"]["m"]
    is_known = found["modes"] is not None and metres is not None
    share = f"{100 * auto_m / metres:.0f} % of the distance" if is_known and metres else ""
    per_km, alarms_per_km = (
        "" if f[name] is None else f"{f[name]:.2f} {unit}"
        for name, unit in (("interventions_per_autonomous_km", "per autonomous km"), ("alarms_per_km", "per km"))
    )
    in_10_min = f"{load['in_10_min']:.1f} in 10 min, benchmark 1" if load else ""
    is_above = bool(load) and load["in_10_min"] > BEARABLE_IN_10_MIN
    marks = found["marks"] or []
    voices, photos = sum(one["voice"] for one in marks), sum(one["photo"] for one in marks)
    p50, p90 = f["acknowledged_p50_s"], f["acknowledged_p90_s"]
    gaps = report_text.counted(f["blind"], "gap")
    waited = f"p90 {p90:.1f} s" if p90 is not None else "none was acknowledged" if f["alarms"] else ""
    return [
        ("Distance", _km(km), "km", _clock(f["driven_s"]), False),
        ("Autonomous", _km(auto_m / 1000) if is_known else None, "km", share, False),
        ("Interventions", _whole(f["interventions"]), "", per_km, False),
        ("Alarms", _whole(f["alarms"]), "", ", ".join(filter(None, (alarms_per_km, in_10_min))), is_above),
        ("To acknowledge", None if p50 is None else f"{p50:.1f}", "s", waited, False),
        ("Marks", _whole(f["marks"]), "", f"{voices} with voice, {photos} with photo" if marks else "", False),
        ("Data lost", f"{f['blind_s']:.1f}", "s", f"in {gaps}{_not_recorded(found)}", False),
    ]


def _not_recorded(found: Mapping[str, Any]) -> str:
    """The time between the parts, and the parts that are missing, which are not among what was lost."""
    seconds = sum(one["to_s"] - one["from_s"] for one in found["gaps"])
    missing = sum(len(one["parts"]) for one in found["no_record"])
    more = [f"{report_text.length(seconds)} not recorded"] if seconds else []
    more += [f"{report_text.counted(missing, 'part')} missing"] if missing else []
    return f", and {', '.join(more)}" if more else ""


def _people(people: Sequence[Mapping[str, Any]]) -> list[tuple[str, str, str]]:
    rows = []
    for one in people:
        rows += [(one["name"], one["role"] or "no person signed on", _span(span)) for span in one["on_duty"]]
        rows += [(one["name"], "in control", _span(span)) for span in one["in_control"]]
        if not one["on_duty"] and not one["in_control"]:
            rows.append((one["name"], one["role"], ""))
    return rows[:MOST_ROWS]


def _span(span: Mapping[str, int | None]) -> str:
    begin = "before" if span["from_ms"] is None else day_time(span["from_ms"])
    end = "end" if span["to_ms"] is None else day_time(span["to_ms"])
    return f"{begin}–{end}"


def _departure(found: Mapping[str, Any] | None) -> str | list[tuple[str, str, str]] | None:
    """A sentence where there was none; None: not known."""
    if found is None:
        return None
    if found["state"] == "none":
        return "No departure check was made."
    failed, is_signed = found["failed"], found["state"] == "signed"
    open_ = found["of"] - found["done"] - failed - found["not_applicable"]
    sign = "critical" if failed else "ok" if is_signed else "unknown"
    rows = [(sign, f"{found['done']} of {found['of']} done", f"{failed} failed" if failed else "")]
    if open_ > 0:
        rows.append(("unknown", f"{open_} open", ""))
    for one in found["items"]:
        is_fixed = one["result"] == "done" and one["had_failed"]
        if one["result"] != "done" or one["note"] or is_fixed:
            parts = (one["value"], "had failed, fixed" if is_fixed else "", one["note"])
            value = " ".join(filter(None, parts)) or one["result"].replace("_", " ")
            rows.append((_RESULTS[one["result"]], one["title"], value))
    return rows


def _departure_head(found: Mapping[str, Any] | None) -> str:
    if found is None or found["state"] == "none":
        return ""
    if found["state"] == "open":
        return "not signed"
    return f"signed {day_time(found['at_ms'])}, {found['by']}"


def _load(found: Mapping[str, Any]) -> list[tuple[bool, str, str, str]] | None:
    load, f = found["load"], found["figures"]
    if load is None:
        return None
    chattering = len(load["chattering"])
    rows = [
        (load["in_10_min"] <= BEARABLE_IN_10_MIN, "Alarms in 10 min, mean", f"{load['in_10_min']:.1f}", "≤ 1"),
        (load["most_in_10_min"] <= FLOOD_IN_10_MIN, "Highest 10 min", f"{load['most_in_10_min']}", "≤ 10"),
        (chattering == 0, "Chattering", f"{chattering}", "0"),
        (not f["unacknowledged"], "Never acknowledged", f"{f['unacknowledged']}", "0"),
    ]
    return rows


def _modes(found: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    if found["modes"] is None:
        return [("The mode of the car was not recorded", "not known", _clock(found["figures"]["driven_s"]))]
    rows = []
    for mode, title in _MODES.items():
        row = found["figures"]["modes"][mode]
        way = "not known" if row["m"] is None else f"{row['m'] / 1000:.2f} km"
        rows.append((title, way, _clock(row["s"])))
    return rows


def _alarms(alarms: Sequence[Mapping[str, Any]] | None) -> list[tuple[str, str, str, str, str]] | None:
    if alarms is None:
        return None
    return [
        (
            day_time(one["raised_ms"]),
            one["priority"],
            one["title"],
            " · ".join(filter(None, (marks_of(one), one["text"]))),
            "not acknowledged" if one["to_acknowledge_s"] is None else f"{one['to_acknowledge_s']:.1f} s",
        )
        for one in alarms
    ]


def _link_head(delay: Mapping[str, float] | None) -> str:
    return "" if delay is None else f"delay in ms; p90 {delay['p90_s'] * 1000:.0f}, most {delay['most_s'] * 1000:.0f}"


def _stretch(stretches: Sequence[LinkStretch]) -> str:
    """How long each stretch of the way is."""
    if not stretches:
        return ""
    return f"mean of each {stretches[0].to_m - stretches[0].from_m:.0f} m, dotted: the most; hatched: nothing received"


def _blind(found: Mapping[str, Any], start_ms: int) -> list[tuple[str, str, str, str]]:
    """When, what, how far the car may have driven, how long."""
    rows = [(one, "no message from the car") for one in found["blind"][:50]]
    rows += [(one, f"messages up to {one['late_s']:.1f} s late") for one in found["late"][:50]]
    return [
        (
            day_time(start_ms + one["from_s"] * 1000),
            what,
            unseen_words(one["unseen_m"]),
            report_text.length(one["to_s"] - one["from_s"]),
        )
        for one, what in sorted(rows, key=lambda row: float(row[0]["from_s"]))
    ]


def _blind_head(found: Mapping[str, Any]) -> str:
    """How the metres are counted."""
    by = found["unseen_by"]
    if by["acceleration_mps2"] is None or not (found["blind"] or found["late"]):
        return ""
    setting = "" if by["is_recorded"] else " (as set today)"
    delay = "" if by["with_delay"] else ", delay of the link not known"
    return f"metres: last speed and at most {by['acceleration_mps2']:.1f} m/s²{setting}{delay}"


def _lost(found: Mapping[str, Any]) -> list[str]:
    """What else is missing, in lines."""
    lines = [*(one["sentence"] for one in found["no_record"][:MOST_NO_RECORD]), *found["damage"][:20]]
    lines += [f"{one['recording']}: {one['sentence']}" for one in found["chain"] if one["is_broken"]][:20]
    for name, what in (("left_out", "not recorded"), ("not_received", "not received")):
        if found[name]:
            shown = ", ".join(found[name][:5])
            more = f" and {len(found[name]) - 5} more" if len(found[name]) > 5 else ""
            lines.append(f"Topics {what}: {shown}{more}.")
    return lines


def _km(km: float | None) -> str | None:
    return None if km is None else f"{km:.2f}" if km < 100 else f"{km:.0f}"


def _whole(number: int | None) -> str | None:
    return None if number is None else str(number)


def _clock(seconds: float) -> str:
    """A time: 12:48 min, 2:03:10 h."""
    whole = round(seconds)
    minutes, rest = divmod(whole, 60)
    return f"{minutes}:{rest:02d} min" if minutes < 60 else f"{minutes // 60}:{minutes % 60:02d}:{rest:02d} h"
