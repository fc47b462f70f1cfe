"""All alarms and thresholds as a page of Markdown, made from their declarations: docs/alarms.md."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import partial
from typing import Any

from monitor import catalog
from monitor.alarm_spec import AlarmSpec
from monitor.catalog import CHECKS, AnyCheck
from monitor.runner import IMPAIRED, IMPAIRED_SPEC
from monitor.signals import SIGNALS

HEAD = """# Alarms and thresholds

Made from the declarations in `monitor/checks/` by `python -m server.protocol.reference --write`.
A test fails when it is out of date.

Each check answers *OK*, *FAULT* or *not checked* (why). A fault that lasts for the *on* delay raises the alarm, *OK*
that lasts for the *off* delay clears it; *not checked* does neither. While an alarm of the column *explained by*
stands, this one is not announced. *Ack*: it stays, although its condition has gone, until somebody has acknowledged it.
*Repeats after*: within this time what was announced is not announced again; it stands in the list as it was left.
`<signal>` stands for each of: {signals}.

"""


def text() -> str:
    """The whole page."""
    head = HEAD.format(signals=", ".join(f"`{name}`" for name in SIGNALS))
    return head + "\n".join([*_alarms(), "", *_thresholds(), ""])


def _alarms() -> Iterator[str]:
    yield "## Alarms"
    yield ""
    yield (
        "| Alarm | Question | Checked when | Priority, place | On / off "
        "| Repeats after | Ack | Explained by | What to do |"
    )
    yield "|---|---|---|---|---|---|---|---|---|"
    families: dict[str, list[AnyCheck]] = {}
    for check in CHECKS:
        families.setdefault(_family(check.id), []).append(check)
    for family in families.values():
        yield _row(family)
    yield _alarm_row(IMPAIRED, IMPAIRED_SPEC, "Does a check fail?", "Always checked.", IMPAIRED_SPEC.inhibited_by)


def _row(family: list[AnyCheck]) -> str:
    """One check, or one of a family that has a member for each signal."""
    first = family[0]
    signal = first.id.partition(".")[2]
    if not signal:
        return _alarm_row(first.id, first.alarm, _question(first), first.checked_when, first.alarm.inhibited_by)
    by = dict.fromkeys(
        name.replace(f".{check.id.partition('.')[2]}", ".<signal>") if _family(name) != _family(check.id) else name
        for check in family
        for name in check.alarm.inhibited_by
    )
    name = first.id.replace(f".{signal}", ".<signal>")
    row = _alarm_row(name, first.alarm, _question(first), first.checked_when, tuple(by))
    return row.replace(f"**{SIGNALS[signal].label}", "**(signal)")


def _family(alarm_id: str) -> str:
    return alarm_id.partition(".")[0]


def _alarm_row(alarm_id: str, spec: AlarmSpec, question: str, checked_when: str, inhibited_by: tuple[str, ...]) -> str:
    cells = (
        f"**{spec.title}** `{alarm_id}`",
        question,
        checked_when,
        f"{spec.priority}, {spec.place}",
        f"{spec.on_delay_s:g} / {spec.off_delay_s:g} s",
        f"{spec.repeat_after_s / 60:g} min" if spec.repeat_after_s else "",
        "yes" if spec.needs_ack else "",
        ", ".join(f"`{name}`" for name in inhibited_by),
        spec.advice,
    )
    return f"| {' | '.join(cells)} |"


def _question(check: AnyCheck) -> str:
    """The first sentence of the check's own file."""
    find: Any = check.find
    if isinstance(find, partial):
        find = find.func
    text = " ".join((sys.modules[find.__module__].__doc__ or "").split())
    ends = [at for at in (text.find("? "), text.find(". "), text.find(": ")) if at > 0]
    return text[: min(ends) + 1].removesuffix(":") if ends else text


def _thresholds() -> Iterator[str]:
    yield "## Thresholds"
    yield ""
    yield "In SI, as in files of settings: `[speed_limit]` and below it `max_mps = 11.0`."
    yield ""
    yield "| Name | What | Default | Range | |"
    yield "|---|---|---|---|---|"
    is_rate_listed = False
    for name, field in catalog.schema().items():
        group, _, short = name.partition(".")
        title = field["title"]
        if group == "signals" and short.removesuffix("_hz") in SIGNALS:
            if is_rate_listed:
                continue
            is_rate_listed = True
            name, title = "signals.<signal>_hz", "(signal): expected rate"
        span = f"{field['minimum']:g} … {field['maximum']:g}".replace("-", "−")
        yield (
            f"| `{name}` | {title} | {field['default']:g} {field['unit']} | {span} | {field.get('description') or ''} |"
        )
