"""The report as one HTML file: no other file, no network, every text from the recording escaped."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from datetime import UTC, datetime
from functools import cache
from importlib.resources import files
from typing import Any, Protocol

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from monitor.alarm_spec import Priority
from server.analysis import plots, report_text
from server.analysis.episodes import Episode
from server.analysis.report import Report, differences, name_of, not_checked
from server.system.page_files import check_vendor, static_dir
from server.version import catgraph_version

_SCRIPTS = ("layout", "elements", "view", "alarms", "plots", "track", "overview")  # each imports earlier ones only
_BEFORE_UNIT = re.compile(r"(?<=\d) (?=(?:m/s²|m/s|km/h|mph|km|m|ms|s|min|h|%|kB|MB|GB|Hz|°C)(?![\w/]))")
_TIMELINE_TEXTS = 400  # reasons in one file; more would not be read


def page(report: Report, drive: FirstPart | None = None) -> str:
    """The whole document; `drive`: what comes first, and is all that is printed.

    Raises AssetsMissing where the page's third-party files are not there.
    """
    check_vendor()
    script, style = _script(), _style() + ("" if drive is None else _page_foot(drive.foot))
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {
        "clock": report_text.clock,
        "lasting": report_text.length,
        "grouped": report_text.grouped,
        "line": report_text.printable,
        "whole": whole,
        "day_time": _day_time,
    }
    template = environment.from_string(_text("report.html"))
    return template.render(
        **_facts(report),
        style=Markup(style),
        script=Markup(script),
        data=Markup(_json(_data(report))),
        policy=_policy(script, style),
        drive=Markup("") if drive is None else drive.sheet(environment, _text("drive.html")),
    )


def whole(text: str) -> str:
    """Text of which no line breaks between a number and its unit."""
    return _BEFORE_UNIT.sub("\N{NO-BREAK SPACE}", text)


class FirstPart(Protocol):
    """What stands before the analysis: the drive's report."""

    @property
    def foot(self) -> str:
        """At the foot of each printed page."""
        ...

    def sheet(self, environment: Environment, template: str) -> Markup:
        """As HTML."""
        ...


def _page_foot(text: str) -> str:
    """A style of plain letters only: nothing in them can end the text."""
    plain = re.sub(r"[^A-Za-z0-9 .,·]", "", text)
    return f'\n@page {{ @bottom-left {{ content: "{plain}"; font: 12px system-ui, sans-serif; }} }}\n'


def _policy(script: str, style: str) -> str:
    """The content security policy: this script, these styles, and nothing from elsewhere."""
    return (
        f"default-src 'none'; script-src '{_hash(script)}'; style-src '{_hash(style)}'; font-src data:; "
        "img-src data:; media-src data:; "
        "base-uri 'none'; form-action 'none'"
    )


def _facts(report: Report) -> dict[str, Any]:
    """The variables of the template."""
    run, recording = report.run, report.recording
    counts = {priority: sum(one.priority is priority for one in run.episodes) for priority in Priority}
    worst = next((priority for priority in Priority if counts[priority]), None)
    return {
        "version": catgraph_version(),
        "name": ", ".join(report_text.printable(_base(file), 80) for file in report.files),
        "files": report.files,
        "report": report,
        "recorded_log": report.recorded_log,
        "brand": "catgraph check"
        if report.recorded_log is None
        else f"catgraph {'incident' if report.recorded_log.clip_of else 'drive'}",
        "run": run,
        "recording": recording,
        "recorded": report.recorded,
        "worst": None if worst is None else str(worst),
        "counts": ", ".join(f"{number} {priority}" for priority, number in counts.items() if number),
        "episodes": run.episodes,
        "unchecked": not_checked(run),
        "signals": [row for row in report.signals() if row.topic is not None or not row.optional],
        "settings": report.settings(),
        "settings_name": name_of(run.override),
        "changes": report.changes,
        "differences": [] if report.before is None else differences(report.before, run),
        "before_name": "" if report.before is None else name_of(report.before.override),
        "load_words": {"bearable": "bearable", "demanding": "demanding", "flood": "a flood"}[run.load.verdict],
        "chattering": [run.titles[name] for name in run.load.chattering],
    }


def _data(report: Report) -> dict[str, Any]:
    """The data that the script draws."""
    run = report.run
    traces = run.traces
    return {
        "from": round(run.from_s, 3),
        "to": round(max(run.to_s, run.from_s + 0.1), 3),
        "startMs": round(report.recording.start_s * 1000) if report.recorded is not None else None,
        "panels": [] if traces is None else plots.panels(traces),
        "track": None if traces is None else plots.track(traces),
        "episodes": [_bar(episode) for episode in run.episodes],
        "before": [_bar(change.before) for change in report.changes if change.before is not None],
        "timelines": _timelines(report),
        "injected": [[laid.name, round(laid.from_s, 2), round(laid.to_s, 2)] for laid in run.faults],
    }


def _bar(episode: Episode) -> dict[str, Any]:
    return {
        "alarm": episode.alarm_id,
        "title": report_text.printable(episode.title, 100),
        "priority": str(episode.priority),
        "from": round(episode.raised_s, 3),
        "to": round(episode.until_s, 3),
        "open": episode.cleared_s is None,
        "hidden": [[round(from_s, 3), round(to_s, 3)] for from_s, to_s in episode.suppressed],
    }


def _timelines(report: Report) -> list[dict[str, Any]]:
    left = _TIMELINE_TEXTS
    rows = []
    for timeline in report.run.timelines:
        spans = []
        for from_s, to_s, verdict, text in timeline.spans:
            left -= 1
            spans.append(
                [round(from_s, 2), round(to_s, 2), str(verdict), report_text.printable(text, 160) if left > 0 else ""]
            )
        rows.append({"label": timeline.label, "priority": str(timeline.priority), "spans": spans})
    return rows


def _json(value: Any) -> str:
    """JSON that can stand inside a script element whatever is in it."""
    text = json.dumps(value, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _hash(text: str) -> str:
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"


def _day_time(at_ms: int) -> str:
    """A time of day, UTC; nothing where no calendar has it."""
    try:
        return datetime.fromtimestamp(at_ms / 1000, UTC).strftime("%H:%M:%S")
    except (OverflowError, ValueError, OSError):
        return ""


def _base(path: str) -> str:
    return path.rstrip("/\\").replace("\\", "/").rpartition("/")[2] or path


@cache
def _text(name: str) -> str:
    return (files("server.analysis") / "html" / name).read_text(encoding="utf-8")


@cache
def _script() -> str:
    """Join uPlot and our own modules to one module; a block keeps our names apart from those of uPlot."""
    plot = (static_dir() / "vendor" / "uPlot.esm.js").read_text(encoding="utf-8")
    plot = re.sub(r"export\s*\{\s*uPlot as default\s*\};?", "", plot)
    parts = [_text(name) for name in (*(f"report/{part}.js" for part in _SCRIPTS), "report.js")]
    own = re.sub(r"^(import .*;$|export )", "", "\n".join(parts), flags=re.MULTILINE)
    return _no_end(f"{plot}\n{{\n{own}}}\n")


@cache
def _style() -> str:
    static = static_dir()
    tokens = (static / "css" / "tokens.css").read_text(encoding="utf-8")

    def inlined(match: re.Match[str]) -> str:
        font = (static / "fonts" / match[1]).read_bytes()
        return f'url("data:font/woff2;base64,{base64.b64encode(font).decode()}")'

    tokens = re.sub(r'url\("\.\./fonts/([\w.-]+)"\)', inlined, tokens)
    plot = (static / "vendor" / "uPlot.min.css").read_text(encoding="utf-8")
    return _no_end(f"{tokens}\n{plot}\n{_text('report.css')}\n{_text('drive.css')}")


def _no_end(text: str) -> str:
    """Nothing in our own files may end the element they stand in."""
    if "</script" in text.lower() or "</style" in text.lower() or "<!--" in text:
        raise ValueError("a file of the page would end its own element")
    return text
