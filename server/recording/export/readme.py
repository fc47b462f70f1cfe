"""README.txt of the tables: their description for later readers of the zip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from monitor.signals import SIGNALS
from server.recording.export.columns import OWN_TABLES, about_numbers
from server.recording.export.decoded_drive import DecodedDrive
from server.recording.verification import of_files
from server.version import catgraph_version


@dataclass(frozen=True, slots=True, kw_only=True)
class Written:
    """One table."""

    name: str
    rows: int


def readme(drive: DecodedDrive, tables: Sequence[Written], notes: Sequence[str]) -> str:
    recording, metadata = drive.recording, drive.recording.metadata
    lines = [
        f"A drive of {metadata.get('vehicle') or 'a car'}, as tables, made by catgraph {catgraph_version()}.",
        "",
        f"Began:      {_day(recording.start_s)}",
        f"Length:     {recording.duration_s:.1f} s",
        f"Messages:   {recording.count}",
        *([f"Car:        {metadata['address']}"] if metadata.get("address") else []),
        f"Kind:       {drive.profile.title}, ROS {recording.ros_version}",
        *([f"Ended:      {_ended(metadata)}"] if metadata.get("ended") else []),
        *(f"Event log:  {one.short}. {one.sentence}" for one in of_files(recording)),
        "",
        "Every table is comma-separated UTF-8 with one line of headings; units are in brackets.",
        "  time                            when the message was received, UTC, ISO 8601",
        "  since start [s]                 the same, in seconds since the first message of the recording",
        "  stamp by the car [s since 1970] the message's own stamp, on the car's clock; empty where it has none",
        "An empty cell means: not known. It never means 0. A text that a spreadsheet would take for a formula has a '",
        "before it. Values are decoded as catgraph shows them; the messages themselves are in the MCAP and the bag.",
        "",
        "Tables:",
    ]
    for table in tables:
        lines.append(f"  {table.name:<18} {table.rows:>9} rows  {_what(table.name)}")
    for signal, source in drive.sources.items():
        if f"{signal}.csv" in {table.name for table in tables}:
            lines.append(
                f"    {signal} is {source.topic} ({source.type}){'' if not source.note else f': {source.note}'}"
            )
    if "alarms.csv" not in {table.name for table in tables}:
        lines += [
            "",
            "No alarm log was recorded in this file. `catgraph check FILE` lists the alarms that it would raise.",
        ]
    if drive.settings_toml is not None:
        lines += [
            "",
            "settings.toml: the settings in force at the start of the recording; each later change has its own file.",
        ]
    if notes:
        lines += ["", "Missing or incomplete in the tables:", *(f"  - {note}" for note in notes)]
    return "\r\n".join(_plain(line) for line in lines) + "\r\n"


def _what(name: str) -> str:
    if name == "alarms.csv":
        return "Every event of the alarm log: raised, acknowledged, cleared, and events of the monitoring itself."
    if name == "marks.csv":
        return "Moments that somebody marked, late ones too; voice notes and photos are in the folder marks."
    if (numbers := about_numbers(name)) is not None:
        return numbers
    signal = SIGNALS.get(name.removesuffix(".csv"))
    if signal is not None:
        return signal.about
    return next((table.what for table in OWN_TABLES.values() if table.file == name), "")


def _ended(metadata: dict[str, str]) -> str:
    why = metadata.get("why")
    return metadata["ended"] + (f", {why}" if why else "")


def _day(at_s: float) -> str:
    try:
        return datetime.fromtimestamp(at_s, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
    except (OverflowError, ValueError, OSError):
        return f"{at_s:.3f} s since 1970"


def _plain(line: str) -> str:
    """One line, whatever the car's topics are called."""
    return "".join(letter if letter.isprintable() else "�" for letter in line)
