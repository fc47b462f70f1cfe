"""The tables of the CSV export: columns of signals and of catgraph's own channels, and the text that explains them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from operator import attrgetter
from typing import Any

from monitor.signals import SIGNALS, Signal
from monitor.values import Diagnostics, LaserScan
from server.judge.units import Unit, unit_named
from server.recording.export.decoded_drive import DecodedDrive
from server.recording.verification import of_files
from server.version import catgraph_version

WITHOUT_UNIT, IN_UNIT = "-unit-unknown", "-in-"  # in the name of a table of numbers as they were published
TIMES = ("time", "since start [s]", "stamp by the car [s since 1970]")


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """What one signal becomes."""

    columns: tuple[str, ...]  # with their units
    rows: Callable[[Any], Iterator[tuple[Any, ...]]]  # of one value; mostly one


def number_table(signal: str, unit: Unit | None) -> str:
    """The name of the table of a signal's numbers as they were published; `unit` None: not known."""
    return f"{signal}{WITHOUT_UNIT if unit is None else f'{IN_UNIT}{unit.name}'}.csv"


def about_numbers(name: str) -> str | None:
    """What such a table holds; None: it is another one."""
    signal, _, unit_name = name.removesuffix(".csv").removesuffix(WITHOUT_UNIT).partition(IN_UNIT)
    unit = unit_named(signal, unit_name)
    if signal not in SIGNALS or name != number_table(signal, unit):
        return None
    why = "their unit is not known" if unit is None else f"in {unit.label}"
    return f"{SIGNALS[signal].label}, the numbers as they were published: {why}."


def _table(**columns: str) -> Table:
    """Field of the value → its column."""
    get = attrgetter(*columns)

    def rows(value: Any) -> Iterator[tuple[Any, ...]]:
        found = get(value)
        yield found if len(columns) > 1 else (found,)

    return Table(columns=tuple(columns.values()), rows=rows)


def _scan(scan: LaserScan) -> Iterator[tuple[Any, ...]]:
    nearest = scan.nearest
    yield (
        scan.beams,
        scan.usable,
        None if nearest is None else round(nearest[0], 4),
        None if nearest is None else round(nearest[1], 6),
        scan.angle_min_rad,
        scan.angle_max_rad,
        scan.angle_increment_rad,
        scan.range_min_m,
        scan.range_max_m,
        scan.frame_id,
    )


def _components(diagnostics: Diagnostics) -> Iterator[tuple[Any, ...]]:
    for component in diagnostics.components:
        yield component.name, component.level, component.message


_ASCII = str.maketrans({"°": "deg", "²": "^2", "³": "^3", "µ": "u", "Ω": "ohm"})  # units in headings


def _number(signal: Signal) -> Table:
    """A signal that is one number."""
    return _table(value=f"{signal.label.lower()} [{signal.unit.translate(_ASCII)}]")


# What is not named here is one number: see `monitor.values.Number`.
_TABLES: Mapping[str, Table] = {
    "speed": _table(speed_mps="speed [m/s]", yaw_rate_radps="yaw rate [rad/s]"),
    "acceleration": _table(acceleration_mps2="acceleration [m/s^2]"),
    "brake": _table(percent="brake [%]"),
    "accelerator": _table(percent="accelerator [%]"),
    "steering": _table(percent="steering [%]"),
    "distance": _table(distance_m="distance [m]", none_in_range="none in range"),
    "bearing": _table(bearing_rad="bearing [rad]"),
    "position": _table(
        lat_deg="latitude [deg]",
        lon_deg="longitude [deg]",
        alt_m="altitude above the ellipsoid [m]",
        status="status",
        sigma_m="sigma [m]",
        covariance_type="covariance type",
    ),
    "odometry": _table(
        x_m="x [m]",
        y_m="y [m]",
        z_m="z [m]",
        yaw_rad="yaw [rad]",
        speed_mps="speed [m/s]",
        frame_id="frame",
    ),
    "heading": _table(heading_deg="heading [deg]"),
    "scan": Table(
        columns=(
            "beams",
            "usable beams",
            "nearest [m]",
            "nearest bearing [rad]",
            "angle min [rad]",
            "angle max [rad]",
            "angle increment [rad]",
            "range min [m]",
            "range max [m]",
            "frame",
        ),
        rows=_scan,
    ),
    "diagnostics": Table(columns=("component", "level", "message"), rows=_components),
    "command": _table(speed_mps="speed [m/s]", tyre_angle_rad="tyre angle [rad]"),
    "fuel": _table(value="level", unit="unit"),
    "mode": _table(mode="mode", text="as sent"),
}
TABLES: Mapping[str, Table] = {name: _TABLES.get(name) or _number(signal) for name, signal in SIGNALS.items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnTable:
    """The table of one of catgraph's own channels; values without a column are in `details` as JSON."""

    what: str
    file: str
    columns: Mapping[str, str]  # column → where the value is, dots between the levels


OWN_TABLES: Mapping[str, OwnTable] = {
    "/catgraph/phone": OwnTable(
        what="Positions reported by operators' phones (WGS84), or the reason for none.",
        file="phone.csv",
        columns={
            "phone": "phone",
            "by": "by",
            "latitude [deg]": "fix.lat_deg",
            "longitude [deg]": "fix.lon_deg",
            "accuracy [m]": "fix.accuracy_m",
            "altitude above the ellipsoid [m]": "fix.alt_m",
            "speed [m/s]": "fix.speed_mps",
            "heading [deg]": "fix.heading_deg",
            "age [s]": "fix.age_s",
            "why not": "why",
        },
    ),
    "/catgraph/operator": OwnTable(
        what="Commands of operators, and their results.",
        file="operator.csv",
        columns={"kind": "kind", "by": "by", "done": "ok", "reason": "reason"},
    ),
    "/catgraph/commands": OwnTable(
        what="Frames sent to the car.",
        file="commands.csv",
        columns={"topic": "topic", "type": "type", "by": "by"},
    ),
    "/catgraph/delay": OwnTable(
        what="The delay of the link, whenever it changed. `delays` in the details: of each topic's newest message.",
        file="delay.csv",
        columns={"late [s]": "late_s", "throttled": "reduced"},
    ),
    "/catgraph/link": OwnTable(
        what="The link to the car whenever it changed.",
        file="link.csv",
        columns={"phase": "phase", "address": "address", "problem": "problem"},
    ),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Written:
    """One table."""

    name: str
    rows: int


def readme(drive: DecodedDrive, tables: Sequence[Written], notes: Sequence[str]) -> str:
    """README.txt of the tables: their description for later readers of the zip."""
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
