"""What is made from the declarations: docs/alarms.md, the tables of docs/protocol.md and the types of the page.

`python -m server.protocol.reference` lists those that are out of date; with --write it writes them.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from textwrap import indent
from typing import Any

from monitor import catalog
from monitor.alarm_spec import AlarmSpec
from monitor.catalog import CHECKS, AnyCheck
from monitor.runner import IMPAIRED, IMPAIRED_SPEC
from monitor.signals import SIGNALS
from server.protocol import tables
from server.protocol.tables import definitions

ALARMS_HEAD = """# Alarms and thresholds

Made from the declarations in `monitor/checks/` by `python -m server.protocol.reference --write`.
A test fails when it is out of date.

Each check answers *OK*, *FAULT* or *not checked* (why). A fault that lasts for the *on* delay raises the alarm, *OK*
that lasts for the *off* delay clears it; *not checked* does neither. While an alarm of the column *explained by*
stands, this one is not announced; a condition that comes and goes within its *on* delay explains it for that delay and
3 s at most, and again only after a pause in which this one could be announced; several in turn explain it for the
longest of their *on* delays and 3 s, and as long again for what explains those.
*Ack*: it stays, although its condition has gone, until somebody has acknowledged it.
*Repeats after*: within this time what was announced is not announced again; it stands in the list as it was left.
`<signal>` stands for each of: {signals}.

"""


def alarms_page() -> str:
    """All alarms and thresholds as a page of Markdown."""
    head = ALARMS_HEAD.format(signals=", ".join(f"`{name}`" for name in SIGNALS))
    return head + "\n".join([*_alarm_table(), "", *_thresholds(), ""])


def _alarm_table() -> Iterator[str]:
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


Schema = Mapping[str, Any]
_PLAIN = {"string": "string", "integer": "number", "number": "number", "boolean": "boolean", "null": "null"}
_GENERIC = re.compile(r"(\w+?)_(\w+)_")  # SignalState_SpeedValue_ is SignalState<SpeedValue>

TYPES = "static/js/core/protocol-types.d.ts"
HEAD = "// Made from server/protocol by `python -m server.protocol.reference --write`.\n\n"
ROOT = Path(__file__).resolve().parent.parent.parent


def declarations(definitions: Mapping[str, Schema]) -> Iterator[str]:
    """One exported declaration for each definition, by name; one for all uses of a generic type."""
    generics = {found[1]: found for found in map(_GENERIC.fullmatch, definitions) if found is not None}
    for name, schema in sorted(definitions.items()):
        if (generic := generics.get(name)) is not None:
            declared = _declaration(f"{name}<Value>", definitions[generic[0]])
            yield declared.replace(generic[2], "Value")
        elif not _GENERIC.fullmatch(name):
            yield _declaration(name, schema)


def _declaration(name: str, schema: Schema) -> str:
    comment = _comment(schema.get("description"))
    if "properties" not in schema:
        return f"{comment}export type {name} = {_type(schema)};\n"
    required = schema.get("required", ())
    fields = "".join(
        f"{_comment(field.get('description'))}{name}{'' if name in required else '?'}: {_type(field)};\n"
        for name, field in schema["properties"].items()
    )
    return f"{comment}export interface {name} {{\n{indent(fields, '  ')}}}\n"


def _comment(text: str | None) -> str:
    return f"/** {' '.join(text.split())} */\n" if text else ""


def _type(schema: Schema) -> str:
    """The TypeScript type of a schema."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        return _GENERIC.sub(r"\1<\2>", name)
    if "const" in schema:
        return json.dumps(schema["const"])
    if "enum" in schema:
        return " | ".join(json.dumps(one) for one in schema["enum"])
    if any_of := schema.get("anyOf") or schema.get("oneOf"):
        return " | ".join(dict.fromkeys(_type(one) for one in any_of))
    match schema.get("type"):
        case "array" if "prefixItems" in schema:
            return f"[{', '.join(_type(one) for one in schema['prefixItems'])}]"
        case "array":
            return f"Array<{_type(schema['items'])}>"
        case "object":
            values = schema.get("additionalProperties")
            return f"Record<string, {_type(values) if isinstance(values, Mapping) else 'any'}>"
        case None:
            return "any"
        case kind:
            return _PLAIN[kind]


def _types(_: str) -> str:
    return HEAD + "\n".join(declarations(definitions()))


# Each file, and how it is made from what it holds now.
FILES: dict[str, Callable[[str], str]] = {
    "docs/alarms.md": lambda _: alarms_page(),
    "docs/protocol.md": tables.filled,
    TYPES: _types,
}


def out_of_date(root: Path = ROOT) -> dict[Path, str]:
    """What each file would have to hold that does not hold it."""
    found: dict[Path, str] = {}
    for name, made in FILES.items():
        path = root / name
        now = path.read_text(encoding="utf-8") if path.exists() else ""
        if (text := made(now)) != now:
            found[path] = text
    return found


def main(arguments: list[str]) -> int:
    """Writes or names what is out of date."""
    stale = out_of_date()
    for path, text in stale.items():
        if "--write" in arguments:
            path.write_text(text, encoding="utf-8")
        print(path.relative_to(ROOT))
    return 1 if stale and "--write" not in arguments else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
