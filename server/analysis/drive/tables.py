"""The drive's report for programs: as JSON, and as one CSV with a row for each thing that happened."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import orjson

from monitor.unseen import unseen_words
from server.analysis.drive.drive_report import DriveReport
from server.analysis.drive.form import as_csv
from server.recording.drive.alarms import marks_of
from server.recording.export.export_format import Outcome
from server.recording.export.formats.csv_zip import when
from server.recording.read.read import Recording

COLUMNS = ("section", "time", "until", "what", "value", "unit", "by", "details")


def write_report_json(
    recording: Recording, path: Path, *, name: str = "", progress: Callable[[float], None] = lambda part: None
) -> Outcome:
    """Raises RecordingUnreadable, OSError."""
    report = DriveReport.read(recording, name=name)
    path.write_bytes(orjson.dumps(report.found, option=orjson.OPT_INDENT_2 | orjson.OPT_APPEND_NEWLINE))
    progress(1.0)
    return Outcome(entries=1, notes=[f"{sentence}." for sentence in recording.damage])


def write_report_csv(
    recording: Recording, path: Path, *, name: str = "", progress: Callable[[float], None] = lambda part: None
) -> Outcome:
    """Raises RecordingUnreadable, OSError."""
    rows = list(report_rows(DriveReport.read(recording, name=name).found))
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(as_csv([list(COLUMNS), *rows]))
    progress(1.0)
    return Outcome(entries=len(rows), notes=[f"{sentence}." for sentence in recording.damage])


def report_rows(found: Mapping[str, Any]) -> Iterator[list[Any]]:
    """Times are ISO 8601; an empty value is not known."""
    figures = found["figures"]
    for name, value in figures.items():
        if not isinstance(value, (dict, list)):
            unit = {"m": "m", "s": "s"}.get(name.rpartition("_")[2], "")
            yield _row("figure", what=name, value=value, unit=unit)
    for mode, row in figures["modes"].items():
        yield _row("mode", what=mode, value=row["m"], unit="m")
        yield _row("mode", what=mode, value=row["s"], unit="s")
    for name in ("vehicle", "title", "weather", "remarks"):
        yield _row("drive", what=name, value=found[name])
    for one in found["parts"]:
        yield _row("part", one["from_ms"], one["to_ms"], what=one["recording"], value=one["part"])
    for one in found["gaps"]:
        moments = (found["start_ms"] + one[end] * 1000 for end in ("from_s", "to_s"))
        yield _row("not recorded", *moments, what="the car moved by", value=one["apart_m"], unit="m")
    for one in found["chain"]:
        yield _row("chain", what=one["state"], value=one["head"], details=one["sentence"])
    for name, value in (found["load"] or {}).items():
        yield _row("alarm load", what=name, value="; ".join(value) if isinstance(value, list) else value)
    yield from _people(found["people"] or ())
    yield from _departure(found["departure"])
    yield from _things(found)


def _people(people: Any) -> Iterator[list[Any]]:
    for one in people:
        for section, spans in (("on duty", one["on_duty"]), ("in control", one["in_control"])):
            for span in spans:
                yield _row(section, span["from_ms"], span["to_ms"], what=one["name"], value=one["role"])


def _departure(found: Mapping[str, Any] | None) -> Iterator[list[Any]]:
    if found is None:
        return
    counts = (
        f"{found['done']} done, {found['failed']} failed, {found['not_applicable']} not applicable of {found['of']}"
    )
    yield _row(
        "departure check", found["at_ms"], what=found["state"], value=found["hash"], by=found["by"], details=counts
    )
    for item in found["items"]:
        about = {"what": item["title"], "value": item["result"], "by": item["by"]}
        yield _row("departure item", item["at_ms"], details=" ".join((item["value"], item["note"])).strip(), **about)


def _things(found: Mapping[str, Any]) -> Iterator[list[Any]]:
    for one in found["modes"] or ():
        yield _row("mode span", one["from_ms"], one["to_ms"], what=one["mode"])
    for one in found["alarms"] or ():
        about = {"what": one["title"], "value": one["to_acknowledge_s"], "unit": "s to acknowledge"}
        details = " · ".join(filter(None, (one["text"], marks_of(one))))
        yield _row("alarm", one["raised_ms"], one["cleared_ms"], by=one["acknowledged_by"], details=details, **about)
    for one in found["interventions"] or ():
        details = ": ".join(filter(None, (one["category"], one["what"])))
        about = {"what": one["kind"], "value": one["speed_mps"], "unit": "m/s", "by": one["initiated_by"]}
        yield _row("intervention", one["at_ms"], details=details, **about)
    for one in found["marks"] or ():
        yield _row(
            "mark",
            one["marked_ms"],
            what=one["category"] or "",
            value=one["words"],
            by=one["by"] or "",
            details=one["mark"],
        )
    for one in found["slow_downs"] or ():
        yield _row(
            "slow-down", one["ordered_ms"], one["released_ms"], what=one["why"], by=one["by"], details=one["proof"]
        )
    for one in found["planned_stops"] or ():
        yield _row("planned stop", one["from_ms"], one["to_ms"], what=one["reason"], by=one["by"], details=_ended(one))
    for one in found["link_along"]:
        about = {"what": f"{one['from_m']:g} to {one['to_m']:g} m", "value": one["delay_s"], "unit": "s of delay"}
        yield _row(
            "link along the way", details=f"most {_or_unknown(one['most_s'])}, blind {one['blind_s']:g} s", **about
        )
    for section, what in (("blind", "no message"), ("late", "messages late")):
        for one in found[section]:
            start = found["start_ms"]
            about = {
                "value": round(one["to_s"] - one["from_s"], 2),
                "unit": "s",
                "details": unseen_words(one["unseen_m"]),
            }
            yield _row(section, start + one["from_s"] * 1000, start + one["to_s"] * 1000, what=what, **about)
    for one in found["no_record"]:
        yield _row(one["what"].lower(), one["from_ms"], one["to_ms"], what=one["sentence"])
    for name in ("parts_missing", "damage", "left_out", "not_received"):
        for line in found[name]:
            yield _row("missing", what=name, value=line)


def _ended(one: Mapping[str, Any]) -> str:
    return " ".join(filter(None, (one["ended"], one["ended_by"] and f"By {one['ended_by']}.")))


def _or_unknown(seconds: float | None) -> str:
    return "not known" if seconds is None else f"{seconds:g} s"


def _row(
    section: str,
    from_ms: float | None = None,
    to_ms: float | None = None,
    *,
    what: str = "",
    value: Any = None,
    unit: str = "",
    by: str = "",
    details: str = "",
) -> list[Any]:
    times = ["" if at_ms is None else when(at_ms / 1000) for at_ms in (from_ms, to_ms)]
    return [section, *times, what, "" if value is None else value, unit, by, details]
