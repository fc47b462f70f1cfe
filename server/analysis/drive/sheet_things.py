"""Tables of the drive's report with a row for each thing: parts, interventions, marks, slow-downs, planned stops.

An intervention has a drawing of the seconds before it, a mark its voice note and its photo as data: URIs, for a page
that needs no other file. Only numbers of ours are put into drawings.
"""

from __future__ import annotations

import base64
import contextlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from server.analysis import report_text
from server.analysis.drive.axis import Scale, day_time, ticks
from server.analysis.drive.drawings import path, sign_at, svg
from server.recording.marks.media import MediaName
from server.recording.marks.recorded import all_media

MOST_ROWS = 300  # of one table; the CSV has all of them
BEFORE_S = 10.0
BEFORE_BREAK_S = 1.2  # without a sample for longer: the line ends
BEFORE_WIDTH, BEFORE_HEIGHT = 260.0, 76.0
MOST_MEDIA_BYTES = 24_000_000  # of all together: a page of more is not sent by mail, nor opened by a phone


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


def before_plot(one: Mapping[str, Any]) -> Markup | None:
    """The speed in the 10 s before an intervention; None: fewer than two samples."""
    samples = [(at_s, abs(mps)) for at_s, mps in one["before"] if -BEFORE_S - 0.5 <= at_s <= 0.05]
    if len(samples) < 2:
        return None
    marks = ticks(0.0, max(max(mps for _, mps in samples), 1.0), 2)
    x, y = Scale(-BEFORE_S, 0.0, 34.0, BEFORE_WIDTH - 14), Scale(0.0, marks[-1], BEFORE_HEIGHT - 22, 22.0)
    parts = [
        f'<path class="{"grid" if mark else "axis"}" d="M34 {y(mark):.1f}H{BEFORE_WIDTH - 14:g}"/>'
        f'<text x="28" y="{y(mark) + 4.5:.1f}" text-anchor="end">{mark:g}</text>'
        for mark in (marks[0], marks[-1])
    ]
    parts += [f'<path class="line" d="{path([(x(s), y(mps)) for s, mps in line])}"/>' for line in _unbroken(samples)]
    parts.append(f'<path class="axis" d="M{x(0):.1f} 16V{BEFORE_HEIGHT - 22:g}"/>')
    parts.append(sign_at("wheel", x(0), 8.0))
    parts.append('<text x="28" y="11" text-anchor="end">m/s</text>')
    for at_s, anchor, words in (
        (-BEFORE_S, "start", "−10 s"),
        (-BEFORE_S / 2, "middle", "−5 s"),
        (0.0, "end", "0"),
    ):
        parts.append(f'<text x="{x(at_s):.1f}" y="{BEFORE_HEIGHT - 4:g}" text-anchor="{anchor}">{words}</text>')
    return svg(BEFORE_WIDTH, BEFORE_HEIGHT, parts, "Speed in the 10 s before it")


def _unbroken(samples: Sequence[tuple[float, float]]) -> list[list[tuple[float, float]]]:
    lines: list[list[tuple[float, float]]] = []
    for at_s, mps in samples:
        if not lines or at_s - lines[-1][-1][0] > BEFORE_BREAK_S:
            lines.append([])
        lines[-1].append((at_s, mps))
    return lines


class Media:
    """Of one drive; what does not fit is counted in `left_out`."""

    def __init__(self) -> None:
        self.left_out = 0
        self._bytes = 0
        self._found: dict[tuple[str, str], str] = {}

    def get(self, mark: str, kind: str) -> str | None:
        """The data: URI of a mark's `voice` or `photo`."""
        return self._found.get((mark, kind))

    def add(self, name: MediaName, data: bytes) -> None:
        """The first of a mark counts."""
        if (name.mark, name.kind) in self._found:
            return
        if self._bytes + len(data) > MOST_MEDIA_BYTES:
            self.left_out += 1
            return
        self._bytes += len(data)
        self._found[name.mark, name.kind] = f"data:{name.media_type};base64,{base64.b64encode(data).decode()}"


def media_of(files: Iterable[Path]) -> Media:
    """The attachments of recordings and the files beside them; what cannot be read has none."""
    found = Media()
    for file in files:
        with contextlib.suppress(OSError):
            for name, data in all_media(file):
                found.add(name, data)
    return found
