"""Tables of the drive's report with a row for each thing: parts, interventions, marks, slow-downs, planned stops."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

from server.analysis import report_text
from server.analysis.drive.axis import day_time
from server.analysis.drive.intervention_drawing import before_plot
from server.analysis.drive.media import Media

MOST_ROWS = 300  # of one table; the CSV has all of them


def parts(found: Mapping[str, Any]) -> list[tuple[str, str, str, str]]:
    """Of a drive of several: when each began, what it is called, its hash chain and how long it is; and between two of
    them, for how long nothing was recorded."""
    if len(found["parts"]) < 2:
        return []
    heads = {one["recording"]: _chain(one) for one in found["chain"]}
    rows = []
    for one in found["parts"]:
        title = one["recording"] if one["part"] is None else f"Part {one['part']}, {one['recording']}"
        lasted = report_text.length((one["to_ms"] - one["from_ms"]) / 1000)
        rows.append((one["from_ms"], (title, heads.get(one["recording"], "no hash chain"), lasted)))
    for gap in found["gaps"]:
        apart_m = gap["apart_m"]
        apart = (
            "how far the car moved is not known" if apart_m is None else f"the car was {apart_m:.0f} m away after it"
        )
        lasted = report_text.length(gap["to_s"] - gap["from_s"])
        rows.append(
            (found["start_ms"] + gap["from_s"] * 1000, ("Not recorded", f"{apart}; not counted as driven", lasted))
        )
    ordered = sorted(rows, key=lambda row: row[0])[:MOST_ROWS]
    return [(day_time(at_ms), *texts) for at_ms, texts in ordered]


def _chain(one: Mapping[str, Any]) -> str:
    state = "Intact" if one["state"] == "intact" and not one["is_broken"] else one["short"]
    return f"{state}, head {(one['head'] or 'not known')[:16]}"


def interventions(found: Sequence[Mapping[str, Any]] | None) -> list[tuple[str, str, str, str, Markup | None]] | None:
    """When, what, how it was described, where with which alarms, and the speed before it."""
    if found is None:
        return None
    rows = []
    for one in found[:MOST_ROWS]:
        initiator = "by whom not known" if one["initiated_by"] == "unknown" else f"by the {one['initiated_by']}"
        speed = "speed not known" if one["speed_mps"] is None else f"{one['speed_mps']:.1f} m/s"
        kind = f"{one['kind'].capitalize()}, {initiator}, {speed}"
        what = ": ".join(filter(None, (one["category"], one["what"]))) or "not described"
        place = (
            "place not known"
            if one["lat_deg"] is None or one["lon_deg"] is None
            else f"{one['lat_deg']:.6f}, {one['lon_deg']:.6f}"
        )
        active = f"alarms then: {', '.join(one['active'][:6])}" if one["active"] else "no alarm was active"
        described = f"described by {one['described_by']}" if one["described_by"] else ""
        more = "; ".join(filter(None, (place, active, described)))
        rows.append((day_time(one["at_ms"]), kind, what, more, before_plot(one)))
    return rows


def marks(marks: Sequence[Mapping[str, Any]] | None, media: Media) -> list[dict[str, Any]] | None:
    if marks is None:
        return None
    rows = []
    for one in marks[:MOST_ROWS]:
        voice, photo = media.get(one["mark"], "voice"), media.get(one["mark"], "photo")
        has = [kind for kind in ("voice", "photo") if one[kind]]
        rows.append(
            {
                "at": day_time(one["marked_ms"]),
                **{name: one[name] or "" for name in ("category", "words", "by")},
                "has": ", ".join(has),
                "voice": voice if one["voice"] else None,
                "photo": photo if one["photo"] else None,
            }
        )
    return rows


def slow_downs(found: Sequence[Mapping[str, Any]] | None) -> list[tuple[str, str, str, str]] | None:
    """When, by whom and why, the proof, and how long until then."""
    if found is None:
        return None
    rows = []
    for one in found[:MOST_ROWS]:
        title = f"Ordered by {one['by'] or 'nobody known'}" + (f": {one['why']}" if one["why"] else "")
        slows = one["slows_ms"]
        proof = one["proof"] or ("the car slowed" if slows else "no proof was recorded that the car slowed")
        rows.append(
            (
                day_time(one["ordered_ms"]),
                title,
                proof,
                f"{(slows - one['ordered_ms']) / 1000:.1f} s" if slows else "not proven",
            )
        )
    return rows


def planned_stops(found: Sequence[Mapping[str, Any]] | None, end_ms: int) -> list[tuple[str, str, str, str]] | None:
    """When, why and by whom, how it ended, how long."""
    if found is None:
        return None
    rows = []
    for one in found[:MOST_ROWS]:
        until_ms = end_ms if one["to_ms"] is None else one["to_ms"]
        ended = "it was in force to the end" if one["to_ms"] is None else one["ended"] or "another reason followed"
        by = f" By {one['ended_by']}." if one["ended_by"] else ""
        title = f"{one['reason'].capitalize()}, by {one['by'] or 'nobody known'}"
        lasted = report_text.length((until_ms - one["from_ms"]) / 1000)
        rows.append((day_time(one["from_ms"]), title, f"{ended}{by}", lasted))
    return rows
